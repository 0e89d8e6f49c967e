"""Trajectories of VDA 5050: NURBS curves, as polylines."""

from itertools import pairwise
from math import atan2, hypot, isfinite

import numpy as np

from ingest.batch import Floats
from ingest.languages.vda5050.vda_messages import Trajectory

MOST_DEGREE, MOST_CONTROL_POINTS = 10, 500
SPACING_M = 0.3
"""Distance of two points of a polyline, roughly."""
BEND_RAD = 0.1
"""Where a line bends by more than this, a point of it is kept however near the next is."""
LEAST_POINTS, MOST_POINTS = 9, 65
Point = tuple[float, float]
Polyline = tuple[Point, ...]


def polyline(trajectory: Trajectory) -> Polyline | None:
    """Points along the curve, from its first control point to its last. None if it is no clamped NURBS."""
    points = trajectory.control_points
    degree = trajectory.degree if trajectory.degree is not None else 1
    if not (1 <= degree <= MOST_DEGREE and degree < len(points) <= MOST_CONTROL_POINTS):
        return None
    weights = [1.0 if point.weight is None else point.weight for point in points]
    corners = [(point.x, point.y) for point in points]
    if not all(0.0 < weight < 1e9 for weight in weights) or not all(_on_earth(*corner) for corner in corners):
        return None
    if degree == 1:
        return _thinned(corners)
    knots = _knots(trajectory.knot_vector, len(points), degree)
    return None if knots is None else _sampled(knots, corners, weights, degree)


def is_needless(before: Point, point: Point, after: Point) -> bool:
    """Whether a line is nearly the same without a point of it, since the next is near and straight on."""
    (ax, ay), (bx, by), (cx, cy) = before, point, after
    dx, dy, ex, ey = bx - ax, by - ay, cx - bx, cy - by
    return hypot(cx - ax, cy - ay) < SPACING_M and abs(atan2(dx * ey - dy * ex, dx * ex + dy * ey)) < BEND_RAD


def _thinned(corners: list[Point]) -> Polyline:
    kept = corners[:2]
    for corner in corners[2:]:
        if is_needless(kept[-2], kept[-1], corner):
            kept.pop()
        kept.append(corner)
    return tuple(kept)


def _on_earth(x: float, y: float) -> bool:
    return abs(x) < 1e7 and abs(y) < 1e7


def _knots(sent: list[float] | None, points: int, degree: int) -> Floats | None:
    """The knots (points + degree + 1,). None if those that were sent do not fit the curve."""
    if not sent:
        inner = np.linspace(0.0, 1.0, points - degree + 1)
        return np.concatenate([np.zeros(degree), inner, np.ones(degree)])
    fits = len(sent) == points + degree + 1 and all(map(isfinite, sent)) and all(a <= b for a, b in pairwise(sent))
    return np.array(sent) if fits and sent[degree] < sent[points] else None


def _sampled(knots: Floats, corners: list[tuple[float, float]], weights: list[float], degree: int) -> Polyline | None:
    """A rational curve is the quotient of two curves that are not: the weighted points, and the weights."""
    from scipy.interpolate import BSpline  # noqa: PLC0415 - half of all fleets send no curves

    length_m = sum(hypot(bx - ax, by - ay) for (ax, ay), (bx, by) in pairwise(corners))
    count = min(max(int(length_m / SPACING_M), LEAST_POINTS), MOST_POINTS)
    w = np.array(weights)
    weighted = np.column_stack([np.array(corners) * w[:, None], w])
    at = np.linspace(knots[degree], knots[-degree - 1], count)
    curve = BSpline(knots, weighted, degree)(at)
    with np.errstate(all="ignore"):
        sampled = curve[:, :2] / curve[:, 2:]
    return tuple(map(tuple, sampled.tolist())) if np.isfinite(sampled).all() else None
