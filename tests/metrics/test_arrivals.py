from pathlib import Path

import pytest

from ingest import stamps
from tests.metrics.test_replay import NOW_S, scored
from tests.saying import identity, points, status


def log_of_a_trip(path: Path, late_s: float, changes_its_mind: bool = False) -> Path:
    """One that goes 50 m at 1 m/s, and says at first that it will be there sooner by `late_s`."""
    raws = [(0.0, identity("A-1", NOW_S))]
    for second in range(60):
        x, goal_x = min(float(second), 50.0), 80.0 if changes_its_mind and second > 20 else 50.0
        goal = points((NOW_S + 50 - late_s, goal_x, 0.0, 0.0))
        raws.append((second, status("A-1", NOW_S + second, x, 0.0, 0.0, destinations=goal)))
    lines = [f'{{"received":"{stamps.write(NOW_S + t + 0.05)}","message":{raw.decode()}}}\n' for t, raw in raws]
    path.write_text("".join(lines))
    return path


def test_a_robot_that_comes_late_is_late_by_that_much(tmp_path: Path) -> None:
    late, early = (scored(log_of_a_trip(tmp_path / f"{s}.jsonl", s), [0.3])["arrivals"][0] for s in (10.0, -10.0))
    # its words of the beginning and of half a minute later
    assert (late["vendor"], late["ahead_up_to_s"], late["cases"], late["late"]) == ("Alder", 60.0, 2, 1.0)
    assert late["off_median_s"] == pytest.approx(10.0, abs=1.1)
    assert (early["late"], early["off_median_s"]) == (0.0, pytest.approx(10.0, abs=1.1))


def test_a_robot_that_goes_elsewhere_has_not_come_late(tmp_path: Path) -> None:
    assert scored(log_of_a_trip(tmp_path / "log.jsonl", 0.0, changes_its_mind=True), [0.3])["arrivals"] == []
