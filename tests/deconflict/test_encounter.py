from math import pi

import numpy as np
import pytest

from deconflict.advisory import EncounterClass
from deconflict.encounter import encounter, separation_m
from deconflict.pose import pose_at
from ingest.seam import Forecasts

Knot = tuple[float, float, float, float]


def two(a: list[Knot], b: list[Knot], floors: tuple[int, int] = (0, 0)) -> tuple[Forecasts, Forecasts]:
    """Two robots of 1 x 1 m from knots t, x, y, yaw."""
    knots = np.array(a + b)
    both = Forecasts(
        start=np.array([0, len(a), len(a) + len(b)]),
        t_s=knots[:, 0],
        x_m=knots[:, 1],
        y_m=knots[:, 2],
        yaw_rad=knots[:, 3],
        floor=np.array([floors[0]] * len(a) + [floors[1]] * len(b)),
        length_m=np.ones(2),
        width_m=np.ones(2),
        bottom_m=np.full(2, -np.inf),
        top_m=np.full(2, np.inf),
    )
    return both.one(0), both.one(1)


EASTWARD: list[Knot] = [(0, 0, 0, 0), (10, 10, 0, 0)]


@pytest.mark.parametrize(
    ("other", "expected", "closing_mps"),
    [
        ([(0, 10, 0, pi), (10, 0, 0, pi)], EncounterClass.HEAD_ON, 2.0),
        ([(0, 5, -5, pi / 2), (10, 5, 5, pi / 2)], EncounterClass.CROSSING, 2**0.5),
        ([(0, 4, 0, 0), (10, 9, 0, 0)], EncounterClass.FOLLOWING, 0.5),
        ([(0, 5, 0, 0)], EncounterClass.STATIONARY_OBSTACLE, 1.0),
    ],
)
def test_classes_and_closing_speeds(other: list[Knot], expected: EncounterClass, closing_mps: float) -> None:
    met = encounter(*two(EASTWARD, other), 3.0)
    assert met.encounter_class is expected
    assert met.closing_speed_mps == pytest.approx(closing_mps, abs=1e-9)


def test_an_encounter_is_the_same_with_the_robots_swapped() -> None:
    crossing: list[Knot] = [(0, 5, -5, pi / 2), (10, 5, 5, pi / 2)]
    met, swapped = encounter(*two(EASTWARD, crossing), 4), encounter(*two(crossing, EASTWARD), 4)
    assert met.encounter_class is swapped.encounter_class
    assert (met.x_m, met.y_m) == pytest.approx((swapped.x_m, swapped.y_m))
    assert met.closing_speed_mps == pytest.approx(swapped.closing_speed_mps)


def test_the_place_is_midway_between_the_envelopes() -> None:
    met = encounter(*two(EASTWARD, [(0, 5, 0, 0)]), 3.0)
    assert met.x_m == pytest.approx(4.0)


def test_separation_is_between_envelopes_and_zero_where_they_overlap() -> None:
    forecasts = two(EASTWARD, [(0, 5, 0, 0)])
    assert separation_m(*forecasts, 1.0) == pytest.approx(3.0)
    assert separation_m(*forecasts, 5.0) == 0.0


def test_floors_are_not_compared() -> None:
    assert separation_m(*two(EASTWARD, EASTWARD, (0, 1)), 1.0) is None
    assert separation_m(*two(EASTWARD, EASTWARD, (-1, -1)), 1.0) is None


def test_a_robot_stands_where_its_last_knot_left_it() -> None:
    pose = pose_at(two(EASTWARD, EASTWARD)[0], 25.0)
    assert (pose.x_m, pose.y_m, pose.speed_mps) == (10.0, 0.0, 0.0)


def test_yaw_turns_the_shorter_way() -> None:
    pose = pose_at(two([(0, 0, 0, pi - 0.1), (2, 0, 0, -pi + 0.1)], EASTWARD)[0], 1.0)
    assert abs(pose.yaw_rad) == pytest.approx(pi)
