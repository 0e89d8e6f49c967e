"""The state of one robot at a moment: everything that its vendor's dialect can report."""

from dataclasses import dataclass

from deconflict.simulation.crossing_schedule import CrossingSchedule
from deconflict.simulation.driving.motion import Activity
from deconflict.simulation.driving.traffic import RIDE_S, World
from deconflict.simulation.fleet_plans import FleetPlan, plan_of
from deconflict.simulation.floor_layout import BayKind
from deconflict.simulation.participants import Participant
from deconflict.simulation.trips import NOWHERE
from ingest.batch import Ints

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
