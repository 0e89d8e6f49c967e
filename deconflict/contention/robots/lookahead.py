"""Where robots will be in the next ten seconds, at even steps, for many forecasts at once."""

from math import hypot
from typing import NamedTuple, Self

import numpy as np

from deconflict.contention.robots.bounding_boxes import write_box
from deconflict.sweep.geometry.pose import poses_at
from ingest.batch import Floats, Forecasts, Ints
from ingest.frames.corners import corners_of
from ingest.kernels import ANY_FLOATS, CUBE, FLOATS, INT_MATRIX, MATRIX, READ_INTS, inner, kernel, named_type

STEP_S = 0.5
STEPS = 20
_AHEAD_S: Floats = STEP_S * np.arange(STEPS + 1, dtype=np.float64)


class Lookahead(NamedTuple):
    """n robots at `STEPS + 1` times. Arrays are (n, STEPS + 1)."""

    t_s: Floats
    """Seconds since the epoch."""
    x_m: Floats
    """Envelope centre in the floor's frame."""
    y_m: Floats
    yaw_rad: Floats
    floor: Ints

    def after(self, x_m: Floats, y_m: Floats, yaw_rad: Floats) -> Self:
        """The same after other poses (n,), which count as at the time and on the floor of the first."""
        first = self.t_s[:, 0], x_m, y_m, yaw_rad, self.floor[:, 0]
        return type(self)(*(np.column_stack(columns) for columns in zip(first, self, strict=True)))

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


_corners_of = inner(corners_of)


@kernel(CUBE(*[ANY_FLOATS] * 5))
def corners(x_m: Floats, y_m: Floats, yaw_rad: Floats, length_m: Floats, width_m: Floats) -> Floats:
    """(n, 4, 2) the corners of envelopes at poses; all arguments are (n,)."""
    found = np.empty((len(x_m), 4, 2))
    for row in range(len(x_m)):
        ends = _corners_of(x_m[row], y_m[row], yaw_rad[row], length_m[row], width_m[row])
        for corner in range(4):
            found[row, corner, 0], found[row, corner, 1] = ends[corner]
    return found


def look_ahead(forecasts: Forecasts, now_s: float) -> Lookahead:
    """Each robot from `now_s` on; before its first knot, at that knot.

    A robot whose numbers are not finite is on floor -1.
    """
    poses = poses_at(forecasts, np.full(len(forecasts), now_s), _AHEAD_S)
    poses[~np.isfinite(poses).all(axis=(1, 2))] = 0.0, 0.0, 0.0, -1.0
    t_s = np.tile(now_s + _AHEAD_S, (len(poses), 1))
    x_m, y_m, yaw_rad, floor = np.ascontiguousarray(np.moveaxis(poses, -1, 0))
    return Lookahead(t_s, x_m, y_m, yaw_rad, floor.astype(np.int64))


LOOKAHEAD = named_type(Lookahead, *[MATRIX] * 4, INT_MATRIX)
PATHS_AHEAD = named_type(PathsAhead, CUBE, MATRIX, FLOATS)
"""The types of `Lookahead` and `PathsAhead` in kernels."""


@kernel((MATRIX, MATRIX, INT_MATRIX, READ_INTS))
def _paths(x_m: Floats, y_m: Floats, floor: Ints, known: Ints) -> tuple[Floats, Floats, Floats]:
    n, steps = x_m.shape
    lines_m, boxes_m, legs_m = np.empty((n, steps, 2)), np.empty((n, 4)), np.zeros((n, steps - 1))
    for row in range(n):
        last = 0
        lines_m[row, 0, 0], lines_m[row, 0, 1] = x_m[row, 0], y_m[row, 0]
        west, south, east, north = x_m[row, 0], y_m[row, 0], x_m[row, 0], y_m[row, 0]
        while last + 1 < steps and floor[row, last + 1] == floor[row, 0]:
            x, y = x_m[row, last + 1], y_m[row, last + 1]
            legs_m[row, last] = hypot(x - x_m[row, last], y - y_m[row, last])
            last += 1
            if last <= known[row]:
                lines_m[row, last, 0], lines_m[row, last, 1] = x, y
                west, south, east, north = min(west, x), min(south, y), max(east, x), max(north, y)
        end = min(last, known[row])
        for step in range(end + 1, steps):
            lines_m[row, step, 0], lines_m[row, step, 1] = lines_m[row, end, 0], lines_m[row, end, 1]
        write_box(boxes_m[row], west, south, east, north)
    return lines_m, boxes_m, legs_m


def paths_ahead(view: Lookahead, known: Ints) -> PathsAhead:
    """The paths of robots whose future is known until step `known` (n,); each stays where its path ends."""
    lines_m, boxes_m, legs_m = _paths(view.x_m, view.y_m, view.floor, known)
    return PathsAhead(lines_m, boxes_m, legs_m.sum(axis=1))
