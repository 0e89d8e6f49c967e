"""Poses of robots at given times, for many forecasts and many times at once."""

import numba
import numpy as np

from ingest.batch import Floats, Forecasts, Ints
from ingest.frames.angles import turn_between
from ingest.kernels import inner, kernel, ready

_FLOATS, _INTS = (numba.types.Array(kind, 1, "C", readonly=True) for kind in (numba.float64, numba.int64))
_POSES = numba.float64[:, :, ::1]


_turn_between = inner(turn_between)


@kernel(_POSES(_INTS, *[_FLOATS] * 4, _INTS, *[_FLOATS] * 2))
def _poses_at(
    start: Ints, t_s: Floats, x_m: Floats, y_m: Floats, yaw_rad: Floats, floor: Ints, since_s: Floats, after_s: Floats
) -> Floats:
    poses = np.full((len(since_s), len(after_s), 4), np.nan)
    for row in range(len(start) - 1):
        first, last = start[row], start[row + 1] - 1
        if last < first:
            continue
        knot = first
        for at in range(len(after_s)):
            moment = since_s[row] + after_s[at]
            while knot < last and t_s[knot + 1] <= moment:
                knot += 1
            after = min(knot + 1, last)
            if floor[after] != floor[knot]:
                after = knot
            span = t_s[after] - t_s[knot]
            share = min(max((moment - t_s[knot]) / (span if span > 0.0 else 1.0), 0.0), 1.0)
            turn = _turn_between(yaw_rad[knot], yaw_rad[after])
            pose = poses[row, at]
            pose[0] = x_m[knot] + share * (x_m[after] - x_m[knot])
            pose[1] = y_m[knot] + share * (y_m[after] - y_m[knot])
            pose[2], pose[3] = yaw_rad[knot] + share * turn, floor[knot]
    return poses


def poses_at(forecasts: Forecasts, since_s: Floats, after_s: Floats) -> Floats:
    """(n, m, 4) x_m, y_m, yaw_rad and floor of n robots, at `after_s` (m,) ascending seconds after each robot's own
    time `since_s` (n,). Between knots it is interpolated as `Forecasts` says; before the first knot the robot is there.
    nan if a robot has no knots."""
    f = forecasts
    t, x, y, yaw = (ready(column) for column in (f.t_s, f.x_m, f.y_m, f.yaw_rad))
    return _poses_at(ready(f.start, np.int64), t, x, y, yaw, ready(f.floor, np.int64), since_s, after_s)
