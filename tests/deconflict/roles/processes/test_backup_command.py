"""`deconflict backup` of a service under traffic, and a start with the copy."""

import sqlite3
import time
from contextlib import closing
from pathlib import Path

import pytest

from deconflict.roles.processes.backup_command import backed_up
from deconflict.runtime.data_lock import DataDirectoryError
from ingest.recording.log_reader import LogReader, Received
from tests.deconflict.roles.made_service import Served, healthy


def stored(data: Path) -> dict[int, str]:
    with closing(sqlite3.connect(data / "advisories.db")) as db:
        return dict(db.execute("SELECT seq, document FROM revisions ORDER BY seq").fetchall())


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
        async with restored.with_robots(time.time()):
            await restored.until("/advisories", lambda _: max(stored(copy)) > max(copied))
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
    with pytest.raises(DataDirectoryError):
        backed_up(data, tmp_path / "copy")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["data", "there"]
