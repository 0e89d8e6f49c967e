"""Separations of near robots: between oriented envelopes, at every sample of a motion."""

from math import hypot, inf, isnan
from typing import Any, NamedTuple

import numpy as np

from deconflict.sweep.geometry.envelope_distances import gap
from deconflict.sweep.geometry.heights import heights_overlap
from deconflict.sweep.shapes.shape_separations import Looks, bodies, shape_separations
from ingest.batch import Floats, Ints
from ingest.kernels import CUBE, FLOAT, INTS, MATRIX, inner, kernel
from metrics.truth.recorded_motion import SampledMotion


class TooManyPairsError(Exception):
    """More robots are near each other than may be looked at."""


class Separations(NamedTuple):
    """Near pairs of robots at samples, ascending by pair and sample. Arrays are (m,)."""

    a: Ints
    """Slot of the first robot; `b` is that of the second."""
    b: Ints
    sample: Ints
    """Steps since the epoch."""
    separation_m: Floats
    since_s: Floats
    """Time since which both have been present."""
    closeness: Floats
    """Distance of the centres divided by the sum of the radii."""

    def take(self, rows: Ints) -> "Separations":
        return Separations._make(column[rows] for column in self)


def separations(sampled: SampledMotion, within_m: float, most: float = inf) -> Separations:
    """All pairs at all samples with a separation of at most `within_m`, without pairs of which one is above the
    other. A robot counts with its trailers.

    Raises `TooManyPairsError` if there are more than `most` (at all samples together) by the circles around them.
    """
    robot = sampled.robot
    (a, b, column), (apart_m, reach_m) = _near(
        robot, sampled.x_m, sampled.y_m, sampled.half_m, sampled.height_m, sampled.floor, within_m, most
    )
    if len(a) > most:
        raise TooManyPairsError
    of_a, of_b = (a, column), (b, column)
    looks = (
        sampled.x_m[of_b] - sampled.x_m[of_a],
        sampled.y_m[of_b] - sampled.y_m[of_a],
        sampled.yaw_rad[of_a],
        sampled.yaw_rad[of_b],
    )
    distance = gap(*looks, sampled.half_m[:, a, column], sampled.half_m[:, b, column])
    if sampled.shape is not None:
        rows = np.flatnonzero((sampled.shape[of_a] > 0) | (sampled.shape[of_b] > 0))
        distance[rows] = _of_shapes(sampled, a[rows], b[rows], column[rows], distance[rows], _some(looks, rows))
    since = np.maximum(sampled.since_s[of_a], sampled.since_s[of_b])
    closeness = apart_m / (reach_m - within_m)
    found = Separations(robot[a], robot[b], sampled.first + column, distance, since, closeness)
    return found if len(robot) == len(np.unique(robot)) else _of_trains(found)


def _of_trains(found: Separations) -> Separations:
    """The smallest separation of each pair of robots at each sample, of those of all their trailers."""
    a, b = np.minimum(found.a, found.b), np.maximum(found.a, found.b)
    order = np.lexsort((found.closeness, found.separation_m, found.sample, b, a))
    found = found._replace(a=a, b=b).take(order)
    moment = np.stack([found.a, found.b, found.sample])
    return found.take(np.flatnonzero(np.append(True, (np.diff(moment) != 0).any(axis=0))[: len(order)]))


def _some(looks: Looks, rows: Ints) -> Looks:
    dx_m, dy_m, yaw_a_rad, yaw_b_rad = (column[rows, None] for column in looks)
    return dx_m, dy_m, yaw_a_rad, yaw_b_rad


def _of_shapes(sampled: SampledMotion, a: Ints, b: Ints, column: Ints, apart_m: Floats, looks: Looks) -> Floats:
    """(n,) the distances of shapes, whose rectangles are `apart_m` (n,) apart."""
    assert sampled.shape is not None  # noqa: S101 - there are shapes
    shape, half_m, height_m = sampled.shape, sampled.half_m, sampled.height_m
    of_a, of_b = (
        bodies(shape[row, column].astype(np.int64), half_m[:, row, column], height_m[:, row, column]) for row in (a, b)
    )
    return np.maximum(shape_separations(apart_m[:, None], looks, of_a, of_b)[:, 0], 0.0)


_heights_overlap = inner(heights_overlap)


@inner
def _beside(a_m: Floats, b_m: Floats) -> bool:
    """Whether neither of two robots with bottom and top (2,) is above the other."""
    return bool(_heights_overlap(a_m[0], a_m[1], b_m[0], b_m[1]))


@inner
def _longer(table: Any) -> Any:
    """A table with room for twice as many columns."""
    return np.concatenate((table, np.empty_like(table)), axis=1)


@inner
def _boxes(x_m: Floats, y_m: Floats, radius_m: Floats, within_m: float) -> Floats:
    """(r, 4) west, east, south and north bounds of each robot over all samples, extended by half of `within_m`."""
    boxes = np.empty((len(x_m), 4))
    for row in range(len(x_m)):
        west, east, south, north, grown = inf, -inf, inf, -inf, 0.0
        for x, y, radius in zip(x_m[row], y_m[row], radius_m[row]):  # noqa: B905 - of one length
            if not isnan(x):
                west, east, south, north = min(west, x), max(east, x), min(south, y), max(north, y)
                grown = max(grown, radius)
        grown += within_m / 2
        boxes[row, 0], boxes[row, 1] = west - grown, east + grown
        boxes[row, 2], boxes[row, 3] = south - grown, north + grown
    return boxes


@kernel((INTS, MATRIX, MATRIX, CUBE, CUBE, MATRIX, FLOAT, FLOAT))
def _near(
    robot: Ints,
    x_m: Floats,
    y_m: Floats,
    half_m: Floats,
    height_m: Floats,
    floor: Floats,
    within_m: float,
    most: float,
) -> tuple[Ints, Floats]:
    """Pairs whose circumscribed circles are at most `within_m` apart, of which neither is above the other, and that are
    not of one `robot` (r,). Ends with the first that is more than `most`.

    Returns (3, m) the rows of the two and the sample, ascending; and (2, m) the distance of their centres and the
    greatest distance at which they count. Inputs are (r, s); half sides and heights are (2, r, s).
    """
    radius_m = np.hypot(half_m[0], half_m[1])
    boxes = _boxes(x_m, y_m, radius_m, within_m)
    which, how_far, n = np.empty((3, 1024), np.int64), np.empty((2, 1024)), 0
    for a in range(len(x_m)):
        west, east, south, north = boxes[a]
        for b in range(a + 1, len(x_m)):
            if robot[a] == robot[b]:
                continue
            if west > boxes[b, 1] or boxes[b, 0] > east or south > boxes[b, 3] or boxes[b, 2] > north:
                continue
            for column in range(x_m.shape[1]):
                # the sum is nan if a robot is absent, and nan compares as false
                apart_m = hypot(x_m[a, column] - x_m[b, column], y_m[a, column] - y_m[b, column])
                reach_m = radius_m[a, column] + radius_m[b, column] + within_m
                is_near = apart_m <= reach_m and floor[a, column] == floor[b, column]
                if not (is_near and _beside(height_m[:, a, column], height_m[:, b, column])):
                    continue
                if n == which.shape[1]:
                    which, how_far = _longer(which), _longer(how_far)
                which[0, n], which[1, n], which[2, n] = a, b, column
                how_far[0, n], how_far[1, n], n = apart_m, reach_m, n + 1
                if n > most:
                    return which[:, :n].copy(), how_far[:, :n].copy()
    return which[:, :n].copy(), how_far[:, :n].copy()
