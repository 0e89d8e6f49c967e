"""Maps of the plane: an affine one, and one corrected by a triangulation, as ESRI's ADJUST transformation is.

ADJUST takes each reference point exactly to its place and is linear in each triangle of them. ESRI leaves open what
holds outside the triangles; here it is the correction at the nearest point of their rim. Flat triangles at the rim,
such as three points along a wall make, are left out: across their little height the residuals of their points would
turn headings about.
"""

from dataclasses import dataclass
from functools import cached_property
from math import atan2, cos, inf, sin

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import Delaunay

from ingest.seam import Floats, Ints

FLAT_SHARE = 0.1
"""A triangle whose height is less than this share of its longest side is flat."""


@dataclass(frozen=True, eq=False)
class Affine:
    """x -> matrix x + shift."""

    matrix: Floats
    """(2, 2)"""
    shift: Floats
    """(2,)"""

    def __call__(self, points: Floats) -> Floats:
        """`(p, 2)` to `(p, 2)`."""
        return self.place(points)[0]

    def place(self, points: Floats) -> tuple[Floats, Floats]:
        """Where `points` (p, 2) come to lie (p, 2), and the linear part at each (p, 2, 2)."""
        return points @ self.matrix.T + self.shift, np.broadcast_to(self.matrix, (len(points), 2, 2))

    def pose(self, x: float, y: float, yaw_rad: float) -> tuple[float, float, float]:
        """Where one pose comes to lie; an unknown yaw stays nan."""
        a, b, c, d, shift_x, shift_y = self._numbers
        along, across = cos(yaw_rad), sin(yaw_rad)
        return (
            a * x + b * y + shift_x,
            c * x + d * y + shift_y,
            atan2(c * along + d * across, a * along + b * across),
        )

    @property
    def mirrored(self) -> bool:
        a, b, c, d, *_ = self._numbers
        return a * d < b * c

    @cached_property
    def _numbers(self) -> tuple[float, float, float, float, float, float]:
        """The matrix by rows, and the shift."""
        a, b, c, d = self.matrix.ravel().tolist()
        return a, b, c, d, float(self.shift[0]), float(self.shift[1])

    @property
    def scales(self) -> tuple[float, float]:
        """Along the vendor's x axis and along its y axis."""
        along_x, along_y = np.hypot(self.matrix[0], self.matrix[1])
        return float(along_x), float(along_y)

    @property
    def distortion(self) -> float:
        """By what share the direction stretched most exceeds the one stretched least; 0 for a similarity."""
        large, small = np.linalg.svd(self.matrix, compute_uv=False)
        return float(large / small - 1) if small > 0 else inf

    @property
    def rotation_rad(self) -> float:
        """Of the vendor's x axis, anticlockwise from the floor's."""
        return float(np.arctan2(self.matrix[1, 0], self.matrix[0, 0]))

    @property
    def shear_rad(self) -> float:
        """How far the vendor's axes are from square on the floor; 0 for a similarity."""
        along_x, along_y = self.scales
        return float(np.arcsin(np.clip(self.matrix[:, 0] @ self.matrix[:, 1] / (along_x * along_y), -1, 1)))


class Adjusted:
    """A global fit, its residuals corrected by triangles of the reference points.

    Continuous, but for steps where two sides of a notch left by a flat triangle are equally near; each is smaller
    than what the correction changes by along the notch.
    """

    def __init__(self, base: Affine, readings: Floats, residuals: Floats) -> None:
        """`residuals` (points, 2) are what `base` misses at `readings` (points, 2), in the site's frame."""
        self._base = base
        self._middle = readings.mean(axis=0)
        self._triangles = Delaunay(readings - self._middle)
        self._kept, rim = _without_flat_rim(self._triangles)
        corners = residuals[self._triangles.simplices]
        self._anchors = self._triangles.transform[:, 2]
        self._at_anchor = corners[:, 2]
        self._slopes = np.einsum("tij,tik->tjk", corners[:, :2] - corners[:, 2:], self._triangles.transform[:, :2])
        self._edge_starts = self._triangles.points[rim[:, 0]]
        self._edges = self._triangles.points[rim[:, 1]] - self._edge_starts
        self._at_start = residuals[rim[:, 0]]
        self._along_edge = residuals[rim[:, 1]] - self._at_start

    def __call__(self, points: Floats) -> Floats:
        """`(p, 2)` to `(p, 2)`."""
        return self.place(points)[0]

    def place(self, points: Floats) -> tuple[Floats, Floats]:
        """Where `points` (p, 2) come to lie (p, 2), and the linear part at each (p, 2, 2)."""
        corrections, slopes = self._corrections(points)
        return self._base(points) + corrections, self._base.matrix + slopes

    @property
    def mirrored(self) -> bool:
        return self._base.mirrored

    def bend(self) -> tuple[float, tuple[int, ...]]:
        """The largest share by which the correction of a triangle changes a length or, in radians, a heading.

        With it the rows of that triangle's points. Reaches 1 where the correction folds the map.
        """
        kept = np.flatnonzero(self._kept)
        bends = np.linalg.norm(np.linalg.inv(self._base.matrix) @ self._slopes[kept], ord=2, axis=(1, 2))
        worst = int(np.argmax(bends))
        return float(bends[worst]), tuple(int(row) for row in self._triangles.simplices[kept[worst]])

    def _corrections(self, points: Floats) -> tuple[Floats, Floats]:
        """The correction (p, 2) and its slope (p, 2, 2) at each point."""
        centred = points - self._middle
        triangle = self._triangles.find_simplex(centred)
        slopes = self._slopes[triangle]
        values = self._at_anchor[triangle] + np.einsum("pij,pj->pi", slopes, centred - self._anchors[triangle])
        outside = (triangle < 0) | ~self._kept[triangle]
        if outside.any():
            values[outside], slopes[outside] = self._beyond(centred[outside])
        return values, slopes

    def _beyond(self, centred: Floats) -> tuple[Floats, Floats]:
        """The same for points outside: what holds at the nearest point of the rim."""
        lengths = np.sum(self._edges**2, axis=1)
        shares = np.einsum("pek,ek->pe", centred[:, None] - self._edge_starts, self._edges) / lengths
        shares = np.clip(shares, 0, 1)
        feet = self._edge_starts + shares[..., None] * self._edges
        edge = np.argmin(np.sum((centred[:, None] - feet) ** 2, axis=2), axis=1)
        share = shares[np.arange(len(centred)), edge]
        slopes = np.einsum("pj,pk->pjk", self._along_edge[edge], self._edges[edge]) / lengths[edge, None, None]
        slopes[(share == 0) | (share == 1)] = 0
        return self._at_start[edge] + share[:, None] * self._along_edge[edge], slopes


Transform = Affine | Adjusted


def _without_flat_rim(triangles: Delaunay) -> tuple[NDArray[np.bool_], Ints]:
    """Which triangles to keep (t,), and the edges round them as rows of two points (e, 2).

    A flat triangle goes if only its longest side is at the rim: each of its points then belongs to another.
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
