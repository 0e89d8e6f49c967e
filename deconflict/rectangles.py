"""Rectangles in the plane, many pairs at once: their exact distance. What happened is told by it, not by the sweep."""

from dataclasses import dataclass

import numpy as np

from ingest.seam import Floats


@dataclass(frozen=True, slots=True, eq=False)
class Gap:
    """How far n pairs of rectangles are apart. Arrays are (n,)."""

    distance: Floats
    """0 where they overlap."""
    nx: Floats
    """Unit direction between the closest features, from A to B; 0 where they overlap or touch."""
    ny: Floats


def gap(dx: Floats, dy: Floats, yaw_a: Floats, yaw_b: Floats, half_a: Floats, half_b: Floats) -> Gap:
    """Distance of B from A, both rectangles, B's centre at (dx, dy) from A's. `half` are (2, n) half sides.

    Two convex polygons that do not overlap are closest at a corner of one of them; whether they overlap is told by
    the four axes of their sides (Gottschalk, Lin and Manocha 1996, in the plane).
    """
    ca, sa, cb, sb = np.cos(yaw_a), np.sin(yaw_a), np.cos(yaw_b), np.sin(yaw_b)
    c, s = ca * cb + sa * sb, ca * sb - sa * cb
    ax, ay = ca * dx + sa * dy, ca * dy - sa * dx
    bx, by = -(cb * dx + sb * dy), -(cb * dy - sb * dx)
    ac, as_ = np.abs(c), np.abs(s)
    apart = np.abs(ax) > half_a[0] + half_b[0] * ac + half_b[1] * as_
    apart |= np.abs(ay) > half_a[1] + half_b[0] * as_ + half_b[1] * ac
    apart |= np.abs(bx) > half_b[0] + half_a[0] * ac + half_a[1] * as_
    apart |= np.abs(by) > half_b[1] + half_a[0] * as_ + half_a[1] * ac
    of_b, px, py = _nearest_corner(ax, ay, c, s, half_b, half_a)
    of_a, qx, qy = _nearest_corner(bx, by, c, -s, half_a, half_b)
    first = of_b <= of_a
    distance = np.where(apart, np.sqrt(np.minimum(of_b, of_a)), 0.0)
    scale = np.where(distance > 0, 1.0 / np.where(distance > 0, distance, 1.0), 0.0)
    nx = np.where(first, ca * px - sa * py, -(cb * qx - sb * qy)) * scale
    ny = np.where(first, sa * px + ca * py, -(sb * qx + cb * qy)) * scale
    return Gap(distance, nx, ny)


def signed_gap(dx: Floats, dy: Floats, yaw_a: Floats, yaw_b: Floats, half_a: Floats, half_b: Floats) -> Floats:
    """As the distance of `gap`, but negative where they overlap: how far one must move for them not to."""
    distance = gap(dx, dy, yaw_a, yaw_b, half_a, half_b).distance
    over = np.flatnonzero(distance == 0)
    turned = yaw_b[over] - yaw_a[over]
    c, s = np.abs(np.cos(turned)), np.abs(np.sin(turned))
    widest = np.full(len(over), -np.inf)
    a, b = half_a[:, over], half_b[:, over]
    for yaw, half, other in ((yaw_a[over], a, b), (yaw_b[over], b, a)):
        along, across = np.cos(yaw) * dx[over] + np.sin(yaw) * dy[over], np.cos(yaw) * dy[over] - np.sin(yaw) * dx[over]
        np.maximum(widest, np.abs(along) - half[0] - other[0] * c - other[1] * s, out=widest)
        np.maximum(widest, np.abs(across) - half[1] - other[0] * s - other[1] * c, out=widest)
    distance[over] = np.minimum(widest, 0.0)
    return distance


def _nearest_corner(
    cx: Floats, cy: Floats, c: Floats, s: Floats, half: Floats, other: Floats
) -> tuple[Floats, Floats, Floats]:
    """The corner of a rectangle at (cx, cy), turned by (c, s), that is nearest to the upright one with sides `other`.

    Squared distance, and the vector from the upright rectangle to the corner, in its frame.
    """
    best = np.full(len(cx), np.inf)
    best_x, best_y = np.zeros(len(cx)), np.zeros(len(cx))
    ux, uy, wx, wy = half[0] * c, half[0] * s, -half[1] * s, half[1] * c
    for i, j in ((1, 1), (1, -1), (-1, 1), (-1, -1)):
        px, py = cx + i * ux + j * wx, cy + i * uy + j * wy
        ex = np.copysign(np.maximum(np.abs(px) - other[0], 0.0), px)
        ey = np.copysign(np.maximum(np.abs(py) - other[1], 0.0), py)
        squared = ex * ex + ey * ey
        nearer = squared < best
        best = np.where(nearer, squared, best)
        best_x, best_y = np.where(nearer, ex, best_x), np.where(nearer, ey, best_y)
    return best, best_x, best_y
