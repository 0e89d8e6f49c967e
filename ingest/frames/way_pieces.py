"""Where on a way of straight pieces something is."""

from collections.abc import Iterable
from itertools import pairwise
from math import hypot, inf, nan
from typing import NamedTuple


class Nearest(NamedTuple):
    """The place on a way that is nearest to something."""

    away_m: float
    """How far it is from there; inf if the way has no piece."""
    end: int
    """The row of the point at the end of its piece."""
    point: tuple[float, float]


def nearest_place(way: Iterable[tuple[float, float]], x_m: float, y_m: float, first_within_m: float = -inf) -> Nearest:
    """Where a way is nearest to a place, or the first part of it that comes within a distance.

    `way` are the x and y of its points, in metres.
    """
    nearest = Nearest(inf, 0, (nan, nan))
    for row, ((ax, ay), (bx, by)) in enumerate(pairwise(way), 1):
        dx, dy = bx - ax, by - ay
        square = dx * dx + dy * dy
        along = min(max(((x_m - ax) * dx + (y_m - ay) * dy) / square, 0.0), 1.0) if square else 0.0
        point = ax + along * dx, ay + along * dy
        away_m = hypot(point[0] - x_m, point[1] - y_m)
        if away_m < nearest.away_m:
            nearest = Nearest(away_m, row, point)
        elif nearest.away_m <= first_within_m < away_m:
            break
    return nearest


def nearest_piece(way: Iterable[tuple[float, float]], x_m: float, y_m: float) -> tuple[float, int]:
    """How far a place is from a way, and the row of the point at the end of the nearest piece."""
    away_m, end, _ = nearest_place(way, x_m, y_m)
    return away_m, end
