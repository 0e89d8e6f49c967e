"""A robot that moves otherwise than it forecasts: slower along its path, or back. And the proof that this helps.

The proof is the sweep that proves holds. A motion is proven if the robot keeps apart from the other robot of the
conflict until it has had its whole horizon, however late it is, and meets nobody whom it would not meet anyway. It ends
where forecasts end that are continued: twice the longest hold after the horizon.
"""

from collections.abc import Sequence
from itertools import chain
from typing import NamedTuple

import numpy as np

from deconflict.advice.holds.hold_planner import HoldPlan
from deconflict.advice.holds.hold_problem import HoldProblem
from deconflict.advice.holds.hold_windows import SHORT_S, STEP_S, NearbyRobots
from deconflict.sweep.geometry.knots import KNOT, Knots, Robots, delayed
from deconflict.sweep.shapes.trains import with_trailers
from deconflict.sweep.sweep_once import first_contacts
from ingest.batch import Ints, Pair

STANDS_S = 600.0
"""A robot that backs out stands behind for longer than any sweep looks."""


class Motion(NamedTuple):
    """One robot's changed motion."""

    robot: str
    knots: Knots
    """From the start on; velocities are not filled."""
    late_s: float
    """How much later than by its forecast it gets through."""
    trailers: Sequence[Knots] = ()
    """From the start on, of each trailer that it pulls."""


def own_knots(problem: HoldProblem, robot: str) -> Knots:
    """A robot's knots, from its pose at the start on."""
    near = problem.planned.near
    return _knots_from(near, near.uuids.index(robot), problem.window.start_s)


def trailer_knots(problem: HoldProblem, robot: str) -> list[Knots]:
    """The knots of a robot's trailers, from their poses at the start on."""
    near = problem.planned.near
    return [_knots_from(near, row, problem.window.start_s) for row in _trailer_rows(near, near.uuids.index(robot))]


def _trailer_rows(near: NearbyRobots, row: int) -> list[int]:
    """The rows of the trailers that the robot of a row pulls."""
    train, first = near.robots["train"], len(near.uuids)
    rows: list[int] = (first + np.flatnonzero((train[first:] == train[row]) & (train[row] > 0))).tolist()
    return rows


def _knots_from(near: NearbyRobots, row: int, start_s: float) -> Knots:
    body = near.robots[row]
    return _cut(near.knots[body["first"] : body["first"] + body["count"]], start_s)


def _cut(knots: Knots, from_s: float) -> Knots:
    """The knots from a time on, the first of them at this time."""
    first = max(int(np.searchsorted(knots["t"], from_s, side="right")) - 1, 0)
    rest = knots[first:].copy()
    passed_s = from_s - rest["t"][0]
    for field, rate in (("x", "vx"), ("y", "vy"), ("yaw", "turn"), ("reported_yaw", "turn")):
        rest[field][0] += rest[rate][0] * passed_s
    rest["t"][0] = from_s
    return rest


def slowed(knots: Knots, share: float, lasting_s: float) -> Knots:
    """The knots of a robot that drives at this share of its speeds for `lasting_s`, then as fast as before."""
    start_s = knots["t"][0]
    change_s = start_s + share * lasting_s
    slow = knots[knots["t"] < change_s].copy()
    slow["t"] = start_s + (slow["t"] - start_s) / share
    if len(slow) == len(knots):
        return slow
    after = _cut(knots, change_s)
    after["t"] += lasting_s - share * lasting_s
    return np.concatenate([slow, after])


def backed(knots: Knots, distance_m: float, speed_mps: float) -> Knots:
    """The knots of a robot that drives straight back on its track, and then stands."""
    pose = knots[0]
    speed = float(np.hypot(pose["vx"], pose["vy"]))
    yaw = pose["yaw"]
    ahead = (pose["vx"] / speed, pose["vy"] / speed) if speed > 0.0 else (np.cos(yaw), np.sin(yaw))
    back = np.repeat(knots[:1], 3)
    back["x"][1:] -= distance_m * ahead[0]
    back["y"][1:] -= distance_m * ahead[1]
    back["t"] += np.array([0.0, distance_m / speed_mps, STANDS_S])
    return back


def proven(plan: HoldPlan, pair: Pair, motions: Sequence[Motion]) -> list[bool]:
    """Whether each motion of a robot of `pair` keeps it apart and brings no other pair together.

    The other robots are held as the plan says. The robot itself moves instead of its hold, with its trailers.
    """
    near, window, planned = plan.problem.planned.near, plan.problem.window, plan.found.plan
    rows, others = np.array([near.uuids.index(motion.robot) for motion in motions]), len(near.uuids)
    robots, knots = _with(near, rows, motions)
    hold_s = np.array([planned.get(uuid, 0) * STEP_S for uuid in near.uuids], np.float64)
    each, hold_s, trailers = with_trailers(near.robots, others, np.arange(others), hold_s)
    moved = len(each)
    each = np.concatenate([each, np.arange(len(near.robots), len(robots))])
    hold_s = np.concatenate([hold_s, np.zeros(len(each) - moved)])
    trailers |= _places_of_trailers(moved, motions)
    until = (window.start_s, window.horizon_s, SHORT_S, 2 * window.longest_hold_s)
    late = delayed(robots, knots, each, hold_s, *until)
    number, other = np.divmod(np.arange(len(motions) * others), others)
    is_other = other != rows[number]
    number, other = number[is_other], other[is_other]
    late_s = np.clip([motion.late_s for motion in motions], hold_s.max(), 2 * window.longest_hold_s)[number]
    a, b = np.concatenate([moved + number, rows[number]]), np.concatenate([other, other])
    until_s = np.tile(window.start_s + window.horizon_s + late_s, 2)
    start_s, clearance_m = window.start_s, window.clearance_m
    contact_s, _ = first_contacts(
        *late, a, b, now_s=start_s, until_s=until_s, clearance_m=clearance_m, trailers=trailers
    )
    meets, met_before = (contact_s < np.inf).reshape(2, len(motions), others - 1)
    partners = [_place_of_other(near.uuids, pair, motion.robot) for motion in motions]
    keeps_apart = ~meets[np.arange(len(motions)), partners]
    helps: list[bool] = (keeps_apart & ~(meets & ~met_before).any(axis=1)).tolist()
    return helps


def _place_of_other(uuids: Sequence[str], pair: Pair, robot: str) -> int:
    """Where the other robot of a pair is among all robots but `robot`."""
    return [uuid for uuid in uuids if uuid != robot].index(pair[pair[0] == robot])


def _places_of_trailers(first: int, motions: Sequence[Motion]) -> dict[int, list[int]]:
    """The places of the trailers of each motion's robot. The robots are at `first` and after it, then all trailers."""
    places, after = dict[int, list[int]](), first + len(motions)
    for number, motion in enumerate(motions):
        if motion.trailers:
            places[first + number] = list(range(after, after + len(motion.trailers)))
            after += len(motion.trailers)
    return places


def _with(near: NearbyRobots, rows: Ints, motions: Sequence[Motion]) -> tuple[Robots, Knots]:
    """The robots, followed by a copy of each of `rows` with its changed motion, and by copies of their trailers."""
    pulled = [
        row
        for pulling, motion in zip(rows.tolist(), motions, strict=True)
        if motion.trailers
        for row in _trailer_rows(near, pulling)
    ]
    changed = [*(motion.knots for motion in motions), *chain.from_iterable(motion.trailers for motion in motions)]
    copies = near.robots[[*rows.tolist(), *pulled]]
    copies["count"] = [len(knots) for knots in changed]
    copies["first"] = len(near.knots) + np.cumsum(copies["count"]) - copies["count"]
    return np.concatenate([near.robots, copies]), np.concatenate([near.knots, *changed]).astype(KNOT)
