"""Only regular files of a bounded size are opened."""

import os
import socket
from contextlib import closing
from pathlib import Path

import pytest

from benchmarks.faulty_files.faults import Fault, blocked, device, huge, pipe
from ingest.plain_files import (
    UnfitDatabaseError,
    UnfitFileError,
    check_database,
    opened,
    read_file,
)
from ingest.recording.file_faults import FileKind, file_fault
from ingest.recording.log_segments import segments
from ingest.recording.replaced_file import replace_file

KINDS: list[tuple[Fault, str]] = [
    (pipe, "is a pipe where a file is expected; move it away"),
    (device, "is a device where a file is expected; move it away"),
    (blocked, "is a directory where a file is expected; move it away"),
    (huge, "has 107374182400 bytes, and at most 268435456 are read; move it away"),
]
pytestmark = pytest.mark.usefixtures("ends_in_time")
kinds = pytest.mark.parametrize(("fault", "words"), KINDS, ids=lambda part: getattr(part, "__name__", ""))


@kinds
def test_what_is_no_file_is_neither_read_nor_replaced_and_the_error_says_what_to_do(
    tmp_path: Path, fault: Fault, words: str
) -> None:
    path = tmp_path / "owners.json"
    replace_file(path, b"before")
    with fault(path):
        with pytest.raises(UnfitFileError, match=words):
            read_file(path)
        with pytest.raises(UnfitFileError, match=words):
            replace_file(path, b"new")
        with pytest.raises(UnfitFileError, match=words):
            opened(path, os.O_RDWR | os.O_CREAT)
        for kind in (FileKind.FILE, FileKind.RARE_FILE):
            assert words in str(file_fault(path, kind))
    assert read_file(path) == b"before"


@pytest.mark.parametrize("suffix", ["", "-wal", "-shm", "-journal"])
@pytest.mark.parametrize(("fault", "words"), KINDS[:3], ids=lambda part: getattr(part, "__name__", ""))
def test_a_database_with_something_else_in_the_place_of_its_files_is_not_opened(
    tmp_path: Path, fault: Fault, words: str, suffix: str
) -> None:
    path = tmp_path / f"robots.db{suffix}"
    with fault(path):
        with pytest.raises(UnfitDatabaseError, match=words):
            check_database(tmp_path / "robots.db")
        assert words in str(file_fault(tmp_path / "robots.db", FileKind.DATABASE))


def test_a_link_to_a_file_is_read_and_a_socket_is_not(tmp_path: Path) -> None:
    (tmp_path / "file").write_bytes(b"content")
    (tmp_path / "link").symlink_to(tmp_path / "file")
    assert read_file(tmp_path / "link") == b"content"
    with closing(socket.socket(socket.AF_UNIX)) as bound:
        bound.bind(str(tmp_path / "socket"))
        with pytest.raises(UnfitFileError, match="is a socket"):
            read_file(tmp_path / "socket")


@pytest.mark.parametrize("fault", [pipe, device], ids=lambda fault: fault.__name__)
def test_a_pipe_under_the_temporary_name_gives_way(tmp_path: Path, fault: Fault) -> None:
    path = tmp_path / "learned.npz"
    with fault(tmp_path / "learned.new"):
        replace_file(path, b"whole")
        assert path.read_bytes() == b"whole"
        assert not path.is_symlink()


def test_a_directory_under_the_temporary_name_is_a_fault_of_the_file(tmp_path: Path) -> None:
    path = tmp_path / "learned.npz"
    words = "learned.new is a directory where a file is expected; move it away"
    with blocked(tmp_path / "learned.new"):
        assert words in str(file_fault(path, FileKind.FILE))
        with pytest.raises(UnfitFileError, match=words):
            replace_file(path, b"whole")


@pytest.mark.parametrize("fault", [pipe, device], ids=lambda fault: fault.__name__)
def test_a_log_leaves_out_what_is_no_file_and_says_so(tmp_path: Path, fault: Fault) -> None:
    log = tmp_path / "log"
    log.mkdir()
    (log / "log-1.jsonl").touch()
    with fault(log / "log-2.jsonl"):
        assert segments(log) == [log / "log-1.jsonl"]
        assert f"log-2.jsonl is a {fault.__name__} where a file is expected" in str(file_fault(log, FileKind.FOLDER))
    assert file_fault(log, FileKind.FOLDER) is None
