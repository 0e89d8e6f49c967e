"""Going past another robot: only where there is room."""

import numpy as np
import pytest

from deconflict.simulation.driving.passing import Passings
from tests.deconflict.simulation.driving.made_traffic import Way, traffic

LANE_M = 0.7
EAST: Way = ((0.0, -LANE_M), (40.0, -LANE_M))
WEST: Way = ((40.0, LANE_M), (0.0, LANE_M))


def begins(ways: list[Way], progress_m: list[float], speed_mps: list[float]) -> tuple[bool, float]:
    """Whether the first robot goes past the second one, and how far aside."""
    seen = traffic(ways, progress_m, speed_mps, list(range(len(ways))))
    passings = Passings(np.full(len(ways), LANE_M))
    return passings.begin(seen, 0, 1, 0.0, 0.5), float(passings.aside_to_m[0])


def test_a_robot_passes_one_that_stands_on_its_lane() -> None:
    begun, aside_m = begins([EAST, EAST], [5.0, 7.0], [0.0, 0.0])
    assert begun
    assert 1.0 < aside_m < 1.2


@pytest.mark.parametrize(
    ("ways", "progress_m", "speed_mps"),
    [
        ([EAST, EAST], [5.0, 7.0], [0.0, 1.0]),
        ([EAST, EAST], [5.0, 3.0], [0.0, 0.0]),
        ([EAST, EAST, WEST], [5.0, 7.0, 28.0], [0.0, 0.0, 1.0]),
        ([EAST, EAST, WEST], [5.0, 7.0, 33.0], [0.0, 0.0, 0.0]),
        ([((0.0, -LANE_M), (9.0, -LANE_M)), EAST], [5.0, 7.0], [0.0, 0.0]),
    ],
    ids=["it drives on", "it is behind", "another one comes", "another one stands beside", "the way bends too soon"],
)
def test_a_robot_does_not_pass_without_room(ways: list[Way], progress_m: list[float], speed_mps: list[float]) -> None:
    assert begins(ways, progress_m, speed_mps) == (False, 0.0)


def test_a_robot_returns_to_its_path_after_passing() -> None:
    seen = traffic([EAST, EAST], [5.0, 7.0], [0.5, 0.0], [0, 1])
    passings = Passings(np.full(2, LANE_M))
    assert passings.begin(seen, 0, 1, 0.0, 0.5)
    seen.aside_m[0] = passings.aside_to_m[0]
    seen.progress_m[0] = 9.0
    passings.update(seen, 1.0)
    assert passings.aside_to_m[0] == 0.0
    seen.aside_m[0] = 0.0
    passings.update(seen, 2.0)
    assert 0 not in passings


def test_the_plan_of_a_passing_robot_leaves_its_path_and_returns() -> None:
    seen = traffic([EAST, EAST], [5.0, 7.0], [0.5, 0.0], [0, 1])
    passings = Passings(np.full(2, LANE_M))
    assert passings.begin(seen, 0, 1, 0.0, 0.5)
    aside_m = passings.aside_ahead_m(0, 0.0, 5.0, np.array([0.0, 1.0, 2.5, 3.0, 9.0]))
    assert aside_m[[0, 4]].tolist() == [0.0, 0.0]
    assert aside_m[1] == pytest.approx(0.5)
    assert aside_m[2] > 1.0
