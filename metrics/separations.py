"""How far robots were apart, of all that came near: oriented envelopes, at every sample of a stretch of motion."""

from typing import NamedTuple

import numpy as np

from deconflict.rectangles import gap
from ingest.seam import Floats, Ints
from metrics.motion import Stretch

BLOCK = 256
"""Robots that are compared with all others at once."""


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


def separations(stretch: Stretch, within_m: float) -> Separations:
    """Every two robots at every sample at which they are no further apart than `within_m`."""
    a, b = _neighbours(stretch, within_m)
    apart = np.hypot(stretch.x_m[a] - stretch.x_m[b], stretch.y_m[a] - stretch.y_m[b])
    # a sum with an absent robot is nan, and nan is within nothing
    reach = stretch.radius_m[a] + stretch.radius_m[b] + within_m
    row, column = np.nonzero((apart <= reach) & (stretch.floor[a] == stretch.floor[b]))
    of_a, of_b = (a[row], column), (b[row], column)
    distance = gap(
        stretch.x_m[of_b] - stretch.x_m[of_a],
        stretch.y_m[of_b] - stretch.y_m[of_a],
        stretch.yaw_rad[of_a],
        stretch.yaw_rad[of_b],
        stretch.half_m[:, of_a[0], of_a[1]],
        stretch.half_m[:, of_b[0], of_b[1]],
    )
    since = np.maximum(stretch.since_s[of_a], stretch.since_s[of_b])
    closeness = apart[row, column] / (reach[row, column] - within_m)
    return Separations(stretch.robot[a[row]], stretch.robot[b[row]], stretch.first + column, distance, since, closeness)


def _neighbours(stretch: Stretch, within_m: float) -> tuple[Ints, Ints]:
    """Rows of robots, a < b, whose boxes over the whole stretch come as near."""
    grown = np.nanmax(stretch.radius_m, axis=1, initial=0.0) + within_m / 2
    west, east = np.nanmin(stretch.x_m, axis=1) - grown, np.nanmax(stretch.x_m, axis=1) + grown
    south, north = np.nanmin(stretch.y_m, axis=1) - grown, np.nanmax(stretch.y_m, axis=1) + grown
    found: list[tuple[Ints, Ints]] = []
    for start in range(0, len(west), BLOCK):
        rows = slice(start, start + BLOCK)
        near = (west[rows, None] <= east) & (west <= east[rows, None])
        near &= (south[rows, None] <= north) & (south <= north[rows, None])
        a, b = np.nonzero(near)
        found.append((a[a + start < b] + start, b[a + start < b]))
    return np.concatenate([a for a, _ in found] or [_NONE]), np.concatenate([b for _, b in found] or [_NONE])


_NONE = np.empty(0, np.int64)
