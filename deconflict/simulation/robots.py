"""What one robot knows of itself at a moment: all that its vendor's dialect can tell."""

from dataclasses import dataclass

import numpy as np

from deconflict.simulation.cast import Member
from deconflict.simulation.driving.routes import SAMPLE_M
from deconflict.simulation.driving.traffic import BACKING_MPS, MOVING_MPS, RIDE_S, Doing, World
from deconflict.simulation.driving.trips import NOWHERE
from deconflict.simulation.layout import BayKind
from ingest.seam import Floats, Ints

WAITING_AFTER_S = 3.0
"""A robot that others have kept standing for so long says that it waits."""
BATTERY_LOW = 20.0
FULL_RUN_H = 8.0


@dataclass(frozen=True, slots=True, eq=False)
class Plan:
    """Where a robot means to be, others or not: linear between knots, and standing after the last."""

    after_s: Floats
    """(k,) from now, increasing; the first is 0."""
    poses: Floats
    """(k, 3) x, y, yaw of the location, yaw not wrapped."""
    floors: Ints
    """(k,) on which it is from that knot on."""

    def at(self, after_s: Floats) -> tuple[Floats, Ints]:
        """Poses (m, 3) and floors (m,) at these times from now."""
        last = np.searchsorted(self.after_s, after_s, side="right") - 1
        along = np.stack([np.interp(after_s, self.after_s, self.poses[:, column]) for column in range(3)], axis=-1)
        changes = self.floors[np.minimum(last + 1, len(self.floors) - 1)] != self.floors[last]
        return np.where(changes[:, None], self.poses[last], along), self.floors[last]


@dataclass(frozen=True, slots=True, eq=False)
class Robot:
    """One robot now; location in its floor's frame."""

    member: Member
    t_s: float
    """World time."""
    floor: int
    x_m: float
    y_m: float
    yaw_rad: float
    linear_mps: float
    """Along the heading; negative when it backs."""
    turn_radps: float
    state: str
    """As the standard's schema spells it."""
    battery_pct: float
    load_pct: float
    """Of its capacity in use."""
    errors: tuple[str, ...]
    plan: Plan
    destinations: tuple[tuple[float, int, float, float, float], ...]
    """Seconds from now, floor, x, y, yaw of the stops ahead."""

    @property
    def run_time_h(self) -> float:
        return FULL_RUN_H * self.battery_pct / 100


def robots(world: World) -> tuple[Robot, ...]:
    """Everybody."""
    return tuple(some_robots(world, np.arange(len(world))))


def some_robots(world: World, rows: Ints) -> list[Robot]:
    """The robots of these rows of the world."""
    locations, velocities, floors = world.locations(), world.velocities(), world.floor
    told = []
    for row in rows.tolist():
        plan = _plan(world, row, int(floors[row]), locations[row])
        told.append(
            Robot(
                member=world.members[row],
                t_s=world.t_s,
                floor=int(floors[row]),
                x_m=float(locations[row, 0]),
                y_m=float(locations[row, 1]),
                yaw_rad=float(locations[row, 2]),
                linear_mps=float(velocities[row, 0]),
                turn_radps=float(velocities[row, 1]),
                state=_state(world, row),
                battery_pct=float(world.battery_pct[row]),
                load_pct=float(world.load_pct[row]),
                errors=_errors(world, row),
                plan=plan,
                destinations=_destinations(world, row, plan),
            )
        )
    return told


def _plan(world: World, row: int, floor: int, here: Floats) -> Plan:
    doing = world.doing[row]
    if doing == Doing.DRIVING:
        return _driving(world, row, floor, here)
    if doing == Doing.BACKING:
        return _backing(world, row, floor, here)
    if doing == Doing.STANDING and world.trips.beyond[row] != NOWHERE:
        return _riding(world, row, np.zeros(1), here[None, :], floor, float(world.until_s[row] - world.t_s))
    return Plan(np.zeros(1), here[None, :], np.array([floor]))


def _driving(world: World, row: int, floor: int, here: Floats) -> Plan:
    """To the end of its drive, catching up from its present speed to the one that its way allows."""
    x, y, yaw, limit_mps = world.tracks.samples(row)
    step_m, progress_m = world.tracks.step_m[row], world.progress_m[row]
    ahead = int(progress_m / step_m) + 1
    gaps_m = np.full(len(x) - ahead, step_m)
    if not len(gaps_m):
        return Plan(np.zeros(1), here[None, :], np.array([floor]))
    gaps_m[0] = ahead * step_m - progress_m
    gain = world.members[row].make.gain_mps2
    now_mps = max(float(world.speed_mps[row]), MOVING_MPS)
    speeds = np.minimum(limit_mps[ahead:] * world.pace[row], np.sqrt(now_mps**2 + 2 * gain * np.cumsum(gaps_m)))
    mean_mps = (np.concatenate([[now_mps], speeds[:-1]]) + speeds) / 2
    after_s = np.concatenate([[0.0], np.cumsum(gaps_m / mean_mps)])
    poses = np.vstack([here, np.column_stack([x[ahead:], y[ahead:], yaw[ahead:]])])
    goal = world.trips.layout.bays[world.trips.goal[row]]
    if goal.kind is BayKind.LIFT:
        return _riding(world, row, after_s, poses, floor, float(after_s[-1]) + RIDE_S)
    return Plan(after_s, poses, np.full(len(after_s), floor))


def _riding(world: World, row: int, after_s: Floats, poses: Floats, floor: int, out_s: float) -> Plan:
    """And then the lift, out of which it comes after `out_s`."""
    out = world.trips.other_floor(row)
    pose = [*out.place, world.trips.layout.heading_rad(out)]
    floors = np.append(np.full(len(after_s), floor), out.floor)
    return Plan(np.append(after_s, max(out_s, float(after_s[-1]) + 1e-3)), np.vstack([poses, pose]), floors)


def _backing(world: World, row: int, floor: int, here: Floats) -> Plan:
    back_m = max(float(world.progress_m[row] - world.back_to_m[row]), 0.0)
    steps_m = np.linspace(0.0, back_m, max(2, int(back_m / SAMPLE_M)))
    poses = world.tracks.poses(np.array(row), world.progress_m[row] - steps_m).T
    poses[0] = here
    after_s = np.linspace(0.0, max(back_m / BACKING_MPS, 1e-3), len(steps_m))
    return Plan(after_s, poses, np.full(len(after_s), floor))


def _destinations(world: World, row: int, plan: Plan) -> tuple[tuple[float, int, float, float, float], ...]:
    """The bay it drives to, and the one beyond the lift, if any, at about a metre a second from there."""
    if world.trips.goal[row] == NOWHERE:
        return ()
    layout = world.trips.layout
    goal = layout.bays[world.trips.goal[row]]
    arrival_s = float(plan.after_s[plan.floors == plan.floors[0]][-1])
    found = [(arrival_s, goal.floor, *goal.place, layout.heading_rad(goal))]
    if world.trips.beyond[row] != NOWHERE:
        out, last = world.trips.other_floor(row), layout.bays[world.trips.beyond[row]]
        way_m = abs(last.place[0] - out.place[0]) + abs(last.place[1] - out.place[1])
        found.append((arrival_s + RIDE_S + way_m, last.floor, *last.place, layout.heading_rad(last)))
    return tuple(found)


def _state(world: World, row: int) -> str:
    doing, kind = world.doing[row], world.trips.at(row).kind
    if doing == Doing.STANDING:
        riding = world.trips.beyond[row] != NOWHERE
        return "navigating" if riding else _STANDING[kind]
    if doing == Doing.HALTED:
        return "idle" if world.person[row] else "waitingHumanEvent"
    if doing == Doing.HOLDING or world.waited_s[row] > WAITING_AFTER_S:
        return "waitingExternalEvent"
    return "navigating"


_STANDING = {
    BayKind.DOCK: "waitingExternalEvent",
    BayKind.CHARGER: "charging",
    BayKind.PARKING: "idle",
    BayKind.LIFT: "waitingExternalEvent",
}


def _errors(world: World, row: int) -> tuple[str, ...]:
    if world.person[row]:
        return ()
    told = {"Robot Stuck": world.doing[row] == Doing.HALTED, "Battery Low": world.battery_pct[row] < BATTERY_LOW}
    return tuple(code for code, holds in told.items() if holds)
