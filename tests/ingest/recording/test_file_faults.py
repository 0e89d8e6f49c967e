"""What is found to be wrong with files."""

from pathlib import Path

import pytest

from benchmarks.faulty_files.faults import (
    Fault,
    blocked,
    device,
    disk_at,
    full_disk,
    locked,
    pipe,
    read_only_disk,
    socket_file,
)
from ingest.recording import file_faults
from ingest.recording.file_faults import FileKind, file_fault


@pytest.fixture
def database(tmp_path: Path) -> Path:
    path = tmp_path / "robots.db"
    path.touch()
    return path


def test_what_can_be_used_or_made_is_no_fault(database: Path) -> None:
    assert file_fault(database, FileKind.DATABASE) is None
    assert file_fault(database.with_name("learned.npz"), FileKind.FILE) is None
    assert file_fault(database.parent, FileKind.FOLDER) is None


def test_each_fault_says_what_it_is_and_what_to_do(database: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(file_faults, "LOCKED_S", 0.05)
    with locked(database):
        assert "locked by another program; stop" in str(file_fault(database, FileKind.DATABASE))
    assert "a file where a directory is expected; move" in str(file_fault(database, FileKind.FOLDER))
    assert "a directory where a file is expected" in str(file_fault(database.parent, FileKind.FILE))
    assert "is missing" in str(file_fault(database.parent / "gone" / "file", FileKind.FILE))
    assert "no directory" in str(file_fault(database / "file", FileKind.FILE))


@pytest.mark.parametrize(("fault", "found"), [(pipe, "a pipe"), (device, "a device"), (socket_file, "a socket")])
def test_what_has_the_place_of_a_folder_or_is_in_it_is_named(database: Path, fault: Fault, found: str) -> None:
    folder = database.with_name("log")
    with fault(folder):
        assert f"{folder} is {found} where a directory is expected; move" in str(file_fault(folder, FileKind.FOLDER))
    folder.mkdir()
    (folder / "a-folder-of-somebody").mkdir()
    assert file_fault(folder, FileKind.FOLDER) is None
    for harm, words in ((fault, found), (blocked, "a directory")):
        with harm(folder / "log-1.jsonl"):
            assert f"log-1.jsonl is {words} where a file" in str(file_fault(folder, FileKind.FOLDER))


def test_a_disk_that_takes_nothing_is_a_fault(tmp_path: Path) -> None:
    try:
        with disk_at(tmp_path / "disk", 1) as disk:
            (disk / "file").touch()
            with full_disk(disk):
                assert "is full; free" in str(file_fault(disk / "file", FileKind.FILE))
            with read_only_disk(disk):
                assert "its disk is read-only" in str(file_fault(disk / "file", FileKind.FILE))
                assert "can't be made; its disk is read-only" in str(file_fault(disk / "new", FileKind.FILE))
    except PermissionError:
        pytest.skip("may not mount a disk")
