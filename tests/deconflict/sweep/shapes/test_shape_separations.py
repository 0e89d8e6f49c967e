from collections.abc import Sequence

import numpy as np
import shapely
from shapely import affinity

from deconflict.sweep.geometry.envelope_distances import signed_gap
from deconflict.sweep.shapes.shape_separations import NEAR_M, bodies, shape_separations
from deconflict.sweep.shapes.shape_table import SHAPES
from ingest.batch import Floats, Forecasts
from ingest.shapes import Shape, ShapePart, shapes_of

PAIRS, LOOKS = 40, 30
Looks = tuple[Floats, Floats, Floats, Floats]


def numbers(shapes: Sequence[Shape | None]) -> np.ndarray:
    n, ones = len(shapes), np.ones(len(shapes))
    forecasts = Forecasts(np.arange(n + 1), ones, ones, ones, ones, np.zeros(n, np.int64), ones, ones, ones, ones)
    object.__setattr__(forecasts, "shapes", shapes_of(shapes))
    return np.asarray(SHAPES.numbers(forecasts))


def half_sides(shapes: Sequence[Shape | None]) -> Floats:
    return np.array([np.array(shape.size_m) / 2 if shape else (0.5, 0.4) for shape in shapes]).T.copy()


def separations(a: Sequence[Shape | None], b: Sequence[Shape | None], levels_m: Floats, looks: Looks) -> Floats:
    halves = half_sides(a), half_sides(b)
    robots = [bodies(numbers(shapes), half_m, levels_m) for shapes, half_m in zip((a, b), halves, strict=True)]
    return shape_separations(signed_gap(*looks, *halves), looks, *robots)


def test_distances_are_those_of_the_shapes() -> None:
    rng = np.random.default_rng(1)
    arrow = Shape.polygon([(0.8, 0.0), (-0.6, 0.4), (-0.3, 0.0), (-0.6, -0.4)])
    outlines = {None: shapely.box(-0.5, -0.4, 0.5, 0.4), arrow: shapely.Polygon(arrow.parts[0].outline_m)}
    a, b = [arrow] * PAIRS, [None if row % 2 else arrow for row in range(PAIRS)]
    dx_m, dy_m, yaw_a_rad, yaw_b_rad = (rng.uniform(-far, far, (PAIRS, LOOKS)) for far in (2.0, 2.0, 3.0, 3.0))
    looks = dx_m, dy_m, yaw_a_rad, yaw_b_rad
    found = separations(a, b, np.zeros((2, PAIRS)), looks)
    for row in range(PAIRS):
        for at in range(LOOKS):
            dx, dy, yaw_a, yaw_b = (look[row, at] for look in looks)
            area_a = affinity.rotate(outlines[a[row]], yaw_a, origin=(0, 0), use_radians=True)
            area_b = affinity.rotate(outlines[b[row]], yaw_b, origin=(0, 0), use_radians=True)
            apart_m = area_a.distance(affinity.translate(area_b, dx, dy))
            if apart_m < NEAR_M / 2:
                assert abs(max(found[row, at], 0.0) - apart_m) < 1e-9


def test_parts_that_pass_above_each_other_are_not_near() -> None:
    high = Shape((ShapePart(((0.0, 0.0),), 0.5, 1.0, 2.0), ShapePart(((0.9, 0.0),), 0.1, 0.0, 2.0)))
    low = Shape((ShapePart(((0.0, 0.0),), 0.5, 0.0, 0.3),))
    none = np.zeros((1, 1))
    here = none, none, none, none
    levels_m = np.array([[0.0], [2.0]])
    assert 0.2 < separations([high], [low], levels_m, here)[0, 0] < 0.5
    assert separations([low], [low], levels_m, here)[0, 0] <= 0.0
