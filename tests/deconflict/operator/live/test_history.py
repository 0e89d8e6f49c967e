"""The floor as it was is the floor that the live service had."""

import asyncio
import json
from pathlib import Path
from typing import Any

import pytest

from deconflict.operator.live.floor_frames import FloorFrames
from deconflict.operator.live.history import MOST_WAITING, BusyError, History, floor_at, recorded_span
from deconflict.settings.fleet_factory import fleet_of
from deconflict.settings.site import Site
from ingest.fleet.recovery.kept_messages import KeptMessages
from ingest.measures.measures import Measures
from ingest.recording.recorder import Recorder
from ingest.settings import RecorderSettings
from tests.helpers.saying import identity, status
from tests.ingest.recording.made_logs import LINE, NOW_S


def rows(frame: str) -> list[Any]:
    return sorted(json.loads(frame)["robots"])


def driven(log: Path, seconds: int, keeps: bool = False) -> dict[int, str]:
    """Record two robots, one of which says late who it is, in small segments; the live picture at each second."""
    site, clock = Site(), [NOW_S]
    fleet = fleet_of(site, Measures())
    settings = RecorderSettings(segment_bytes=8_000, total_bytes=1_000_000)
    recorder = Recorder(settings, log, Measures(), lambda: clock[0])
    kept, seen = KeptMessages(log.parent, fleet, Measures()), {}
    for second in range(seconds):
        clock[0] = now_s = NOW_S + second
        messages = [status("A-1", now_s, x=float(second)), status("A-2", now_s, y=float(second))]
        if second == 5:
            messages.insert(0, identity("A-2", now_s))
        for raw in messages:
            recorder.received(raw, now_s, LINE, fleet.receive(raw, now_s, LINE))
        recorder.tick(now_s)
        assert recorder.sync()
        picture = FloorFrames()
        picture.add_batch(fleet.snapshot(now_s), whole=True)
        seen[second] = picture.since(0)
        if keeps:
            kept.write(recorder.files.leaving_before_s, now_s)
    recorder.close()
    return seen


def test_the_past_floor_equals_the_live_floor_of_that_time(tmp_path: Path) -> None:
    seen = driven(tmp_path, 40)
    assert {file.suffix for file in tmp_path.iterdir()} == {".jsonl", ".zst"}, "the older ones are packed"
    for second in (3, 6, 20, 39):
        assert rows(floor_at(Site(), tmp_path, NOW_S + second)) == rows(seen[second])


def test_the_past_floor_has_identities_that_came_long_before(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    seen = driven(tmp_path / "log", 130, keeps=True)
    for second in (4, 70, 129):
        assert rows(floor_at(Site(), tmp_path / "log", NOW_S + second)) == rows(seen[second])
    (tmp_path / "robots.db").write_bytes(b"damaged" * 1000)
    assert rows(floor_at(Site(), tmp_path / "log", NOW_S + 129)) != rows(seen[129])
    assert "the identity reports of robots.db can't be read" in caplog.text


def test_before_and_without_a_recording_the_floor_is_empty(tmp_path: Path) -> None:
    assert rows(floor_at(Site(), tmp_path / "none", NOW_S)) == []
    assert recorded_span(tmp_path / "none", NOW_S) is None
    driven(tmp_path, 3)
    assert rows(floor_at(Site(), tmp_path, NOW_S - 1)) == []
    assert recorded_span(tmp_path, NOW_S + 2) == pytest.approx((NOW_S, NOW_S + 2), abs=1e-5)


def test_a_start_with_the_clock_far_ahead_hides_nothing_that_is_recorded_later(tmp_path: Path) -> None:
    ahead_s = NOW_S + 5 * 365 * 86_400.0
    ahead = Recorder(RecorderSettings(), tmp_path, Measures(), lambda: ahead_s)
    ahead.tick(ahead_s)
    ahead.close()
    seen = driven(tmp_path, 40)
    assert len(list(tmp_path.iterdir())) > 2
    for second in (3, 20, 39):
        assert rows(floor_at(Site(), tmp_path, NOW_S + second)) == rows(seen[second])
    assert recorded_span(tmp_path, NOW_S + 39) == pytest.approx((NOW_S, NOW_S + 39), abs=1e-5)


async def test_a_worker_process_reads_one_request_at_a_time_and_refuses_too_many(tmp_path: Path) -> None:
    seen = driven(tmp_path, 10)
    past = History(Site(), tmp_path)
    try:
        asked = [past.read(floor_at, NOW_S + second) for second in range(MOST_WAITING + 1)]
        found = await asyncio.gather(*asked, return_exceptions=True)
        assert [rows(each) for each in found[:-1] if isinstance(each, str)] == [
            rows(seen[i]) for i in range(MOST_WAITING)
        ]
        assert isinstance(found[-1], BusyError)
    finally:
        past.close()
