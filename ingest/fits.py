"""Fits from a vendor's readings of datum reference points to the site's frame (standard, section 3).

Two points give a rotation, a translation and one scale; three an affine map; more the ADJUST method: a global
least-squares affine fit, then a local correction, linear in each triangle of the points (Delaunay), that puts every
point exactly where it belongs. Outside the triangles the correction is that of the nearest point of their hull.
"""

from dataclasses import dataclass
from enum import StrEnum
from typing import Protocol

import numpy as np
from scipy.spatial import Delaunay

from ingest.seam import Floats

COLLINEAR_SHARE = 0.02
"""Points whose spread across their main line is less than this share of that along it are collinear."""
MAX_DISTORTION = 0.05
"""Largest difference of an affine fit's two scales, as a share: survey errors stay below, wrong points do not."""
STEP_M = 1e-3


class Method(StrEnum):
    SIMILARITY = "similarity"
    AFFINE = "affine"
    ADJUST = "adjust"


class FitError(ValueError):
    """Readings that fit nothing; the message says what to change."""


class Transform(Protocol):
    """A map of points in the plane."""

    def __call__(self, points: Floats) -> Floats:
        """`(p, 2)` to `(p, 2)`."""


@dataclass(frozen=True, slots=True, eq=False)
class Affine:
    """x -> matrix x + shift."""

    matrix: Floats
    """(2, 2)"""
    shift: Floats
    """(2,)"""

    def __call__(self, points: Floats) -> Floats:
        moved: Floats = points @ self.matrix.T + self.shift
        return moved

    @property
    def mirrored(self) -> bool:
        return bool(np.linalg.det(self.matrix) < 0)

    @property
    def scales(self) -> tuple[float, float]:
        """The larger and the smaller."""
        large, small = np.linalg.svd(self.matrix, compute_uv=False)
        return float(large), float(small)

    @property
    def rotation_rad(self) -> float:
        """Anticlockwise, of the vendor's x axis."""
        return float(np.arctan2(self.matrix[1, 0], self.matrix[0, 0]))


@dataclass(frozen=True, slots=True, eq=False)
class Adjusted:
    """A global fit with its residuals corrected by triangles."""

    base: Affine
    triangles: Delaunay
    residuals: Floats
    """(points, 2) added at each reference point, in the site's frame."""

    def __call__(self, points: Floats) -> Floats:
        corrected: Floats = self.base(points) + self._corrections(points)
        return corrected

    def _corrections(self, points: Floats) -> Floats:
        inside = self.triangles.find_simplex(points)
        nearest = np.where((inside >= 0)[:, None], points, self._onto_hull(points, inside))
        simplex = np.where(inside >= 0, inside, self.triangles.find_simplex(nearest, tol=1e-6))
        frames = self.triangles.transform[simplex]
        weights = np.einsum("pij,pj->pi", frames[:, :2], nearest - frames[:, 2])
        weights = np.column_stack([weights, 1 - weights.sum(axis=1)])
        at_corners = self.residuals[self.triangles.simplices[simplex]]
        corrections: Floats = np.einsum("pi,pij->pj", weights, at_corners)
        return corrections

    def _onto_hull(self, points: Floats, inside: Floats) -> Floats:
        """Each point outside moved to the nearest of the hull, and a hair within."""
        moved = points.copy()
        corners = self.triangles.points
        middle = corners[np.unique(self.triangles.convex_hull)].mean(axis=0)
        starts, ends = (corners[self.triangles.convex_hull[:, side]] for side in (0, 1))
        along = ends - starts
        for row in np.flatnonzero(inside < 0):
            share = np.clip(np.sum((points[row] - starts) * along, 1) / np.sum(along * along, 1), 0, 1)
            feet = starts + share[:, None] * along
            foot = feet[np.argmin(np.sum((feet - points[row]) ** 2, axis=1))]
            moved[row] = foot + (middle - foot) * 1e-9
        return moved


@dataclass(frozen=True, slots=True, eq=False)
class Fit:
    """A transform, and how well it fits."""

    method: Method
    transform: Affine | Adjusted
    affine: Affine
    """The global part."""
    residuals_m: Floats
    """(points,) distance of each point from where the global fit puts it; 0 by construction up to three points."""
    left_out_m: Floats
    """(points,) the same, with the point left out of the fit; nan where too few would remain."""


def fit(readings: Floats, reference: Floats) -> Fit:
    """The transform that takes `readings` (p, 2) to `reference` (p, 2), metres. Raises `FitError`."""
    if len(readings) < 2:
        raise FitError("needs readings of at least two reference points")
    _check_spread(readings, "readings")
    _check_spread(reference, "reference points")
    affine = _similarity(readings, reference) if len(readings) == 2 else _affine(readings, reference)
    residuals = reference - affine(readings)
    residuals_m = np.hypot(residuals[:, 0], residuals[:, 1])
    if len(readings) > 3:
        adjusted = Adjusted(affine, Delaunay(readings), residuals)
        return Fit(Method.ADJUST, adjusted, affine, residuals_m, _left_out(readings, reference))
    method = Method.AFFINE if len(readings) == 3 else Method.SIMILARITY
    return Fit(method, affine, affine, residuals_m, _left_out(readings, reference))


def flipped(affine: Affine) -> Affine:
    """The same map of the vendor's plane mirrored in its x axis."""
    return Affine(affine.matrix @ np.diag([1.0, -1.0]), affine.shift)


def _check_spread(points: Floats, what: str) -> None:
    spread = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
    if spread[0] < STEP_M:
        raise FitError(f"all {what} are at the same place")
    if len(points) > 2 and spread[1] < COLLINEAR_SHARE * spread[0]:
        raise FitError(f"the {what} lie on one line; add one well away from it")


def _similarity(readings: Floats, reference: Floats) -> Affine:
    """Rotation, translation and scale, as a product of complex numbers; never mirrored."""
    a, b = readings[:, 0] + 1j * readings[:, 1], reference[:, 0] + 1j * reference[:, 1]
    turn = (b[1] - b[0]) / (a[1] - a[0])
    shift = b[0] - turn * a[0]
    matrix = np.array([[turn.real, -turn.imag], [turn.imag, turn.real]])
    return Affine(matrix, np.array([shift.real, shift.imag]))


def _affine(readings: Floats, reference: Floats) -> Affine:
    """Least squares about the centroids, so that far origins lose no digits."""
    from_centre, to_centre = readings.mean(axis=0), reference.mean(axis=0)
    solved, *_ = np.linalg.lstsq(readings - from_centre, reference - to_centre, rcond=None)
    matrix = solved.T
    return Affine(matrix, to_centre - matrix @ from_centre)


def _left_out(readings: Floats, reference: Floats) -> Floats:
    errors_m = np.full(len(readings), np.nan)
    for row in range(len(readings)):
        kept = np.arange(len(readings)) != row
        try:
            _check_spread(readings[kept], "readings")
        except FitError:
            continue
        if kept.sum() >= 3:
            missed = reference[row] - _affine(readings[kept], reference[kept])(readings[row : row + 1])[0]
            errors_m[row] = np.hypot(*missed)
    return errors_m
