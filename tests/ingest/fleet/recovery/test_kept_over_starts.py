"""What is kept over starts with a wrong clock, a locked file or a full disk, and what is forgotten at last."""

import asyncio
import sqlite3
import threading
from contextlib import closing
from math import inf
from pathlib import Path
from typing import Any

import pytest

from ingest.fleet.fleet import Fleet
from ingest.fleet.recovery.kept_messages import FAILURES, KeptMessages
from ingest.fleet.recovery.kept_rows import FILE_NAME
from ingest.fleet.recovery.log_recovery import recover
from ingest.port.connection import KEPT, Connection
from tests.helpers.patience import PATIENCE_S
from tests.helpers.saying import identity, robot, status
from tests.ingest.fleet.made_fleet import NOW_S, fleet
from tests.ingest.fleet.recovery.made_kept_messages import ALDER, FROM_ALDER, LARGE, identified, kept_of, rows


def started(directory: Path, now_s: float) -> tuple[Fleet, KeptMessages]:
    """A fleet that has read the file, and what keeps it."""
    again = fleet(ALDER)
    kept = kept_of(again, directory)
    recover(again, [], now_s, kept=kept.read(now_s))
    return again, kept


@pytest.mark.parametrize("behind_s", [3600.0, 1e9])
def test_a_start_with_a_clock_that_is_behind_keeps_all_identities(tmp_path: Path, behind_s: float) -> None:
    before, kept = started(tmp_path, NOW_S)
    before.receive(identity("A-1", NOW_S), NOW_S, FROM_ALDER)
    kept.write(-inf, NOW_S)
    behind, kept = started(tmp_path, NOW_S - behind_s)
    assert identified(behind) == identified(before)
    kept.write(-inf, NOW_S - behind_s + 5)
    again, _ = started(tmp_path, NOW_S + 60)
    assert identified(again) == identified(before)


def test_a_file_that_is_locked_at_the_start_keeps_its_identities(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("ingest.fleet.recovery.kept_messages.BUSY_TIMEOUT_S", 0.05)
    before, kept = started(tmp_path, NOW_S)
    for name in ("A-1", "A-2"):
        before.receive(identity(name, NOW_S), NOW_S, FROM_ALDER)
    kept.write(-inf, NOW_S)
    with closing(sqlite3.connect(tmp_path / FILE_NAME, isolation_level=None)) as lock:
        lock.execute("BEGIN EXCLUSIVE")
        again, kept = started(tmp_path, NOW_S + 1)
    assert not again.robots
    again.receive(identity("A-2", NOW_S + 2, baseRobotEnvelope=LARGE), NOW_S + 2, FROM_ALDER)
    kept.write(-inf, NOW_S + 2)
    assert rows(tmp_path) == {
        robot("A-1"): identity("A-1", NOW_S),
        robot("A-2"): identity("A-2", NOW_S + 2, baseRobotEnvelope=LARGE),
    }


@pytest.mark.parametrize("is_heard", [False, True], ids=["silent", "heard each day"])
def test_a_robot_is_forgotten_however_often_the_service_is_started_again(tmp_path: Path, is_heard: bool) -> None:
    of, kept = started(tmp_path, NOW_S)
    of.receive(identity("A-1", NOW_S), NOW_S, FROM_ALDER)
    kept.write(-inf, NOW_S)
    for start in range(1, 5):
        now_s = NOW_S + start * 80_000
        of, kept = started(tmp_path, now_s)
        kept.write(-inf, now_s)
        if is_heard:
            assert of.receive(status("A-1", now_s), now_s, FROM_ALDER) is None
        kept.write(-inf, now_s)
    assert bool(identified(of)) == is_heard


def test_a_kept_status_of_a_robot_without_identity_stays_after_a_start(tmp_path: Path) -> None:
    of, kept = started(tmp_path, NOW_S)
    of.receive(status("A-1", NOW_S), NOW_S, FROM_ALDER)
    kept.write(NOW_S + 1, NOW_S + 2)
    of, kept = started(tmp_path, NOW_S + 3)
    of.receive(identity("A-2", NOW_S + 3), NOW_S + 3, FROM_ALDER)
    kept.write(-inf, NOW_S + 4)
    assert started(tmp_path, NOW_S + 5)[0].robots.keys() == {robot("A-1"), robot("A-2")}


def test_an_outage_is_logged_once(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    of, directory = fleet(ALDER), tmp_path / "absent"
    kept = kept_of(of, directory)
    of.receive(identity("A-1", NOW_S), NOW_S, FROM_ALDER)
    for outage in (1, 2):
        for _ in range(3):
            kept.write(-inf, NOW_S)
        assert len(caplog.records) == outage
        directory.mkdir()
        kept.write(-inf, NOW_S)
        assert rows(directory)
        (directory / FILE_NAME).unlink()
        directory.rmdir()
        assert of.receive(identity("A-1", NOW_S, baseRobotEnvelope=LARGE), NOW_S, FROM_ALDER) is None
    assert of.measures.values[FAILURES]["write",] == 6


async def test_a_write_that_is_cancelled_ends_before_the_task_does(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("ingest.fleet.recovery.kept_messages.WRITE_EVERY_S", 0.0)
    of, begun, may_end = fleet(ALDER), threading.Event(), threading.Event()
    kept = kept_of(of, tmp_path)
    write = kept._write

    def write_slowly(changes: Any) -> bool | None:
        begun.set()
        may_end.wait(PATIENCE_S)
        return write(changes)

    monkeypatch.setattr(kept, "_write", write_slowly)
    of.receive(identity("A-1", NOW_S), NOW_S, FROM_ALDER)
    keeping = asyncio.create_task(kept.keep(lambda: -inf, lambda: NOW_S))
    await asyncio.to_thread(begun.wait, PATIENCE_S)
    keeping.cancel()
    asyncio.get_running_loop().call_later(0.05, may_end.set)
    with pytest.raises(asyncio.CancelledError):
        await keeping
    assert rows(tmp_path)
    assert kept._changes(-inf, NOW_S) is None


def test_only_kept_messages_settle_no_owner_also_not_those_of_a_log_without_connection_numbers() -> None:
    known = fleet(ALDER)
    known.receive(identity("A-1", NOW_S), NOW_S, Connection(0, vendor="Alder"))
    known.receive(identity("A-2", NOW_S), NOW_S, Connection(KEPT, vendor="Alder"))
    assert [known.robots[robot(name)].owned for name in ("A-1", "A-2")] == [True, False]
