"""The cheapest plan of a few robots, by trying: exact, and found before a solver has read the question."""

from collections.abc import Sequence
from typing import NamedTuple

import numba
import numpy as np

from ingest.batch import Bools, Ints
from ingest.kernels import inner, kernel

MOST_TRIED = 200_000
"""Holds of one robot that are tried before a question is left to the solver: milliseconds, as it takes itself."""
NONE, UNKNOWN = -1, -2
ROOMY = 1 << 62
"""More than any plan counts."""

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
def _below(allowed: Bools) -> Ints:
    """(p, 2 m + 1) the nearest column at or before each that is allowed, -1 where there is none."""
    below = np.empty(allowed.shape, np.int64)
    for row in range(len(allowed)):
        last = -1
        for column in range(allowed.shape[1]):
            if allowed[row, column]:
                last = column
            below[row, column] = last
    return below


@inner
def _fitting(robot: int, first: int, hold: int, longest: int, plan: Ints, pairs: Ints, below: Ints) -> int:
    """The shortest hold from `hold` on at which a robot keeps apart from those before it, from `first` on; more than
    `longest` where there is none."""
    middle, row = below.shape[1] // 2, 0
    while row < len(pairs) and hold <= longest:
        a, b = pairs[row]
        row += 1
        if b == robot and a >= first:
            column = plan[a] - hold + middle
            nearest = below[row - 1, column]
            if nearest < 0:
                return longest + 1
            if nearest < column:
                hold, row = hold + column - nearest, 0
    return hold


@inner
def _worthwhile(longest: int, left: int, weight: int, room: int, step: int, held: int) -> int:
    """The longest hold that costs no more than is `left` and counts no more than there is `room` for; -1 for none."""
    if room < 0:
        return -1
    return max(min(longest, left // weight, (room - held) // step), 0)


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

    (Verfaillie, Lemaitre and Schiex 1996, Russian doll search.) Holds that do not fit are passed over at once, and
    count as tried.
    """
    robots, tried, least, below = len(longest), 0, 0, _below(allowed)
    rest, plan = np.zeros(robots + 1, np.int64), np.full(robots, -1)
    cost, count = np.zeros(robots + 1, np.int64), np.zeros(robots + 1, np.int64)
    for first in range(robots - 1, -1, -1):
        least, robot = NONE, first
        cost[first] = count[first] = 0
        while robot >= first:
            begin = plan[robot] + 1
            room = ROOMY if least == NONE else least - 1 - count[robot] - rest[robot + 1]
            last = _worthwhile(longest[robot], budget - cost[robot], weight[robot], room, step[robot], held[robot])
            hold = _fitting(robot, first, begin, last, plan, pairs, below) if begin <= last else begin
            tried += 1 + max(min(hold, last + 1) - begin, 0)
            if tried > most:
                return UNKNOWN
            if hold > last:
                plan[robot] = -1
                robot -= 1
                continue
            plan[robot] = hold
            costs = cost[robot] + weight[robot] * hold
            counts = count[robot] + step[robot] * hold + held[robot] * (hold > 0)
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


@kernel(numba.boolean(*[_INTS] * 2, _PAIRS, _BOOLS, _INTS))
def _in_turn(order: Ints, longest: Ints, pairs: Ints, allowed: Bools, plan: Ints) -> bool:
    """Set the shortest hold of each robot, in order, that keeps it apart from those before it; whether all have one."""
    middle = allowed.shape[1] // 2
    plan[:] = -1
    for robot in order:
        for hold in range(longest[robot] + 1):
            plan[robot], apart = hold, True
            for row in range(len(pairs)):
                a, b = pairs[row]
                if (a == robot and plan[b] >= 0) or (b == robot and plan[a] >= 0):
                    apart &= allowed[row, plan[a] - plan[b] + middle]
            if apart:
                break
        else:
            return False
    return True


def in_turn(choice: Choice, order: Sequence[int]) -> list[int] | None:
    """The holds where each robot, by row and in this order, waits for those before it; None where one then can't."""
    plan = np.empty(len(choice.longest), np.int64)
    found = _in_turn(np.array(order, np.int64), choice.longest, choice.pairs, choice.allowed, plan)
    return plan.tolist() if found else None


def least(choice: Choice, budget: int, most: int = MOST_TRIED) -> tuple[int, list[int]]:
    """The plan that counts least of those that cost no more than `budget`, the first in order of several.

    What it counts, `NONE` where there is no plan or `UNKNOWN` where that would take too long; and the holds.
    """
    best = np.zeros(len(choice.longest), np.int64)
    return _least(*choice, budget, most, best), best.tolist()
