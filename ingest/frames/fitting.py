"""Fits from a vendor's readings of datum reference points to the site's frame (standard, section 3).

Two points give a rotation, a translation and one scale. Three points give an affine map. More points give the ADJUST
method of the `warp` tool to which the standard refers: a global least-squares fit (first order, the tool's default),
and then the local correction of `ingest/frames/transforms.py`.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from itertools import combinations

import numpy as np

from ingest.batch import Floats
from ingest.frames.transforms import Adjusted, Affine, Transform

COLLINEAR_SHARE = 0.02
"""Points are collinear if their spread across their main line is less than this share of the spread along it."""
COINCIDENT_SHARE = 1e-6
"""Two points are the same if they are closer than this share of the extent of all points."""
COINCIDENT_M = 1e-3
"""Two reference points are the same if they are closer than this."""
NEAREST, FARTHEST = 1e-9, 1e12
"""In any unit: closer points are the same, and coordinates beyond are invalid, since their sums overflow."""
FLATTENED_SHARE = 0.01
"""If a global fit shrinks one direction to less than this share of another, its points are paired wrongly."""


class Method(StrEnum):
    SIMILARITY = "similarity"
    AFFINE = "affine"
    ADJUST = "adjust"


class FitError(ValueError):
    """Readings to which nothing can be fitted. The message says what to change."""


@dataclass(frozen=True, slots=True, eq=False)
class Fit:
    """A transform, and how well it fits."""

    method: Method
    transform: Transform
    """From readings to the floor's frame."""
    affine: Affine
    """The global fit, to which ADJUST adds local corrections."""
    residuals_m: Floats
    """(points,) distance of each point from its place by the global fit; 0 by construction for up to three points."""
    left_out_m: Floats
    """(points,) the same distance with the point left out of the fit; nan if the others can't be fitted."""


def fit(readings: Floats, reference: Floats, names: Sequence[str], *, mirrored: bool = False) -> Fit:
    """The transform from `readings` (p, 2) to `reference` (p, 2), metres.

    `names` are the names of the points for messages. `mirrored` is used with two points, which can't show it, and
    ignored with more. Raises `FitError` for fewer than two points, and for coincident, collinear or absurd points.
    """
    if len(readings) < 2:
        raise FitError(f"readings of at least two reference points are needed, found {len(readings)}")
    for points, what in ((readings, "readings of"), (reference, "reference points")):
        if not (np.abs(points) < FARTHEST).all():
            raise FitError(f"the {what} {', '.join(names)} are too far away for any map; correct them")
    _check_distinct(readings, names, "readings of", floor=max(NEAREST, 1e-12 * float(np.abs(readings).max())))
    _check_distinct(reference, names, "reference points", floor=COINCIDENT_M)
    for points, what in ((readings, "readings"), (reference, "reference points")):
        if _collinear(points):
            raise FitError(f"the {what} of {', '.join(names)} lie on one line; read another well away from it")
    affine = _global(readings, reference, mirrored)
    if affine.distortion > 1 / FLATTENED_SHARE - 1:
        raise FitError(f"no map takes the readings to {', '.join(names)}; two of them may be exchanged")
    residuals = reference - affine(readings)
    residuals_m = np.hypot(residuals[:, 0], residuals[:, 1])
    left_out_m = _left_out(readings, reference, affine.mirrored)
    if len(readings) > 3:
        return Fit(Method.ADJUST, Adjusted(affine, readings, residuals), affine, residuals_m, left_out_m)
    method = Method.AFFINE if len(readings) == 3 else Method.SIMILARITY
    return Fit(method, affine, affine, residuals_m, left_out_m)


def _check_distinct(points: Floats, names: Sequence[str], what: str, floor: float) -> None:
    extent = float(np.hypot(*np.ptp(points, axis=0)))
    for a, b in combinations(range(len(points)), 2):
        if np.hypot(*(points[a] - points[b])) <= max(COINCIDENT_SHARE * extent, floor):
            raise FitError(f"the {what} {names[a]} and {names[b]} are at the same place; correct one or leave it out")


def _collinear(points: Floats) -> bool:
    if len(points) < 3:
        return False
    along, across = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
    return bool(across < COLLINEAR_SHARE * along)


def _global(readings: Floats, reference: Floats, mirrored: bool) -> Affine:
    """The least-squares fit, computed relative to the centroids so that distant origins lose no digits."""
    from_centre, to_centre = readings.mean(axis=0), reference.mean(axis=0)
    centred, wanted = readings - from_centre, reference - to_centre
    if len(readings) == 2:
        matrix = _similarity(centred[0], wanted[0], mirrored)
    else:
        matrix = np.linalg.lstsq(centred, wanted, rcond=None)[0].T
    return Affine(matrix, to_centre - matrix @ from_centre)


def _similarity(reading: Floats, wanted: Floats, mirrored: bool) -> Floats:
    """The rotation and scale from one vector to another, as the quotient of two complex numbers."""
    flip = np.diag([1.0, -1.0 if mirrored else 1.0])
    turn = complex(*wanted) / complex(*(flip @ reading))
    return np.array([[turn.real, -turn.imag], [turn.imag, turn.real]]) @ flip


def _left_out(readings: Floats, reference: Floats, mirrored: bool) -> Floats:
    """(points,) distance of each point from its place by a global fit of all others, metres."""
    missed_m = np.full(len(readings), np.nan)
    if len(readings) < 3:
        return missed_m
    for row in range(len(readings)):
        others = np.arange(len(readings)) != row
        if not _collinear(readings[others]):
            rest = _global(readings[others], reference[others], mirrored)
            missed_m[row] = np.hypot(*(reference[row] - rest(readings[row : row + 1])[0]))
    return missed_m
