"""What a restart has of robots whose messages are no longer in the newest segments of the log."""

import asyncio
import sqlite3
from collections.abc import Callable
from contextlib import closing
from math import inf
from pathlib import Path

import pytest

from benchmarks.faulty_files.faults import Fault, held_alone, without_its_disk
from ingest.fleet.fleet import Fleet
from ingest.fleet.fleet_report import add_identity, shared_identities
from ingest.fleet.owners.owner_file import OwnerFile
from ingest.fleet.recovery.kept_messages import FAILURES
from ingest.fleet.recovery.kept_rows import FILE_NAME
from ingest.fleet.recovery.log_recovery import recover
from ingest.fleet.shared_identities import INTRODUCER, SharedIdentity
from ingest.measures.measures import Measures
from ingest.port.connection import Connection
from ingest.recording.log_segments import segments
from ingest.recording.recorder import Recorder
from ingest.settings import RecorderSettings, Vendor
from tests.helpers import iso_saying, vda_saying
from tests.helpers.patience import PATIENCE_S
from tests.helpers.saying import identity, robot, status
from tests.ingest.fleet.made_fleet import NOW_S, document, fleet
from tests.ingest.fleet.recovery.made_kept_messages import (
    ALDER,
    BASALT,
    FROM_ALDER,
    FROM_BASALT,
    LARGE,
    identified,
    kept_of,
    rows,
)


def restored(directory: Path, now_s: float, *vendors: Vendor, log: Path | None = None) -> Fleet:
    """A new fleet that has read the file, and perhaps a log."""
    again = fleet(*vendors)
    recover(again, [log] if log else [], now_s, kept=kept_of(again, directory).read(now_s))
    return again


@pytest.mark.parametrize(
    ("raw", "connection"),
    [
        (identity("A-1", NOW_S, baseRobotEnvelope=LARGE), FROM_ALDER),
        (identity("A-1", NOW_S, uuid="cart 7"), FROM_ALDER),
        (identity("A-1", NOW_S), Connection(3)),
        (vda_saying.factsheet(NOW_S), vda_saying.line("factsheet")),
        (iso_saying.identity(NOW_S), iso_saying.line("identity")),
    ],
    ids=["sized", "by name", "of no vendor", "VDA 5050", "ISO 21423"],
)
def test_an_identity_comes_back_whatever_its_age_and_language(
    tmp_path: Path, raw: bytes, connection: Connection
) -> None:
    before = fleet(ALDER)
    before.receive(raw, NOW_S, connection)
    kept_of(before, tmp_path).write(-inf, NOW_S)
    again = restored(tmp_path, NOW_S + 80_000, ALDER)
    assert len(identified(again)) == 1
    assert identified(again) == identified(before)


def test_a_robot_that_reports_rarely_comes_back_from_beyond_the_segments_that_are_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("ingest.fleet.recovery.log_recovery.MOST_BYTES", 0)
    before, now, log = fleet(ALDER), [NOW_S], tmp_path / "log"
    recorder = Recorder(RecorderSettings(segment_bytes=5_000), log, Measures(), lambda: now[0])
    kept = kept_of(before, tmp_path)

    def take(raw: bytes) -> None:
        recorder.received(raw, now[0], FROM_ALDER, before.receive(raw, now[0], FROM_ALDER))

    take(identity("A-1", NOW_S))
    for second in range(50):
        now[0] = NOW_S + second
        if second % 30 == 3:
            take(status("A-1", now[0], x=float(second)))
        take(status("A-2", now[0], y=float(second)))
        recorder.tick(now[0])
        assert recorder.sync()
        kept.write(recorder.files.leaving_before_s, now[0])
    recorder.close()
    assert len(segments(log)) > 4
    again = restored(tmp_path, now[0], ALDER, log=log)
    for name in ("A-1", "A-2"):
        for key in ("identified", "location", "envelope", "age_s", "vendor"):
            assert document(again, name, now[0])[key] == document(before, name, now[0])[key]
    assert document(restored(tmp_path, NOW_S + 500, ALDER), "A-1")["location"] is None, "it may have driven on"


def test_only_what_is_new_of_an_identity_is_written(tmp_path: Path) -> None:
    of = fleet(ALDER)
    kept = kept_of(of, tmp_path)
    of.receive(identity("A-1", NOW_S), NOW_S, FROM_ALDER)
    kept.write(-inf, NOW_S)
    kept.write(-inf, NOW_S)
    of.receive(identity("A-1", NOW_S + 1), NOW_S + 1, FROM_ALDER)
    kept.write(-inf, NOW_S + 1)
    assert rows(tmp_path) == {robot("A-1"): identity("A-1", NOW_S)}
    of.receive(identity("A-1", NOW_S + 2, baseRobotEnvelope=LARGE), NOW_S + 2, FROM_ALDER)
    kept.write(-inf, NOW_S + 2)
    assert rows(tmp_path) == {robot("A-1"): identity("A-1", NOW_S + 2, baseRobotEnvelope=LARGE)}


def test_many_identities_are_written_at_once(tmp_path: Path) -> None:
    of = fleet(ALDER)
    for number in range(1_200):
        of.receive(identity(f"A-{number}", NOW_S), NOW_S, FROM_ALDER)
    kept_of(of, tmp_path).write(-inf, NOW_S)
    assert rows(tmp_path).keys() == of.robots.keys()


@pytest.mark.parametrize(
    "leave", [lambda of: of.next_batch(NOW_S + 1e6), lambda of: of.give(robot("A-1"), "Basalt")], ids=["forget", "give"]
)
def test_what_is_kept_of_a_robot_that_left_is_removed(tmp_path: Path, leave: Callable[[Fleet], object]) -> None:
    of = fleet(ALDER, BASALT)
    kept = kept_of(of, tmp_path)
    of.receive(identity("A-1", NOW_S), NOW_S, FROM_ALDER)
    of.receive(status("A-1", NOW_S), NOW_S, FROM_ALDER)
    kept.write(NOW_S + 1, NOW_S + 2)
    assert len(kept_of(fleet(ALDER, BASALT), tmp_path).read(NOW_S + 2)) == 2
    leave(of)
    kept.write(NOW_S + 1, NOW_S + 2)
    assert kept_of(fleet(ALDER, BASALT), tmp_path).read(NOW_S + 2) == []


def test_a_robot_that_was_given_away_comes_back_as_its_new_vendors_and_without_a_claim(tmp_path: Path) -> None:
    before, log = fleet(ALDER, BASALT), tmp_path / "log"
    recorder = Recorder(RecorderSettings(), log, Measures(), lambda: NOW_S)
    recorder.received(status("A-1", NOW_S), NOW_S, FROM_ALDER, before.receive(status("A-1", NOW_S), NOW_S, FROM_ALDER))
    before.give(robot("A-1"), "Basalt")
    recorder.given(robot("A-1"), "Basalt", NOW_S + 1)
    before.receive(identity("A-1", NOW_S + 2), NOW_S + 2, FROM_BASALT)
    kept_of(before, tmp_path).write(-inf, NOW_S + 2)
    raw = status("A-1", NOW_S + 3)
    recorder.received(raw, NOW_S + 3, FROM_BASALT, before.receive(raw, NOW_S + 3, FROM_BASALT))
    recorder.close()
    again = restored(tmp_path, NOW_S + 4, ALDER, BASALT, log=log)
    assert identified(again) == identified(before)
    assert document(again, "A-1")["vendor"] == "Basalt"
    assert again.next_batch(NOW_S + 5).claims == ()


CEDAR = Vendor(name="Cedar", manufacturers=("Alder", vda_saying.MAKER))
FROM_CEDAR = Connection(5, vendor="Cedar")


@pytest.mark.parametrize(
    ("earlier", "raw", "connection", "later", "report", "present"),
    [
        ([ALDER], identity("A-1", NOW_S), FROM_ALDER, [CEDAR], status, FROM_CEDAR),
        ([ALDER], identity("A-1", NOW_S), FROM_ALDER, [Vendor(name="Cedar")], status, FROM_CEDAR),
        ([ALDER, BASALT], identity("A-1", NOW_S), FROM_ALDER, [BASALT], status, FROM_BASALT),
        ([], identity("A-1", NOW_S), Connection(3), [CEDAR], status, FROM_CEDAR),
        (
            [],
            vda_saying.factsheet(NOW_S),
            vda_saying.line("factsheet"),
            [CEDAR],
            lambda _, at_s: vda_saying.state(at_s),
            vda_saying.line("state"),
        ),
        ([ALDER, BASALT], identity("A-1", NOW_S), FROM_ALDER, [ALDER, BASALT], status, FROM_BASALT),
    ],
    ids=["renamed", "replaced", "removed", "named", "VDA 5050, named", "given away, and both files are lost but this"],
)
def test_a_kept_identity_refuses_nothing_that_the_present_vendor_sends(
    tmp_path: Path,
    earlier: list[Vendor],
    raw: bytes,
    connection: Connection,
    later: list[Vendor],
    report: Callable[[str, float], bytes],
    present: Connection,
) -> None:
    before = fleet(*earlier)
    assert before.receive(raw, NOW_S, connection) is None
    kept_of(before, tmp_path).write(-inf, NOW_S)
    again = restored(tmp_path, NOW_S + 3600, *later)
    assert again.receive(report("A-1", NOW_S + 3600), NOW_S + 3600, present) is None
    (known,) = again.robots.values()
    assert known.identity
    assert known.vendor == (present.vendor or "Cedar")
    assert again.owners.owner(known.uuid) == known.vendor
    assert again.next_batch(NOW_S + 3600).claims == ()


def test_the_register_protects_a_robot_whose_identity_is_kept(tmp_path: Path) -> None:
    before = fleet(ALDER, BASALT)
    before.receive(identity("A-1", NOW_S), NOW_S, FROM_ALDER)
    kept_of(before, tmp_path).write(-inf, NOW_S)
    OwnerFile(tmp_path, before.owners, before.measures).write()
    again = restored(tmp_path, NOW_S + 3600, ALDER, BASALT)
    OwnerFile(tmp_path, again.owners, again.measures)
    assert again.receive(status("A-1", NOW_S + 3600), NOW_S + 3600, FROM_BASALT) == "uuid-of-another-vendor"
    assert again.receive(status("A-1", NOW_S + 3600), NOW_S + 3600, FROM_ALDER) is None


def test_an_identity_of_another_ingest_comes_back_as_such(tmp_path: Path) -> None:
    before = fleet(ALDER)
    before.receive(status("A-1", NOW_S), NOW_S, FROM_ALDER)
    heard = SharedIdentity(robot("A-1"), identity("A-1", NOW_S), NOW_S, None, "Alder", elsewhere=True)
    assert add_identity(before, heard, NOW_S, Connection(3, INTRODUCER)) is None
    kept_of(before, tmp_path).write(-inf, NOW_S)
    again = restored(tmp_path, NOW_S + 100, ALDER)
    assert again.robots[robot("A-1")].shared_identity == heard
    assert shared_identities(again, 0.0) == []


def test_what_cannot_be_written_is_counted_and_written_later(tmp_path: Path) -> None:
    of, directory = fleet(ALDER), tmp_path / "absent"
    kept = kept_of(of, directory)
    of.receive(identity("A-1", NOW_S), NOW_S, FROM_ALDER)
    of.receive(status("A-1", NOW_S), NOW_S, FROM_ALDER)
    kept.write(NOW_S + 1, NOW_S + 2)
    assert of.measures.values[FAILURES]["write",] == 1
    directory.mkdir()
    kept.write(NOW_S + 1, NOW_S + 3)
    assert [message.raw for message in kept_of(fleet(ALDER), directory).read(NOW_S + 3)] == [
        identity("A-1", NOW_S),
        status("A-1", NOW_S),
    ]


def test_what_the_fleet_did_not_take_back_is_removed_after_a_restart(tmp_path: Path) -> None:
    before = fleet(ALDER)
    for name in ("A-1", "A-2"):
        before.receive(identity(name, NOW_S), NOW_S, FROM_ALDER)
    kept_of(before, tmp_path).write(-inf, NOW_S)
    again = fleet(ALDER, max_robots_per_vendor=1)
    kept = kept_of(again, tmp_path)
    recover(again, [], NOW_S + 1, kept=kept.read(NOW_S + 1))
    kept.write(-inf, NOW_S + 1)
    assert rows(tmp_path).keys() == again.robots.keys()


def newer_format(path: Path) -> None:
    with closing(sqlite3.connect(path)) as db:
        db.execute("PRAGMA user_version = 1000")


def damaged(path: Path) -> None:
    path.write_bytes(b"no database" * 1000)


@pytest.mark.parametrize("spoil", [damaged, newer_format, Path.unlink])
def test_a_file_that_is_spoilt_while_the_service_runs_is_begun_anew_with_all_robots(
    tmp_path: Path, spoil: Callable[[Path], None]
) -> None:
    of = fleet(ALDER)
    kept = kept_of(of, tmp_path)
    for name in ("A-1", "A-2"):
        of.receive(identity(name, NOW_S), NOW_S, FROM_ALDER)
        kept.write(-inf, NOW_S)
        if name == "A-1":
            spoil(tmp_path / FILE_NAME)
    for _ in range(3):
        kept.write(-inf, NOW_S)
    assert rows(tmp_path).keys() == of.robots.keys()


@pytest.mark.parametrize("spoil", [damaged, newer_format])
def test_an_unreadable_file_is_set_aside_at_the_start_and_counted(
    tmp_path: Path, spoil: Callable[[Path], None], caplog: pytest.LogCaptureFixture
) -> None:
    spoil(tmp_path / FILE_NAME)
    of = fleet(ALDER)
    assert kept_of(of, tmp_path).read(NOW_S) == []
    assert of.measures.values[FAILURES]["read",] == 1
    assert "set aside" in caplog.text
    assert [path.name for path in tmp_path.iterdir()] == [f"{FILE_NAME}.unreadable"]


def test_a_file_of_the_first_format_is_read_and_upgraded(tmp_path: Path) -> None:
    of = fleet(ALDER)
    kept = kept_of(of, tmp_path)
    of.receive(identity("A-1", NOW_S), NOW_S, FROM_ALDER)
    kept.write(-inf, NOW_S)
    with closing(sqlite3.connect(tmp_path / FILE_NAME)) as db:
        db.execute("ALTER TABLE messages DROP COLUMN heard_s")
        db.execute("PRAGMA user_version = 1")
    again = fleet(ALDER)
    kept = kept_of(again, tmp_path)
    recover(again, [], NOW_S + 1, kept=kept.read(NOW_S + 1))
    assert again.robots.keys() == of.robots.keys()
    kept.write(-inf, NOW_S + 1)
    assert rows(tmp_path).keys() == of.robots.keys()
    assert again.measures.values[FAILURES]["read",] == 0


@pytest.mark.parametrize("fault", [held_alone, without_its_disk])
async def test_a_file_that_is_locked_at_the_start_is_read_as_soon_as_it_is_free(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, fault: Fault
) -> None:
    for name in ("READ_TIMEOUT_S", "WRITE_EVERY_S", "RETRY_S"):
        monkeypatch.setattr(f"ingest.fleet.recovery.kept_messages.{name}", 0.05)
    before, data = fleet(ALDER), tmp_path / "data"
    data.mkdir()
    before.receive(identity("A-1", NOW_S, baseRobotEnvelope=LARGE), NOW_S, FROM_ALDER)
    before.receive(identity("A-2", NOW_S, baseRobotEnvelope=LARGE), NOW_S, FROM_ALDER)
    kept_of(before, data).write(-inf, NOW_S)
    again = fleet(ALDER)
    with fault(data / FILE_NAME):
        kept = kept_of(again, data)
        assert kept.read(NOW_S + 1.0) == []
        again.receive(status("A-1", NOW_S + 2.0), NOW_S + 2.0, FROM_ALDER)
        keeping = asyncio.create_task(kept.keep(lambda: -inf, lambda: NOW_S + 3.0))
    async with asyncio.timeout(PATIENCE_S):
        while len(identified(again)) < 2:
            await asyncio.sleep(0.01)
    keeping.cancel()
    await asyncio.gather(keeping, return_exceptions=True)
    assert {name: size for _, name, _, size in identified(again).values()}.keys() == {"Alder A-1", "Alder A-2"}
    assert set(rows(data)) == {robot("A-1"), robot("A-2")}


async def test_a_file_that_is_removed_while_the_service_runs_has_all_robots_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("ingest.fleet.recovery.kept_messages.WRITE_EVERY_S", 0.05)
    here = fleet(ALDER)
    here.receive(identity("A-1", NOW_S), NOW_S, FROM_ALDER)
    kept = kept_of(here, tmp_path)
    kept.write(-inf, NOW_S)
    keeping = asyncio.create_task(kept.keep(lambda: -inf, lambda: NOW_S))
    (tmp_path / FILE_NAME).unlink()
    async with asyncio.timeout(PATIENCE_S):
        while not (tmp_path / FILE_NAME).exists() or not rows(tmp_path):
            await asyncio.sleep(0.01)
    keeping.cancel()
    await asyncio.gather(keeping, return_exceptions=True)
    assert set(rows(tmp_path)) == {robot("A-1")}


def test_a_robot_is_known_after_a_restart_since_its_kept_report(tmp_path: Path) -> None:
    running = fleet(ALDER)
    kept = kept_of(running, tmp_path)
    running.receive(identity("A-1", NOW_S), NOW_S, FROM_ALDER)
    kept.write(-inf, NOW_S)
    again = restored(tmp_path, NOW_S + 3600.0, ALDER)
    again.receive(status("A-1", NOW_S + 3600.0, 0.0, 0.0, 0.0), NOW_S + 3600.0, FROM_ALDER)
    again.receive(status("A-2", NOW_S + 3600.0, 5.0, 0.0, 0.0), NOW_S + 3600.0, FROM_ALDER)
    batch = again.next_batch(NOW_S + 3600.0)
    assert dict(zip(batch.robots, batch.came_s.tolist(), strict=True)) == {
        robot("A-1"): NOW_S,
        robot("A-2"): NOW_S + 3600.0,
    }
