"""The floor from the end of a log."""

from pathlib import Path

import pytest

from ingest.fleet.recovery.log_recovery import recover, summary
from ingest.port.connection import Connection
from ingest.recording.log_reader import Received
from ingest.recording.recorder import Recorder
from ingest.settings import RecorderSettings, Vendor
from tests.helpers import vda_saying
from tests.helpers.saying import identity, robot, status
from tests.ingest.fleet.made_fleet import LINE, NOW_S, fleet
from tests.ingest.recording.packed_logs import settle

ALDER = Vendor(name="Alder")
FROM_ALDER = Connection(1, vendor="Alder")


def test_robots_come_back_however_often_the_receiver_has_started_since_they_reported(tmp_path: Path) -> None:
    for start in range(6):
        of = fleet(ALDER)
        recorder = Recorder(RecorderSettings(), tmp_path, of.measures, lambda: NOW_S)
        recorder.received(status(f"A-{start}", NOW_S + start), NOW_S + start, FROM_ALDER, None)
        recorder.close()
    again = fleet(ALDER)
    recover(again, [tmp_path], NOW_S + 10)
    assert set(again.robots) == {robot(f"A-{start}") for start in range(6)}


@pytest.mark.parametrize("most_bytes", [0, 10_000, 50_000])
def test_as_much_is_read_of_packed_segments_as_of_plain_ones(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, most_bytes: int
) -> None:
    monkeypatch.setattr("ingest.fleet.recovery.log_recovery.MOST_BYTES", most_bytes)
    read = dict[str, int]()
    for name, plain in (("plain", 100), ("packed", 2)):
        monkeypatch.setattr("ingest.recording.log_packing.PLAIN_SEGMENTS", plain)
        of, log = fleet(ALDER), tmp_path / name
        recorder = Recorder(RecorderSettings(segment_bytes=2_000), log, of.measures, lambda: NOW_S)
        for at_s in (NOW_S + number / 10 for number in range(60)):
            recorder.received(status("A-1", at_s), at_s, FROM_ALDER, None)
            recorder.tick(at_s)
            assert recorder.sync()
            settle(recorder)
        recorder.close()
        read[name] = recover(fleet(ALDER), [log], NOW_S + 6).messages
    assert len(list((tmp_path / "packed").glob("*.zst"))) > 5
    assert read["packed"] == read["plain"] > 0


def test_a_silent_robot_that_is_restored_is_forgotten_after_its_time_and_not_at_once() -> None:
    again = fleet(ALDER, forget_after_s=1000.0)
    recover(again, [], NOW_S, kept=[Received(identity("A-1", NOW_S - 5000), NOW_S - 5000, FROM_ALDER)])
    assert list(again.next_batch(NOW_S + 1).gone) == []
    assert list(again.robots) == [robot("A-1")]
    assert list(again.next_batch(NOW_S + 1000).gone) == [robot("A-1")]


def test_a_restored_robot_keeps_nobody_from_speaking_another_language() -> None:
    again = fleet(ALDER)
    report = identity("A-1", NOW_S - 5000, manufacturerName=vda_saying.MAKER, robotSerialNumber=vda_saying.SERIAL)
    recover(again, [], NOW_S, kept=[Received(report, NOW_S - 5000, LINE)])
    now_s = NOW_S + 1
    assert again.receive(vda_saying.state(now_s), now_s, vda_saying.line("state")) is None


def test_the_summary_says_how_many_robots_lack_an_identity_and_how_many_of_them_have_an_owner() -> None:
    again = fleet(ALDER)
    reports = [identity("A-1", NOW_S), status("A-2", NOW_S)]
    kept = [Received(raw, NOW_S, FROM_ALDER) for raw in reports] + [Received(status("A-3", NOW_S), NOW_S, LINE)]
    assert summary(again, recover(again, [], NOW_S + 1, kept=kept)) == (
        "the floor is restored: 3 robots, 2 of them with a position; 2 have sent no identity report, and of these 1 "
        "has an owner; 3 messages were read"
    )
