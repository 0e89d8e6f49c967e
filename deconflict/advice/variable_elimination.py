"""The cheapest plan of robots that hang together in chains and plain rings, by folding them up: exact, however many.

A robot that shares pairs with no more than two others is left out: what its best hold counts at each hold of theirs is
added to what they count. In the end nobody is left, and the holds are read off backwards. (Variable elimination;
Bertele and Brioschi 1972, Nonserial Dynamic Programming.)
"""

import numba
import numpy as np

from deconflict.advice.exhaustive_search import NONE, UNKNOWN, Choice
from ingest.batch import Bools, Ints
from ingest.kernels import inner, kernel

MOST_ADDED = 500_000
"""Sums for one question: more take as long as the solver."""
NOBODY, _NO_PLAN, _TANGLED = -1, -1, -2
_FAR = 1 << 58
"""What holds count that do not keep apart: more than any that do, and three of them are a number still."""

_INTS = numba.int64[::1]


@inner
def _neighbours(edge: Ints, there: Bools, robot: int) -> tuple[int, int, int]:
    """How many robots that are `there` one shares a pair with, and the first two of them or `NOBODY`."""
    n, one, other = 0, NOBODY, NOBODY
    for beside in range(len(there)):
        if there[beside] and edge[robot, beside] >= 0:
            n += 1
            one, other = (beside, other) if n == 1 else (one, beside if n == 2 else other)
    return n, one, other


@inner
def _pair_counts(edge: Ints, between: Ints, robot: int, beside: int, hold: int) -> Ints:
    """(holds,) what each hold of a robot counts with one beside it that is held so long; nothing with `NOBODY`."""
    if beside == NOBODY:
        return np.zeros(between.shape[1], np.int64)
    shared = between[edge[robot, beside]]
    return shared[:, hold].copy() if robot < beside else shared[hold].copy()  # type: ignore[no-any-return]


@inner
def _fold(own: Ints, edge: Ints, between: Ints, robot: int, one: int, other: int) -> None:
    """Add what the best hold of `robot` counts, for each hold of the one or two beside it, to what they count."""
    holds = own.shape[1]
    with_other = np.empty((holds, holds), np.int64)
    for k in range(holds if other != NOBODY else 0):
        with_other[k] = _pair_counts(edge, between, robot, other, k)
    for j in range(holds):
        counts = own[robot] + _pair_counts(edge, between, robot, one, j)
        if other == NOBODY:
            own[one, j] = min(own[one, j] + counts.min(), _FAR)
            continue
        for k in range(holds):
            least = _FAR
            for hold in range(holds):
                least = min(least, counts[hold] + with_other[k, hold])
            between[edge[one, other], j, k] = min(between[edge[one, other], j, k] + least, _FAR)


@inner
def _unfolded(own: Ints, edge: Ints, between: Ints, robot: int, one: int, other: int, plan: Ints) -> bool:
    """Set the best hold of `robot` beside those that are set; whether there is but one."""
    counts = own[robot].copy()
    for beside in (one, other):
        if beside != NOBODY:
            counts += _pair_counts(edge, between, robot, beside, plan[beside])
    plan[robot] = counts.argmin()
    return bool((counts == counts[plan[robot]]).sum() == 1)


@inner
def _laid_out(longest: Ints, step: Ints, held: Ints, pairs: Ints, allowed: Bools) -> tuple[Ints, Ints, Ints]:
    """(robots, holds) what each counts; (robots, robots) the row of what each two count together, -1 for nothing, and
    (rows, holds, holds) that, the lower robot first. There is room for as many rows more as there are robots."""
    robots, middle = len(longest), allowed.shape[1] // 2
    holds = middle + 1
    own, edge = np.full((robots, holds), _FAR), np.full((robots, robots), -1)
    between = np.zeros((len(pairs) + robots, holds, holds), np.int64)
    for robot in range(robots):
        for hold in range(longest[robot] + 1):
            own[robot, hold] = step[robot] * hold + held[robot] * (hold > 0)
    for row in range(len(pairs)):
        a, b = pairs[row]
        edge[a, b] = edge[b, a] = row
        for j in range(holds):
            for k in range(holds):
                if not allowed[row, j - k + middle]:
                    between[row, j, k] = _FAR
    return own, edge, between


@inner
def _loosest(edge: Ints, there: Bools) -> tuple[int, int, int, int]:
    """The robot that shares pairs with the fewest others that are `there`; how many they are, and the first two."""
    fewest, robot, one, other = len(there), NOBODY, NOBODY, NOBODY
    for each in range(len(there)):
        if there[each]:
            n, first, second = _neighbours(edge, there, each)
            if n < fewest:
                fewest, robot, one, other = n, each, first, second
    return fewest, robot, one, other


@kernel(
    numba.types.Tuple((numba.int64, numba.boolean))(  # type: ignore[no-untyped-call]
        *[_INTS] * 3, numba.int64[:, ::1], numba.boolean[:, ::1], numba.int64, _INTS
    )
)
def _folded(
    longest: Ints, step: Ints, held: Ints, pairs: Ints, allowed: Bools, most: int, plan: Ints
) -> tuple[int, bool]:
    own, edge, between = _laid_out(longest, step, held, pairs, allowed)
    robots, rows, added, least, alone = len(longest), len(pairs), 0, 0, True
    there, left = np.ones(robots, np.bool_), np.empty((robots, 3), np.int64)
    for at in range(robots):
        fewest, robot, one, other = _loosest(edge, there)
        added += own.shape[1] ** (fewest + 1)
        if fewest > 2 or added > most:
            return _TANGLED, False
        there[robot], left[at, 0], left[at, 1], left[at, 2] = False, robot, one, other
        if fewest == 2 and edge[one, other] < 0:
            edge[one, other] = edge[other, one] = rows
            rows += 1
        if fewest:
            _fold(own, edge, between, robot, one, other)
        else:
            least += own[robot].min()
        if least >= _FAR:
            return _NO_PLAN, False
    for at in range(robots - 1, -1, -1):
        alone &= _unfolded(own, edge, between, left[at, 0], left[at, 1], left[at, 2], plan)
    return least, alone


def folded(choice: Choice, most: int = MOST_ADDED) -> tuple[int, list[int] | None]:
    """What the plan counts that counts least, `NONE` where there is no plan or `UNKNOWN` where robots hang together
    too closely; and the holds, None where several plans count as little. What they cost is not looked at.
    """
    plan = np.zeros(len(choice.longest), np.int64)
    told = choice.longest, choice.step, choice.held, choice.pairs, choice.allowed
    count, alone = _folded(*told, most, plan)
    return {_NO_PLAN: NONE, _TANGLED: UNKNOWN}.get(count, count), plan.tolist() if alone else None
