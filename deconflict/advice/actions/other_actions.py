"""Actions beside waiting: slowing down, backing out, another route, and having a person look."""

from collections.abc import Iterator, Sequence
from math import floor, inf
from typing import NamedTuple

import numpy as np

from deconflict.advice.actions.changed_motion import Motion, backed, own_knots, proven, slowed, trailer_knots
from deconflict.advice.actions.looking import FIND_CAUSE
from deconflict.advice.holds.hold_planner import HoldPlan
from deconflict.advice.holds.hold_problem import HoldProblem
from deconflict.sweep.geometry.knots import Knots
from deconflict_client.advisory import Action
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
