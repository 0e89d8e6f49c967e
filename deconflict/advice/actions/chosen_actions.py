"""Which actions a conflict's advice has for people: the cheapest that are proven."""

from deconflict.advice.actions.other_actions import another_route, back_out, slow_down
from deconflict.advice.actions.waiting import waits
from deconflict.advice.holds.hold_problem import Plan
from deconflict.advice.holds.plan_parts import PlanParts
from deconflict_client.advisory import Action, Recommendation
from ingest.batch import Pair

LONG_WAIT_S = 4.0
"""Slowing down is tried in place of a longer wait."""
WORTH_S = 1.0
"""Slowing down takes the place of waiting if it costs less by this."""


def chosen_actions(parts: PlanParts, pair: Pair, holds: Plan, before: Recommendation | None) -> tuple[Action, ...]:
    """The actions on a conflict: what resolves it, and who goes first. Of what is proven, what was advised `before`.

    If `holds` resolve it, one of the held robots slows down instead of a long wait, if that costs less, or of a wait
    that is too short for people. If no hold does, and both robots are on their way: slowing down, backing out, another
    route. Towards a robot that stands, and in a ring, only another route helps. People on foot go
    around what stands: nothing is asked of them.
    """
    plan = parts.plan
    if pair in plan.unplanned:
        return _without_plan(parts, pair, before)
    waiting = waits(parts, pair, holds) if holds else ()
    seconds = [action.seconds or 0.0 for action in waiting]
    if not holds or (waiting and max(seconds) <= LONG_WAIT_S):
        return waiting
    slowing = slow_down(plan, pair, [robot for robot in pair if robot in holds], _standing(before, "slow_down"))
    if slowing is None or (waiting and slowing[1] + WORTH_S > _cost_s(parts, waiting)):
        return waiting
    return _with_other(parts, pair, slowing[0], "slows down")


def _without_plan(parts: PlanParts, pair: Pair, before: Recommendation | None) -> tuple[Action, ...]:
    plan, planned = parts.plan, parts.plan.problem.planned
    on_foot = any(planned[robot].on_foot for robot in pair)
    if plan.unplanned[pair] == pair and all(planned[robot].holdable or planned[robot].on_foot for robot in pair):
        movers = sorted((robot for robot in pair if planned[robot].holdable), key=plan.problem.reluctance)
        if slowing := slow_down(plan, pair, movers, _standing(before, "slow_down")):
            return _with_other(parts, pair, slowing[0], "slows down")
        if backing := back_out(plan, pair, movers, _standing(before, "back_out")):
            return _with_other(parts, pair, backing, "backs out")
    if on_foot and plan.problem.first_to_yield(plan.unplanned[pair]) is None:
        return ()
    return (another_route(plan, pair, _standing(before, "take_another_route")),)


def _standing(before: Recommendation | None, kind: str) -> Action | None:
    return next((action for action in before.actions if action.action == kind), None) if before else None


def _cost_s(parts: PlanParts, waiting: tuple[Action, ...]) -> float:
    planned = parts.plan.problem.planned
    return sum((action.seconds or 0.0) * planned[action.robot].priority for action in waiting)


def _with_other(parts: PlanParts, pair: Pair, action: Action, does: str) -> tuple[Action, Action]:
    """An action of one robot of a pair, and that the other one goes first."""
    other = pair[pair[0] == action.robot]
    name = parts.plan.problem.planned[other].name
    return action, Action(robot=other, name=name, action="go_first", reason=f"{action.name} {does} for it")
