"""The place between two robots of which at least one is a shape or pulls trailers."""

from math import hypot, inf, nan
from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

from deconflict.sweep.geometry.encounter import SAME_M, Encounters, moving_there
from deconflict.sweep.geometry.heights import heights_overlap
from deconflict.sweep.geometry.knots import KNOT, ROBOT, Knots, Robots, replace
from deconflict.sweep.shapes.shape_gaps import Body, Table, between, body_of, heights, place, table_of
from deconflict.sweep.shapes.shape_table import CORNER, PIECE, SHAPES
from deconflict.sweep.shapes.trains import pairs_of_bodies
from ingest.batch import Floats, Forecasts, Ints
from ingest.kernels import FLOATS, INTS, MATRIX, inner, kernel

_KNOT, _ROBOT, _PIECE, _CORNER = map(numba.from_dtype, (KNOT, ROBOT, PIECE, CORNER))
_heights_overlap = inner(heights_overlap)


def set_places(met: Encounters, robots: Robots, knots: Knots, widened_m: Floats, slots: Ints, at_s: Floats) -> None:
    """Set the places of those of n encounters in which there is a shape or a train. `slots` are (n, 2), -1 for an
    unknown robot. The place is unknown if the two overlap."""
    rows = np.flatnonzero((slots >= 0).all(axis=1) & (robots[["shape", "train"]][slots] != _PLAIN).any(axis=1))
    if not len(rows):
        return
    alone, (a, b) = np.arange(len(rows)), slots[rows].T
    trailers_a, trailers_b, row_of = pairs_of_bodies(a, b, robots)
    each_a, each_b = np.concatenate([a, trailers_a]), np.concatenate([b, trailers_b])
    row_of = np.concatenate([alone, row_of])
    found = _places_between(robots, knots, widened_m, each_a, each_b, at_s[rows][row_of], *SHAPES.arrays)
    nearest = np.lexsort((found[:, 0], row_of))[np.searchsorted(np.sort(row_of), alone)]
    met["x"][rows], met["y"][rows] = found[nearest, 1:].T


_PLAIN = np.zeros(1, ROBOT)[["shape", "train"]][0]


def places_of(forecasts: Forecasts, a: Ints, b: Ints, at_s: float) -> Floats:
    """`_places_between` of rows of valid forecasts."""
    robots, knots = np.zeros(len(forecasts), ROBOT), np.zeros(len(forecasts.t_s), KNOT)
    replace(robots, knots, np.arange(len(forecasts)), 0, forecasts)
    robots["shape"] = SHAPES.numbers(forecasts)
    widened_m, looks_s = np.zeros(len(robots)), np.full(len(a), at_s)
    return _places_between(robots, knots, widened_m, a, b, looks_s, *SHAPES.arrays)


@inner
def _to_outline(x: float, y: float, corners: Floats, count: int) -> tuple[float, float, float]:
    """The point of a convex piece that is nearest to (x, y), which is outside, and its distance."""
    best, best_x, best_y = inf, 0.0, 0.0
    for at in range(count):
        after = (at + 1) % count
        from_x, from_y = corners[at, 0], corners[at, 1]
        side_x, side_y = corners[after, 0] - from_x, corners[after, 1] - from_y
        squared = side_x * side_x + side_y * side_y
        along = ((x - from_x) * side_x + (y - from_y) * side_y) / squared if squared > 0.0 else 0.0
        along = min(max(along, 0.0), 1.0)
        near_x, near_y = from_x + along * side_x, from_y + along * side_y
        apart = hypot(x - near_x, y - near_y)
        if apart < best:
            best, best_x, best_y = apart, near_x, near_y
    return best_x, best_y, best


@inner
def _midway(piece_a: Any, piece_b: Any, table: Table, apart: float) -> tuple[float, float]:
    """The mean of the places midway between the nearest points of two pieces, whose corners are placed in the work
    space of the table, and which are `apart` from each other without their roundings."""
    _, _, _, placed_b, placed_a = table
    places, mean_x, mean_y = 0, 0.0, 0.0
    for side in range(2):
        corners, other = (placed_a, placed_b) if side == 0 else (placed_b, placed_a)
        count, others = (piece_a.count, piece_b.count) if side == 0 else (piece_b.count, piece_a.count)
        rounding = piece_a.rounding - piece_b.rounding if side == 0 else piece_b.rounding - piece_a.rounding
        for at in range(count):
            x, y, away = _to_outline(corners[at, 0], corners[at, 1], other, others)
            if away > apart + SAME_M:
                continue
            share = 0.5 - rounding / (2 * away)
            places += 1
            mean_x += x + (corners[at, 0] - x) * share
            mean_y += y + (corners[at, 1] - y) * share
    return mean_x / places, mean_y / places


@inner
def _nearest_pieces(a: Body, b: Body, table: Table, x: float, y: float, c: float, s: float) -> tuple[float, int, int]:
    """The two pieces at one height that are nearest to each other, and their distance; inf if there are none. B is at
    (x, y), turned by (c, s), in A's frame."""
    pieces, nearest, first, second = table[1], inf, a[0], b[0]
    for i in range(a[0], a[1]):
        for j in range(b[0], b[1]):
            bottom_a, top_a = heights(pieces[i], a)
            bottom_b, top_b = heights(pieces[j], b)
            if _heights_overlap(bottom_a, top_a, bottom_b, top_b):
                core, _, _ = between(pieces[i], pieces[j], table, x, y, c, s)
                apart = core - pieces[i].rounding - pieces[j].rounding
                if apart < nearest:
                    nearest, first, second = apart, i, j
    return nearest, first, second


@inner
def _place_between(
    a: Body, b: Body, table: Table, x: float, y: float, c: float, s: float
) -> tuple[float, float, float]:
    """The distance of two bodies, and the place between them in A's frame; nan if they overlap."""
    apart, i, j = _nearest_pieces(a, b, table, x, y, c, s)
    if apart <= 0.0 or apart == inf:
        return max(apart, 0.0), nan, nan
    piece_a, piece_b = table[1][i], table[1][j]
    place(piece_b, table[2], x, y, c, s, table[3])
    place(piece_a, table[2], 0.0, 0.0, 1.0, 0.0, table[4])
    mx, my = _midway(piece_a, piece_b, table, apart + piece_a.rounding + piece_b.rounding)
    return apart, mx, my


@kernel(MATRIX(_ROBOT[::1], _KNOT[::1], FLOATS, *[INTS] * 2, FLOATS, INTS, _PIECE[::1], _CORNER[::1]))
def _places_between(
    robots: Robots,
    knots: Knots,
    widened_m: Floats,
    a: Ints,
    b: Ints,
    at_s: Floats,
    begins: Ints,
    pieces: NDArray[Any],
    corners: NDArray[Any],
) -> Floats:
    """(n, 3) of the robots of slots `a` and `b` (n,), with their sizes as reported, at the times `at_s` (n,): their
    distance, inf if they are on two floors or pass above each other; and x and y midway between their nearest points,
    nan if they overlap. If there are several such places, their mean."""
    found, table, two = np.empty((len(a), 3)), table_of(begins, pieces, corners), np.empty(2, ROBOT)
    for row in range(len(a)):
        for side in range(2):
            slot = a[row] if side == 0 else b[row]
            two[side] = robots[slot]
            two[side].half_length -= widened_m[slot] / 2
            two[side].half_width -= widened_m[slot] / 2
        p, q = moving_there(two[0], knots, at_s[row]), moving_there(two[1], knots, at_s[row])
        body_a, body_b = body_of(two[0], table, 0), body_of(two[1], table, 1)
        dx, dy, ca, sa = q[0] - p[0], q[1] - p[1], np.cos(p[2]), np.sin(p[2])
        turn = q[2] - p[2]
        apart, x, y = _place_between(
            body_a, body_b, table, ca * dx + sa * dy, ca * dy - sa * dx, np.cos(turn), np.sin(turn)
        )
        found[row, 0] = apart if p[5] == q[5] and p[5] >= 0 else inf
        found[row, 1], found[row, 2] = p[0] + ca * x - sa * y, p[1] + sa * x + ca * y
    return found
