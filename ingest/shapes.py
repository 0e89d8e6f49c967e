"""Shapes of robots that are more than one rectangle: circles, polygons, and several of them at different heights."""

from collections.abc import Iterable, Sequence
from functools import lru_cache
from math import hypot, inf, isfinite
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

Shapes = NDArray[np.object_]
"""Of `Shape`, or None for a rectangle."""


MOST_CORNERS, MOST_PARTS, MOST_TRAILERS = 32, 8, 10
"""Limits of a footprint, of a model and of a train."""
SMALLEST_M2 = 1e-4
"""A polygon of which all triangles have less area has none."""
SMALLEST_SWEPT_M2 = 1e-12
"""The sweep takes smaller ones, as a small part or load."""

Corner = tuple[float, float]


class ShapePart(NamedTuple):
    """A part of a robot: a polygon or a circle in the plane, over a range of heights."""

    outline_m: tuple[Corner, ...]
    """Corners of the polygon, or the centre of the circle: ahead of the envelope's centre, and to its left."""
    radius_m: float = 0.0
    """Of the circle; 0 for a polygon."""
    bottom_m: float = -inf
    """Above the bottom of the robot; -inf and inf if the part is as high as the robot."""
    top_m: float = inf

    @classmethod
    def box(cls, centre_m: Corner, length_m: float, width_m: float, bottom_m: float, top_m: float) -> Self:
        """A rectangle along the heading."""
        (x, y), long_m, wide_m = centre_m, length_m / 2, width_m / 2
        outline = (x + long_m, y + wide_m), (x - long_m, y + wide_m), (x - long_m, y - wide_m), (x + long_m, y - wide_m)
        return cls(outline, 0.0, bottom_m, top_m)


class Trailer(NamedTuple):
    """A trailer: a rectangle around its axle, which follows the axle of the vehicle ahead at a distance."""

    length_m: float
    width_m: float
    hitch_m: float
    """From the axle of the vehicle ahead to its own."""
    yaw_rad: float = 0.0
    """Its heading at the first knot of the forecast."""


class Shape(NamedTuple):
    """What a robot is if it is more than the rectangle of its length and width."""

    parts: tuple[ShapePart, ...]
    """Empty for the rectangle of a robot that pulls trailers."""
    axle_m: Corner = (0.0, 0.0)
    """Where the robot's axle is, which the first trailer follows: ahead of the envelope's centre, and to its left."""
    trailers: tuple[Trailer, ...] = ()
    """In their order behind the robot."""

    @classmethod
    def circle(cls, diameter_m: float) -> Self:
        """A circle around the envelope's centre."""
        return cls((ShapePart(((0.0, 0.0),), diameter_m / 2),))

    @classmethod
    def polygon(cls, corners_m: Iterable[tuple[float, float]]) -> Self:
        """A polygon, convex or not, that does not cross itself. The first corner may be repeated as the last."""
        corners = tuple((float(x), float(y)) for x, y in corners_m)
        return cls((ShapePart(corners[:-1] if corners and corners[0] == corners[-1] else corners),))

    @property
    def bounds_m(self) -> tuple[float, float, float, float]:
        """The rectangle around the shape: least x and y, greatest x and y."""
        spans = [(x, y, part.radius_m) for part in self.parts for x, y in part.outline_m]
        least = min(x - r for x, _, r in spans), min(y - r for _, y, r in spans)
        return *least, max(x + r for x, _, r in spans), max(y + r for _, y, r in spans)

    @property
    def heights_m(self) -> tuple[float, float]:
        """The lowest bottom and the highest top of its parts."""
        return min(part.bottom_m for part in self.parts), max(part.top_m for part in self.parts)

    @property
    def size_m(self) -> tuple[float, float]:
        """Length and width of the smallest rectangle around the envelope's centre that holds the shape."""
        west, south, east, north = self.bounds_m
        return 2 * max(-west, east), 2 * max(-south, north)

    def reach_m(self, radius_m: float = 0.0) -> float:
        """The radius of a circle around the envelope's centre that holds the shape and its trailers in any direction.
        `radius_m` is that of the robot if it has no parts."""
        reaches = [hypot(*corner) + part.radius_m for part in self.parts for corner in part.outline_m]
        robot_m = max(reaches, default=radius_m)
        if not self.trailers:
            return robot_m
        last, hitches_m = self.trailers[-1], sum(trailer.hitch_m for trailer in self.trailers)
        return max(robot_m, hypot(*self.axle_m) + hitches_m + hypot(last.length_m, last.width_m) / 2)

    def moved(self, ahead_m: float, left_m: float) -> Self:
        """The shape moved in the plane."""
        moved = [tuple((x + ahead_m, y + left_m) for x, y in part.outline_m) for part in self.parts]
        parts = (part._replace(outline_m=outline) for part, outline in zip(self.parts, moved, strict=True))
        return type(self)(tuple(parts))

    def raised(self, by_m: float) -> Self:
        """The shape at another height."""
        parts = (part._replace(bottom_m=part.bottom_m + by_m, top_m=part.top_m + by_m) for part in self.parts)
        return type(self)(tuple(parts))

    def divided(self, by: float) -> Self:
        """The shape in another unit, of which so many are one of its own."""
        divided = [tuple((x / by, y / by) for x, y in part.outline_m) for part in self.parts]
        pairs = zip(self.parts, divided, strict=True)
        parts = (part._replace(outline_m=outline, radius_m=part.radius_m / by) for part, outline in pairs)
        return type(self)(tuple(parts))

    def with_headings(self, yaws_rad: Iterable[float]) -> Self:
        """The shape with these headings of its trailers."""
        headed = (trailer._replace(yaw_rad=yaw) for trailer, yaw in zip(self.trailers, yaws_rad, strict=True))
        return self._replace(trailers=tuple(headed))


def shapes_of(shapes: Sequence[Shape | None]) -> Shapes | None:
    """The shapes of robots as an array; None if all are rectangles."""
    if not any(shapes):
        return None
    column = np.empty(len(shapes), object)
    for row, shape in enumerate(shapes):
        column[row] = shape
    return column


def joined_shapes(parts: Iterable[tuple[Shapes | None, int]]) -> Shapes | None:
    """The shapes of several groups of robots, each with its number of robots. None if all are rectangles."""
    groups = list(parts)
    if all(shapes is None for shapes, _ in groups):
        return None
    return np.concatenate([np.full(n, None) if shapes is None else shapes for shapes, n in groups])


def shapes_of_json(values: Sequence[Any] | None) -> Shapes | None:
    """The shapes that were written as JSON, in which null is an infinite height. The same shape is one object."""
    if values is None:
        return None
    shapes, known = np.full(len(values), None), dict[Shape, Shape]()
    for row, value in enumerate(values):
        if value is not None:
            parts, axle_m, trailers = value
            axle_x_m, axle_y_m = axle_m
            shape = Shape(
                tuple(_part(*part) for part in parts),
                (axle_x_m, axle_y_m),
                tuple(Trailer(*trailer) for trailer in trailers),
            )
            shapes[row] = known.setdefault(shape, shape)
    return shapes


def _part(outline_m: Any, radius_m: float, bottom_m: float | None, top_m: float | None) -> ShapePart:
    heights_m = -inf if bottom_m is None else bottom_m, inf if top_m is None else top_m
    return ShapePart(tuple((x, y) for x, y in outline_m), radius_m, *heights_m)


def is_sound(shape: Shape) -> bool:
    """Whether a robot of this shape can be swept. The size does not matter: a load may be large."""
    return _are_sound(shape.parts) and (not shape.trailers or _is_sound_train(shape))


@lru_cache(4096)
def _are_sound(parts: tuple[ShapePart, ...]) -> bool:
    return all(map(_is_sound_part, parts))


def _is_sound_part(part: ShapePart) -> bool:
    heights_m = part.bottom_m, part.top_m
    if heights_m != (-inf, inf) and not 0.0 <= part.bottom_m <= part.top_m < inf:
        return False
    if not all(isfinite(value) for corner in part.outline_m for value in corner):
        return False
    if part.radius_m:
        return 0.0 < part.radius_m < inf and len(part.outline_m) == 1
    return not outline_fault(part.outline_m, SMALLEST_SWEPT_M2)


def _is_sound_train(shape: Shape) -> bool:
    for length_m, width_m, hitch_m, yaw_rad in shape.trailers:
        if not (0.0 < length_m < inf and 0.0 < width_m < inf and 0.0 < hitch_m < inf and isfinite(yaw_rad)):
            return False
    return all(map(isfinite, shape.axle_m))


def outline_fault(corners_m: Sequence[Corner], smallest_m2: float = SMALLEST_M2) -> str | None:
    """What is wrong with the corners of a polygon; None if nothing is. `ingest/sizes` judges its size."""
    if not 3 <= len(corners_m) <= MOST_CORNERS:
        return f"expected 3 to {MOST_CORNERS} corners, not {len(corners_m)}"
    sides = list(zip(corners_m, [*corners_m[1:], corners_m[0]], strict=True))
    if all(abs(_side(corners_m[0], *side)) / 2 < smallest_m2 for side in sides):
        return "has no area"
    if any(_cross(*sides[row], *other) for row in range(len(sides)) for other in sides[row + 1 :]):
        return "crosses itself; list the corners in their order around the robot, each once"
    return None


def _cross(a: Corner, b: Corner, c: Corner, d: Corner) -> bool:
    """Whether two sides of a polygon meet elsewhere than at a corner that they share."""
    if b == c or a == d:
        return _side(a, b, d if b == c else c) == 0.0 and _are_folded(a, b, c, d)
    if any(max(min(a[k], b[k]), min(c[k], d[k])) > min(max(a[k], b[k]), max(c[k], d[k])) for k in (0, 1)):
        return False
    of_c, of_d, of_a, of_b = _side(a, b, c), _side(a, b, d), _side(c, d, a), _side(c, d, b)
    return of_c == of_d == 0.0 or (of_c * of_d <= 0.0 and of_a * of_b <= 0.0)


def _are_folded(a: Corner, b: Corner, c: Corner, d: Corner) -> bool:
    """Whether the second of two sides that share a corner, and are in line, runs back over the first."""
    return (b[0] - a[0]) * (d[0] - c[0]) + (b[1] - a[1]) * (d[1] - c[1]) < 0.0


def _side(a: Corner, b: Corner, c: Corner) -> float:
    """Above 0 if `c` is to the left of the line from `a` to `b`."""
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
