"""Where robots will be in the next ten seconds, at even steps, for many forecasts at once."""

from math import atan2, cos, hypot, isfinite, sin
from typing import NamedTuple, Self

import numba
import numpy as np

from ingest.batch import Floats, Forecasts, Ints
from ingest.kernels import kernel, ready

STEP_S = 0.5
STEPS = 20

_FLOATS, _INTS = (numba.types.Array(kind, 1, "C", readonly=True) for kind in (numba.float64, numba.int64))


class Lookahead(NamedTuple):
    """n robots at `STEPS + 1` times. Arrays are (n, STEPS + 1)."""

    t_s: Floats
    """Seconds since the epoch."""
    x_m: Floats
    """Envelope centre in the floor's frame."""
    y_m: Floats
    yaw_rad: Floats
    floor: Ints

    def at_rows(self, rows: Ints) -> Self:
        columns = (self.t_s[rows], self.x_m[rows], self.y_m[rows], self.yaw_rad[rows])
        return type(self)(*columns, self.floor[rows])


class PathsAhead(NamedTuple):
    """The paths of n robots on the floors that they are on now."""

    lines_m: Floats
    """(n, STEPS + 1, 2) where the centres of their envelopes will be, as far as that is known."""
    boxes_m: Floats
    """(n, 4) boxes around that: west, south, east and north."""
    way_m: Floats
    """(n,) how far each gets, also beyond what is known."""

    def at_rows(self, rows: Ints) -> Self:
        return type(self)(self.lines_m[rows], self.boxes_m[rows], self.way_m[rows])


@kernel(numba.float64[:, :, ::1](*[numba.types.Array(numba.float64, 1, "A", readonly=True)] * 5))
def corners(x_m: Floats, y_m: Floats, yaw_rad: Floats, length_m: Floats, width_m: Floats) -> Floats:
    """(n, 4, 2) the corners of envelopes at poses; all arguments are (n,)."""
    found = np.empty((len(x_m), 4, 2))
    for row in range(len(x_m)):
        c, s, end = cos(yaw_rad[row]), sin(yaw_rad[row]), found[row]
        along_x, along_y = c * length_m[row] / 2, s * length_m[row] / 2
        across_x, across_y = -s * width_m[row] / 2, c * width_m[row] / 2
        front_x, front_y, back_x, back_y = (
            x_m[row] + along_x,
            y_m[row] + along_y,
            x_m[row] - along_x,
            y_m[row] - along_y,
        )
        end[0, 0], end[0, 1] = front_x + across_x, front_y + across_y
        end[1, 0], end[1, 1] = back_x + across_x, back_y + across_y
        end[2, 0], end[2, 1] = back_x - across_x, back_y - across_y
        end[3, 0], end[3, 1] = front_x - across_x, front_y - across_y
    return found


@kernel(
    numba.types.Tuple((*[numba.float64[:, ::1]] * 4, numba.int64[:, ::1]))(  # type: ignore[no-untyped-call]
        _INTS, *[_FLOATS] * 4, _INTS, *[numba.float64] * 2, numba.int64
    )
)
def _ahead(
    start: Ints,
    t_s: Floats,
    x_m: Floats,
    y_m: Floats,
    yaw_rad: Floats,
    floor: Ints,
    now_s: float,
    step_s: float,
    steps: int,
) -> tuple[Floats, Floats, Floats, Floats, Ints]:
    n = len(start) - 1
    times, x, y, yaw = np.empty((n, steps)), np.empty((n, steps)), np.empty((n, steps)), np.empty((n, steps))
    on = np.empty((n, steps), np.int64)
    for row in range(n):
        before, end = start[row], start[row + 1]
        sound, turn, turns_from = before < end, 0.0, -1
        for step in range(steps):
            times[row, step] = now_s + step_s * step
            if not sound:
                continue
            while before + 1 < end and t_s[before + 1] - now_s <= step_s * step:
                before += 1
            after, share = min(before + 1, end - 1), 0.0
            if after > before and floor[after] == floor[before]:
                share = (times[row, step] - t_s[before]) / (t_s[after] - t_s[before])
                share = 0.0 if share < 0.0 else 1.0 if share > 1.0 else share
            if turns_from != before:
                turn, turns_from = yaw_rad[after] - yaw_rad[before], before
                turn = atan2(sin(turn), cos(turn)) if turn != 0.0 else turn
            x[row, step] = x_m[before] + share * (x_m[after] - x_m[before])
            y[row, step] = y_m[before] + share * (y_m[after] - y_m[before])
            yaw[row, step] = yaw_rad[before] + share * turn
            on[row, step] = floor[before]
            sound = isfinite(x[row, step] + y[row, step] + yaw[row, step])
        if not sound:
            x[row], y[row], yaw[row], on[row] = 0.0, 0.0, 0.0, -1
    return times, x, y, yaw, on


def look_ahead(forecasts: Forecasts, now_s: float) -> Lookahead:
    """Each robot from `now_s` on, interpolated as `Forecasts` says; before its first knot, at that knot.

    A robot whose numbers are not finite is on floor -1.
    """
    f = forecasts
    t_s, x_m, y_m, yaw_rad = (ready(column) for column in (f.t_s, f.x_m, f.y_m, f.yaw_rad))
    start, floor = ready(f.start, np.int64), ready(f.floor, np.int64)
    return Lookahead(*_ahead(start, t_s, x_m, y_m, yaw_rad, floor, now_s, STEP_S, STEPS + 1))


LOOKAHEAD = numba.types.NamedTuple(  # type: ignore[no-untyped-call]
    (*[numba.float64[:, ::1]] * 4, numba.int64[:, ::1]), Lookahead
)
PATHS_AHEAD = numba.types.NamedTuple(  # type: ignore[no-untyped-call]
    (numba.float64[:, :, ::1], numba.float64[:, ::1], numba.float64[::1]), PathsAhead
)
"""The types of `Lookahead` and `PathsAhead` in kernels."""


@kernel(
    numba.types.Tuple((numba.float64[:, :, ::1], *[numba.float64[:, ::1]] * 2))(  # type: ignore[no-untyped-call]
        numba.float64[:, ::1], numba.float64[:, ::1], numba.int64[:, ::1], _INTS
    )
)
def _paths(x_m: Floats, y_m: Floats, floor: Ints, known: Ints) -> tuple[Floats, Floats, Floats]:
    n, steps = x_m.shape
    lines_m, boxes_m, legs_m = np.empty((n, steps, 2)), np.empty((n, 4)), np.zeros((n, steps - 1))
    for row in range(n):
        last = 0
        lines_m[row, 0] = x_m[row, 0], y_m[row, 0]
        west, south, east, north = x_m[row, 0], y_m[row, 0], x_m[row, 0], y_m[row, 0]
        while last + 1 < steps and floor[row, last + 1] == floor[row, 0]:
            x, y = x_m[row, last + 1], y_m[row, last + 1]
            legs_m[row, last] = hypot(x - x_m[row, last], y - y_m[row, last])
            last += 1
            if last <= known[row]:
                lines_m[row, last] = x, y
                west, south, east, north = min(west, x), min(south, y), max(east, x), max(north, y)
        lines_m[row, min(last, known[row]) + 1 :] = lines_m[row, min(last, known[row])]
        boxes_m[row] = west, south, east, north
    return lines_m, boxes_m, legs_m


def paths_ahead(view: Lookahead, known: Ints) -> PathsAhead:
    """The paths of robots whose future is known until step `known` (n,); each stays where its path ends."""
    lines_m, boxes_m, legs_m = _paths(view.x_m, view.y_m, view.floor, known)
    return PathsAhead(lines_m, boxes_m, legs_m.sum(axis=1))
