"""Distances of shapes at many times, for what is asked at samples: probabilities."""

from math import cos, inf, sin
from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

from deconflict.sweep.geometry.knots import ROBOT, Robots
from deconflict.sweep.narrowphase import MOTION
from deconflict.sweep.shapes.shape_gaps import body_of, gap, table_of
from deconflict.sweep.shapes.shape_table import CORNER, PIECE, SHAPES
from ingest.batch import Floats, Ints
from ingest.kernels import INTS, MATRIX, kernel, ready

NEAR_M = 2.0
"""Of robots whose rectangles are further apart, the distance of the rectangles is near enough."""

Looks = tuple[Floats, Floats, Floats, Floats]
"""(n, m) each: x and y from the centre of A to that of B, and the headings of both."""

_ROBOT, _PIECE, _CORNER = (numba.from_dtype(dtype) for dtype in (ROBOT, PIECE, CORNER))


def bodies(shape: Ints, half_m: Floats, levels_m: Floats) -> Robots:
    """Robots by the numbers of their shapes (n,), half sides (2, n), and bottoms and tops (2, n)."""
    made = np.zeros(len(shape), ROBOT)
    made["shape"], made["radius"] = shape, np.hypot(*half_m)
    made["half_length"], made["half_width"] = half_m
    made["bottom"], made["top"] = levels_m
    return made


def shape_separations(apart_m: Floats, looks: Looks, a: Robots, b: Robots) -> Floats:
    """(n, m) distances of n pairs of bodies `a` and `b` (n,) at m times; 0 or less if they overlap.

    `apart_m` are those of the rectangles around them. Parts that pass above each other have no distance: if all do,
    they are as far apart as their rectangles are long.
    """
    dx_m, dy_m, yaw_a_rad, yaw_b_rad = map(ready, looks)
    apart_m = ready(apart_m)
    return _separations(apart_m, dx_m, dy_m, yaw_a_rad, yaw_b_rad, a, b, *SHAPES.arrays)


@kernel(MATRIX(*[MATRIX] * 5, *[_ROBOT[::1]] * 2, INTS, _PIECE[::1], _CORNER[::1]))
def _separations(
    apart_m: Floats,
    dx_m: Floats,
    dy_m: Floats,
    yaw_a_rad: Floats,
    yaw_b_rad: Floats,
    a: Robots,
    b: Robots,
    begins: Ints,
    pieces: NDArray[Any],
    corners: NDArray[Any],
) -> Floats:
    found, motion = apart_m.copy(), np.zeros(1, MOTION)
    table, m = table_of(begins, pieces, corners), motion[0]
    for row in range(len(found)):
        body_a, body_b = body_of(a[row], table, 0), body_of(b[row], table, 1)
        for at in range(found.shape[1]):
            if not apart_m[row, at] < NEAR_M:
                continue
            m.dx, m.dy = dx_m[row, at], dy_m[row, at]
            m.cos_a, m.sin_a = cos(yaw_a_rad[row, at]), sin(yaw_a_rad[row, at])
            m.cos_b, m.sin_b = cos(yaw_b_rad[row, at]), sin(yaw_b_rad[row, at])
            nearest = gap(m, 0.0, body_a, body_b, table, 0.0, 0.0)[0][0]
            if nearest == inf:
                nearest = max(apart_m[row, at], 2 * (a[row].radius + b[row].radius))
            found[row, at] = nearest if nearest > 0.0 else min(apart_m[row, at], 0.0)
    return found
