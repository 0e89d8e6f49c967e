"""Robots that drive head-on and brake, for an hour: taking braking for "did not meet" would silence the service."""

from pathlib import Path

import pytest

from benchmarks.planned_floors.comparison.compare import log_cases, make
from benchmarks.planned_floors.floors.corridors import Corridors
from benchmarks.planned_floors.scoring.alerts import SERVICE
from benchmarks.planned_floors.scoring.all_figures import figures
from benchmarks.planned_floors.truth.floor_truth import LOG

LAST_S = 3000.0


@pytest.fixture(scope="module")
def hour(tmp_path_factory: pytest.TempPathFactory) -> Path:
    directory = tmp_path_factory.mktemp("hour")
    make(Corridors("head_on", seconds=3600.0, corridors=1), directory)
    return directory


def test_stops_have_alerts_at_the_end_of_an_hour_as_at_its_start(hour: Path) -> None:
    last = log_cases(hour / LOG, hour, 0.3, after_s=LAST_S)[SERVICE]
    assert len(last.stops) >= 10
    assert figures(last)["stops told 4 s"]["value"] >= 0.95


def test_robots_that_pass_with_room_raise_no_alert(tmp_path: Path) -> None:
    make(Corridors("two_way", seconds=300.0, corridors=4), tmp_path)
    cases = log_cases(tmp_path / LOG, tmp_path, 0.3)[SERVICE]
    assert figures(cases)["alerts per robot-hour"]["value"] == 0.0
