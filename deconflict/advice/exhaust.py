"""The cheapest plan of a few robots, by trying: exact, and found before a solver has read the question."""

from typing import NamedTuple

import numba
import numpy as np

from deconflict.motion import Bools
from ingest.compiled import inner, kernel
from ingest.seam import Ints

MOST_TRIED = 200_000
"""Holds of one robot that are tried before a question is left to the solver: milliseconds, as it takes itself."""
NONE, UNKNOWN = -1, -2

_INTS, _PAIRS, _BOOLS = numba.int64[::1], numba.int64[:, ::1], numba.boolean[:, ::1]


class Choice(NamedTuple):
    """What r robots may do and what counts. Arrays are (r,) unless said otherwise."""

    longest: Ints
    """Of a hold, in steps."""
    weight: Ints
    """What a step of a hold costs."""
    step: Ints
    """What it counts."""
    held: Ints
    """What it counts to be held at all."""
    pairs: Ints
    """(p, 2) robots, by row, the lower first."""
    allowed: Bools
    """(p, 2 m + 1) differences of the holds of a pair, from -m on, at which it keeps apart."""


@inner
def _fits(robot: int, first: int, hold: int, plan: Ints, pairs: Ints, allowed: Bools) -> bool:
    """Whether a robot that is held so long keeps apart from those before it, from `first` on."""
    middle = allowed.shape[1] // 2
    for row in range(len(pairs)):
        a, b = pairs[row]
        if b == robot and a >= first and not allowed[row, plan[a] - hold + middle]:
            return False
    return True


@kernel(numba.int64(*[_INTS] * 4, _PAIRS, _BOOLS, numba.int64, numba.int64, _INTS))
def _least(
    longest: Ints,
    weight: Ints,
    step: Ints,
    held: Ints,
    pairs: Ints,
    allowed: Bools,
    budget: int,
    most: int,
    best: Ints,
) -> int:
    """Depth first, the shortest holds first, for the last robot alone, then for the last two, and so on: what those
    that follow count at least is known then, and nothing is tried that can't count less than what was found.

    (Verfaillie, Lemaitre and Schiex 1996, Russian doll search.)
    """
    robots, tried, least = len(longest), 0, 0
    rest, plan = np.zeros(robots + 1, np.int64), np.full(robots, -1)
    cost, count = np.zeros(robots + 1, np.int64), np.zeros(robots + 1, np.int64)
    for first in range(robots - 1, -1, -1):
        least, robot = NONE, first
        cost[first] = count[first] = 0
        while robot >= first:
            plan[robot], tried = plan[robot] + 1, tried + 1
            if tried > most:
                return UNKNOWN
            hold = plan[robot]
            costs = cost[robot] + weight[robot] * hold
            counts = count[robot] + step[robot] * hold + held[robot] * (hold > 0)
            if hold > longest[robot] or costs > budget or (least != NONE and counts + rest[robot + 1] >= least):
                plan[robot] = -1
                robot -= 1
            elif _fits(robot, first, hold, plan, pairs, allowed):
                if robot + 1 == robots:
                    least = counts
                    best[:] = plan
                else:
                    robot += 1
                    cost[robot], count[robot] = costs, counts
        if least == NONE:
            return NONE
        rest[first] = least
    return least


def least(choice: Choice, budget: int, most: int = MOST_TRIED) -> tuple[int, list[int]]:
    """The plan that counts least of those that cost no more than `budget`, the first in order of several.

    What it counts, `NONE` where there is no plan or `UNKNOWN` where that would take too long; and the holds.
    """
    best = np.zeros(len(choice.longest), np.int64)
    return _least(*choice, budget, most, best), best.tolist()
