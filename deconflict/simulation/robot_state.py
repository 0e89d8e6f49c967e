"""The state of one robot at a moment: everything that its vendor's dialect can report."""

from dataclasses import dataclass

import numpy as np

from deconflict.simulation.driving.crossings import CrossingPassage
from deconflict.simulation.driving.motion import Activity
from deconflict.simulation.driving.traffic import RIDE_S, World
from deconflict.simulation.fleet_plans import FleetPlan, plan_of
from deconflict.simulation.floor_layout import BayKind
from deconflict.simulation.participants import Participant
from deconflict.simulation.trips import NOWHERE
from ingest.batch import Ints

AHEAD_M = 18.0
"""Crossings are planned up to this distance ahead."""
START_S = 0.8
"""Time that a standing robot loses until it reaches its speed."""


@dataclass(frozen=True, slots=True)
class CrossingArrival:
    """One robot at one crossing, as its fleet plans it."""

    robot: int
    """Row of the robot."""
    passage: CrossingPassage
    enter_s: float
    """When it enters, seconds from now."""
    leave_s: float
    """When it has left, seconds from now."""


class CrossingSchedule:
    """The plans of every fleet for its crossings, at one moment."""

    def __init__(self, world: World) -> None:
        self._world = world
        self._by_robot: dict[int, list[CrossingArrival]] = {}
        self._by_place: dict[tuple[int, int], list[CrossingArrival]] = {}
        """By fleet and crossing."""
        rows = np.flatnonzero((world.doing == Activity.DRIVING) & ~world.person)
        until_m = world.progress_m + AHEAD_M
        every = [
            (row, passage)
            for row, end_m in zip(rows.tolist(), until_m[rows].tolist(), strict=True)
            for passage in world.crossings.ahead[row]
            if passage.enter_m < end_m
        ]
        if not every:
            return
        robots = np.array([row for row, _ in every])
        now_s = world.tracks.seconds(robots, world.progress_m[robots]) - START_S * (world.speed_mps[robots] < 0.3)
        enter_s, leave_s = (
            (world.tracks.seconds(robots, np.array(at_m)) - now_s).tolist()
            for at_m in ([passage.enter_m for _, passage in every], [passage.leave_m for _, passage in every])
        )
        for (row, passage), in_s, out_s in zip(every, enter_s, leave_s, strict=True):
            due = CrossingArrival(row, passage, in_s, out_s)
            self._by_robot.setdefault(row, []).append(due)
            self._by_place.setdefault((int(world.fleet[row]), passage.node), []).append(due)

    def waits(self, robot: int) -> list[tuple[float, float]]:
        """Where a robot will wait for others of its fleet: progress in metres, and duration in seconds."""
        found, late_s = list[tuple[float, float]](), 0.0
        mine = self._by_robot.get(robot, [])
        if mine and self._world.crossings.is_inside(robot):
            mine = mine[1:]
        for due in mine:
            others = self._by_place[int(self._world.fleet[robot]), due.passage.node]
            free_s = max((other.leave_s for other in others if self._goes_first(other, due)), default=0.0)
            wait_s = free_s - (due.enter_s + late_s)
            if wait_s > 0:
                found.append((due.passage.enter_m, wait_s))
                late_s += wait_s
        return found

    def _goes_first(self, due: CrossingArrival, other: CrossingArrival) -> bool:
        if due.robot == other.robot or not due.passage.meets(other.passage):
            return False
        first = self._world.crossings.ahead[due.robot][0] is due.passage
        return (first and self._world.crossings.is_inside(due.robot)) or due.enter_s < other.enter_s


WAITING_AFTER_S = 3.0
"""A robot reports that it waits if others have blocked it for this long."""
BATTERY_LOW = 20.0


@dataclass(frozen=True, slots=True, eq=False)
class RobotState:
    """One robot at a moment. The location is in its floor's frame."""

    member: Participant
    t_s: float
    """World time."""
    floor: int
    x_m: float
    y_m: float
    yaw_rad: float
    linear_mps: float
    """Speed along the heading; negative if it drives backwards."""
    state: str
    """As the standard's schema spells it."""
    battery_pct: float
    plan: FleetPlan
    destinations: tuple[tuple[float, int, float, float, float], ...]
    """Seconds from now, floor, x, y and yaw of each stop ahead."""
    turn_radps: float = 0.0
    load_pct: float = 0.0
    """Share of its capacity in use."""
    errors: tuple[str, ...] = ()


def robot_states(world: World, rows: Ints) -> list[RobotState]:
    """The states of the members in these rows of the world."""
    locations, velocities, floors = world.locations(), world.velocities(), world.floor
    schedule, found = CrossingSchedule(world), []
    for row in rows.tolist():
        plan = plan_of(world, row, int(floors[row]), locations[row], schedule.waits(row))
        found.append(
            RobotState(
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


def _destinations(world: World, row: int, plan: FleetPlan) -> tuple[tuple[float, int, float, float, float], ...]:
    """The bay it drives to, and the bay beyond the lift, if any. From there it needs about a second for each metre."""
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
    if doing == Activity.STANDING:
        riding = world.trips.beyond[row] != NOWHERE
        return "navigating" if riding else _STANDING[kind]
    if doing == Activity.HALTED:
        return "idle" if world.person[row] else "waitingHumanEvent"
    is_instructed = world.instructions.waits(row, world.t_s)
    waits = is_instructed or doing == Activity.HOLDING or world.waits.waited_s[row] > WAITING_AFTER_S
    if waits and world.members[row].make.tells_waiting:
        return "waitingExternalEvent"
    return "navigating"


_STANDING = {
    BayKind.RACK: "waitingExternalEvent",
    BayKind.PICK: "waitingExternalEvent",
    BayKind.DOCK: "waitingExternalEvent",
    BayKind.CHARGER: "charging",
    BayKind.PARKING: "idle",
    BayKind.LIFT: "waitingExternalEvent",
}


def _errors(world: World, row: int) -> tuple[str, ...]:
    if world.person[row]:
        return ()
    codes = {"Robot Stuck": world.doing[row] == Activity.HALTED, "Battery Low": world.battery_pct[row] < BATTERY_LOW}
    return tuple(code for code, holds in codes.items() if holds)
