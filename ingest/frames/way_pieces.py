"""Where on a way of straight pieces something is."""

from collections.abc import Iterable
from itertools import pairwise
from math import hypot, inf


def nearest_piece(way: Iterable[tuple[float, float]], x_m: float, y_m: float) -> tuple[float, int]:
    """How far a place is from a way, and the row of the point at the end of the nearest piece.

    `way` are the x and y of its points, in metres. (inf, 0) if it has no piece.
    """
    nearest_m, end = inf, 0
    for row, ((ax, ay), (bx, by)) in enumerate(pairwise(way), 1):
        dx, dy = bx - ax, by - ay
        square = dx * dx + dy * dy
        along = min(max(((x_m - ax) * dx + (y_m - ay) * dy) / square, 0.0), 1.0) if square else 0.0
        away_m = hypot(ax + along * dx - x_m, ay + along * dy - y_m)
        if away_m < nearest_m:
            nearest_m, end = away_m, row
    return nearest_m, end
