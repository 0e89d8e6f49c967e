"""The cheapest plan of robots that form chains and plain rings, by variable elimination: exact, however many they are.

A robot that shares pairs with at most two others is eliminated: the score of its best hold, at each hold of theirs, is
added to their scores. Once no robot is left, the holds are read off backwards. (Bertele and Brioschi 1972, Nonserial
Dynamic Programming.)
"""

import numba
import numpy as np

from deconflict.advice.exhaustive_search import NO_PLAN, UNKNOWN, HoldChoice
from ingest.batch import Bools, Ints
from ingest.kernels import inner, kernel

MOST_ADDITIONS = 500_000
"""For one question; more take as long as the solver."""
NOBODY, _INFEASIBLE, _TANGLED = -1, -1, -2
_FORBIDDEN = 1 << 58
"""Score of holds that do not keep apart: above any that do, and the sum of three of them does not overflow."""

_INTS = numba.int64[::1]


@inner
def _neighbours(edge: Ints, left: Bools, robot: int) -> tuple[int, int, int]:
    """How many robots that are `left` share a pair with one, and the first two of them; `NOBODY` if there is none."""
    n, first, second = 0, NOBODY, NOBODY
    for neighbour in range(len(left)):
        if left[neighbour] and edge[robot, neighbour] >= 0:
            n += 1
            first, second = (neighbour, second) if n == 1 else (first, neighbour if n == 2 else second)
    return n, first, second


@inner
def _pair_scores(edge: Ints, between: Ints, robot: int, neighbour: int, hold: int) -> Ints:
    """(holds,) the score of each hold of a robot with a neighbour that is held for `hold`; 0 with `NOBODY`."""
    if neighbour == NOBODY:
        return np.zeros(between.shape[1], np.int64)
    shared = between[edge[robot, neighbour]]
    return shared[:, hold].copy() if robot < neighbour else shared[hold].copy()  # type: ignore[no-any-return]


@inner
def _eliminate(own: Ints, edge: Ints, between: Ints, robot: int, first: int, second: int) -> None:
    """Add the score of the best hold of `robot`, at each hold of its one or two neighbours, to their scores."""
    holds = own.shape[1]
    with_second = np.empty((holds, holds), np.int64)
    for k in range(holds if second != NOBODY else 0):
        with_second[k] = _pair_scores(edge, between, robot, second, k)
    for j in range(holds):
        scores = own[robot] + _pair_scores(edge, between, robot, first, j)
        if second == NOBODY:
            own[first, j] = min(own[first, j] + scores.min(), _FORBIDDEN)
            continue
        for k in range(holds):
            least = _FORBIDDEN
            for hold in range(holds):
                least = min(least, scores[hold] + with_second[k, hold])
            between[edge[first, second], j, k] = min(between[edge[first, second], j, k] + least, _FORBIDDEN)


@inner
def _set_best_hold(own: Ints, edge: Ints, between: Ints, robot: int, first: int, second: int, plan: Ints) -> bool:
    """Set the best hold of an eliminated robot, now that its neighbours have theirs; whether there is only one."""
    scores = own[robot].copy()
    for neighbour in (first, second):
        if neighbour != NOBODY:
            scores += _pair_scores(edge, between, robot, neighbour, plan[neighbour])
    plan[robot] = scores.argmin()
    return bool((scores == scores[plan[robot]]).sum() == 1)


@inner
def _score_tables(longest: Ints, step: Ints, held: Ints, pairs: Ints, allowed: Bools) -> tuple[Ints, Ints, Ints]:
    """The scores of robots and of pairs.

    (robots, holds) the score of each hold of each robot; (robots, robots) the row of each pair, -1 if there is none;
    (rows, holds, holds) the score of each two holds of a pair, of the lower robot first. There are as many spare rows
    as robots.
    """
    robots, middle = len(longest), allowed.shape[1] // 2
    holds = middle + 1
    own, edge = np.full((robots, holds), _FORBIDDEN), np.full((robots, robots), -1)
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
                    between[row, j, k] = _FORBIDDEN
    return own, edge, between


@inner
def _loosest(edge: Ints, left: Bools) -> tuple[int, int, int, int]:
    """The robot with the fewest neighbours of those that are `left`: how many it has, itself, and the first two."""
    fewest, loosest, first, second = len(left), NOBODY, NOBODY, NOBODY
    for robot in range(len(left)):
        if left[robot]:
            n, n_first, n_second = _neighbours(edge, left, robot)
            if n < fewest:
                fewest, loosest, first, second = n, robot, n_first, n_second
    return fewest, loosest, first, second


@kernel(
    numba.types.Tuple((numba.int64, numba.boolean))(  # type: ignore[no-untyped-call]
        *[_INTS] * 3, numba.int64[:, ::1], numba.boolean[:, ::1], numba.int64, _INTS
    )
)
def _eliminate_all(
    longest: Ints, step: Ints, held: Ints, pairs: Ints, allowed: Bools, most_additions: int, plan: Ints
) -> tuple[int, bool]:
    """Fill `plan`; its score, `_INFEASIBLE` or `_TANGLED`, and whether no other plan has that score."""
    own, edge, between = _score_tables(longest, step, held, pairs, allowed)
    robots, rows, additions, score, is_only = len(longest), len(pairs), 0, 0, True
    left, eliminated = np.ones(robots, np.bool_), np.empty((robots, 3), np.int64)
    for at in range(robots):
        fewest, robot, first, second = _loosest(edge, left)
        additions += own.shape[1] ** (fewest + 1)
        if fewest > 2 or additions > most_additions:
            return _TANGLED, False
        left[robot], eliminated[at, 0], eliminated[at, 1], eliminated[at, 2] = False, robot, first, second
        if fewest == 2 and edge[first, second] < 0:
            edge[first, second] = edge[second, first] = rows
            rows += 1
        if fewest:
            _eliminate(own, edge, between, robot, first, second)
        else:
            score += own[robot].min()
        if score >= _FORBIDDEN:
            return _INFEASIBLE, False
    for at in range(robots - 1, -1, -1):
        robot, first, second = eliminated[at, 0], eliminated[at, 1], eliminated[at, 2]
        is_only &= _set_best_hold(own, edge, between, robot, first, second, plan)
    return score, is_only


def only_cheapest_plan(choice: HoldChoice, most_additions: int = MOST_ADDITIONS) -> tuple[int, list[int] | None]:
    """The lowest score of all plans, and the holds; None if several plans have that score. Costs are not looked at.

    Instead of the score: `NO_PLAN`, or `UNKNOWN` if robots depend on each other too closely.
    """
    plan = np.zeros(len(choice.longest), np.int64)
    question = choice.longest, choice.step, choice.held, choice.pairs, choice.allowed
    score, is_only = _eliminate_all(*question, most_additions, plan)
    return {_INFEASIBLE: NO_PLAN, _TANGLED: UNKNOWN}.get(score, score), plan.tolist() if is_only else None
