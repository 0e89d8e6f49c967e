"""Poses of robots at given times of their forecasts."""

from dataclasses import dataclass
from math import hypot

import numba
import numpy as np

from ingest.batch import Floats, Forecasts, Ints
from ingest.frames.angles import turn_between
from ingest.kernels import CUBE, FLOAT, INT, READ_FLOATS, READ_INTS, inner, kernel, ready

_turn_between = inner(turn_between)

Knot = tuple[float, float, float, float]
"""t_s, x_m, y_m and yaw_rad."""
Columns = tuple[Ints, Floats, Floats, Floats, Floats, Ints, Floats, Floats, int]
"""The columns of `Forecasts` that describe the motion and size of robots, and the row of one robot."""
_REAL, _WHOLE = (numba.types.Array(kind, 1, "A", readonly=True) for kind in (FLOAT, INT))
COLUMNS = numba.types.Tuple((_WHOLE, *[_REAL] * 4, _WHOLE, *[_REAL] * 2, INT))  # type: ignore[no-untyped-call]
"""The type of `Columns` in kernels."""
Moving = tuple[float, float, float, float, float, int]
"""A robot at one moment: the fields of `Pose` in order."""


@dataclass(frozen=True, slots=True)
class Pose:
    """The pose and velocity of an envelope, in the frame of its floor."""

    x_m: float
    """Centre of the envelope."""
    y_m: float
    yaw_rad: float
    """Heading, anticlockwise from x."""
    vx_mps: float
    vy_mps: float
    floor: int
    """Index of the floor; -1 if it is not known."""

    @property
    def speed_mps(self) -> float:
        return hypot(self.vx_mps, self.vy_mps)


@inner
def between(knot: Knot, following: Knot, at_s: float) -> tuple[float, float, float, float, float]:
    """x, y and yaw of a robot at `at_s`, and its velocity along x and y.

    It stands at `knot` before that, and if both are the same.
    """
    begins_s, x, y, yaw = knot
    span_s = following[0] - begins_s
    if at_s < begins_s or span_s == 0.0:
        return x, y, yaw, 0.0, 0.0
    share, dx, dy = (at_s - begins_s) / span_s, following[1] - x, following[2] - y
    turn = _turn_between(yaw, following[3])
    return x + share * dx, y + share * dy, yaw + share * turn, dx / span_s, dy / span_s


def moving(columns: Columns, at_s: float) -> Moving:
    """A robot at `at_s`, interpolated as `Forecasts` says; before its first knot it is there."""
    start, t_s, x_m, y_m, yaw_rad, floor, _, _, row = columns
    knot, end = start[row], start[row + 1]
    while knot + 1 < end and t_s[knot + 1] <= at_s:
        knot += 1
    after = knot + int(knot + 1 < end and floor[knot + 1] == floor[knot])
    following = t_s[after], x_m[after], y_m[after], yaw_rad[after]
    return *between((t_s[knot], x_m[knot], y_m[knot], yaw_rad[knot]), following, at_s), floor[knot]


_MOVING = numba.types.Tuple((*[FLOAT] * 5, INT))  # type: ignore[no-untyped-call]
_pose_at = kernel(_MOVING(COLUMNS, FLOAT))(moving)


def columns_of(forecasts: Forecasts, row: int) -> Columns:
    f = forecasts
    return f.start, f.t_s, f.x_m, f.y_m, f.yaw_rad, f.floor, f.length_m, f.width_m, row


def pose_at(forecast: Forecasts, t_s: float) -> Pose:
    """The pose of one robot at `t_s`, as `moving`."""
    return Pose(*_pose_at(columns_of(forecast, 0), t_s))


@kernel(CUBE(READ_INTS, *[READ_FLOATS] * 4, READ_INTS, *[READ_FLOATS] * 2))
def _poses_at(
    start: Ints, t_s: Floats, x_m: Floats, y_m: Floats, yaw_rad: Floats, floor: Ints, since_s: Floats, after_s: Floats
) -> Floats:
    poses = np.full((len(since_s), len(after_s), 4), np.nan)
    for row in range(len(since_s)):
        knot, end = start[row], start[row + 1]
        for at in range(len(after_s) if knot < end else 0):
            at_s, pose = since_s[row] + after_s[at], poses[row, at]
            while knot + 1 < end and t_s[knot + 1] <= at_s:
                knot += 1
            after = knot + int(knot + 1 < end and floor[knot + 1] == floor[knot])
            following = t_s[after], x_m[after], y_m[after], yaw_rad[after]
            before = t_s[knot], x_m[knot], y_m[knot], yaw_rad[knot]
            pose[0], pose[1], pose[2], _, _ = between(before, following, at_s)
            pose[3] = floor[knot]
    return poses


def poses_at(forecasts: Forecasts, since_s: Floats, after_s: Floats) -> Floats:
    """(n, m, 4) x_m, y_m, yaw_rad and floor of n robots, at `after_s` (m,) ascending seconds after each robot's own
    time `since_s` (n,), as `pose_at`. nan if a robot has no knots."""
    f = forecasts
    t, x, y, yaw = (ready(column) for column in (f.t_s, f.x_m, f.y_m, f.yaw_rad))
    return _poses_at(ready(f.start, np.int64), t, x, y, yaw, ready(f.floor, np.int64), since_s, after_s)
