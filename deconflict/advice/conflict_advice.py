"""The advice for each conflict of a group: the part of the group's plan that it needs, and actions for people."""

from collections.abc import Mapping, Sequence

from deconflict.advice.actions.action_text import action_text
from deconflict.advice.actions.chosen_actions import chosen_actions
from deconflict.advice.deferred_answers import PairAdvice
from deconflict.advice.document_limits import listed
from deconflict.advice.holds.hold_planner import HoldPlan, plan_holds
from deconflict.advice.holds.hold_problem import Plan
from deconflict.advice.holds.hold_windows import STEP_S, HoldWindow, NearbyRobots
from deconflict.advice.holds.plan_parts import PlanParts
from deconflict.advice.priorities import WEIGHT
from deconflict.advice.standing_advice import decide
from deconflict.settings.site import USUAL_ADVICE, Advice
from deconflict_client.advisory import Action, Hold, Recommendation
from ingest.batch import Pair

HOLD_WORKS = "a hold keeps them apart now"
NO_LONGER_WORKS = "what was advised before no longer keeps them apart"
COSTS_MORE = "waiting costs more than it is expected to save"
NOT_WORTH = Recommendation(cost_s=0.0, bound_s=0.0, proven_optimal=False, note=COSTS_MORE)
KEPT_SHARE = 0.6
"""A standing hold is given up only if this share of it costs more than it is expected to save."""


def advise_conflicts(
    near: NearbyRobots,
    conflicts: Sequence[Pair],
    window: HoldWindow,
    *,
    burdens_s: Mapping[str, float] | None = None,
    standing: Mapping[Pair, Recommendation] | None = None,
    losses_s: Mapping[Pair, float] | None = None,
    settings: Advice = USUAL_ADVICE,
) -> PairAdvice:
    """The advice for each of `conflicts`, which are a connected group; see `plan_holds`.

    `standing` is the advice that they have now. It is given again if it still works. `losses_s` are what the conflicts
    are expected to cost: holds that cost more are left out.
    """
    standing = standing or {}
    held = frozenset(hold.robot for advice in standing.values() for hold in advice.holds)
    plan = plan_holds(near, conflicts, window, burdens_s=burdens_s, held_before=held, settings=settings)
    decision = decide(plan, conflicts, standing, settings.switch_s)
    parts, advice = PlanParts(decision.plan), PairAdvice()
    for pair in conflicts:
        before = standing.get(pair)
        if before is None:
            advice[pair] = _pair_advice(parts, pair, None)
        elif decision.stands and before.holds:
            advice[pair] = before
        else:
            after = _pair_advice(parts, pair, before)
            advice[pair] = before if _is_same(before, after) else _changed(before, after, decision.because)
    return advice if losses_s is None else _worth_their_time(advice, standing, losses_s)


def _worth_their_time(
    advice: PairAdvice, standing: Mapping[Pair, Recommendation], losses_s: Mapping[Pair, float]
) -> PairAdvice:
    """The advice without holds that cost more than the conflicts which they resolve are expected to cost."""
    held = {pair: frozenset(hold.robot for hold in given.holds) for pair, given in advice.items() if given.holds}
    kept = PairAdvice(advice)
    for pair, robots in held.items():
        saved_s = sum(losses_s[other] for other, others in held.items() if others <= robots)
        before = standing.get(pair, NOT_WORTH)
        if sum(hold.hold_s for hold in advice[pair].holds) * (KEPT_SHARE if before.holds else 1.0) > saved_s:
            kept[pair] = _changed(before, NOT_WORTH, COSTS_MORE) if before.holds else NOT_WORTH
    return kept


def _is_same(before: Recommendation, after: Recommendation) -> bool:
    """Whether both ask the same of the same robots, without holds: the time for which counts from the first."""
    if before.holds or after.holds or not after.actions:
        return False
    first, second = ([(a.robot, a.action, a.speed_mps, a.where) for a in each.actions] for each in (before, after))
    return first == second


def _changed(before: Recommendation, after: Recommendation, because: str) -> Recommendation:
    """The advice `after`, which says why it takes the place of `before`."""
    if not because and (before.holds or before.actions):
        because = HOLD_WORKS if after.holds and not before.holds else NO_LONGER_WORKS
    return after.model_copy(update={"changed_because": because})


def _pair_advice(parts: PlanParts, pair: Pair, before: Recommendation | None) -> Recommendation:
    plan = parts.plan
    is_planned = pair not in plan.unplanned
    problem, holds = plan.problem, parts.of(pair) if is_planned else {}
    cost, bound = problem.cost(holds), _bound(plan, holds, pair)
    first_cost = _first_come_cost(plan, holds, pair)
    actions = chosen_actions(parts, pair, holds, before)
    return Recommendation(
        holds=tuple(Hold(robot=robot, hold_s=hold * STEP_S) for robot, hold in holds.items()),
        actions=actions,
        cost_s=_seconds(cost),
        bound_s=_seconds(bound),
        first_come_cost_s=None if first_cost is None else _seconds(first_cost),
        expected_saving_s=0.0 if first_cost is None else _seconds(max(first_cost - cost, 0)),
        proven_optimal=is_planned and bound == cost,
        note="" if is_planned else _no_plan(plan, pair, actions),
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


def _no_plan(plan: HoldPlan, pair: Pair, actions: Sequence[Action]) -> str:
    """Who has no plan together, and what they need instead."""
    robots, problem = plan.unplanned[pair], plan.problem
    names = [problem.planned[robot].name for robot in robots]
    what = f"no hold keeps {names[0]} and {names[1]} apart" if robots == pair else f"no hold works for {listed(names)}"
    return f"{what}: {action_text(actions[0])}" if actions else what


def _seconds(cost: int) -> float:
    return cost * STEP_S / WEIGHT
