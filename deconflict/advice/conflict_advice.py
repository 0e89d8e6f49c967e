"""The advice for each conflict of a group: the part of the group's plan that it needs, and actions for people."""

from collections.abc import Mapping, Sequence

from deconflict.advice.actions.waiting import waits
from deconflict.advice.deferred_answers import PairAdvice
from deconflict.advice.document_limits import listed
from deconflict.advice.holds.hold_planner import HoldPlan, plan_holds
from deconflict.advice.holds.hold_problem import Plan
from deconflict.advice.holds.hold_windows import STEP_S, HoldWindow, NearbyRobots
from deconflict.advice.holds.plan_parts import PlanParts
from deconflict.advice.priorities import WEIGHT
from deconflict.advice.standing_advice import decide
from deconflict.advisory import Hold, Recommendation
from deconflict.settings.site import USUAL_ADVICE, Advice
from ingest.batch import Pair


def advise_conflicts(
    near: NearbyRobots,
    conflicts: Sequence[Pair],
    window: HoldWindow,
    *,
    burdens_s: Mapping[str, float] | None = None,
    standing: Mapping[Pair, Recommendation] | None = None,
    settings: Advice = USUAL_ADVICE,
) -> PairAdvice:
    """The advice for each of `conflicts`, which are a connected group; see `plan_holds`.

    `standing` is the advice that they have now. It is given again if it still works.
    """
    standing = standing or {}
    held = frozenset(hold.robot for advice in standing.values() for hold in advice.holds)
    plan = plan_holds(near, conflicts, window, burdens_s=burdens_s, held_before=held, settings=settings)
    decision = decide(plan, conflicts, standing, settings.switch_s)
    parts, advice = PlanParts(decision.plan), PairAdvice()
    for pair in conflicts:
        before = standing.get(pair)
        if decision.stands and before and before.holds:
            advice[pair] = before
        else:
            because = decision.because if before else ""
            advice[pair] = _pair_advice(parts, pair).model_copy(update={"changed_because": because})
    return advice


def _pair_advice(parts: PlanParts, pair: Pair) -> Recommendation:
    plan, holds = parts.plan, parts.of(pair)
    problem = plan.problem
    cost, bound = problem.cost(holds), _bound(plan, holds, pair)
    first_cost = _first_come_cost(plan, holds, pair)
    is_planned = pair not in plan.unplanned
    return Recommendation(
        holds=tuple(Hold(robot=robot, hold_s=hold * STEP_S) for robot, hold in holds.items()),
        actions=waits(parts, pair, holds) if holds else (),
        cost_s=_seconds(cost),
        bound_s=_seconds(bound),
        first_come_cost_s=None if first_cost is None else _seconds(first_cost),
        expected_saving_s=0.0 if first_cost is None else _seconds(max(first_cost - cost, 0)),
        proven_optimal=is_planned and bound == cost,
        note="" if is_planned else _needs_another_route(plan, pair),
    )


def _bound(plan: HoldPlan, holds: Plan, pair: Pair) -> int:
    """A lower bound of the cost of any holds that keep a pair apart: of the group, if its whole plan is needed."""
    if holds and holds == {robot: hold for robot, hold in plan.found.plan.items() if hold}:
        return plan.found.bound
    problem, middle = plan.problem, plan.problem.window.steps
    if pair not in problem.allowed:
        return 0
    differences = (problem.allowed[pair].nonzero()[0] - middle).tolist()
    weights = [problem.weight(robot) for robot in pair]
    return min(abs(steps) * weights[steps < 0] for steps in differences)


def _first_come_cost(plan: HoldPlan, holds: Plan, pair: Pair) -> int | None:
    """What first come, first served costs the robots of a pair and those that are held with them."""
    if plan.first_come is None:
        return None
    concerned = {*pair, *holds}
    return plan.problem.cost({robot: hold for robot, hold in plan.first_come.items() if robot in concerned})


def _needs_another_route(plan: HoldPlan, pair: Pair) -> str:
    """Who has no plan together, and who needs another route."""
    robots, problem = plan.unplanned[pair], plan.problem
    names = [problem.planned[robot].name for robot in robots]
    leaves = problem.first_to_yield(robots)
    what = f"no hold keeps {names[0]} and {names[1]} apart" if robots == pair else f"no hold works for {listed(names)}"
    return f"{what}: {problem.planned[leaves].name} needs another route" if leaves else what


def _seconds(cost: int) -> float:
    return cost * STEP_S / WEIGHT
