"""Which actions a conflict's advice has for people: the cheapest that are proven.

To wait, with holds that are long enough for people to pass on; to slow down, to back out, to take another route, or to
have a person look.
"""

from collections.abc import Iterator, Sequence
from math import floor, inf
from typing import NamedTuple

import numpy as np

from deconflict.advice.actions.action_text import FIND_CAUSE, SHORTEST_WAIT_S
from deconflict.advice.actions.changed_motion import Motion, backed, own_knots, proven, slowed, trailer_knots
from deconflict.advice.holds.hold_planner import HoldPlan
from deconflict.advice.holds.hold_problem import HoldProblem, Plan
from deconflict.advice.holds.hold_windows import STEP_S
from deconflict.advice.holds.plan_parts import PlanParts
from deconflict.sweep.geometry.knots import Knots
from deconflict_client.advisory import Action, Recommendation
from ingest.batch import Pair

SPEED_SHARES = (0.75, 0.5, 0.25)
LASTING_S = (4.0, 8.0)
"""Which lower speeds are tried, beside that of the other robot, and for how long, beside the whole horizon."""
SLOWEST_MPS = 0.2
"""No robot is asked to drive slower."""
BACK_M, BACK_MPS = (2.0, 4.0, 6.0), 0.5
"""How far back is tried, and how fast a robot backs."""


class Slowing(NamedTuple):
    """A robot drives slower for a while."""

    cost_s: float
    """How late it is at the horizon, weighted by priority."""
    speed_mps: float
    lasting_s: float
    motion: Motion


def slow_down(
    plan: HoldPlan, pair: Pair, robots: Sequence[str], standing: Action | None
) -> tuple[Action, float] | None:
    """The slower drive of one of `robots` that ends the conflict at the least cost, and the cost in seconds.

    At the same speed as by the `standing` action, if that still ends the conflict.
    """
    ways = [way for robot in robots for way in _slowings(plan, robot, pair[pair[0] == robot])]
    kept = (standing.robot, standing.speed_mps) if standing else None
    ways.sort(key=lambda way: ((way.motion.robot, way.speed_mps) != kept, way.cost_s, -way.speed_mps, way.motion.robot))
    helps = proven(plan, pair, [way.motion for way in ways]) if ways else []
    if True not in helps:
        return None
    best = ways[helps.index(True)]
    robot = best.motion.robot
    name = plan.problem.planned[robot].name
    action = Action(robot=robot, name=name, action="slow_down", seconds=best.lasting_s, speed_mps=best.speed_mps)
    return action, best.cost_s


def _slowings(plan: HoldPlan, robot: str, other: str) -> Iterator[Slowing]:
    problem, knots = plan.problem, own_knots(plan.problem, robot)
    trailers = trailer_knots(problem, robot)
    weight, horizon_s, usual_mps = problem.planned[robot].priority, problem.window.horizon_s, _speed_mps(knots)
    speeds_mps = {round(usual_mps * share, 1) for share in SPEED_SHARES}
    for speed_mps in sorted(speeds_mps | {floor(10 * _speed_mps(own_knots(problem, other))) / 10}):
        if not SLOWEST_MPS <= speed_mps < usual_mps:
            continue
        share = speed_mps / usual_mps
        for lasting_s in LASTING_S:
            late_s = lasting_s * (1 - share)
            motion = _slowed(robot, (knots, trailers), share, lasting_s, late_s)
            yield Slowing(weight * late_s, speed_mps, lasting_s, motion)
        motion = _slowed(robot, (knots, trailers), share, inf, horizon_s / share - horizon_s)
        yield Slowing(weight * horizon_s * (1 - share), speed_mps, horizon_s, motion)


def _slowed(robot: str, bodies: tuple[Knots, Sequence[Knots]], share: float, lasting_s: float, late_s: float) -> Motion:
    """The motion of a robot and its trailers at a share of its speeds. Trailers keep to the track that they have."""
    knots, trailers = bodies
    slow_trailers = [slowed(trailer, share, lasting_s) for trailer in trailers]
    return Motion(robot, slowed(knots, share, lasting_s), late_s, slow_trailers)


def _speed_mps(knots: Knots) -> float:
    """The highest speed."""
    return float(np.hypot(knots["vx"], knots["vy"]).max())


def back_out(plan: HoldPlan, pair: Pair, robots: Sequence[str], standing: Action | None) -> Action | None:
    """The shortest way straight back of the first of `robots` that can let the other one pass; of that which does so
    by the `standing` action, if it can. No robot that pulls trailers backs: they would fold."""
    problem = plan.problem
    backing = [robot for robot in robots if not trailer_knots(problem, robot)]
    ways = [(robot, back_m) for robot in backing for back_m in BACK_M]
    ways.sort(key=lambda way: standing is None or way[0] != standing.robot)
    motions = [
        Motion(robot, backed(own_knots(problem, robot), back_m, BACK_MPS), back_m / BACK_MPS) for robot, back_m in ways
    ]
    helps = proven(plan, pair, motions) if motions else []
    if True not in helps:
        return None
    robot, back_m = ways[helps.index(True)]
    other = pair[pair[0] == robot]
    helpful = {robot for (robot, _), works in zip(ways, helps, strict=True) if works}
    reason = _why_it_backs(problem, robot, other, other in backing, other in helpful)
    name = problem.planned[robot].name
    return Action(robot=robot, name=name, action="back_out", where=f"{back_m:g} m", reason=reason)


def _why_it_backs(problem: HoldProblem, robot: str, other: str, can_back: bool, would_help: bool) -> str:
    """Why this robot of two backs out, for a person. `can_back` and `would_help` are about the other one."""
    name, other_name = problem.planned[robot].name, problem.planned[other].name
    if not can_back:
        return f"{other_name} pulls trailers and can't"
    if not would_help:
        return f"if {other_name} backed out, they would still meet, or it would meet another robot"
    if problem.weight(robot) < problem.weight(other):
        return f"{other_name} has the higher priority"
    vendor, other_vendor = problem.planned[robot].vendor, problem.planned[other].vendor
    if problem.burdens_s.get(vendor, 0.0) < problem.burdens_s.get(other_vendor, 0.0):
        return f"robots of {vendor} have waited less by advice so far than those of {other_vendor}"
    return f"{name} or {other_name} could, one is enough"


def another_route(plan: HoldPlan, pair: Pair, standing: Action | None) -> Action:
    """Who of a conflict without a plan needs another route; if all of them stand, a person has to look.

    It is proven only in that the others keep apart if this robot is not there: which way is free is not known.
    """
    problem, robots = plan.problem, plan.unplanned[pair]
    leaves = problem.first_to_yield(robots)
    if leaves is None:
        name = problem.planned[pair[0]].name
        reason = "none of them is about to move"
        return Action(robot=pair[0], name=name, action="look", reason=reason, task=FIND_CAUSE)
    if standing and robots == pair and problem.first_to_yield([standing.robot]) and standing.robot in robots:
        leaves = standing.robot
    return Action(robot=leaves, name=problem.planned[leaves].name, action="take_another_route")


STEPS_A_SECOND = round(1 / STEP_S)
SHORTEST_STEPS = round(SHORTEST_WAIT_S / STEP_S)


def waits(parts: PlanParts, pair: Pair, holds: Plan) -> tuple[Action, ...]:
    """Who of a pair waits, and those that have to wait because of them; then who goes first.

    Empty if the holds are too short for people, and longer ones do not keep the pair apart.
    """
    long = _long_enough(parts, pair, holds)
    if not long:
        return ()
    name_of = {robot: parts.plan.problem.planned[robot].name for robot in {*pair, *long}}
    own = [robot for robot in pair if robot in long]
    others = sorted(long.keys() - set(own))
    first = [robot for robot in pair if robot not in long]
    because = f"it would come too near to {name_of[own[0]]} otherwise" if own else ""
    return (
        *(Action(robot=robot, name=name_of[robot], action="wait", seconds=long[robot] * STEP_S) for robot in own),
        *(
            Action(robot=robot, name=name_of[robot], action="wait", seconds=long[robot] * STEP_S, reason=because)
            for robot in others
        ),
        *(
            Action(robot=robot, name=name_of[robot], action="go_first", reason=f"{name_of[own[0]]} waits for it")
            for robot in first
            if own
        ),
    )


def _long_enough(parts: PlanParts, pair: Pair, holds: Plan) -> Plan:
    """Holds of which none is too short for people, and which are proven; none if there are none."""
    return next((plan for plan in _longer(parts, pair, holds) if plan == holds or parts.is_kept_apart(pair, plan)), {})


def _longer(parts: PlanParts, pair: Pair, holds: Plan) -> Iterator[Plan]:
    """The holds in whole seconds, the short ones made longer; the holds as they are; for one robot also the shortest
    hold that is long enough.

    They hold nobody else: a machine may follow the holds of the same advice.
    """
    problem = parts.plan.problem
    longer = {robot: max(hold + hold % STEPS_A_SECOND, SHORTEST_STEPS) for robot, hold in holds.items()}
    if max(longer.values()) <= problem.window.steps:
        yield longer
    if min(holds.values()) >= SHORTEST_STEPS:
        yield holds
    if len(holds) == 1 and pair in problem.allowed:
        sign = 1 if pair[0] in holds else -1
        steps = sign * (problem.allowed[pair].nonzero()[0] - problem.window.steps)
        long_enough = steps[steps > SHORTEST_STEPS]
        if len(long_enough):
            yield dict.fromkeys(holds, int(long_enough.min()))


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
