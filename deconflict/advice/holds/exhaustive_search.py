"""The cheapest plan of a few robots, found by trying all plans. It is exact, and for few robots faster than a solver.

`_search` is long because it is one loop: its state would be passed to every part of it.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numba
import numpy as np

from ingest.batch import Bools, Ints
from ingest.kernels import copy_row, inner, kernel

MOST_TRIED = 200_000
"""Number of tried holds after which the search gives up. From there on the solver is as fast."""
NO_PLAN, UNKNOWN = -1, -2
"""Returned in place of a score: there is no plan, or the search gave up."""
HIGHEST_SCORE = 1 << 62
"""Above the score of any plan."""

_INTS, _PAIRS, _BOOLS = numba.int64[::1], numba.int64[:, ::1], numba.boolean[:, ::1]


class HoldChoice(NamedTuple):
    """The holds that r robots may have, and the score of a plan: the lowest is best. Arrays are (r,) by default."""

    longest: Ints
    """Longest hold, in steps."""
    shortest: Ints
    """Shortest hold of a robot that is held at all, in steps."""
    weight: Ints
    """Cost of a step of a hold."""
    step: Ints
    """Score of a step of a hold."""
    held: Ints
    """Score of being held at all."""
    pairs: Ints
    """(p, 2) rows of robots, the lower first."""
    allowed: Bools
    """(p, 2 m + 1) whether a pair keeps apart at each difference of its holds, from -m to m."""


@inner
def _nearest_allowed(allowed: Bools) -> Ints:
    """(p, 2 m + 1) the nearest column at or before each that is allowed; -1 if there is none."""
    nearest = np.empty(allowed.shape, np.int64)
    for row in range(len(allowed)):
        last = -1
        for column in range(allowed.shape[1]):
            if allowed[row, column]:
                last = column
            nearest[row, column] = last
    return nearest


@inner
def _shortest_hold(
    robot: int, first: int, hold: int, shortest: int, longest: int, plan: Ints, pairs: Ints, nearest: Ints
) -> int:
    """The shortest hold from `hold` on at which a robot keeps apart from the robots from `first` to itself.

    0, or `shortest` or more; more than `longest` if there is none.
    """
    hold, middle, row = max(hold, shortest) if hold else 0, nearest.shape[1] // 2, 0
    while row < len(pairs) and hold <= longest:
        a, b = pairs[row]
        row += 1
        if b == robot and a >= first:
            column = plan[a] - hold + middle
            allowed_column = nearest[row - 1, column]
            if allowed_column < 0:
                return longest + 1
            if allowed_column < column:
                hold, row = max(hold + column - allowed_column, shortest), 0
    return hold


@inner
def _longest_worthwhile(longest: int, budget: int, weight: int, room: int, step: int, held: int) -> int:
    """The longest hold that costs at most `budget` and scores at most `room`; -1 if there is none."""
    if room < 0:
        return -1
    return max(min(longest, budget // weight, (room - held) // step), 0)


@kernel(numba.int64(*[_INTS] * 5, _PAIRS, _BOOLS, numba.int64, numba.int64, _INTS))
def _search(
    longest: Ints,
    shortest: Ints,
    weight: Ints,
    step: Ints,
    held: Ints,
    pairs: Ints,
    allowed: Bools,
    budget: int,
    most_tried: int,
    best: Ints,
) -> int:
    """Russian doll search (Verfaillie, Lemaitre and Schiex 1996); fills `best` and returns its score.

    Depth first, the shortest holds first: for the last robot alone, then for the last two, and so on. Each of these
    searches finds the lowest score of the robots from one row on. The next search uses it as a lower bound of their
    score, and skips plans that can't score less than the best so far. Holds that bring two robots together are
    skipped at once, and count as tried.
    """
    robots, tried, least, nearest = len(longest), 0, 0, _nearest_allowed(allowed)
    rest, plan = np.zeros(robots + 1, np.int64), np.full(robots, -1)
    cost, score = np.zeros(robots + 1, np.int64), np.zeros(robots + 1, np.int64)
    for first in range(robots - 1, -1, -1):
        least, robot = NO_PLAN, first
        cost[first] = score[first] = 0
        while robot >= first:
            begin = plan[robot] + 1
            room = HIGHEST_SCORE if least == NO_PLAN else least - 1 - score[robot] - rest[robot + 1]
            last = _longest_worthwhile(
                longest[robot], budget - cost[robot], weight[robot], room, step[robot], held[robot]
            )
            hold = begin
            if begin <= last:
                hold = _shortest_hold(robot, first, begin, shortest[robot], last, plan, pairs, nearest)
            tried += 1 + max(min(hold, last + 1) - begin, 0)
            if tried > most_tried:
                return UNKNOWN
            if hold > last:
                plan[robot] = -1
                robot -= 1
                continue
            plan[robot] = hold
            costs = cost[robot] + weight[robot] * hold
            scores = score[robot] + step[robot] * hold + held[robot] * (hold > 0)
            if robot + 1 == robots:
                least = scores
                copy_row(plan, best)
            else:
                robot += 1
                cost[robot], score[robot] = costs, scores
        if least == NO_PLAN:
            return NO_PLAN
        rest[first] = least
    return least


@kernel(numba.boolean(*[_INTS] * 3, _PAIRS, _BOOLS, _INTS))
def _fill_in_order(order: Ints, longest: Ints, shortest: Ints, pairs: Ints, allowed: Bools, plan: Ints) -> bool:
    """Set the shortest hold of each robot, in order, that keeps it apart from those before it; whether all have one."""
    middle = allowed.shape[1] // 2
    plan[:] = -1
    for robot in order:
        for hold in range(longest[robot] + 1):
            plan[robot], apart = hold, hold == 0 or hold >= shortest[robot]
            for row in range(len(pairs)):
                a, b = pairs[row]
                if (a == robot and plan[b] >= 0) or (b == robot and plan[a] >= 0):
                    apart &= allowed[row, plan[a] - plan[b] + middle]
            if apart:
                break
        else:
            return False
    return True


def plan_in_order(choice: HoldChoice, order: Sequence[int]) -> list[int] | None:
    """The holds if each robot, by row and in this order, waits for those before it; None if one then has no hold."""
    plan = np.empty(len(choice.longest), np.int64)
    found = _fill_in_order(
        np.array(order, np.int64), choice.longest, choice.shortest, choice.pairs, choice.allowed, plan
    )
    return plan.tolist() if found else None


def cheapest_plan(choice: HoldChoice, budget: int, most_tried: int = MOST_TRIED) -> tuple[int, list[int]]:
    """The lowest score of plans that cost at most `budget`, and the holds; of several plans, the first in order.

    Instead of the score: `NO_PLAN`, or `UNKNOWN` if the search would take too long.
    """
    best = np.zeros(len(choice.longest), np.int64)
    return _search(*choice, budget, most_tried, best), best.tolist()
