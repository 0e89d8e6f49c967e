"""What health says of the files of the data directory."""

import shutil
from pathlib import Path

import pytest

from benchmarks.faulty_files.faults import remove
from deconflict.operator.blackbox.archive import FOLDER
from deconflict.operator.blackbox.keeper import PENDING
from deconflict.roles.health.file_health import REMOVED_SHOWN_S, SILENT_S, FileHealth, data_files
from deconflict.settings.site import BlackBox, Site
from ingest.recording.replaced_file import set_file_aside


@pytest.fixture
def data(tmp_path: Path) -> Path:
    for path, _ in data_files(Site(), tmp_path):
        path.mkdir() if path.name in ("log", "blackbox") else path.touch()
    (tmp_path / "log" / "log-1.jsonl").touch()
    return tmp_path


@pytest.mark.parametrize("file", ["advisories.db", "losses.db", "robots.db", "owners.json", "learned.npz", "log"])
def test_a_file_that_was_removed_shows_for_a_while_also_if_it_was_made_anew(data: Path, file: str) -> None:
    health = FileHealth(data_files(Site(), data))
    health.look(0.0)
    now_s = health._looked_s
    assert health.document(now_s) == {"status": "ok"}
    shutil.rmtree(data / file) if file == "log" else remove(data / file)
    health.look(now_s)
    assert list(health.document(now_s)["faults"]) == [file]
    (data / file).touch() if file != "log" else (data / file).mkdir()
    health.look(now_s + 1.0)
    assert health.document(now_s + 1.0)["status"] == "degraded"
    assert health.document(now_s + 1.0 + REMOVED_SHOWN_S)["status"] != "ok", "nobody has looked for so long"
    health.look(now_s)
    assert file in health.document(health._looked_s)["reason"]


@pytest.mark.parametrize("file", ["advisories.db", "owners.json", "log"])
def test_a_file_that_stays_away_is_said_all_the_time_and_then_that_it_is_written_anew(data: Path, file: str) -> None:
    health = FileHealth(data_files(Site(), data))
    health.look(0.0)
    shutil.rmtree(data / file) if file == "log" else remove(data / file)
    for now_s in (0.0, 10 * REMOVED_SHOWN_S):
        health._looked_s = now_s
        health.look(now_s)
        health._looked_s = now_s
        assert "is not there yet" in health.document(now_s)["faults"][file]
    (data / file).mkdir() if file == "log" else (data / file).touch()
    health.look(now_s)
    health._looked_s = now_s + 20.0
    assert "is written anew since 20 s" in health.document(now_s + 20.0)["faults"][file]
    health._looked_s = now_s + REMOVED_SHOWN_S
    assert health.document(now_s + REMOVED_SHOWN_S) == {"status": "ok"}


def test_a_file_that_the_service_set_aside_is_not_called_removed(data: Path) -> None:
    health, aside = FileHealth(data_files(Site(), data)), data / "learned.npz.unreadable"
    aside.touch()
    for words in ("set it aside as learned.npz.unreadable", "removed or replaced"):
        (data / "learned.npz").touch()
        health.look(0.0)
        if words.startswith("set"):
            aside.unlink()
            (data / "other").touch()  # so that the next file gets another inode
            set_file_aside(data / "learned.npz")
        else:
            (data / "learned.npz").unlink()
            health._removed_s.clear()
        health.look(1.0)
        health._looked_s = 1.0
        assert words in health.document(1.0)["faults"]["learned.npz"]


def test_a_folder_that_is_made_at_need_is_no_fault_for_ever(data: Path) -> None:
    health = FileHealth(data_files(Site(), data))
    (data / FOLDER / "box").touch()
    health.look(0.0)
    shutil.rmtree(data / FOLDER)
    health.look(1.0)
    health._looked_s = 1.0
    assert "is not there yet" in health.document(1.0)["faults"][FOLDER]
    health.look(REMOVED_SHOWN_S)
    health._looked_s = 1.0 + REMOVED_SHOWN_S
    assert health.document(1.0 + REMOVED_SHOWN_S) == {"status": "ok"}


def test_a_file_that_is_replaced_at_each_write_is_not_removed(data: Path) -> None:
    health = FileHealth(data_files(Site(), data))
    health.look(0.0)
    (data / "new").touch()
    (data / "new").rename(data / "owners.json")
    health.look(health._looked_s)
    assert health.document(health._looked_s) == {"status": "ok"}


@pytest.mark.parametrize(
    ("folder", "before", "after"),
    [
        (FOLDER, PENDING, ["register.jsonl", "blackbox-20260101T000000000Z.jsonl.zst"]),
        (FOLDER, "blackbox-20260101T000000000Z.jsonl.new", ["blackbox-20260101T000000000Z.jsonl.zst"]),
        ("log", "log-1.jsonl", ["log-1.jsonl.zst", "log-2.jsonl"]),
    ],
)
def test_what_the_service_itself_removes_or_renames_is_no_loss_of_a_folder(
    data: Path, folder: str, before: str, after: list[str]
) -> None:
    health = FileHealth(data_files(Site(), data))
    for path in (data / folder).iterdir():
        path.unlink()
    (data / folder / before).touch()
    health.look(0.0)
    (data / folder / before).unlink()
    for name in after:
        (data / folder / name).touch()
    health.look(health._looked_s)
    assert health.document(health._looked_s) == {"status": "ok"}


def test_a_disk_that_does_not_answer_is_reported(data: Path) -> None:
    health = FileHealth(data_files(Site(), data))
    health.look(0.0)
    assert "has not answered" in health.document(health._looked_s + SILENT_S + 1.0)["reason"]


def test_what_is_not_kept_is_not_looked_at(data: Path) -> None:
    site = Site(blackbox=BlackBox(enabled=False))
    assert "blackbox" not in {path.name for path, _ in data_files(site, data)}


@pytest.mark.parametrize("is_made_anew", [False, True])
def test_a_database_that_is_put_back_is_no_longer_called_missing(data: Path, is_made_anew: bool) -> None:
    health = FileHealth(data_files(Site(), data))
    health.look(0.0)
    path, aside = data / "advisories.db", data / "aside"
    path.rename(aside)
    if is_made_anew:
        path.touch()
    health.look(health._looked_s)
    assert "what it had is missing" in health.document(health._looked_s)["reason"]
    if is_made_anew:
        health.look(health._looked_s + 2 * REMOVED_SHOWN_S)
    aside.replace(path)
    health.look(health._looked_s)
    assert health.document(health._looked_s) == {"status": "ok"}


def test_another_database_with_the_number_of_a_removed_one_is_not_taken_for_it(data: Path) -> None:
    health = FileHealth(data_files(Site(), data))
    path = data / "advisories.db"
    health.look(0.0)
    for _ in range(5):
        path.unlink()
        path.touch()
        health.look(health._looked_s)
        assert "what it had is missing" in health.document(health._looked_s)["reason"]
        health._removed_s.clear()
        health.look(health._looked_s)
