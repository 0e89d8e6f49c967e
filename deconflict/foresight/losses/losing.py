"""What is known of robots, what is kept of each while it may lose time, and what was lost."""

from math import hypot
from typing import Any, NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

from ingest.batch import Bools, Floats, Ints
from ingest.kernels import BOOLS, CUBE, CUBES, INTS, MATRIX, inner, kernel, named_type

RESTS, WAITS, GOES, HALTS = range(4)
"""What a robot says of itself: it is not on its way, it waits, it is on its way, or it waits and does not name its
destination any more."""
NO_WAY, VELOCITY, ORDER, PATH = range(4)
"""What the forecast of a robot tells: not where it goes, only whither it drives now, its way, or its way and times."""
STANDS_M = 0.05
"""A robot that came less far stands."""
APART_S = 6.0
"""Reports further apart do not tell how much time was lost."""
MOST_NEAR = 64
"""Of the robots near another one so many are looked at, the nearest. Only side by side do more have room there."""
SQUARE_M, SQUARES = 8.0, 1 << 24
"""Side of a square of a floor, and more squares than are side by side on any."""

LOSING = np.dtype(
    [
        ("known", np.bool_),  # the robot has a report
        ("heard_s", np.float64),  # time of its last report
        ("loses", np.bool_),  # it lost time until its last report
        ("blocker", np.int64),  # slot of the robot because of which; NOBODY if none is known
        ("seen_s", np.float64),  # when the blocker was last in its way
        ("is_on_way", np.bool_),  # the blocker was on its way, and did not only cross it
        ("went", np.int64),  # what the robot said of itself at its last report
        ("references", np.int64),  # number of kept forecasts from before it began to lose time
        ("usual_mps", np.float64),  # speed at which it drives if nothing is in its way
        ("pending_s", np.float64),  # lost since `pending_from_s`, before a blocker was seen
        ("pending_from_s", np.float64),
        ("pending_over_s", np.float64),  # the same against the usual time
        ("lost_at_s", np.float64),  # when it last lost time
        ("is_planned", np.bool_),  # it said itself which way it goes
        ("stood_s", np.float64),  # since when it stands on its way; 0 if it does not
        ("stood_x_m", np.float64),  # where it stands
        ("stood_y_m", np.float64),
        ("booked_s", np.float64),  # until when what it lost is because of another robot
    ],
    align=True,
)
LOST = np.dtype(
    [
        ("row", np.int64),  # of the reports
        ("blocker", np.int64),  # slot; NOBODY if no robot was in the way
        ("from_s", np.float64),
        ("until_s", np.float64),
        ("lost_s", np.float64),
        ("over_s", np.float64),  # what it needed longer than usual
        ("is_on_way", np.bool_),  # the blocker was on the way, and did not only cross it
        ("is_mutual", np.bool_),  # the blocker stands for the robot, as that does for it
    ],
    align=True,
)
Losing = NDArray[Any]
"""Of `LOSING`."""
LostTimes = NDArray[Any]
"""Of `LOST`."""
LOSING_TYPE, LOST_TYPE = (numba.from_dtype(dtype)[::1] for dtype in (LOSING, LOST))
"""The types of both in kernels."""


class KnownRobots(NamedTuple):
    """What is known of all robots that do not rest, by row."""

    newest: Ints
    """(rows,) place of the newest report in the history."""
    reports: Ints
    """(rows,) number of kept reports."""
    t_s: Floats
    """(rows, kept) time of each kept report."""
    tracks: Floats
    """(rows, kept, k, 3) x_m, y_m, yaw_rad of each kept report, and of its forecast for each second after it."""
    floor: Floats
    """(rows, kept) floor of each kept report."""
    half_m: Floats
    """(2, rows) half length and half width."""
    levels_m: Floats
    """(2, rows) bottom and top."""
    vendor: Ints
    """(rows,)"""
    ways: Floats
    """(rows, k, 3) the newest forecast by which the robot moves."""
    has_way: Bools
    """(rows,)"""
    cell: Ints
    """(rows,) the squares of the newest reports, ascending, see `square`."""
    by_cell: Ints
    """(rows,) whose they are."""


KNOWN = named_type(KnownRobots, *[INTS] * 2, MATRIX, CUBES, *[MATRIX] * 3, INTS, CUBE, BOOLS, *[INTS] * 2)
"""The type of `KnownRobots` in kernels."""


@inner
def square(floor: float, column: float, row: float) -> int:
    """The number of a square of `SQUARE_M`. Those of a floor and column are in the order of their rows."""
    return (int(floor) * SQUARES + int(column)) * SQUARES + int(row)


@kernel(INTS(INTS, CUBES, MATRIX))
def squares(newest: Ints, tracks: Floats, floor: Floats) -> Ints:
    """(rows,) the squares of the newest reports."""
    found = np.empty(len(newest), np.int64)
    for row, at in enumerate(newest):
        x_m, y_m = tracks[row, at, 0, 0], tracks[row, at, 0, 1]
        found[row] = square(floor[row, at], x_m // SQUARE_M, y_m // SQUARE_M)
    return found


@inner
def nearest_rows(robots: KnownRobots, slot: int, x_m: float, y_m: float, reach_m: float) -> Ints:
    """(n,) the rows of the `MOST_NEAR` robots that are nearest to a place by their newest reports, the nearest first:
    on the floor and at the height of a robot, itself left out, and no farther from the place along x or y than
    `reach_m`."""
    rows, away_m, n = np.empty(len(robots.newest), np.int64), np.empty(len(robots.newest)), 0
    floor, levels_m = robots.floor[slot, robots.newest[slot]], robots.levels_m
    for column in range(int((x_m - reach_m) // SQUARE_M), int((x_m + reach_m) // SQUARE_M) + 1):
        begin = np.searchsorted(robots.cell, square(floor, column, (y_m - reach_m) // SQUARE_M))
        end = np.searchsorted(robots.cell, square(floor, column, (y_m + reach_m) // SQUARE_M), side="right")
        for other in robots.by_cell[begin:end]:
            if other == slot or robots.reports[other] == 0:
                continue
            if levels_m[0, slot] > levels_m[1, other] or levels_m[0, other] > levels_m[1, slot]:
                continue
            here = robots.tracks[other, robots.newest[other], 0]
            if abs(here[0] - x_m) <= reach_m and abs(here[1] - y_m) <= reach_m:
                rows[n], away_m[n] = other, hypot(here[0] - x_m, here[1] - y_m)
                n += 1
    return rows[:n][np.argsort(away_m[:n], kind="mergesort")[:MOST_NEAR]]
