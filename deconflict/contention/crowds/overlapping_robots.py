"""Which robots overlap with others of their group as no bodies can.

The functions are compiled. Arrays of robots are by slot, see `LiveRobots`.
"""

from math import floor, hypot, pi

import numpy as np

from deconflict.sweep.geometry.knots import FARTHEST_M
from deconflict.sweep.pair_choice import LATER_S
from ingest.batch import Bools, Floats, Ints
from ingest.kernels import BOOLS, FLOATS, INTS, MATRIX, inner, kernel

COVERED = 2.0
"""A robot overlaps with others if the bodies with their centres in the circle around it, its own included, would cover
that circle so many times. Robots that stand side by side stay below, as they can't overlap."""
CELL_M = 2.0
"""Side of a cell. Robots are compared with those in the cells around them."""
SMALLEST_M = 0.25
"""Shortest side of a body. A shorter one counts as this long: no robots are so small that more of them have room."""
MOST_COMPARED = 200
"""A robot is compared with at most so many others, so that many above each other cost no more."""


@inner
def _cell(x_m: float, y_m: float) -> tuple[int, int]:
    return floor(x_m / CELL_M), floor(y_m / CELL_M)


@inner
def _place(x: int, y: int, on_floor: int, group: int, places: int) -> int:
    """The place of a cell of one floor and group among a power of two of places, which others may share."""
    return (x * 73_856_093 ^ y * 19_349_663 ^ on_floor * 83_492_791 ^ group * 50_331_653) & (places - 1)


@inner
def _is_located(at: Floats) -> bool:
    """Whether a robot is on a floor. Comparisons with nan are false."""
    return bool(at[2] >= 0.0 and abs(at[0]) <= FARTHEST_M and abs(at[1]) <= FARTHEST_M)


@inner
def _overlaps(slot: int, at: Floats, sizes_m: Floats, group: Ints, came_s: Floats, last: Ints, before: Ints) -> bool:
    """Whether the bodies near a robot cover the circle around it `COVERED` times; a larger body counts as its circle.

    The robots of a place are `last` (places,), then the one `before` (slots,) that, and so on to -1.
    """
    x_m, y_m, on_floor, bottom_m, top_m = at[slot]
    radius_m = hypot(sizes_m[slot, 0], sizes_m[slot, 1]) / 2
    circle_m2, area_m2, compared = pi * radius_m * radius_m, 0.0, 0
    (west, south), (east, north) = _cell(x_m - radius_m, y_m - radius_m), _cell(x_m + radius_m, y_m + radius_m)
    for x in range(west, east + 1):
        for y in range(south, north + 1):
            other = last[_place(x, y, int(on_floor), group[slot], len(last))]
            while other >= 0 and compared < MOST_COMPARED:
                other_x_m, other_y_m, other_floor, other_bottom_m, other_top_m = at[other]
                is_beside = group[other] == group[slot] and other_floor == on_floor
                is_beside = is_beside and _cell(other_x_m, other_y_m) == (x, y)
                is_beside = is_beside and came_s[other] <= came_s[slot] + LATER_S
                is_beside = is_beside and bottom_m <= other_top_m and other_bottom_m <= top_m
                compared += is_beside
                if is_beside and hypot(other_x_m - x_m, other_y_m - y_m) <= radius_m:
                    area_m2 += min(sizes_m[other, 0] * sizes_m[other, 1], circle_m2)
                if area_m2 > COVERED * circle_m2:
                    return True
                other = before[other]
    return False


@kernel(BOOLS(INTS, *[MATRIX] * 2, INTS, FLOATS))
def overlapping(robots: Ints, at: Floats, sizes_m: Floats, group: Ints, came_s: Floats) -> Bools:
    """(n,) which of the slots `robots` (n,) overlap with others of their group, on their floor and at their height.

    `at` (slots, 5) is x_m, y_m, floor, bottom_m and top_m; nan for a free slot. `sizes_m` (slots, 2) is length and
    width, `group` (slots,) a number, `came_s` (slots,) when each robot came to the floor.
    """
    sizes_m, places = np.maximum(sizes_m, SMALLEST_M), 4
    while places < 2 * len(at):
        places *= 2
    last, before, overlaps = np.full(places, -1), np.empty(len(at), np.int64), np.zeros(len(robots), np.bool_)
    for slot in range(len(at)):
        if _is_located(at[slot]):
            x, y = _cell(at[slot, 0], at[slot, 1])
            place = _place(x, y, int(at[slot, 2]), group[slot], places)
            before[slot], last[place] = last[place], slot
    for row, slot in enumerate(robots):
        overlaps[row] = _is_located(at[slot]) and _overlaps(slot, at, sizes_m, group, came_s, last, before)
    return overlaps
