from dataclasses import replace
from math import isnan, pi

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from shapely import Point

from deconflict.sweep.geometry.encounter import CLASSES, Row, encounter, envelope, separation_m
from deconflict.sweep.geometry.pose import pose_at
from deconflict.sweep.incremental import Sweeper
from deconflict_client.advisory import EncounterClass
from ingest.batch import Forecasts
from tests.helpers.made_encounters import NOW_S, wanderer

Knot = tuple[float, float, float, float]
Size = tuple[float, float]
SQUARES = ((1.0, 1.0), (1.0, 1.0))


def two(
    a: list[Knot], b: list[Knot], floors: tuple[int, int] = (0, 0), sizes_m: tuple[Size, Size] = SQUARES
) -> tuple[Row, Row]:
    """Two robots from knots t, x, y, yaw."""
    knots, sizes = np.array(a + b, float), np.array(sizes_m, float)
    both = Forecasts(
        start=np.array([0, len(a), len(a) + len(b)]),
        t_s=knots[:, 0],
        x_m=knots[:, 1],
        y_m=knots[:, 2],
        yaw_rad=knots[:, 3],
        floor=np.array([floors[0]] * len(a) + [floors[1]] * len(b)),
        length_m=sizes[:, 0],
        width_m=sizes[:, 1],
        bottom_m=np.full(2, -np.inf),
        top_m=np.full(2, np.inf),
    )
    return (both, 0), (both, 1)


def standing(a: Knot, b: Knot, sizes_m: tuple[Size, Size]) -> tuple[float, float, float]:
    """The separation of two robots that stand, and the place between them."""
    robots = two([a], [b], sizes_m=sizes_m)
    apart_m, met = separation_m(*robots, 0.0), encounter(*robots, 0.0)
    assert apart_m is not None
    return apart_m, met.x_m, met.y_m


sides_m = st.floats(0.1, 4)
standing_robots = st.builds(
    two,
    st.tuples(st.just(0.0), st.floats(-3, 3), st.floats(-3, 3), st.floats(-4, 4)).map(lambda knot: [knot]),
    st.tuples(st.just(0.0), st.floats(-3, 3), st.floats(-3, 3), st.floats(-4, 4)).map(lambda knot: [knot]),
    sizes_m=st.tuples(st.tuples(sides_m, sides_m), st.tuples(sides_m, sides_m)),
)


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
    pose = pose_at(two(EASTWARD, EASTWARD)[0][0].single(0), 25.0)
    assert (pose.x_m, pose.y_m, pose.speed_mps) == (10.0, 0.0, 0.0)


def test_yaw_turns_the_shorter_way() -> None:
    pose = pose_at(two([(0, 0, 0, pi - 0.1), (2, 0, 0, -pi + 0.1)], EASTWARD)[0][0].single(0), 1.0)
    assert abs(pose.yaw_rad) == pytest.approx(pi)


@given(standing_robots)
def test_the_separation_is_that_of_the_envelopes_and_the_place_is_midway(robots: tuple[Row, Row]) -> None:
    apart_m, met = separation_m(*robots, 0.0), encounter(*robots, 0.0)
    first, other = (
        envelope(robot, pose_at(robot, 0.0)) for robot in (forecasts.single(row) for forecasts, row in robots)
    )
    assert apart_m == pytest.approx(first.distance(other), abs=1e-6)
    for polygon in (first, other):
        assert polygon.distance(Point(met.x_m, met.y_m)) == pytest.approx(first.distance(other) / 2, abs=1e-6)


@given(standing_robots)
def test_swapping_the_robots_moves_neither_separation_nor_place(robots: tuple[Row, Row]) -> None:
    (a, b), (met, swapped) = robots, (encounter(*robots, 0.0), encounter(*robots[::-1], 0.0))
    assert separation_m(a, b, 0.0) == pytest.approx(separation_m(b, a, 0.0), abs=1e-9)
    assert (met.x_m, met.y_m) == pytest.approx((swapped.x_m, swapped.y_m), abs=1e-9)


def test_sides_that_face_each_other_are_nearest_in_their_middle() -> None:
    assert standing((0, 0, 0, 0), (0, 5, 0, pi / 2), ((2, 2), (2, 2))) == pytest.approx((3.0, 2.5, 0.0))


def test_envelopes_that_cross_without_a_corner_in_the_other_overlap() -> None:
    assert standing((0, 0, 0, 0), (0, 1.4, 0, pi / 2), ((6, 1), (6, 1))) == pytest.approx((0.0, 1.4, 0.0))


@given(st.floats(-1, 12))
def test_robots_meet_where_their_poses_are(t_s: float) -> None:
    turning: list[Knot] = [(0, 5, -5, 3.0), (4, 6, 0, -3.0), (9, 0, 0, 0.0)]
    (forecasts, _), _ = robots = two(EASTWARD, turning)
    poses = [pose_at(forecasts.single(row), t_s) for row in (0, 1)]
    dx, dy = poses[1].x_m - poses[0].x_m, poses[1].y_m - poses[0].y_m
    dvx, dvy = poses[1].vx_mps - poses[0].vx_mps, poses[1].vy_mps - poses[0].vy_mps
    met = encounter(*robots, t_s)
    first, other = (envelope(forecasts.single(row), pose) for row, pose in enumerate(poses))
    assert separation_m(*robots, t_s) == pytest.approx(first.distance(other), abs=1e-9)
    assert met.closing_speed_mps == pytest.approx(-(dx * dvx + dy * dvy) / np.hypot(dx, dy))


def test_robots_meet_by_what_is_swept_as_by_what_they_said() -> None:
    """Robots with widened envelopes, as they are swept, and with headings within one turn."""
    rng, sweeper = np.random.default_rng(81), Sweeper(clearance_m=0.3)
    forecasts = Forecasts.joined(wanderer(rng, knots=int(rng.integers(1, 6))) for _ in range(40))
    forecasts = replace(forecasts, yaw_rad=forecasts.yaw_rad + 2 * pi, floor=rng.integers(-1, 3, len(forecasts.t_s)))
    widened_m, keys = rng.uniform(0, 2, len(forecasts)), [str(row) for row in range(len(forecasts))]
    wide = replace(forecasts, length_m=forecasts.length_m + widened_m, width_m=forecasts.width_m + widened_m)
    assert sweeper.update(keys, wide, widened_m) == ()
    some, at_s = rng.integers(0, len(forecasts), (500, 2)), NOW_S + rng.uniform(-3, 13, 500)
    met, known = sweeper.encounters([(keys[a], keys[b]) for a, b in some.tolist()], at_s), 0
    for entry, (a, b), when_s in zip(met, some.tolist(), at_s.tolist(), strict=True):
        expected = encounter((forecasts, a), (forecasts, b), when_s)
        assert (CLASSES[entry["kind"]], entry["floor"]) == (expected.encounter_class, expected.floor)
        if not isnan(entry["x"]):
            known += 1
            assert (entry["x"], entry["y"]) == pytest.approx((expected.x_m, expected.y_m), abs=1e-6)
    assert known > 400
    (nobody,) = sweeper.encounters([("0", "who?")], at_s[:1])
    assert isnan(nobody["x"])
