"""The service keeps a black box of a near miss, which anyone may fetch and prove."""

import asyncio
import json
import time
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, closing
from math import pi
from pathlib import Path
from typing import Any

import pytest
from websockets.asyncio.client import connect

from deconflict.operator.blackbox.archive import FOLDER, Archive
from deconflict.operator.blackbox.blackbox_request import NearPair
from deconflict.operator.blackbox.keeper import MOST_PAIRS, PENDING, Keeper
from deconflict.operator.store.store import Store
from deconflict.settings.site import BlackBox, Site
from ingest.measures.measures import Measures
from ingest.recording.log_reader import Tick, lines_of, parsed
from metrics.replay.blackbox_verify import verify
from tests.deconflict.operator.blackbox.made_floor import SITE as MADE
from tests.deconflict.operator.blackbox.made_floor import TICK_S, Floor, crossing, lived, put
from tests.deconflict.operator.http.served_face import until
from tests.deconflict.roles.made_service import SITE, Course, drive, running
from tests.helpers.made_clock import put_notes
from tests.helpers.patience import PATIENCE_S

SETTINGS = SITE.model_copy(update={"blackbox": BlackBox(before_s=2.0, after_s=1.0)})
PASSING: dict[str, Course] = {
    "A-1": lambda t: (-3.0 + t, 0.0, 0.0),
    "B-1": lambda t: (0.0, -4.7 + t, pi / 2),
}


async def drive_again_and_again(url: str) -> None:
    """A machine that stalls while the two pass each other sees no near miss the first time."""
    while True:
        await drive(url, PASSING, 14)


async def test_a_near_miss_is_kept_listed_fetched_and_verified(tmp_path: Path) -> None:
    def kept(answer: dict[str, Any]) -> bool:
        return bool(answer["blackboxes"])

    async with running(tmp_path / "data", SETTINGS) as service:
        driving = asyncio.create_task(drive_again_and_again(service.robots_url))
        async with asyncio.timeout(PATIENCE_S):
            while not kept(answer := (await service.get("/blackboxes")).json()):
                await asyncio.sleep(0.2)
        (box,) = answer["blackboxes"]
        (miss,) = box["near_misses"]
        fetched = await service.get(f"/blackboxes/{box['file']}")
        assert (await service.get("/blackboxes/blackbox-20000101T000000000Z.jsonl.zst")).status_code == 404
        text = (await service.get("/metrics")).text
        driving.cancel()
    assert miss["separation_m"] < 0.3
    assert miss["warned_s"] > 0
    (tmp_path / box["file"]).write_bytes(fetched.content)
    verdict = await asyncio.to_thread(verify, tmp_path / box["file"])
    assert (verdict.sha256, verdict.published > 0) == (box["sha256"], True)
    assert verdict.same, verdict.text()
    assert 'deconflict_blackboxes_total{outcome="kept"} 1.0' in text


def test_pending_near_misses_survive_a_restart_and_are_bounded(tmp_path: Path) -> None:
    store, measures = Store(tmp_path), Measures()
    keeper = Keeper(SETTINGS, tmp_path, store, measures)
    keeper.note(NearPair("a", f"{number:04}", 5.0) for number in range(MOST_PAIRS + 3))
    keeper.write_pending()
    assert measures.values["deconflict_blackboxes_total"][("beyond",)] == 3
    assert len(json.loads((tmp_path / FOLDER / PENDING).read_text())) == MOST_PAIRS
    store.close()


def test_many_near_misses_of_two_vendors_leave_room_for_those_of_others(tmp_path: Path) -> None:
    def noted() -> list[str]:
        return [a for a, *_ in json.loads((tmp_path / FOLDER / PENDING).read_text())]

    with closing(Store(tmp_path)) as store:
        measures = Measures()
        keeper = Keeper(SETTINGS, tmp_path, store, measures)
        keeper.note(NearPair(f"flood {number}", "x", 5.0, ("Mallory", "Mallory")) for number in range(MOST_PAIRS + 3))
        keeper.note([NearPair("a", "b", 5.0, ("Alder", "Basalt"))])
        keeper.note(NearPair(f"late {number}", "x", 5.0, ("Mallory", "Mallory")) for number in range(3))
        keeper.write_pending()
        assert noted() == [*(f"flood {number}" for number in range(MOST_PAIRS - 1)), "a"]
        assert measures.values["deconflict_blackboxes_total"]["beyond",] == 7


async def test_a_near_miss_noted_before_a_restart_is_written_after_it_and_old_boxes_are_removed(tmp_path: Path) -> None:
    (tmp_path / FOLDER).mkdir()
    put_notes(tmp_path, time.time())
    old = put(Archive(tmp_path / FOLDER), 1, year=2001)
    old_file = tmp_path / FOLDER / old["file"]
    assert old_file.exists()
    (tmp_path / FOLDER / PENDING).write_text(json.dumps([["a", "b", time.time() - 5.0]]))
    async with running(tmp_path, SETTINGS) as service, connect(service.robots_url):
        async with asyncio.timeout(PATIENCE_S):
            while 'deconflict_blackboxes_total{outcome="unfounded"} 1.0' not in (await service.get("/metrics")).text:
                await asyncio.sleep(0.2)
        assert (await service.get("/blackboxes")).json() == {"blackboxes": []}
    assert not old_file.exists()
    assert not (tmp_path / FOLDER / PENDING).exists()


@pytest.fixture
def behind(tmp_path: Path) -> tuple[Floor, Site, bytes]:
    """A near miss whose recording ends half a second after it, the settings, and the lines that have not come."""
    floor = lived(tmp_path, crossing(40.0, 1.7), 60)
    (segment,) = (tmp_path / "log").iterdir()
    lines = segment.read_bytes().splitlines(keepends=True)
    ends = next(row for row, line in enumerate(lines) if _tick_s(line) > floor.near[-1].at_s + 0.5)
    segment.write_bytes(b"".join(lines[:ends]))
    kept_for_ever = BlackBox(before_s=10.0, after_s=1.0, keep_days=36500.0)
    return floor, MADE.model_copy(update={"blackbox": kept_for_ever}), b"".join(lines[ends:])


def _tick_s(line: bytes) -> float:
    event = parsed(line)
    return event.now_s if isinstance(event, Tick) else 0.0


async def test_a_box_waits_for_a_recording_that_is_behind(
    tmp_path: Path, behind: tuple[Floor, Site, bytes], caplog: pytest.LogCaptureFixture
) -> None:
    floor, site, rest = behind
    async with keeping(tmp_path, site, floor) as measures:
        await until(lambda: "waits for the recording" in caplog.text)
        assert not measures.values["deconflict_blackboxes_total"]["kept",]
        (segment,) = (tmp_path / "log").iterdir()
        with segment.open("ab") as file:
            file.write(rest)
        await until(lambda: measures.values["deconflict_blackboxes_total"]["kept",])
    (box,) = Archive(tmp_path / FOLDER).boxes()
    last = [_tick_s(line) for line in lines_of(tmp_path / FOLDER / box["file"]) if b'"tick"' in line][-1]
    assert last >= floor.near[-1].at_s + 1.0 - TICK_S


async def test_a_recording_that_never_catches_up_is_logged_and_the_box_is_cut_short(
    tmp_path: Path,
    behind: tuple[Floor, Site, bytes],
    caplog: pytest.LogCaptureFixture,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("deconflict.operator.blackbox.keeper.LATEST_S", 0.0)
    floor, site, _ = behind
    async with keeping(tmp_path, site, floor) as measures:
        await until(lambda: measures.values["deconflict_blackboxes_total"]["kept",])
    assert "is cut short" in caplog.text


@asynccontextmanager
async def keeping(data: Path, site: Site, floor: Floor) -> AsyncIterator[Measures]:
    """A keeper at work, which was told of the floor's near misses."""
    store, measures = Store(data), Measures()
    keeper = Keeper(site, data, store, measures)
    keeper.note(floor.near)
    running = asyncio.create_task(keeper.run())
    try:
        async with asyncio.timeout(PATIENCE_S):
            yield measures
    finally:
        running.cancel()
        await asyncio.gather(running, return_exceptions=True)
        store.close()


async def test_a_box_that_cannot_be_written_is_counted_and_stops_no_other(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    (tmp_path / FOLDER).write_text("a file where the directory belongs")
    async with running(tmp_path, SETTINGS) as service:
        driving = asyncio.create_task(drive(service.robots_url, PASSING, 14))
        async with asyncio.timeout(PATIENCE_S):
            while 'deconflict_blackboxes_total{outcome="failed"} 1.0' not in (await service.get("/metrics")).text:
                await asyncio.sleep(0.2)
        await service.health(lambda health: list(health["files"]["faults"]) == [FOLDER])
        assert (await service.get("/advisories?state=all")).json()["advisories"]
        driving.cancel()
    assert "has no black box" in caplog.text
