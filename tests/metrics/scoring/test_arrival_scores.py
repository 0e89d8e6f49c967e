from pathlib import Path

import pytest

from ingest.languages import timestamps
from tests.helpers.saying import identity, points, status
from tests.metrics.replay.made_replays import NOW_S, scored


def log_of_a_trip(path: Path, late_s: float, changes_its_mind: bool = False, seconds: int = 60) -> Path:
    """One that goes 50 m at 1 m/s, and says at first that it will be there sooner by `late_s`."""
    raws = [(0.0, identity("A-1", NOW_S))]
    for second in range(seconds):
        goal_s, goal_x = (80.0, 80.0) if changes_its_mind and second > 20 else (50.0, 50.0)
        goal, x = points((NOW_S + goal_s - late_s, goal_x, 0.0, 0.0)), min(float(second), 50.0)
        raws.append((second, status("A-1", NOW_S + second, x, 0.0, 0.0, destinations=goal)))
    lines = [f'{{"received":"{timestamps.write(NOW_S + t + 0.05)}","message":{raw.decode()}}}\n' for t, raw in raws]
    path.write_text("".join(lines))
    return path


def test_a_robot_that_comes_late_is_late_by_that_much(tmp_path: Path) -> None:
    late, early = (scored(log_of_a_trip(tmp_path / f"{s}.jsonl", s), [0.3])["arrivals"] for s in (10.0, -10.0))
    # its words of half a minute after the beginning, and of the beginning
    assert [(entry["vendor"], entry["ahead_up_to_s"], entry["cases"], entry["late"]) for entry in late] == [
        ("Alder", 30.0, 1, 1.0),
        ("Alder", 60.0, 1, 1.0),
    ]
    for row in (*late, *early):
        assert row["off_median_s"] == pytest.approx(10.0, abs=1.1)
    assert all(entry["late"] == entry["out"] == 0 for entry in early)


def test_a_robot_that_has_not_arrived_is_late_by_the_time_to_its_last_report(tmp_path: Path) -> None:
    (only,) = scored(log_of_a_trip(tmp_path / "log.jsonl", 20.0, seconds=45), [0.3])["arrivals"]
    assert (only["ahead_up_to_s"], only["cases"], only["out"], only["late"]) == (30.0, 2, 2, 1.0)
    # it said at the beginning and half a minute later that it would be there after 30 s, and was awaited for 44 s
    assert only["off_median_s"] == pytest.approx(14.0, abs=0.3)


def test_a_robot_that_changes_its_destination_is_not_late(tmp_path: Path) -> None:
    assert scored(log_of_a_trip(tmp_path / "log.jsonl", 0.0, changes_its_mind=True), [0.3])["arrivals"] == []
