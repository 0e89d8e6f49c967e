"""Maps of the plane: an affine one, and one corrected by a triangulation, like ESRI's ADJUST transformation.

ADJUST maps each reference point exactly and is linear in each triangle of reference points. ESRI does not say what
applies outside the triangles. Here it is the correction at the nearest point of their rim. Flat triangles at the rim,
for example of three points along a wall, are left out: over their small height the residuals of their points would
give wrong headings.
"""

from functools import cached_property
from math import atan2, cos, inf, sin
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ingest.batch import Floats, Ints

if TYPE_CHECKING:
    from scipy.spatial import Delaunay

WITHIN = 1e-12
"""A point that is outside a triangle by at most this share of its height counts as inside."""
FLAT_SHARE = 0.1
"""A triangle whose height is less than this share of its longest side is flat."""


Placed = tuple[float, float, float, float, float, float]
"""The mapped x and y of a point, and the linear part of the map there by rows."""
Rows = list[list[float]]
"""A map, in rows of twelve numbers, filled up with zeros.

1. The global fit: its matrix by rows, its shift, the middle of the reference points, the number of triangles.
2. Each triangle: its barycentric map by rows, its last corner, and the correction there with its slope by rows.
3. Each edge of the rim: its start, its vector, the squared length of that, the correction at its start, and the change
   of the correction along it.

Corners and starts are relative to the middle. A map without correction has one row.
"""


def map_point(x: float, y: float, rows: Rows | Floats) -> Placed:
    """The mapped point. `ingest/fast_path/path_kernels.py` compiles this function too.

    Outside all triangles the slope of the correction is that along the nearest edge, or 0 at the edge's ends.
    """
    base = rows[0]
    a, b, c, d = base[0], base[1], base[2], base[3]
    to_x, to_y = a * x + b * y + base[4], c * x + d * y + base[5]
    if len(rows) == 1:
        return to_x, to_y, a, b, c, d
    x, y = x - base[6], y - base[7]
    first_edge = 1 + int(base[8])
    for i in range(1, first_edge):
        row = rows[i]
        dx, dy = x - row[4], y - row[5]
        first, second = row[0] * dx + row[1] * dy, row[2] * dx + row[3] * dy
        if not (first < -WITHIN or second < -WITHIN or first + second > 1 + WITHIN):
            by_x, by_y = row[6] + row[8] * dx + row[9] * dy, row[7] + row[10] * dx + row[11] * dy
            return to_x + by_x, to_y + by_y, a + row[8], b + row[9], c + row[10], d + row[11]
    least, at, nearest = inf, 0.0, rows[first_edge]
    for i in range(first_edge, len(rows)):
        edge = rows[i]
        dx, dy = edge[2], edge[3]
        share = ((x - edge[0]) * dx + (y - edge[1]) * dy) / edge[4]
        share = 0.0 if share < 0.0 else 1.0 if share > 1.0 else share
        away_x, away_y = x - edge[0] - share * dx, y - edge[1] - share * dy
        distance2 = away_x * away_x + away_y * away_y
        if distance2 < least:
            least, at, nearest = distance2, share, edge
    more_x, more_y = nearest[7], nearest[8]
    to_x, to_y = to_x + (nearest[5] + at * more_x), to_y + (nearest[6] + at * more_y)
    if at in {0.0, 1.0}:
        return to_x, to_y, a, b, c, d
    u, v = nearest[2] / nearest[4], nearest[3] / nearest[4]
    return to_x, to_y, a + more_x * u, b + more_x * v, c + more_y * u, d + more_y * v


class Map:
    """Maps points one at a time, since a message has few of them, or as an array."""

    rows: Rows

    @cached_property
    def table(self) -> Floats:
        """The rows for compiled code, (rows, 12)."""
        return np.array(self.rows)

    def at(self, x: float, y: float) -> Placed:
        """The mapped point."""
        return map_point(x, y, self.rows)

    def pose(self, x: float, y: float, yaw_rad: float) -> tuple[float, float, float]:
        """The mapped pose. Its heading is mapped by the linear part there; an unknown heading stays nan."""
        to_x, to_y, a, b, c, d = self.at(x, y)
        along, across = cos(yaw_rad), sin(yaw_rad)
        return to_x, to_y, atan2(c * along + d * across, a * along + b * across)

    def __call__(self, points: Floats) -> Floats:
        """`(p, 2)` to `(p, 2)`."""
        return np.array([self.at(x, y)[:2] for x, y in points.tolist()], np.float64).reshape(-1, 2)


class Affine(Map):
    """x -> matrix x + shift."""

    def __init__(self, matrix: Floats, shift: Floats) -> None:
        """`matrix` (2, 2), `shift` (2,)."""
        self.matrix, self.shift = matrix, shift
        self.rows = [[*matrix.ravel().tolist(), *shift.tolist(), *[0.0] * 6]]

    @property
    def mirrored(self) -> bool:
        (a, b), (c, d) = self.matrix.tolist()
        return bool(a * d < b * c)

    @property
    def scales(self) -> tuple[float, float]:
        """Along the vendor's x axis and along its y axis."""
        along_x, along_y = np.hypot(self.matrix[0], self.matrix[1])
        return float(along_x), float(along_y)

    @property
    def distortion(self) -> float:
        """By what share the greatest stretch of a direction exceeds the least; 0 for a similarity."""
        large, small = np.linalg.svd(self.matrix, compute_uv=False)
        return float(large / small - 1) if small > 0 else inf

    @property
    def rotation_rad(self) -> float:
        """The angle of the vendor's x axis, anticlockwise from the floor's."""
        return float(np.arctan2(self.matrix[1, 0], self.matrix[0, 0]))

    @property
    def shear_rad(self) -> float:
        """How far the vendor's axes are from perpendicular on the floor; 0 for a similarity."""
        along_x, along_y = self.scales
        return float(np.arcsin(np.clip(self.matrix[:, 0] @ self.matrix[:, 1] / (along_x * along_y), -1, 1)))


class Adjusted(Map):
    """A global fit whose residuals are corrected by triangles of the reference points.

    It is continuous except outside the triangles, where a flat triangle was left out and its two other sides are
    equally near. The step there is smaller than the change of the correction along these sides.
    """

    def __init__(self, base: Affine, readings: Floats, residuals: Floats) -> None:
        """`residuals` (points, 2) are the errors of `base` at `readings` (points, 2), in the site's frame."""
        from scipy.spatial import Delaunay  # noqa: PLC0415 - takes a fifth of a second, and few maps need it

        self._base = base
        middle = readings.mean(axis=0)
        self._triangles = Delaunay(readings - middle)
        self._kept, rim = _without_flat_rim(self._triangles)
        kept = self._triangles.simplices[self._kept]
        points, missed = self._triangles.points[kept], residuals[kept]
        shares = _shares(points)
        self._slopes = np.einsum("tij,tik->tjk", missed[:, :2] - missed[:, 2:], shares)
        flat = [part.reshape(-1, part[0].size) for part in (shares, points[:, 2], missed[:, 2], self._slopes)]
        starts, ends = self._triangles.points[rim[:, 0]], self._triangles.points[rim[:, 1]]
        changes = residuals[rim[:, 1]] - residuals[rim[:, 0]]
        along = ends - starts
        length2 = along[:, :1] * along[:, :1] + along[:, 1:] * along[:, 1:]
        edges = np.hstack([starts, along, length2, residuals[rim[:, 0]], changes, np.zeros((len(rim), 3))])
        fit = [*base.rows[0][:6], *middle.tolist(), float(len(kept)), *[0.0] * 3]
        self.rows = [fit, *np.hstack(flat).tolist(), *edges.tolist()]

    @property
    def mirrored(self) -> bool:
        return self._base.mirrored

    def bend(self) -> tuple[float, tuple[int, ...]]:
        """The largest share by which the correction of a triangle changes a length or, in radians, a heading.

        With it the rows of that triangle's points. It is 1 or more if the correction folds the map.
        """
        bends = np.linalg.norm(np.linalg.inv(self._base.matrix) @ self._slopes, ord=2, axis=(1, 2))
        worst = int(np.argmax(bends))
        return float(bends[worst]), tuple(self._triangles.simplices[self._kept][worst].tolist())


Transform = Affine | Adjusted


def _shares(corners: Floats) -> Floats:
    """The barycentric maps (t, 2, 2) of triangles with `corners` (t, 3, 2).

    Each maps a point relative to the last corner to its weights of the first two. `Delaunay` has them too, but
    computing them there wakes threads of LAPACK that then spin for a tenth of a second.
    """
    first, second = corners[:, 0] - corners[:, 2], corners[:, 1] - corners[:, 2]
    # elimination with the side that is longer along x as pivot, as in LAPACK
    swapped = np.abs(second[:, :1]) > np.abs(first[:, :1])
    (x, y), (other_x, other_y) = np.where(swapped, second, first).T, np.where(swapped, first, second).T
    per_x = 1 / x
    slant = other_x * per_x
    per_y = 1 / (other_y - slant * y)
    drop = slant * per_y
    own = np.stack([(1 + y * drop) * per_x, -drop], axis=1)
    others = np.stack([-y * per_y * per_x, per_y], axis=1)
    return np.stack([np.where(swapped, others, own), np.where(swapped, own, others)], axis=1)


def _without_flat_rim(triangles: "Delaunay") -> tuple[NDArray[np.bool_], Ints]:
    """Which triangles to keep (t,), and the edges of their rim as rows of two points (e, 2).

    A flat triangle is removed if only its longest side is at the rim: each of its points then belongs to another one.
    """
    corners = triangles.points[triangles.simplices]
    sides = np.stack([corners[:, k - 2] - corners[:, k - 1] for k in range(3)], axis=1)
    lengths = np.hypot(sides[..., 0], sides[..., 1])
    area = np.abs(sides[:, 0, 0] * sides[:, 1, 1] - sides[:, 0, 1] * sides[:, 1, 0])
    flat = area < FLAT_SHARE * lengths.max(axis=1) ** 2
    rows, longest = np.arange(len(flat)), lengths.argmax(axis=1)
    kept = np.ones(len(flat), bool)
    while True:
        at_rim = (triangles.neighbors < 0) | ~kept[triangles.neighbors]
        loose = np.flatnonzero(kept & flat & at_rim[rows, longest] & (at_rim.sum(axis=1) == 1))
        if not len(loose):
            break
        kept[loose[0]] = False
    row, side = np.nonzero(at_rim & kept[:, None])
    return kept, np.column_stack([triangles.simplices[row, side - 2], triangles.simplices[row, side - 1]])
