"""Holds: which robots should wait where they are, and how long, so that a whole group of conflicts is resolved."""

from collections.abc import Mapping, Sequence

from deconflict.advice.document_limits import MOST_NAMED, listed
from deconflict.advice.hold_problem import HoldProblem, Plan, PlannedRobots
from deconflict.advice.hold_search import FoundPlan, HoldSearch, hold_model
from deconflict.advice.hold_windows import STEP_S, DelayWindows, HoldWindow, NearbyRobots
from deconflict.advice.priorities import WEIGHT
from deconflict.advice.solver import solve
from deconflict.advisory import Hold, Recommendation
from deconflict.settings.site import USUAL_ADVICE, Advice
from ingest.batch import Pair

ROUNDS = 8
"""After so many plans that bring other robots together, no hold is advised."""


def advise_holds(
    near: NearbyRobots,
    conflicts: Sequence[Pair],
    window: HoldWindow,
    *,
    burdens_s: Mapping[str, float] | None = None,
    standing: Recommendation | None = None,
    settings: Advice = USUAL_ADVICE,
) -> Recommendation:
    """The holds that resolve `conflicts` with the least waiting, weighted by priority.

    `near` are the robots of the conflicts and all robots near them: no hold may bring robots together that keep apart
    without it. Of plans that cost the same, the one that holds fewest robots, then the one that holds the vendors that
    are least burdened by `burdens_s`. A robot that `standing` does not hold is held only if that saves
    `settings.switch_s`. If no hold works, `note` says who needs another route.
    """
    problem = HoldProblem(PlannedRobots(near), window, DelayWindows(near, window))
    pairs = sorted({(min(pair), max(pair)) for pair in conflicts})
    problem.constrain(pairs)
    ranks, switch = _ranks(burdens_s or {}, near.vendors), round(settings.switch_s / STEP_S * WEIGHT)
    search = HoldSearch(problem, ranks, _held_robots(standing), settings.effort, switch)
    for _ in range(ROUNDS):
        if not problem.allowed:
            return _recommendation(problem, FoundPlan({}, 0, proven=True), {})
        best = search.best()
        if best is None:
            return _no_recommendation(problem, settings.effort)
        found, first_come = best
        missed = _missed_pairs(problem, found.plan)
        if not missed:
            return _recommendation(problem, found, first_come)
        known = [pair for pair in missed if pair in problem.allowed]
        for a, b in known:
            problem.forbid((a, b), found.plan.get(a, 0) - found.plan.get(b, 0))
        problem.constrain([pair for pair in missed if pair not in known])
    return _no_recommendation(problem, settings.effort)


def _missed_pairs(problem: HoldProblem, plan: Plan) -> list[Pair]:
    """The pairs that a plan was to keep apart and does not, and those that it brings together, by another sweep."""
    held_s = {robot: hold * STEP_S for robot, hold in plan.items() if hold}
    of = held_s.keys() | {pair[0] for pair in problem.allowed if held_s.keys().isdisjoint(pair)}
    found = problem.delays.contacts_s(held_s, of) if held_s else problem.without_holds_s
    before = problem.without_holds_s.keys() | set(problem.hopeless)
    return sorted(
        pair for pair in found if pair in problem.allowed or (pair not in before and not held_s.keys().isdisjoint(pair))
    )


def _recommendation(problem: HoldProblem, found: FoundPlan, first_come: Plan | None) -> Recommendation:
    cost, first_cost = problem.cost(found.plan), None if first_come is None else problem.cost(first_come)
    return Recommendation(
        holds=tuple(Hold(robot=robot, hold_s=hold * STEP_S) for robot, hold in sorted(found.plan.items()) if hold),
        cost_s=_seconds(cost),
        bound_s=_seconds(found.bound),
        first_come_cost_s=None if first_cost is None else _seconds(first_cost),
        expected_saving_s=0.0 if first_cost is None else _seconds(first_cost - cost),
        proven_optimal=found.proven,
        note=_needs_another_route(problem),
    )


def _no_recommendation(problem: HoldProblem, effort: float) -> Recommendation:
    """No holds, and a note that says who blocks whom."""
    if problem.allowed and not problem.hopeless:
        names = [problem.planned[robot].name for robot in _blocking_robots(problem, effort)]
        note = f"no hold works for {listed(names)}: one of them needs another route"
    else:
        note = _needs_another_route(problem)
    return Recommendation(cost_s=0.0, bound_s=0.0, proven_optimal=False, note=note)


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


def _needs_another_route(problem: HoldProblem) -> str:
    pairs = sorted(set(problem.hopeless))
    names = [tuple(problem.planned[robot].name for robot in pair) for pair in pairs[:MOST_NAMED]]
    notes = [f"no hold keeps {a} and {b} apart: one of them needs another route" for a, b in names]
    return "; ".join([*notes, *["so do others"] * (len(pairs) > MOST_NAMED)])


def _ranks(burdens_s: Mapping[str, float], vendors: Sequence[str]) -> dict[str, int]:
    """By vendor, its rank by burden, from 0 for the least burdened."""
    burden_s = {vendor: burdens_s.get(vendor, 0.0) for vendor in set(vendors)}
    rank_of = {level: rank for rank, level in enumerate(sorted(set(burden_s.values())))}
    return {vendor: rank_of[level] for vendor, level in burden_s.items()}


def _held_robots(advice: Recommendation | None) -> frozenset[str]:
    return frozenset(hold.robot for hold in advice.holds) if advice else frozenset()


def _seconds(cost: int) -> float:
    return cost * STEP_S / WEIGHT
