"""Holds: which robots should wait where they are, and how long, so that a whole group of conflicts is resolved."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from deconflict.advice.holds.hold_problem import HoldProblem, Plan, PlannedRobots
from deconflict.advice.holds.hold_search import FoundPlan, HoldSearch, hold_model
from deconflict.advice.holds.hold_windows import STEP_S, DelayWindows, HoldWindow, NearbyRobots
from deconflict.advice.priorities import WEIGHT
from deconflict.advice.solver import solve
from deconflict.advice.vendor_burden import burden_ranks
from deconflict.settings.site import USUAL_ADVICE, Advice
from ingest.batch import Pair

ROUNDS = 8
"""After so many plans that bring other robots together, no hold is advised."""
MOST_LEFT_OUT = 2
"""At most so many robots are left out of the plan of a group; beyond that no hold is advised."""
NO_PLAN = FoundPlan({}, 0)


class HoldPlan(NamedTuple):
    """The plan of a group of conflicts."""

    problem: HoldProblem
    found: FoundPlan
    """The holds; none if there is no plan."""
    first_come: Plan | None
    """The plan by first come, first served; None if there is none."""
    unplanned: Mapping[Pair, tuple[str, ...]]
    """By pair that the plan does not keep apart: robots that have no plan together, the two or a ring with them."""


def plan_holds(
    near: NearbyRobots,
    conflicts: Sequence[Pair],
    window: HoldWindow,
    *,
    burdens_s: Mapping[str, float] | None = None,
    held_before: frozenset[str] = frozenset(),
    settings: Advice = USUAL_ADVICE,
) -> HoldPlan:
    """The holds that resolve `conflicts` with the least waiting, weighted by priority.

    `near` are the robots of the conflicts and all robots near them: no hold may bring robots together that keep apart
    without it. Of plans that cost the same, the one that holds fewest robots, then the one that holds the vendors that
    are least burdened by `burdens_s`. If some robots are `held_before` by standing advice, another robot is held only
    if that saves `settings.switch_s`. If robots have no plan together, the plan leaves out the one that can best take
    another route.
    """
    problem = HoldProblem(PlannedRobots(near), window, DelayWindows(near, window), burdens_s or {})
    problem.constrain(sorted({(min(pair), max(pair)) for pair in conflicts}))
    ranks, switch = burden_ranks(burdens_s or {}, near.vendors), round(settings.switch_s / STEP_S * WEIGHT)
    return _planned(problem, HoldSearch(problem, ranks, held_before, settings.effort, switch))


def _planned(problem: HoldProblem, search: HoldSearch) -> HoldPlan:
    rings: dict[Pair, tuple[str, ...]] = {}
    for _ in range(ROUNDS):
        if not problem.allowed:
            return HoldPlan(problem, FoundPlan({}, 0), {}, _unplanned(problem, rings))
        best = search.best()
        if best is None:
            ring = tuple(_blocking_robots(problem, search.effort))
            leaves = problem.first_to_yield(ring)
            if leaves is None or len(problem.left_out) == MOST_LEFT_OUT:
                break
            rings |= dict.fromkeys(problem.leave_out(leaves, ring), ring)
            continue
        found, first_come = best
        missed = _missed_pairs(problem, found.plan)
        if not missed:
            return HoldPlan(problem, found, first_come, _unplanned(problem, rings))
        known = [pair for pair in missed if pair in problem.allowed]
        for a, b in known:
            problem.forbid((a, b), found.plan.get(a, 0) - found.plan.get(b, 0))
        problem.constrain([pair for pair in missed if pair not in known])
    return HoldPlan(problem, NO_PLAN, None, _unplanned(problem, rings) | {pair: pair for pair in problem.allowed})


def _unplanned(problem: HoldProblem, rings: Mapping[Pair, tuple[str, ...]]) -> dict[Pair, tuple[str, ...]]:
    return {pair: rings.get(pair, pair) for pair in problem.hopeless}


def _missed_pairs(problem: HoldProblem, plan: Plan) -> list[Pair]:
    """The pairs that a plan was to keep apart and does not, and those that it brings together, by another sweep."""
    held_s = {robot: hold * STEP_S for robot, hold in plan.items() if hold}
    of = held_s.keys() | {pair[0] for pair in problem.allowed if held_s.keys().isdisjoint(pair)}
    found = problem.delays.contacts_s(held_s, of) if held_s else problem.without_holds_s
    before = problem.pairs_together()
    return sorted(
        pair for pair in found if pair in problem.allowed or (pair not in before and not held_s.keys().isdisjoint(pair))
    )


def _blocking_robots(problem: HoldProblem, effort: float) -> list[str]:
    """A smallest set of robots that has no plan: without any one of them there is a plan."""
    blocking = problem.robots()
    for robot in list(blocking):
        rest = [other for other in blocking if other != robot]
        if not _may_have_plan(problem, rest, effort):
            blocking = rest
    return blocking


def _may_have_plan(problem: HoldProblem, robots: Sequence[str], effort: float) -> bool:
    """Whether there is a plan for some robots alone, or it is not known."""
    solved = solve(hold_model(problem, robots)[0], effort, presolve=False)
    return solved.found or not solved.proven
