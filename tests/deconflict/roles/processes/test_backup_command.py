"""`deconflict backup` of a service under traffic, and a start with the copy."""

import asyncio
import os
import sqlite3
import time
from contextlib import closing
from pathlib import Path

import pytest

from deconflict.roles.processes import backup_command
from deconflict.roles.processes.backup_command import backed_up, left_out
from deconflict.runtime.data_lock import DataDirectoryError
from deconflict_client.client import Client, PositionLostError
from ingest.recording.log_reader import LogReader, Received
from tests.deconflict.roles.made_service import Served, healthy
from tests.helpers.patience import PATIENCE_S


def stored(data: Path) -> dict[int, str]:
    with closing(sqlite3.connect(data / "advisories.db")) as db:
        return dict(db.execute("SELECT seq, document FROM revisions ORDER BY seq").fetchall())


async def is_told_to_read_again(service: Served, last: int) -> None:
    """A subscriber of the service before, and one that reads anew after that."""
    async with Client(service.face_url) as client, asyncio.timeout(PATIENCE_S):
        with pytest.raises(PositionLostError):
            await anext(client.follow(after=last))
        assert (await client.open()).seq != last


async def test_a_copy_of_a_running_service_goes_on_without_giving_a_number_twice(tmp_path: Path) -> None:
    data, copy = tmp_path / "data", tmp_path / "copy"
    service = Served(data)
    with service.running():
        await service.until("/healthz", healthy)
        async with service.with_robots(time.time()):
            await service.until("/advisories", lambda answer: answer.get("advisories"))
            backed_up(data, copy)
            copied = stored(copy)
            assert copied
            await service.until("/advisories", lambda _: max(stored(data)) > max(copied))
    given = stored(data)
    assert {seq: text for seq, text in given.items() if seq <= max(copied)} == copied
    assert any(isinstance(event, Received) for event in LogReader().read([copy / "log"]))
    restored = Served(copy)
    with restored.running():
        await restored.until("/healthz", healthy)
        await is_told_to_read_again(restored, max(given))
        async with restored.with_robots(time.time()):
            await restored.until("/advisories", lambda _: max(stored(copy)) > max(copied))
        await is_told_to_read_again(restored, max(given))
    after = stored(copy)
    assert {seq: text for seq, text in after.items() if seq in copied} == copied
    assert min(after.keys() - copied.keys()) > max(given)


def test_a_copy_replaces_nothing_and_is_whole_or_not_there(tmp_path: Path) -> None:
    data, there = tmp_path / "data", tmp_path / "there"
    (data / "log").mkdir(parents=True)
    there.mkdir()
    for unfit in (there, data / "inside"):
        with pytest.raises(DataDirectoryError):
            backed_up(data, unfit)
    with pytest.raises(DataDirectoryError):
        backed_up(there, tmp_path / "copy")
    (data / "losses.db").write_bytes(b"no database" * 100)
    with pytest.raises(DataDirectoryError, match=r"losses\.db: file is not a database; a start of the service sets"):
        backed_up(data, tmp_path / "copy")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["data", "there"]


def test_what_was_set_aside_is_copied_and_what_is_not_copied_is_named(tmp_path: Path) -> None:
    data, copy = tmp_path / "data", tmp_path / "copy"
    (data / "log").mkdir(parents=True)
    aside = {"advisories-20260101T000000.db", "losses-20260101T000000.db", "owners.json.unreadable"}
    aside |= {"advisories-20260101T000000.db-wal"}
    for name in (*aside, ".face.lock", "advisories.db-shm", "learned.new", "notes.txt", "\x1b[2J"):
        (data / name).write_text(name)
    os.mkfifo(data / "owners.json")
    os.mkfifo(data / "robots.db.unreadable")
    backed_up(data, copy)
    assert {path.name: path.read_text() for path in copy.iterdir() if path.name in aside} == {
        name: name for name in aside
    }
    assert left_out(data, copy) == ["\x1b[2J", "notes.txt", "owners.json", "robots.db.unreadable"]


def test_a_second_backup_to_the_same_place_leaves_the_first_one_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    data, copy = tmp_path / "data", tmp_path / "copy"
    (data / "log").mkdir(parents=True)
    for number in range(3):
        (data / "log" / f"log-{number:017d}.jsonl").write_bytes(b"{}\n")
    refused: list[str] = []

    def copied_beside_another(file: Path, folder: Path) -> bool:
        if file.name.endswith("2.jsonl") and not refused:
            with pytest.raises(DataDirectoryError) as error:
                backed_up(data, copy)
            refused.append(str(error.value))
        return copied(file, folder)

    copied = backup_command._copy
    monkeypatch.setattr(backup_command, "_copy", copied_beside_another)
    assert backed_up(data, copy) >= 3
    assert "another backup is writing it" in refused[0]
    assert len(list((copy / "log").iterdir())) == 3
    assert not list(copy.glob(".*"))
