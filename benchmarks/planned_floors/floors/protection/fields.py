"""Protective fields: whose body is in a robot's field. Compiled."""

from math import cos, hypot, sin
from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

from benchmarks.planned_floors.truth.motion import Bools
from ingest.batch import Floats, Ints
from ingest.kernels import inner, kernel

NOBODY = -1

Fields = NDArray[Any]
"""Of `FIELD`."""

FIELD = np.dtype(
    [
        ("rear_m", np.float64),  # from the centre to the rear end of the field
        ("front_m", np.float64),  # from the centre to its front end
        ("left_m", np.float64),  # from the centre to its left side
        ("right_m", np.float64),  # from the centre to its right side
    ],
    align=True,
)

_FIELDS = numba.from_dtype(FIELD)[::1]
_POSES, _ROWS = numba.float64[:, ::1], numba.int64[::1]


@inner
def _apart(
    dx_m: float, dy_m: float, yaw_a: float, yaw_b: float, half_a: tuple[float, float], half_b: tuple[float, float]
) -> bool:
    """Whether two rectangles do not touch; B's middle is at (dx, dy) from A's. By their four axes."""
    for axis_yaw in (yaw_a, yaw_b):
        for quarter in (0.0, 1.0):
            ux, uy = cos(axis_yaw), sin(axis_yaw)
            if quarter:
                ux, uy = -uy, ux
            reach = 0.0
            for yaw, half in ((yaw_a, half_a), (yaw_b, half_b)):
                c, s = cos(yaw), sin(yaw)
                reach += half[0] * abs(c * ux + s * uy) + half[1] * abs(c * uy - s * ux)
            if abs(dx_m * ux + dy_m * uy) > reach:
                return True
    return False


@inner
def _touches(poses: Floats, field: Any, robot: int, other: int, half_m: Floats, coming_m: float) -> bool:
    """Whether the body of `other`, or the next `coming_m` of its way, is in the field of `robot`."""
    half = ((field.front_m + field.rear_m) / 2, (field.left_m + field.right_m) / 2)
    body = (half_m[0] + coming_m / 2, half_m[1])
    forward_m, left_m = (field.front_m - field.rear_m) / 2, (field.left_m - field.right_m) / 2
    yaw, other_yaw = poses[robot, 2], poses[other, 2]
    dx_m = poses[other, 0] - poses[robot, 0] - forward_m * cos(yaw) + left_m * sin(yaw) + coming_m / 2 * cos(other_yaw)
    dy_m = poses[other, 1] - poses[robot, 1] - forward_m * sin(yaw) - left_m * cos(yaw) + coming_m / 2 * sin(other_yaw)
    if hypot(dx_m, dy_m) > hypot(half[0], half[1]) + hypot(body[0], body[1]):
        return False
    return not _apart(dx_m, dy_m, yaw, other_yaw, half, body)


_BOOLS, _ALL = numba.boolean[::1], numba.float64[::1]


@kernel(numba.int64[::1](_POSES, _BOOLS, _FIELDS, _ALL, _ALL, numba.boolean[:, ::1], _ROWS))
def obstructors(
    poses: Floats, present: Bools, fields: Fields, half_m: Floats, coming_m: Floats, ignored: Bools, known: Ints
) -> Ints:
    """(n,) the robot whose body is in each robot's field, `NOBODY` where none is.

    Where there are several it is the one that is `known` (n,), else the nearest. `poses` (n, 3) x, y, yaw; `present`
    (n,); `half_m` (2,) half length and width of all bodies; `coming_m` (n,) how much of each robot's way counts as its
    body; `ignored` (n, n) the robots, by column, that each robot does not mind.
    """
    found = np.full(len(poses), NOBODY, np.int64)
    for robot in range(len(poses)):
        nearest_m = np.inf
        for other in range(len(poses)):
            if other == robot or not present[robot] or not present[other] or ignored[robot, other]:
                continue
            away_m = hypot(poses[other, 0] - poses[robot, 0], poses[other, 1] - poses[robot, 1])
            away_m = 0.0 if other == known[robot] else away_m
            if away_m < nearest_m and _touches(poses, fields[robot], robot, other, half_m, coming_m[other]):
                nearest_m, found[robot] = away_m, other
    return found


@kernel(numba.boolean(_POSES, _BOOLS, _FIELDS, _ALL, numba.int64))
def occupied(poses: Floats, present: Bools, field: Fields, half_m: Floats, robot: int) -> bool:
    """Whether any body is in the one `field` (1,) of one robot."""
    for other in range(len(poses)):
        if other != robot and present[other] and _touches(poses, field[0], robot, other, half_m, 0.0):
            return True
    return False
