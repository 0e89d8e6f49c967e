"""How far robots were apart, of all that came near: oriented envelopes, at every sample of a stretch of motion."""

from math import hypot, inf, isnan
from typing import NamedTuple

import numba
import numpy as np

from deconflict.sweep.geometry.rectangles import gap
from ingest.batch import Floats, Ints
from ingest.kernels import inner, kernel
from metrics.truth.recorded_motion import SampledMotion


class Separations(NamedTuple):
    """Pairs that are near at a sample, ascending by pair and sample. Arrays are (m,)."""

    a: Ints
    """Index of the robot."""
    b: Ints
    sample: Ints
    """Steps since the epoch."""
    separation_m: Floats
    since_s: Floats
    """Since when both have been there."""
    closeness: Floats
    """Distance of the centres over the sum of the radii."""

    def take(self, rows: Ints) -> "Separations":
        return Separations(
            self.a[rows],
            self.b[rows],
            self.sample[rows],
            self.separation_m[rows],
            self.since_s[rows],
            self.closeness[rows],
        )


def separations(stretch: SampledMotion, within_m: float) -> Separations:
    """Every two robots at every sample at which they are no further apart than `within_m`, neither above the other."""
    (a, b, column), (apart_m, reach_m) = _near(
        stretch.x_m, stretch.y_m, stretch.half_m, stretch.height_m, stretch.floor, within_m
    )
    of_a, of_b = (a, column), (b, column)
    distance = gap(
        stretch.x_m[of_b] - stretch.x_m[of_a],
        stretch.y_m[of_b] - stretch.y_m[of_a],
        stretch.yaw_rad[of_a],
        stretch.yaw_rad[of_b],
        stretch.half_m[:, a, column],
        stretch.half_m[:, b, column],
    )
    since = np.maximum(stretch.since_s[of_a], stretch.since_s[of_b])
    closeness = apart_m / (reach_m - within_m)
    return Separations(stretch.robot[a], stretch.robot[b], stretch.first + column, distance, since, closeness)


_MATRIX, _STACK = numba.float64[:, ::1], numba.float64[:, :, ::1]


@inner
def _boxes(x_m: Floats, y_m: Floats, radius_m: Floats, within_m: float) -> Floats:
    """(r, 4) west, east, south and north of each robot over a stretch, half of `within_m` beyond its reach."""
    boxes = np.empty((len(x_m), 4))
    for row in range(len(x_m)):
        west, east, south, north, grown = inf, -inf, inf, -inf, 0.0
        for x, y, radius in zip(x_m[row], y_m[row], radius_m[row]):  # noqa: B905 - of one length
            if not isnan(x):
                west, east, south, north = min(west, x), max(east, x), min(south, y), max(north, y)
                grown = max(grown, radius)
        grown += within_m / 2
        boxes[row] = west - grown, east + grown, south - grown, north + grown
    return boxes


@kernel(
    numba.types.Tuple((numba.int64[:, ::1], _MATRIX))(  # type: ignore[no-untyped-call]
        _MATRIX, _MATRIX, _STACK, _STACK, _MATRIX, numba.float64
    )
)
def _near(
    x_m: Floats, y_m: Floats, half_m: Floats, height_m: Floats, floor: Floats, within_m: float
) -> tuple[Ints, Floats]:
    """(3, m) two robots' rows and the sample, ascending, where their circles are no further apart than `within_m` and
    neither is above the other, and (2, m) how far their centres are apart and how far they may be for that; all else is
    (r, s), half sides and heights (2, r, s).
    """
    radius_m = np.hypot(half_m[0], half_m[1])
    boxes = _boxes(x_m, y_m, radius_m, within_m)
    which, how_far, n = np.empty((3, 1024), np.int64), np.empty((2, 1024)), 0
    for a in range(len(x_m)):
        west, east, south, north = boxes[a]
        for b in range(a + 1, len(x_m)):
            if west > boxes[b, 1] or boxes[b, 0] > east or south > boxes[b, 3] or boxes[b, 2] > north:
                continue
            for column in range(x_m.shape[1]):
                # a sum with an absent robot is nan, and nan is within nothing
                apart_m = hypot(x_m[a, column] - x_m[b, column], y_m[a, column] - y_m[b, column])
                reach_m = radius_m[a, column] + radius_m[b, column] + within_m
                if not (apart_m <= reach_m and floor[a, column] == floor[b, column]):
                    continue
                if height_m[0, a, column] > height_m[1, b, column] or height_m[0, b, column] > height_m[1, a, column]:
                    continue
                if n == which.shape[1]:
                    which = np.concatenate((which, np.empty_like(which)), axis=1)
                    how_far = np.concatenate((how_far, np.empty_like(how_far)), axis=1)
                which[0, n], which[1, n], which[2, n] = a, b, column
                how_far[0, n], how_far[1, n], n = apart_m, reach_m, n + 1
    return which[:, :n].copy(), how_far[:, :n].copy()
