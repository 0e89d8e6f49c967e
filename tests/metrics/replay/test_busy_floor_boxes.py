"""Black boxes of the demo's floor: they replay exactly, and measure an event as the report of the log does."""

from datetime import datetime
from pathlib import Path
from typing import Any

import pytest

from benchmarks.boxes import RecordedFloor, boxes_of, recorded
from benchmarks.watch_demo.watching import START_S
from deconflict.operator.blackbox.archive import FOLDER, Box
from deconflict.operator.blackbox.start_state import head_of
from deconflict.settings.site import BlackBox
from deconflict.settings.site_file import load
from deconflict.simulation.demo.demo_site import demo_site
from ingest.recording.log_reader import LogReader
from metrics.replay.blackbox_verify import verify
from metrics.replay.replay import replay
from metrics.truth import nearest_scenes

SECONDS, ROBOTS = 200.0, 60
Event = tuple[str, ...]


@pytest.fixture(scope="module")
def floor(tmp_path_factory: pytest.TempPathFactory) -> RecordedFloor:
    site = load(demo_site()).model_copy(update={"blackbox": BlackBox(before_s=20.0, after_s=15.0)})
    return recorded(tmp_path_factory.mktemp("floor"), site, ROBOTS, 1, SECONDS)


@pytest.fixture(scope="module")
def boxes(floor: RecordedFloor) -> list[Box]:
    return boxes_of(floor, floor.data / FOLDER, START_S + SECONDS)


def test_boxes_of_a_busy_floor_replay_exactly_though_the_engine_was_running(
    floor: RecordedFloor, boxes: list[Box]
) -> None:
    resumed = [verify(floor.data / FOLDER / box["file"]) for box in boxes[-2:]]
    assert all(verdict.resumed for verdict in resumed)
    assert sum(verdict.published for verdict in resumed) > 50
    assert [verdict.text() for verdict in resumed if not verdict.same] == []


def test_boxes_stay_small_beside_what_was_under_way(floor: RecordedFloor, boxes: list[Box]) -> None:
    heads = [head_of(floor.data / FOLDER / box["file"]) for box in boxes]
    packed = [len(head["under_way"]) for head in heads if head and head["resumed_s"]]
    assert packed
    assert max(packed) < 0.1 * max(box["bytes"] for box in boxes)


def test_a_box_and_the_report_have_the_same_events_with_the_same_separation_and_lead(
    floor: RecordedFloor, boxes: list[Box], monkeypatch: pytest.MonkeyPatch
) -> None:
    """To the last digit that both write."""
    for limit in ("KEPT", "CANDIDATES"):
        monkeypatch.setattr(nearest_scenes, limit, 1000)
    reader = LogReader()
    clearances_m = [floor.site.conflict.clearance_m]
    result = replay(reader, reader.read(sorted(floor.log.iterdir())), floor.site, clearances_m)
    of_report = {moment(scene, "began_at", "at") for scene in result["nearest"] if scene["began_at"]}
    of_boxes = {moment(miss, "at", "nearest_at") for box in boxes for miss in box["near_misses"]}
    assert len(of_boxes) > 3
    assert of_boxes - of_report == set()
    assert any(event[-1] != "None" for event in of_boxes)


def moment(document: dict[str, Any], began: str, nearest: str) -> Event:
    """An event: its robots, when it began and was nearest, how near, and its lead."""
    times = [f"{datetime.fromisoformat(document[key]).timestamp():.3f}" for key in (began, nearest)]
    warned_s = document["warned_s"]
    lead = "None" if warned_s is None else f"{warned_s:.3f}"
    return (*sorted(document["robots"]), *times, f"{document['separation_m']:.3f}", lead)


def test_a_box_without_what_was_under_way_does_not_replay_exactly(floor: RecordedFloor, tmp_path: Path) -> None:
    snapshots = [snapshot._replace(under_way=b"") for snapshot in floor.snapshots]
    poorer = RecordedFloor(floor.site, floor.data, floor.near, floor.decided, snapshots)
    found = boxes_of(poorer, tmp_path / FOLDER, START_S + SECONDS, last=1)
    assert not verify(tmp_path / FOLDER / found[0]["file"]).same
