from itertools import pairwise
from math import cos, hypot, sin, sqrt

import pytest

from ingest.languages.vda5050.trajectories import MOST_POINTS, polyline
from ingest.languages.vda5050.vda_messages import ControlPoint, Trajectory

QUARTER = [ControlPoint(2.0, 0.0), ControlPoint(2.0, 2.0, sqrt(0.5)), ControlPoint(0.0, 2.0)]
CLAMPED = [0.0, 0.0, 0.0, 1.0, 1.0, 1.0]


def test_a_rational_curve_of_degree_two_is_a_true_circle() -> None:
    points = polyline(Trajectory(QUARTER, 2, CLAMPED))
    assert points is not None
    assert points[0] == pytest.approx((2.0, 0.0))
    assert points[-1] == pytest.approx((0.0, 2.0))
    assert all(hypot(x, y) == pytest.approx(2.0) for x, y in points)


def test_without_weights_the_same_points_give_a_parabola() -> None:
    points = polyline(Trajectory([ControlPoint(each.x, each.y) for each in QUARTER], 2, CLAMPED))
    assert points is not None
    assert max(hypot(x, y) for x, y in points) == pytest.approx(sqrt(4.5))


def test_degree_and_knots_have_the_defaults_of_version_3() -> None:
    corners = [ControlPoint(0.0, 0.0), ControlPoint(3.0, 0.0), ControlPoint(3.0, 4.0)]
    assert polyline(Trajectory(corners)) == ((0.0, 0.0), (3.0, 0.0), (3.0, 4.0))
    assert polyline(Trajectory(QUARTER, 2)) == polyline(Trajectory(QUARTER, 2, CLAMPED))


def test_a_long_curve_has_a_limited_number_of_points() -> None:
    points = polyline(Trajectory([ControlPoint(900.0 * each.x, 900.0 * each.y) for each in QUARTER], 2, CLAMPED))
    assert points is not None
    assert len(points) == MOST_POINTS


@pytest.mark.parametrize(
    "trajectory",
    [
        Trajectory(QUARTER, 0),
        Trajectory(QUARTER, 3),
        Trajectory(QUARTER[:1], 1),
        Trajectory(QUARTER, 2, [0.0, 0.0, 1.0, 1.0]),
        Trajectory(QUARTER, 2, [0.0, 0.0, 1.0, 0.5, 1.0, 1.0]),
        Trajectory(QUARTER, 2, [1.0] * 6),
        Trajectory([*QUARTER[:2], ControlPoint(0.0, 2.0, 0.0)], 2, CLAMPED),
        Trajectory([*QUARTER[:2], ControlPoint(0.0, 2e7)], 2, CLAMPED),
        Trajectory(QUARTER * 400, 2),
    ],
    ids=["degree 0", "too few points", "one point", "too few knots", "unsorted", "no span", "weight 0", "far", "long"],
)
def test_what_is_no_clamped_curve_is_none(trajectory: Trajectory) -> None:
    assert polyline(trajectory) is None


def test_a_line_that_is_drawn_finely_is_thinned_and_keeps_its_corners() -> None:
    out = [ControlPoint(0.02 * step, 0.0) for step in range(201)]
    up = [ControlPoint(4.0, 0.02 * step) for step in range(1, 151)]
    points = polyline(Trajectory([*out, *up], 1))
    assert points is not None
    assert len(points) < 30
    assert {points[0], points[-1]} == {(0.0, 0.0), (4.0, 3.0)}
    assert (4.0, 0.0) in points


def test_a_circle_that_is_drawn_finely_stays_one() -> None:
    circle = [ControlPoint(cos(step / 50), sin(step / 50)) for step in range(300)]
    points = polyline(Trajectory(circle, 1))
    assert points is not None
    assert len(points) < 60
    assert all(hypot(ax + bx, ay + by) / 2 > 0.99 for (ax, ay), (bx, by) in pairwise(points))
