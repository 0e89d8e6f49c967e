"""The plans of robots as their fleets know them: along their own paths, at their own speed, in the order of their
fleet.

A plan ignores robots of other fleets. A robot that stands because of one plans to continue at once.
"""

from dataclasses import dataclass

import numpy as np

from deconflict.simulation.driving.braking import MOVING_MPS
from deconflict.simulation.driving.motion import BACKING_MPS, Activity
from deconflict.simulation.driving.protection import NOBODY
from deconflict.simulation.driving.routes import SAMPLE_M
from deconflict.simulation.driving.traffic import RIDE_S, World
from deconflict.simulation.floor_layout import BayKind
from deconflict.simulation.trips import NOWHERE
from ingest.batch import Floats, Ints

FOLLOWS_S = 0.5
"""Time gap between a robot and the robot of its own fleet ahead of it."""
BACKS_S = 3.0
"""A robot that does not drive is assumed to stand for at least this long."""
HELD_UP_M = 3.0
"""A robot that drives slowly for a reason plans to do so over this distance."""

PlannedWaits = list[tuple[float, float]]
"""Where a robot waits for others of its fleet: progress in metres, and duration in seconds."""


@dataclass(frozen=True, slots=True, eq=False)
class FleetPlan:
    """The planned motion of a robot: linear between knots, and standing after the last."""

    after_s: Floats
    """(k,) seconds from now, increasing. The first is 0."""
    poses: Floats
    """(k, 3) x, y, yaw of the location, yaw not wrapped."""
    floors: Ints
    """(k,) floor from each knot on."""

    def at(self, after_s: Floats) -> tuple[Floats, Ints]:
        """Poses (m, 3) and floors (m,) at these times from now."""
        last = np.searchsorted(self.after_s, after_s, side="right") - 1
        along = np.stack([np.interp(after_s, self.after_s, self.poses[:, column]) for column in range(3)], axis=-1)
        changes = self.floors[np.minimum(last + 1, len(self.floors) - 1)] != self.floors[last]
        return np.where(changes[:, None], self.poses[last], along), self.floors[last]


def plan_of(world: World, row: int, floor: int, here: Floats, waits: PlannedWaits) -> FleetPlan:
    """The plan of a robot of the world whose location is `here`."""
    doing, left_s = world.doing[row], float(world.until_s[row] - world.t_s)
    if doing == Activity.DRIVING:
        plan = _driving(world, row, floor, here, waits)
        instructed_mps, instructed_s = world.instructions.top_of_mps(row, world.t_s)
        return _later(plan, instructed_s) if instructed_mps == 0.0 else plan
    if doing == Activity.BACKING:
        return _backing(world, row, floor, here)
    if doing == Activity.HOLDING and left_s > 0:
        return _later(_driving(world, row, floor, here, waits), left_s)
    if doing == Activity.STANDING and world.trips.beyond[row] != NOWHERE:
        return _riding(world, row, np.zeros(1), here[None, :], floor, left_s)
    return FleetPlan(np.zeros(1), here[None, :], np.array([floor]))


def _later(plan: FleetPlan, wait_s: float) -> FleetPlan:
    after_s = np.concatenate([[0.0], plan.after_s + wait_s])
    return FleetPlan(after_s, np.vstack([plan.poses[:1], plan.poses]), np.concatenate([plan.floors[:1], plan.floors]))


def _driving(world: World, row: int, floor: int, here: Floats, waits: PlannedWaits) -> FleetPlan:
    """A plan to the end of its drive. It accelerates from its present speed to the speed limit of the path."""
    x, y, yaw, limit_mps = world.tracks.samples(row)
    step_m, progress_m = world.tracks.step_m[row], world.progress_m[row]
    ahead = int(progress_m / step_m) + 1
    gaps_m = np.full(len(x) - ahead, step_m)
    if not len(gaps_m):
        return FleetPlan(np.zeros(1), here[None, :], np.array([floor]))
    gaps_m[0] = max(ahead * step_m - progress_m, 1e-6)
    driven_m = np.cumsum(gaps_m)
    gain = world.members[row].make.gain_mps2
    now_mps = max(float(world.speed_mps[row]), MOVING_MPS)
    most_mps = np.where(driven_m < HELD_UP_M, world.braking.top_of_mps(row, world.t_s), np.inf)
    speeds = np.minimum(limit_mps[ahead:] * world.pace[row], np.sqrt(now_mps**2 + 2 * gain * driven_m))
    instructed_mps, instructed_s = world.instructions.top_of_mps(row, world.t_s)
    if 0.0 < instructed_mps < np.inf:
        most_mps = np.where(driven_m < instructed_mps * instructed_s, np.minimum(most_mps, instructed_mps), most_mps)
    speeds = np.minimum(speeds, np.maximum(most_mps, MOVING_MPS))
    mean_mps = (np.concatenate([[now_mps], speeds[:-1]]) + speeds) / 2
    after_s = np.concatenate([[0.0], np.cumsum(gaps_m / mean_mps)])
    after_s[1:] = _in_order(world, row, after_s[1:], driven_m, waits)
    aside_m = world.passings.aside_ahead_m(row, float(world.aside_m[row]), float(progress_m), driven_m)
    x, y = x[ahead:] - np.sin(yaw[ahead:]) * aside_m, y[ahead:] + np.cos(yaw[ahead:]) * aside_m
    poses = np.vstack([here, np.column_stack([x, y, yaw[ahead:]])])
    goal = world.trips.layout.bays[world.trips.goal[row]]
    if goal.kind is BayKind.LIFT:
        return _riding(world, row, after_s, poses, floor, float(after_s[-1]) + RIDE_S)
    return FleetPlan(after_s, poses, np.full(len(after_s), floor))


def _in_order(world: World, row: int, after_s: Floats, driven_m: Floats, waits: PlannedWaits) -> Floats:
    """(k,) times at which it will have driven so far, given the order of its own fleet."""
    for at_m, wait_s in waits:
        after_s = after_s + wait_s * (world.progress_m[row] + driven_m > at_m)
    leader = int(world.braking.behind[row])
    if leader == NOBODY or world.person[row]:
        return after_s
    way_m = np.maximum(driven_m - world.braking.behind_m[row], 0.0)
    return np.where(way_m > 0, np.maximum(after_s, _driven_s(world, leader, way_m) + FOLLOWS_S), after_s)


def _driven_s(world: World, robot: int, way_m: Floats) -> Floats:
    """(k,) times at which a robot will have driven `way_m`. It stands until it may continue."""
    doing, make = world.doing[robot], world.members[robot].make
    starts_s = 0.0 if doing == Activity.DRIVING else max(float(world.until_s[robot] - world.t_s), BACKS_S)
    now_mps = max(float(world.speed_mps[robot]), 0.0)
    gains_m = (make.max_speed_mps**2 - now_mps**2) / (2 * make.gain_mps2)
    gaining_s = (np.sqrt(now_mps**2 + 2 * make.gain_mps2 * np.minimum(way_m, gains_m)) - now_mps) / make.gain_mps2
    return starts_s + gaining_s + np.maximum(way_m - gains_m, 0.0) / make.max_speed_mps


def _riding(world: World, row: int, after_s: Floats, poses: Floats, floor: int, out_s: float) -> FleetPlan:
    """A plan that continues with the lift, which it leaves after `out_s`."""
    out = world.trips.other_floor(row)
    pose = [*out.place, world.trips.layout.heading_rad(out)]
    floors = np.append(np.full(len(after_s), floor), out.floor)
    return FleetPlan(np.append(after_s, max(out_s, float(after_s[-1]) + 1e-3)), np.vstack([poses, pose]), floors)


def _backing(world: World, row: int, floor: int, here: Floats) -> FleetPlan:
    back_m = max(float(world.progress_m[row] - world.back_to_m[row]), 0.0)
    steps_m = np.linspace(0.0, back_m, max(2, int(back_m / SAMPLE_M)))
    x, y, yaw = world.tracks.poses(np.array(row), world.progress_m[row] - steps_m)
    aside_m = world.aside_m[row]
    poses = np.column_stack([x - np.sin(yaw) * aside_m, y + np.cos(yaw) * aside_m, yaw])
    poses[0] = here
    after_s = np.linspace(0.0, max(back_m / BACKING_MPS, 1e-3), len(steps_m))
    return FleetPlan(after_s, poses, np.full(len(after_s), floor))
