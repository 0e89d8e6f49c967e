"""Places: which resource a point is in, which zones an envelope sweeps through, and when."""

from dataclasses import replace
from math import inf

import numpy as np
import pytest

from deconflict.contention.robots.bodies_ahead import bodies_ahead
from deconflict.contention.robots.lookahead import STEPS, Lookahead, corners, look_ahead, paths_ahead
from deconflict.contention.robots.place_geometry import PlaceGeometry, ZonePassage
from ingest.batch import Forecasts
from ingest.shapes import Shape, Trailer, shapes_of
from tests.deconflict.contention.scenes import aisle, box, resource
from tests.helpers.saying import HALL, LOFT

NOW_S = 1_790_000_000.0
LANE = aisle("lane", 4, 10)


def forecast(*knots: tuple[float, float, float, int], yaw_rad: float = 0.0) -> Forecasts:
    """One robot of 1.0 x 0.5 m; knots of seconds from now, x, y and floor."""
    t, x, y, floor = (np.array(column, float) for column in zip(*knots, strict=True))
    ones = np.ones(1)
    return Forecasts(
        np.array([0, len(t)]),
        NOW_S + t,
        x,
        y,
        np.full(len(t), yaw_rad),
        floor.astype(np.int64),
        1.0 * ones,
        0.5 * ones,
        -inf * ones,
        inf * ones,
    )


def passage(of: Forecasts, geometry: PlaceGeometry) -> ZonePassage | None:
    view = look_ahead(of, NOW_S)
    ways = paths_ahead(view, np.full(1, STEPS))
    return geometry.passages([HALL], bodies_ahead(of, view, ways, NOW_S), np.zeros(1, np.bool_)).get(0, {}).get("lane")


def test_the_lookahead_interpolates_knots_and_stands_after_the_last() -> None:
    view: Lookahead = look_ahead(forecast((-1, 0, 0, 0), (1, 4, 0, 0), (3, 4, 2, 0)), NOW_S)
    assert view.x_m[0, :5].tolist() == pytest.approx([2.0, 3.0, 4.0, 4.0, 4.0])
    assert view.y_m[0, [2, 4, 6, 20]].tolist() == pytest.approx([0.0, 1.0, 2.0, 2.0])


def test_an_envelope_is_in_a_zone_also_if_its_centre_is_not() -> None:
    found = passage(forecast((0, 0, 0, 0), (20, 20, 0, 0)), PlaceGeometry([], [LANE]))
    assert found
    assert found.enter_s == pytest.approx(NOW_S + 3.5, abs=0.01)
    assert found.direction == 1
    assert found.leave_s == inf
    assert found.at_m(NOW_S + 6) == pytest.approx(2.0)


@pytest.mark.parametrize(("trailers", "leave_s"), [(0, 5.5), (2, 8.5)])
def test_a_train_has_left_a_zone_when_its_last_trailer_has(trailers: int, leave_s: float) -> None:
    """The last axle is 3 m behind the middle of the robot, and each trailer is as long as it."""
    shape = Shape((), (0.0, 0.0), (Trailer(1.0, 0.5, 1.5),) * trailers) if trailers else None
    train = replace(forecast((0, 5.2, 0, 0), (20, 25.2, 0, 0)), shapes=shapes_of([shape]))
    found = passage(train, PlaceGeometry([], [LANE]))
    assert found
    assert (found.enter_s, found.leave_s) == (NOW_S, NOW_S + leave_s)


def test_a_robot_that_passes_beside_a_zone_is_not_in_it() -> None:
    geometry = PlaceGeometry([], [LANE])
    assert passage(forecast((0, 0, 1.1, 0), (20, 20, 1.1, 0)), geometry) is None
    assert passage(forecast((0, 0, 1.0, 0), (20, 20, 1.0, 0)), geometry) is not None


def test_a_robot_that_changes_floors_first_is_not_in_it() -> None:
    assert passage(forecast((0, 0, 0, 0), (2, 2, 0, 1), (20, 20, 0, 1)), PlaceGeometry([], [LANE])) is None


def test_a_robot_with_numbers_that_are_not_finite_is_on_no_floor() -> None:
    assert look_ahead(forecast((0, float("nan"), 0, 0)), NOW_S).floor[0, 0] == -1


def test_a_lift_is_one_resource_on_all_its_floors() -> None:
    lift = resource("l1", 0, 0, kind="lift", floors=({"datum": LOFT, "polygon": box(50, 0)},))
    found = PlaceGeometry([lift], []).resources_at(
        [HALL, LOFT, LOFT, "elsewhere"], np.array([0.5, 50.5, 0.5, 0.5]), np.zeros(4)
    )
    assert found == ["l1", "l1", None, None]


def test_of_overlapping_outlines_the_first_in_the_site_file_counts() -> None:
    both = PlaceGeometry([resource("b", 0.5, 0), resource("a", 0, 0)], [])
    assert both.resources_at([HALL, HALL], np.array([0.4, -0.9]), np.zeros(2)) == ["b", "a"]


def test_paths_end_where_a_robot_changes_floors_or_its_future_is_unknown() -> None:
    rng = np.random.default_rng(1)
    x_m, y_m = rng.normal(size=(2, 200, STEPS + 1)).cumsum(axis=2)
    floor, known = np.zeros_like(x_m, np.int64), rng.choice([6, STEPS], 200)
    floor[50:, 9:], floor[100:, 12:], floor[150:, 1:] = 1, 0, 2
    found = paths_ahead(Lookahead(x_m, x_m, y_m, x_m, floor), known)
    last = np.repeat([STEPS, 8, 8, 0], 50)
    there = np.minimum(np.arange(STEPS + 1), last[:, None])
    legs_m = np.hypot(*(np.diff(np.take_along_axis(each, there, 1), axis=1) for each in (x_m, y_m)))
    assert found.way_m == pytest.approx(legs_m.sum(axis=1))
    there = np.minimum(there, known[:, None])
    lines_m = np.stack([np.take_along_axis(each, there, 1) for each in (x_m, y_m)], axis=-1)
    assert np.array_equal(found.lines_m, lines_m)
    assert np.array_equal(found.boxes_m, np.concatenate([lines_m.min(axis=1), lines_m.max(axis=1)], axis=1))


def test_corners_are_those_of_an_upright_envelope_turned_and_moved() -> None:
    x_m, y_m, yaw_rad, length_m, width_m = poses = np.random.default_rng(1).normal(size=(50, 5)).T
    upright = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]]) / 2 * np.stack([length_m, width_m], axis=1)[:, None]
    c, s = np.cos(yaw_rad), np.sin(yaw_rad)
    turned = np.einsum("nij,nkj->nki", np.array([[c, -s], [s, c]]).transpose(2, 0, 1), upright)
    assert corners(*poses) == pytest.approx(turned + np.stack([x_m, y_m], axis=1)[:, None])
