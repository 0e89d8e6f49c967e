"""Where robots of any shape meet: the places of the sweep, against shapely."""

from dataclasses import replace
from itertools import product
from math import isnan

import numpy as np
import pytest
import shapely

from deconflict.sweep.geometry.pose import pose_at
from deconflict.sweep.incremental import Sweeper
from deconflict.sweep.shapes.shape_encounters import bodies, encounter, placed_parts, separation_m
from ingest.batch import Forecasts
from ingest.shapes import Shape, Trailer, shapes_of
from tests.helpers.made_encounters import NOW_S, robot, wanderer
from tests.helpers.made_shapes import KINDS


def crowd(robots: int, seed: int) -> Forecasts:
    """Robots of all kinds of shape; each fifth of them pulls trailers."""
    rng = np.random.default_rng(seed)
    forecasts = Forecasts.joined(wanderer(rng) for _ in range(robots))
    shapes = [list(KINDS.values())[row % 5](rng) for row in range(robots)]
    for row in range(0, robots, 4):
        shapes[row] = (shapes[row] or Shape(()))._replace(trailers=(Trailer(0.8, 0.5, 1.2, 0.3 * row),) * 2)
    return replace(forecasts, shapes=shapes_of(shapes))


def test_the_place_is_midway_between_the_nearest_points() -> None:
    forecasts, apart = crowd(40, 3), 0
    for row in range(0, 40, 2):
        pair = [forecasts.single(row), forecasts.single(row + 1)]
        met, separation = encounter((pair[0], 0), (pair[1], 0), NOW_S), separation_m((pair[0], 0), (pair[1], 0), NOW_S)
        if not separation or separation == np.inf:
            continue
        apart += 1
        parts = [[part for body in bodies(each) for part in placed_parts(body, pose_at(body, NOW_S))] for each in pair]
        place = shapely.Point(met.x_m, met.y_m)
        away = [sorted(part.core.distance(place) - part.radius_m for part in each) for each in parts]
        assert any(
            a == pytest.approx(separation / 2, abs=1e-6) and b == pytest.approx(separation / 2, abs=1e-6)
            for a, b in product(*away)
        )
    assert apart > 10


def test_sides_that_face_each_other_are_nearest_in_their_middle() -> None:
    both = Forecasts.joined([robot([0], [0], [0], 0.0, (2, 2)), robot([0], [4], [0.2], 0.0, (1, 1))])
    square = Shape.polygon([(0.5, 0.5), (-0.5, 0.5), (-0.5, -0.5), (0.5, -0.5)])
    both = replace(both, shapes=shapes_of([None, square]))
    met = encounter((both, 0), (both, 1), NOW_S)
    assert (met.x_m, met.y_m) == pytest.approx((2.25, 0.2))


def test_robots_meet_by_what_is_swept_as_by_what_they_said() -> None:
    """Robots that are swept wider than they are."""
    rng, sweeper, forecasts = np.random.default_rng(5), Sweeper(clearance_m=0.3), crowd(40, 4)
    widened_m, keys = rng.uniform(0, 1, 40), [f"{row:02}" for row in range(40)]
    wide = replace(forecasts, length_m=forecasts.length_m + widened_m, width_m=forecasts.width_m + widened_m)
    assert sweeper.update(keys, wide, widened_m) == ()
    some, at_s = rng.integers(0, 40, (200, 2)), NOW_S + rng.uniform(0, 10, 200)
    met, known = sweeper.encounters([(keys[a], keys[b]) for a, b in some.tolist()], at_s), 0
    for entry, (a, b), when_s in zip(met, some.tolist(), at_s.tolist(), strict=True):
        if a == b or isnan(entry["x"]):
            continue
        expected, known = encounter((forecasts, a), (forecasts, b), when_s), known + 1
        assert (entry["x"], entry["y"]) == pytest.approx((expected.x_m, expected.y_m), abs=1e-6)
    assert known > 100
