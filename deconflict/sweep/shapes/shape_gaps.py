"""Exact distances of two shapes that move past each other, and for how long they surely keep apart.

The distance of two convex pieces is that of a corner of one from a side of the other. Along the direction between the
closest features the gap of the two closes at most at the speed -v.n + |wA| rA + |wB| rB, as in
`deconflict/sweep/narrowphase.py`. The bound of two shapes is the least of those of their pieces.
"""

from math import inf, sqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray

from deconflict.sweep.geometry.heights import heights_overlap
from deconflict.sweep.narrowphase import TINY_MPS, turned
from deconflict.sweep.shapes.shape_table import CORNER, MOST_CORNERS, PIECE
from ingest.batch import Floats, Ints
from ingest.kernels import copy_row, inner

SOLIDS = 2
"""Rows for the rectangles of a pair behind the pieces of all shapes."""
CORNERS_OF_RECTANGLE = 4

Body = tuple[int, int, float, float, float]
"""The first and the end of a robot's pieces, how much it is grown all around, its bottom and its top."""
Table = tuple[Ints, NDArray[Any], NDArray[Any], Floats, Floats]
"""The begins of shapes, their pieces and corners with room for two rectangles, and work space for placed corners."""
Gap = tuple[float, float, float, float]
"""The distance, 0 or less if the shapes overlap; for how long it surely stays above a limit; and the least distance
in a span after and before."""
Bridge = tuple[float, float]
"""The shortest vector from A to B in A's frame, without their growth; 0 if they overlap."""

_heights_overlap = inner(heights_overlap)


@inner
def table_of(begins: Ints, pieces: NDArray[Any], corners: NDArray[Any]) -> Table:
    """The table for a kernel's run."""
    all_pieces = np.empty(len(pieces) + SOLIDS, PIECE)
    copy_row(pieces, all_pieces)
    all_corners = np.empty(len(corners) + SOLIDS * CORNERS_OF_RECTANGLE, CORNER)
    copy_row(corners, all_corners)
    return begins, all_pieces, all_corners, np.empty((MOST_CORNERS, 2)), np.empty((MOST_CORNERS, 2))


@inner
def body_of(robot: Any, table: Table, solid: int) -> Body:
    """The pieces of a robot. A rectangle is written to the place `solid` behind the pieces of all shapes."""
    begins, pieces, corners, _, _ = table
    if robot.shape:
        return begins[robot.shape], begins[robot.shape + 1], robot.grown, robot.bottom, robot.top
    row = len(pieces) - SOLIDS + solid
    first = len(corners) + (solid - SOLIDS) * CORNERS_OF_RECTANGLE
    piece, length, width = pieces[row], robot.half_length, robot.half_width
    piece.first, piece.count, piece.rounding = first, CORNERS_OF_RECTANGLE, 0.0
    piece.x, piece.y, piece.around, piece.reach = 0.0, 0.0, robot.radius, robot.radius
    piece.bottom, piece.top = -inf, inf
    for at in range(CORNERS_OF_RECTANGLE):
        corner = corners[first + at]
        corner.x = length if at in (0, 3) else -length
        corner.y = width if at < 2 else -width
        corner.normal_x = (0.0, -1.0, 0.0, 1.0)[at]
        corner.normal_y = (1.0, 0.0, -1.0, 0.0)[at]
        corner.side = 2 * (length if at in (0, 2) else width)
    return row, row + 1, 0.0, robot.bottom, robot.top


@inner
def heights(piece: Any, body: Body) -> tuple[float, float]:
    """Bottom and top of a piece of a body."""
    _, _, _, bottom, top = body
    if piece.bottom == -inf or bottom == -inf:
        return bottom, top
    return bottom + piece.bottom, bottom + piece.top


@inner
def place(piece: Any, corners: NDArray[Any], x: float, y: float, c: float, s: float, placed: Floats) -> None:
    """Write the corners of a piece, turned by (c, s) and moved to (x, y)."""
    for at in range(piece.count):
        corner = corners[piece.first + at]
        placed[at, 0] = x + c * corner.x - s * corner.y
        placed[at, 1] = y + s * corner.x + c * corner.y


@inner
def _from_sides(
    piece: Any, corners: NDArray[Any], placed: Floats, count: int, x: float, y: float, around: float
) -> tuple[bool, float, float, float]:
    """Whether a side of a piece separates it from `count` placed corners, which are in the circle of radius `around`
    at (x, y); the squared distance of the nearest of these outside; and the vector to it."""
    separates, best, best_x, best_y = False, inf, 0.0, 0.0
    for row in range(piece.first, piece.first + piece.count):
        side, outside = corners[row], 0
        middle = (x - side.x) * side.normal_x + (y - side.y) * side.normal_y
        if middle < -around:
            continue
        if middle > around:
            separates = True
            if (middle - around) * (middle - around) > best:
                continue
        for at in range(count):
            dx, dy = placed[at, 0] - side.x, placed[at, 1] - side.y
            above = dx * side.normal_x + dy * side.normal_y
            if above <= 0.0:
                continue
            outside += 1
            along = dy * side.normal_x - dx * side.normal_y
            beyond = along - min(max(along, 0.0), side.side)
            squared = above * above + beyond * beyond
            if squared < best:
                best = squared
                best_x = above * side.normal_x - beyond * side.normal_y
                best_y = above * side.normal_y + beyond * side.normal_x
        separates = separates or outside == count
    return separates, best, best_x, best_y


@inner
def between(
    piece_a: Any, piece_b: Any, table: Table, x: float, y: float, c: float, s: float
) -> tuple[float, float, float]:
    """The distance of two pieces without their roundings, and the unit vector between the closest features in A's
    frame; all 0 if they overlap. B is at (x, y), turned by (c, s), in A's frame."""
    _, _, corners, placed_b, placed_a = table
    place(piece_b, corners, x, y, c, s, placed_b)
    if piece_a.count == 1 and piece_b.count == 1:
        dx, dy = placed_b[0, 0] - corners[piece_a.first].x, placed_b[0, 1] - corners[piece_a.first].y
        distance = sqrt(dx * dx + dy * dy)
        return (distance, dx / distance, dy / distance) if distance > 0.0 else (0.0, 0.0, 0.0)
    mx, my = x + c * piece_b.x - s * piece_b.y, y + s * piece_b.x + c * piece_b.y
    a_separates, of_b, px, py = _from_sides(piece_a, corners, placed_b, piece_b.count, mx, my, piece_b.around)
    x, y = -c * x - s * y, s * x - c * y
    place(piece_a, corners, x, y, c, -s, placed_a)
    mx, my = x + c * piece_a.x + s * piece_a.y, y - s * piece_a.x + c * piece_a.y
    b_separates, of_a, qx, qy = _from_sides(piece_b, corners, placed_a, piece_a.count, mx, my, piece_a.around)
    if not (a_separates or b_separates):
        return 0.0, 0.0, 0.0
    if of_b <= of_a:
        distance = sqrt(of_b)
        return distance, px / distance, py / distance
    distance = sqrt(of_a)
    return distance, -(c * qx - s * qy) / distance, -(s * qx + c * qy) / distance


@inner
def gap(m: Any, t: float, a: Body, b: Body, table: Table, limit_m: float, span_s: float) -> tuple[Gap, Bridge]:
    """The gap of two bodies that move by `m`, at `t`; see `Gap` for the limit and the span."""
    into, pieces = t - m.begin, table[1]
    dx, dy = m.dx + m.vx * into, m.dy + m.vy * into
    ca, sa, cb, sb = turned(m, into)
    c, s = ca * cb + sa * sb, ca * sb - sa * cb
    x, y, vx, vy = ca * dx + sa * dy, ca * dy - sa * dx, ca * m.vx + sa * m.vy, ca * m.vy - sa * m.vx
    grown = a[2] + b[2]
    nearest, lasts, after, before, bridge = inf, inf, inf, inf, (0.0, 0.0)
    for i in range(a[0], a[1]):
        for j in range(b[0], b[1]):
            piece_a, piece_b = pieces[i], pieces[j]
            bottom_a, top_a = heights(piece_a, a)
            bottom_b, top_b = heights(piece_b, b)
            if not _heights_overlap(bottom_a, top_a, bottom_b, top_b):
                continue
            swing = abs(m.turn_a) * piece_a.reach + abs(m.turn_b) * piece_b.reach
            if nearest < inf:
                dx, dy = x + c * piece_b.x - s * piece_b.y - piece_a.x, y + s * piece_b.x + c * piece_b.y - piece_a.y
                least = sqrt(dx * dx + dy * dy) - piece_a.around - piece_b.around - grown
                most = sqrt(vx * vx + vy * vy) + swing
                low = least - most * span_s
                if least > nearest and low > after and low > before and least - limit_m > lasts * most:
                    continue
            core, nx, ny = between(piece_a, piece_b, table, x, y, c, s)
            apart, opening = core - piece_a.rounding - piece_b.rounding - grown, vx * nx + vy * ny
            if apart < nearest:
                nearest, bridge = apart, (nx * max(apart + grown, 0.0), ny * max(apart + grown, 0.0))
            lasts = min(lasts, (apart - limit_m) / max(swing - opening, TINY_MPS))
            after = min(after, apart - max(swing - opening, 0.0) * span_s)
            before = min(before, apart - max(swing + opening, 0.0) * span_s)
    return (nearest, lasts, after, before), bridge
