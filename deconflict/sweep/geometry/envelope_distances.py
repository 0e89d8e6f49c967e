"""Exact distances of rectangles in the plane, for many pairs at once. Scores use these distances, not the sweep."""

from math import copysign, cos, inf, sin, sqrt

import numpy as np

from ingest.batch import Floats
from ingest.kernels import MATRIX, READ_MATRIX, inner, kernel


@inner
def nearest_corner(
    cx: float, cy: float, c: float, s: float, length: float, width: float, other_length: float, other_width: float
) -> tuple[float, float, float]:
    """Of a rectangle at (cx, cy), turned by (c, s), the corner that is nearest to an upright rectangle at the origin.

    Returns the squared distance, and the vector from the upright rectangle to the corner in its frame.
    """
    best, best_x, best_y = inf, 0.0, 0.0
    for i in (length, -length):
        for j in (width, -width):
            px, py = cx + i * c - j * s, cy + i * s + j * c
            ex = copysign(max(abs(px) - other_length, 0.0), px)
            ey = copysign(max(abs(py) - other_width, 0.0), py)
            squared = ex * ex + ey * ey
            if squared < best:
                best, best_x, best_y = squared, ex, ey
    return best, best_x, best_y


@inner
def rectangle_gap(
    x: float,
    y: float,
    turn_a: tuple[float, float],
    turn_b: tuple[float, float],
    half_a: tuple[float, float],
    half_b: tuple[float, float],
) -> float:
    """The distance of two rectangles, negative in overlap, as `signed_gap`. (x, y) is from A's centre to B's, a turn
    is its cosine and sine, and the half sides are along the heading and across it."""
    (ca, sa), (cb, sb), (length_a, width_a), (length_b, width_b) = turn_a, turn_b, half_a, half_b
    c, s = ca * cb + sa * sb, ca * sb - sa * cb
    ax, ay, bx, by = ca * x + sa * y, ca * y - sa * x, -(cb * x + sb * y), -(cb * y - sb * x)
    along_a = abs(ax) - length_a - length_b * abs(c) - width_b * abs(s)
    across_a = abs(ay) - width_a - length_b * abs(s) - width_b * abs(c)
    along_b = abs(bx) - length_b - length_a * abs(c) - width_a * abs(s)
    across_b = abs(by) - width_b - length_a * abs(s) - width_a * abs(c)
    widest = max(along_a, across_a, along_b, across_b)
    if widest > 0.0:
        of_b, _, _ = nearest_corner(ax, ay, c, s, length_b, width_b, length_a, width_a)
        of_a, _, _ = nearest_corner(bx, by, c, -s, length_a, width_a, length_b, width_b)
        widest = sqrt(min(of_a, of_b))
    return widest


@inner
def _set_turns(c: Floats, s: Floats, yaw: Floats, row: int) -> None:
    """Set cosine and sine of a row of headings, most of which equal the one before."""
    for at in range(len(c)):
        if at and yaw[row, at] == yaw[row, at - 1]:
            c[at], s[at] = c[at - 1], s[at - 1]
        else:
            c[at], s[at] = cos(yaw[row, at]), sin(yaw[row, at])


@kernel(MATRIX(*[READ_MATRIX] * 6))
def _signed_gap(dx: Floats, dy: Floats, yaw_a: Floats, yaw_b: Floats, half_a: Floats, half_b: Floats) -> Floats:
    apart, looks = np.empty(dx.shape), dx.shape[1]
    cos_a, sin_a, cos_b, sin_b = np.empty(looks), np.empty(looks), np.empty(looks), np.empty(looks)
    for row in range(dx.shape[0]):
        _set_turns(cos_a, sin_a, yaw_a, row)
        _set_turns(cos_b, sin_b, yaw_b, row)
        length_a, width_a, length_b, width_b = half_a[0, row], half_a[1, row], half_b[0, row], half_b[1, row]
        for at in range(looks):
            turn_a, turn_b = (cos_a[at], sin_a[at]), (cos_b[at], sin_b[at])
            apart[row, at] = rectangle_gap(
                dx[row, at], dy[row, at], turn_a, turn_b, (length_a, width_a), (length_b, width_b)
            )
    return apart


def signed_gap(dx: Floats, dy: Floats, yaw_a: Floats, yaw_b: Floats, half_a: Floats, half_b: Floats) -> Floats:
    """(n, m) distance of n pairs of rectangles at m times each. If the two overlap it is negative: how far one must
    move to end the overlap.

    (dx, dy) (n, m) each is from A's centre to B's; `half_a` and `half_b` (2, n) are half sides. Two convex polygons
    that do not overlap are closest at a corner of one of them. The four axes of their sides show whether they overlap
    (Gottschalk, Lin and Manocha 1996, in the plane).
    """
    return _signed_gap(*map(np.ascontiguousarray, (dx, dy, yaw_a, yaw_b, half_a, half_b)))


def gap(dx: Floats, dy: Floats, yaw_a: Floats, yaw_b: Floats, half_a: Floats, half_b: Floats) -> Floats:
    """(n,) distance of n pairs of rectangles at one time, 0 if they overlap; arguments as of `signed_gap`."""
    apart = signed_gap(dx[:, None], dy[:, None], yaw_a[:, None], yaw_b[:, None], half_a, half_b)
    return np.maximum(apart[:, 0], 0.0)
