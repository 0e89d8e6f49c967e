"""What one robot knows of itself at a moment: all that its vendor's dialect can tell."""

from dataclasses import dataclass

import numpy as np

from deconflict.simulation.cast import Member
from deconflict.simulation.crossing_schedule import Schedule
from deconflict.simulation.driving.traffic import RIDE_S, Doing, World
from deconflict.simulation.driving.trips import NOWHERE
from deconflict.simulation.fleet_plans import Plan, plan_of
from deconflict.simulation.floor_layout import BayKind
from ingest.batch import Ints

WAITING_AFTER_S = 3.0
"""A robot that others have kept standing for so long says that it waits."""
BATTERY_LOW = 20.0
FULL_RUN_H = 8.0


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
    schedule, found = Schedule(world), []
    for row in rows.tolist():
        plan = plan_of(world, row, int(floors[row]), locations[row], schedule.waits(row))
        found.append(
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
    return found


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
    waits = doing == Doing.HOLDING or world.waited_s[row] > WAITING_AFTER_S
    if waits and world.members[row].make.tells_waiting:
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
