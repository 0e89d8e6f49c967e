"""Curves of messages, which are NURBS, as polylines."""

from collections.abc import Sequence
from functools import lru_cache
from itertools import pairwise
from math import atan2, hypot, isfinite
from typing import NamedTuple, Protocol

import numpy as np

from ingest.frames.way_pieces import nearest_piece
from ingest.languages.model import BESIDE_M
from ingest.languages.rules import Findings

MOST_DEGREE, MOST_CONTROL_POINTS = 10, 500
SPACING_M = 0.3
"""Distance of two points of a polyline, roughly."""
ON_CURVE_M = 2.0
"""A robot this near to a curve drives on along it."""
BEND_RAD = 0.1
"""Where a line bends by more than this, a point of it is kept however near the next is."""
LEAST_POINTS, MOST_POINTS = 9, 65
_SAMPLED = 256
"""Curves of which the points are cached: those near robots. No limit of a source counts them, and each may be long."""
Point = tuple[float, float]
Polyline = tuple[Point, ...]


class SentPlace(Protocol):
    """A place in a message."""

    @property
    def x(self) -> float: ...
    @property
    def y(self) -> float: ...


class SentControlPoint(SentPlace, Protocol):
    """A control point in a message."""

    @property
    def weight(self) -> float | None: ...


class SentCurve(Protocol):
    """A curve in a message."""

    @property
    def control_points(self) -> Sequence[SentControlPoint]: ...
    @property
    def degree(self) -> int | None: ...
    @property
    def knot_vector(self) -> list[float] | None: ...


class Curve(NamedTuple):
    """A clamped NURBS."""

    degree: int
    knots: tuple[float, ...]
    """(n + degree + 1,) or () if they are uniform."""
    points: tuple[tuple[float, float, float], ...]
    """(n,) x, y and weight of each control point."""


def curve_of(trajectory: SentCurve, findings: Findings, key: str = "trajectory") -> Curve | None:
    """The curve of a trajectory under a key. None, which is counted, if it is no clamped NURBS."""
    degree = trajectory.degree if trajectory.degree is not None else 1
    corners = [(point.x, point.y) for point in trajectory.control_points]
    weights = [1.0 if point.weight is None else point.weight for point in trajectory.control_points]
    is_on_earth = all(_on_earth(*corner) for corner in corners)
    if degree == 1 and is_on_earth:
        corners = _thinned(corners)
        weights = [1.0] * len(corners)
    elif not any(weights):
        findings.note("trajectory-odd", f"{key}.controlPoints[0].weight", 0.0, "1 for all")
        weights = [1.0] * len(corners)
    is_long_enough = 1 <= degree <= MOST_DEGREE and degree < len(corners) <= MOST_CONTROL_POINTS
    if not (is_on_earth and is_long_enough and all(1e-9 < weight < 1e9 for weight in weights)):
        findings.note("trajectory-unreadable", f"{key}.controlPoints", corners, "not used")
        return None
    knots = _knots(trajectory.knot_vector or [], len(corners), degree, findings, key) if degree > 1 else ()
    return Curve(degree, knots, tuple((*corner, weight) for corner, weight in zip(corners, weights, strict=True)))


def curve_to(end: SentPlace | None, trajectory: SentCurve, findings: Findings) -> Curve | None:
    """The curve of an edge that leads to a node. One that leads from there is turned round, which is counted."""
    curve = curve_of(trajectory, findings)
    if curve is None or end is None:
        return curve
    first_m, last_m = (hypot(x - end.x, y - end.y) for x, y, _ in (curve.points[0], curve.points[-1]))
    if first_m > BESIDE_M or last_m <= first_m + BESIDE_M:
        return curve
    findings.note("trajectory-odd", "trajectory.controlPoints", None, "turned round")
    return Curve(curve.degree, tuple(-knot for knot in reversed(curve.knots)), curve.points[::-1])


def polyline(trajectory: SentCurve) -> Polyline | None:
    """Points along a trajectory, from its first control point to its last. None if it is no clamped NURBS."""
    curve = curve_of(trajectory, Findings())
    return sampled(curve) if curve else None


def is_needless(before: Point, point: Point, after: Point) -> bool:
    """Whether a line is nearly the same without a point of it, since the next is near and straight on."""
    (ax, ay), (bx, by), (cx, cy) = before, point, after
    dx, dy, ex, ey = bx - ax, by - ay, cx - bx, cy - by
    return hypot(cx - ax, cy - ay) < SPACING_M and abs(atan2(dx * ey - dy * ex, dx * ex + dy * ey)) < BEND_RAD


def _thinned(corners: list[Point]) -> list[Point]:
    kept = corners[:2]
    for corner in corners[2:]:
        if is_needless(kept[-2], kept[-1], corner):
            kept.pop()
        kept.append(corner)
    return kept


def _on_earth(x: float, y: float) -> bool:
    return abs(x) < 1e7 and abs(y) < 1e7


def _knots(sent: list[float], points: int, degree: int, findings: Findings, key: str) -> tuple[float, ...]:
    """The knots. () if none were sent, or if those that were do not fit the points, which is counted."""
    fits = len(sent) == points + degree + 1 and all(map(isfinite, sent)) and all(a <= b for a, b in pairwise(sent))
    if fits and sent[degree] < sent[points]:
        return tuple(sent)
    if sent:
        findings.note("trajectory-odd", f"{key}.knotVector", sent, "as if there were none")
    return ()


def sampled(curve: Curve) -> Polyline:
    """Points along a curve, from its first control point to its last."""
    return _corners(curve) if curve.degree == 1 else _points_along(curve)


def curve_ahead(curve: Curve | None, here: Point) -> Polyline:
    """The points of a curve that are ahead of a robot. Empty without a curve, or if the robot is far from it."""
    points = sampled(curve) if curve else ()
    nearest_m, ahead = nearest_piece(points, *here)
    return points[ahead:] if nearest_m <= ON_CURVE_M else ()


def is_in_box(here: Point, points: Sequence[Sequence[float]], margin_m: float) -> bool:
    """Whether a place is in the box around points, or no further beside it. A curve stays within its control points."""
    for axis, at in enumerate(here):
        along = [point[axis] for point in points]
        if not min(along) - margin_m <= at <= max(along) + margin_m:
            return False
    return True


def _corners(curve: Curve) -> Polyline:
    return tuple((x, y) for x, y, _ in curve.points)


@lru_cache(_SAMPLED)
def _points_along(curve: Curve) -> Polyline:
    """A rational curve is the quotient of two curves that are not: the weighted points, and the weights."""
    corners, degree = _corners(curve), curve.degree
    from scipy.interpolate import BSpline  # noqa: PLC0415 - half of all fleets send no curves

    length_m = sum(hypot(bx - ax, by - ay) for (ax, ay), (bx, by) in pairwise(corners))
    count = min(max(int(length_m / SPACING_M), LEAST_POINTS), MOST_POINTS)
    inner = np.linspace(0.0, 1.0, len(corners) - degree + 1)
    knots = np.array(curve.knots or [*[0.0] * degree, *inner, *[1.0] * degree])
    weighted = np.array(curve.points)
    weighted[:, :2] *= weighted[:, 2:]
    along = BSpline(knots, weighted, degree)(np.linspace(knots[degree], knots[-degree - 1], count))
    with np.errstate(all="ignore"):
        points = along[:, :2] / along[:, 2:]
    return tuple(map(tuple, points.tolist())) if np.isfinite(points).all() else corners
