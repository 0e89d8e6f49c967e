"""Where two rectangles come nearest to each other: one pair at a time, for what is told of it."""

from dataclasses import dataclass
from math import cos, hypot, sin

from shapely import Polygon

SAME_M = 1e-9
"""Distances that differ by less are the same."""

Point = tuple[float, float]


@dataclass(frozen=True, slots=True)
class Box:
    """A rectangle by its centre, heading and half sizes."""

    x_m: float
    y_m: float
    yaw_rad: float
    half_length_m: float
    half_width_m: float

    def corners(self) -> list[Point]:
        c, s = cos(self.yaw_rad), sin(self.yaw_rad)
        u, v = self.half_length_m, self.half_width_m
        return [
            (self.x_m + c * along - s * across, self.y_m + s * along + c * across)
            for along, across in ((u, v), (-u, v), (-u, -v), (u, -v))
        ]

    def within(self, points: list[Point]) -> list[Point]:
        """The points along the rectangle's own axes, from its centre."""
        c, s = cos(self.yaw_rad), sin(self.yaw_rad)
        offsets = [(x - self.x_m, y - self.y_m) for x, y in points]
        return [(c * dx + s * dy, c * dy - s * dx) for dx, dy in offsets]


def nearest(a: Box, b: Box) -> tuple[float, Point]:
    """Their distance, 0 where they overlap, and the place midway between where they are that near.

    Where more than one place is, or where they overlap, it is the middle of those; where they overlap without a corner
    in the other, the middle of what they share.
    """
    ways, apart = [], False
    for one, other in ((a, b), (b, a)):
        corners = other.corners()
        inside = one.within(corners)
        apart = apart or _beyond(inside, one)
        ways += [(_way(within, one), corner, one) for corner, within in zip(corners, inside, strict=True)]
    distance_m = min(hypot(*way) for way, _, _ in ways) if apart else 0.0
    places = [_midway(way, corner, one) for way, corner, one in ways if hypot(*way) <= distance_m + SAME_M]
    if not places:
        middle = Polygon(a.corners()).intersection(Polygon(b.corners())).centroid
        return 0.0, (middle.x, middle.y)
    return distance_m, (sum(x for x, _ in places) / len(places), sum(y for _, y in places) / len(places))


def _beyond(points: list[Point], box: Box) -> bool:
    """Whether a side of the box parts it from all the points, given along its axes."""
    along, across = [u for u, _ in points], [v for _, v in points]
    return (
        min(along) > box.half_length_m
        or max(along) < -box.half_length_m
        or min(across) > box.half_width_m
        or max(across) < -box.half_width_m
    )


def _way(within: Point, box: Box) -> Point:
    """From a corner to the box; the corner and the way are along the box's axes."""
    u, v = within
    du = min(max(u, -box.half_length_m), box.half_length_m) - u
    return du, min(max(v, -box.half_width_m), box.half_width_m) - v


def _midway(way: Point, corner: Point, box: Box) -> Point:
    (du, dv), c, s = way, cos(box.yaw_rad), sin(box.yaw_rad)
    return corner[0] + (c * du - s * dv) / 2, corner[1] + (s * du + c * dv) / 2
