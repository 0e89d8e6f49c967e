"""Shapes as convex pieces in arrays, by a number for each shape. Number 0 is the rectangle of a robot's own size.

A piece is a convex polygon with rounded corners: a circle is one corner with its radius. Along the direction between
the closest features of two convex pieces the gap is their distance, which the certified advancement needs.
"""

from collections.abc import Iterator, Sequence
from itertools import combinations
from math import hypot, inf
from threading import Lock
from typing import Any, NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray

from ingest.batch import Bools, Floats, Forecasts, Ints
from ingest.shapes import Shape, ShapePart, is_sound

RECTANGLE = 0
"""The number of a robot that is a rectangle."""
UNSOUND = -1
"""In place of a number, if a shape can't be swept."""
MOST_CORNERS = 32
"""Of one piece."""
CONVEX_M2 = 1e-12
"""Two pieces are joined if their hull is larger than they are by no more than this."""

PIECE = np.dtype(
    [
        ("first", np.int64),  # row of its first corner
        ("count", np.int64),  # how many corners it has
        ("rounding", np.float64),  # radius around the corners, metres
        ("x", np.float64),  # centre of a circle around the piece
        ("y", np.float64),
        ("around", np.float64),  # radius of that circle
        ("reach", np.float64),  # distance of the farthest corner from the robot's centre
        ("bottom", np.float64),  # above the bottom of the robot; -inf and inf for a piece as high as the robot
        ("top", np.float64),
    ],
    align=True,
)
"""A convex piece of a shape, in the robot's own frame."""

CORNER = np.dtype(
    [
        ("x", np.float64),
        ("y", np.float64),
        ("normal_x", np.float64),  # outward unit normal of the side to the next corner, 0 if there is none
        ("normal_y", np.float64),
        ("side", np.float64),  # length of that side
    ],
    align=True,
)
"""A corner of a piece; the corners of a piece run anticlockwise."""

Outline = NDArray[Any]
"""Of `CORNER`."""


class Pieces(NamedTuple):
    """The pieces of all shapes known so far. Shape s has the pieces `begins[s]` to `begins[s + 1] - 1`."""

    begins: Ints
    pieces: NDArray[Any]
    """Of `PIECE`."""
    corners: NDArray[Any]
    """Of `CORNER`."""


class ShapeTable:
    """Numbers shapes. A shape keeps its number, and arrays that were given away do not change."""

    def __init__(self) -> None:
        self._lock = Lock()
        self.arrays = Pieces(np.zeros(2, np.int64), np.empty(0, PIECE), np.empty(0, CORNER))
        self.half_m: Floats = np.zeros((1, 2))
        """(shapes, 2) half the sides of the rectangle around each shape."""
        self.top_m: Floats = np.full(1, -inf)
        """(shapes,) the highest top of a part, above the bottom of the robot; -inf if all are as high as the robot."""
        self.is_plain: Bools = np.ones(1, bool)
        """(shapes,) whether each shape is a rectangle or one circle: the distance of two of these is one formula."""
        self._numbers: dict[tuple[ShapePart, ...], int] = {}
        self._shapes: list[Shape | None] = [None]

    def __getitem__(self, number: int) -> Shape | None:
        return self._shapes[number]

    def numbers(self, forecasts: Forecasts) -> Ints | int:
        """(n,) the number of each robot's shape, or `RECTANGLE` if all are rectangles. Shapes not seen yet are
        added. A shape that can't be swept counts as a rectangle."""
        numbers: Ints | int = np.maximum(self.numbers_of_sound(forecasts), RECTANGLE)
        return numbers

    def numbers_of_sound(self, forecasts: Forecasts) -> Ints | int:
        """As `numbers`, and `UNSOUND` of a shape that can't be swept."""
        if forecasts.shapes is None:
            return RECTANGLE
        with self._lock:
            return np.fromiter(map(self._number, forecasts.shapes), np.int64, len(forecasts))

    def _number(self, shape: Shape | None) -> int:
        if shape is None:
            return RECTANGLE
        if shape.trailers and not is_sound(shape):
            return UNSOUND
        if not shape.parts:
            return RECTANGLE
        number = self._numbers.get(shape.parts)
        if number is None:
            if not is_sound(shape):
                return UNSOUND
            number = len(self._shapes)
            self._add(shape)
            self._numbers[shape.parts] = number
        return number

    def _add(self, shape: Shape) -> None:
        begins, pieces, corners = self.arrays
        rows, outlines = [], [corners]
        first = len(corners)
        for part in shape.parts:
            for outline in convex_outlines(part):
                rows.append(_piece(part, outline, first))
                outlines.append(outline)
                first += len(outline)
        self._shapes.append(shape)
        self.half_m = np.concatenate([self.half_m, [np.array(shape.size_m) / 2]])
        self.top_m = np.append(self.top_m, max((part.top_m for part in shape.parts if part.top_m < inf), default=-inf))
        self.is_plain = np.append(self.is_plain, len(shape.parts) == 1 and shape.parts[0].radius_m > 0.0)
        pieces = np.concatenate([pieces, np.array(rows, PIECE)])
        self.arrays = Pieces(np.append(begins, len(pieces)), pieces, np.concatenate(outlines))


SHAPES = ShapeTable()
"""The shapes of this process."""


def convex_outlines(part: ShapePart) -> Iterator[Outline]:
    """The convex pieces of a part, which together cover it and nothing else."""
    if len(part.outline_m) < 3:
        yield outline_of(part.outline_m)
        return
    for polygon in convex_polygons(shapely.Polygon(part.outline_m)):
        ring = shapely.Polygon(polygon.exterior).normalize().exterior.reverse()
        corners = list(ring.coords)[:-1]
        yield outline_of(corners if ring.is_ccw else corners[::-1])


def convex_polygons(polygon: shapely.Polygon) -> list[shapely.Polygon]:
    """A polygon cut into triangles, which are joined again as long as the result is convex."""
    if _is_convex(polygon):
        return [polygon.convex_hull]
    polygons = list(shapely.constrained_delaunay_triangles(polygon).geoms)
    while joined := _first_convex_union(polygons):
        row, other, union = joined
        polygons = [polygon for at, polygon in enumerate(polygons) if at not in (row, other)]
        polygons.append(union)
    return polygons


def _first_convex_union(polygons: Sequence[shapely.Polygon]) -> tuple[int, int, shapely.Polygon] | None:
    for (row, a), (other, b) in combinations(enumerate(polygons), 2):
        if a.boundary.intersection(b.boundary).length > 0.0:
            union = a.union(b)
            if union.geom_type == "Polygon" and _is_convex(union):
                return row, other, union.convex_hull
    return None


def _is_convex(polygon: shapely.Polygon) -> bool:
    return float(polygon.convex_hull.area - polygon.area) <= CONVEX_M2


def outline_of(corners_m: Sequence[Sequence[float]]) -> Outline:
    """The corners of a convex polygon, anticlockwise, or of the centre of a circle."""
    outline = np.zeros(len(corners_m), CORNER)
    x, y = np.array(corners_m, np.float64).T
    dx, dy = np.roll(x, -1) - x, np.roll(y, -1) - y
    side = np.hypot(dx, dy)
    outline["x"], outline["y"], outline["side"] = x, y, side
    long = np.maximum(side, np.finfo(np.float64).tiny)
    outline["normal_x"], outline["normal_y"] = dy / long, -dx / long
    return outline


def _piece(part: ShapePart, outline: Outline, first: int) -> tuple[float, ...]:
    x, y = outline["x"], outline["y"]
    middle_x, middle_y = (x.min() + x.max()) / 2, (y.min() + y.max()) / 2
    around = np.hypot(x - middle_x, y - middle_y).max() + part.radius_m
    circle = float(middle_x), float(middle_y), float(around), max(map(hypot, x, y))
    heights = (part.bottom_m, part.top_m) if part.top_m < inf else (-inf, inf)
    return first, len(outline), part.radius_m, *circle, *heights
