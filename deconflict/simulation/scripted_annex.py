"""An annex south of the hall, in which robots follow a script: a charger for two robots, a single lane, a tugger train.

The script repeats. Robots queue for the charger. Two robots enter the lane from both ends, stand face to face until
one backs out, and change sides. The train drives its round. No other robot comes here.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import atan2, cos, dist, hypot, pi, sin

import numpy as np

from deconflict.simulation.fleet_plans import FleetPlan
from deconflict.simulation.floor_layout import GROUND, Place
from deconflict.simulation.participants import TUG, Participant, VendorName
from deconflict.simulation.robot_state import RobotState
from ingest.frames.angles import turn_between

FEWEST = 16
"""With fewer participants there are no robots for the annex."""
ROLES = (VendorName.ALDER, VendorName.CORVID, VendorName.BASALT, VendorName.ALDER, VendorName.CORVID)
"""The first two use the lane, the next two the charger, the last pulls trailers."""
CHARGING, TRAIN = (2, 3), 4
"""Rows of those that charge, and of the one that pulls trailers."""
LANE_Y_M, WEST_M, EAST_M = -5.0, 2.0, 26.0
HALF_S = 240.0
"""After this time the two in the lane have changed sides."""
CHARGER: Place = (14.0, -11.0)
WAITING: tuple[Place, ...] = ((4.0, -11.0), (24.0, -11.0))
ROUND_S = 220.0
"""Each robot charges once in this time."""
TURN_S = 55.0
"""Time from the first robot's turn at the charger to the second robot's turn."""
CHARGE_S = (10.0, 43.0)
"""When in its turn a robot arrives at the charger and leaves it."""
WISH_S = 25.0
"""When in the first robot's turn the second would arrive if the charger were free."""
BEGINS_S = 12.0
"""Start time within the script, with the first robot at the charger."""
PACE_MPS = 1.0
YARD_M = (34.0, -17.0, 62.0, -5.0)
"""West, south, east and north side of the train's round."""
CORNER_M, CHORD_RAD = 3.0, pi / 16
"""Radius of its corners, and the angle of each of the straight pieces of which they consist."""
STATION_M, STATION_S = 48.0, 25.0
"""x of its stop on the north side, and how long it stays."""


@dataclass(frozen=True, slots=True)
class ScriptStep:
    """One step of a script: the robot moves straight to `to` until `until_s`."""

    until_s: float
    """Time since the start of the script."""
    to: Place
    """x and y in the frame of the ground hall."""
    state: str = "navigating"
    """The operational state that it reports."""
    means: Place | None = None
    """The destination that it announces, if it is not `to`."""
    backs: bool = False
    """Whether it drives backwards."""


_WEST, _EAST = (WEST_M, LANE_Y_M), (EAST_M, LANE_Y_M)
_NOSE, _OTHER_NOSE = (13.3, LANE_Y_M), (14.7, LANE_Y_M)
_NORTH, _SOUTH = (EAST_M, LANE_Y_M + 3), (EAST_M, LANE_Y_M - 3)
THROUGH = (
    ScriptStep(5.0, _WEST, "waitingExternalEvent"),
    ScriptStep(16.3, _NOSE, means=_EAST),
    ScriptStep(62.0, _NOSE, "waitingExternalEvent", means=_EAST),
    ScriptStep(74.7, _EAST),
    ScriptStep(77.7, _NORTH),
    ScriptStep(HALF_S - 4.0, _NORTH, "idle"),
    ScriptStep(HALF_S - 1.0, _EAST),
    ScriptStep(HALF_S, _EAST, "idle"),
)
"""Script of the robot that drives through the lane, from the west."""
BACK_OUT = (
    ScriptStep(5.0, _EAST, "waitingExternalEvent"),
    ScriptStep(16.3, _OTHER_NOSE, means=_WEST),
    ScriptStep(46.0, _OTHER_NOSE, "waitingExternalEvent", means=_WEST),
    ScriptStep(59.0, _EAST, backs=True),
    ScriptStep(62.0, _SOUTH),
    ScriptStep(78.0, _SOUTH, "waitingExternalEvent"),
    ScriptStep(81.0, _EAST),
    ScriptStep(105.0, _WEST),
    ScriptStep(HALF_S, _WEST, "idle"),
)
"""Script of the robot that backs out of the lane, to the east."""


def _mirrored(steps: Sequence[ScriptStep]) -> list[ScriptStep]:
    """The same script from the other end of the lane, later by `HALF_S`."""

    def across(place: Place | None) -> Place | None:
        return None if place is None else (WEST_M + EAST_M - place[0], place[1])

    return [
        ScriptStep(step.until_s + HALF_S, across(step.to) or step.to, step.state, across(step.means), step.backs)
        for step in steps
    ]


def _turn(rank: int) -> list[ScriptStep]:
    """One round of the charger for the robot whose turn is number `rank`."""
    home, begins_s = WAITING[rank], rank * TURN_S
    away_s = hypot(CHARGER[0] - home[0], CHARGER[1] - home[1]) / PACE_MPS
    before = [ScriptStep(WISH_S - away_s, home, "idle"), ScriptStep(begins_s, home, "waitingExternalEvent")]
    return [
        *(before if rank else ()),
        ScriptStep(begins_s + CHARGE_S[0], CHARGER),
        ScriptStep(begins_s + CHARGE_S[1], CHARGER, "charging"),
        ScriptStep(begins_s + CHARGE_S[1] + away_s, home),
        ScriptStep(ROUND_S, home, "idle"),
    ]


def _round() -> list[ScriptStep]:
    """The round of the train, from its station."""
    west_m, south_m, east_m, north_m = YARD_M
    corners = (
        ((east_m - CORNER_M, north_m - CORNER_M), pi / 2),
        ((east_m - CORNER_M, south_m + CORNER_M), 0.0),
        ((west_m + CORNER_M, south_m + CORNER_M), -pi / 2),
        ((west_m + CORNER_M, north_m - CORNER_M), -pi),
    )
    path = [
        (x_m + CORNER_M * cos(start_rad - turn_rad), y_m + CORNER_M * sin(start_rad - turn_rad))
        for (x_m, y_m), start_rad in corners
        for turn_rad in np.arange(0.0, pi / 2 + CHORD_RAD / 2, CHORD_RAD).tolist()
    ]
    station, t_s = (STATION_M, north_m), STATION_S
    steps, last = [ScriptStep(STATION_S, station, "waitingExternalEvent")], station
    for place in (*path, station):
        t_s += dist(last, place) / PACE_MPS
        steps.append(ScriptStep(t_s, place))
        last = place
    return steps


class Annex:
    """The scripted robots of the annex."""

    def __init__(self, members: Sequence[Participant]) -> None:
        """`members` are in the order of `ROLES`."""
        self.members = tuple(members)
        self._steps = [[*play, *_mirrored(play)] for play in (THROUGH, BACK_OUT)]
        self._steps += [*(_turn(rank) for rank in range(len(WAITING))), _round()]

    def robot(self, row: int, t_s: float) -> RobotState:
        """The state of one robot, `t_s` after the start."""
        steps, now_s = self._steps[row], (t_s + BEGINS_S * (row > 1)) % self._steps[row][-1].until_s
        step, place, heading_rad = _step_at(steps, now_s)
        goal = step.means or step.to
        speed_mps = _speed_mps(steps, step)
        if step.state != "navigating":
            plan = _plan(place, heading_rad, 0.0, [])
        elif step.means or step.backs:
            plan = _plan(place, heading_rad, speed_mps, [goal])
        else:
            plan = _plan(place, heading_rad, speed_mps, _ahead(steps, steps.index(step)))
        return RobotState(
            member=self.members[row],
            t_s=t_s,
            floor=GROUND,
            x_m=place[0],
            y_m=place[1],
            yaw_rad=heading_rad,
            linear_mps=0.0 if step.state != "navigating" else -speed_mps if step.backs else speed_mps,
            state=step.state,
            battery_pct=60.0,
            plan=plan,
            destinations=self._destinations(row, now_s, step, place),
        )

    def _destinations(
        self, row: int, now_s: float, step: ScriptStep, place: Place
    ) -> tuple[tuple[float, int, float, float, float], ...]:
        """Its announced destinations. A robot that waits for the charger announces when it would arrive if that were
        free."""
        if row in CHARGING and now_s < CHARGING.index(row) * TURN_S:
            away_s = hypot(CHARGER[0] - place[0], CHARGER[1] - place[1]) / PACE_MPS
            return ((max(WISH_S - now_s, away_s), GROUND, *CHARGER, 0.0),)
        goal = step.means or step.to
        after_s = hypot(goal[0] - place[0], goal[1] - place[1]) / PACE_MPS
        return ((after_s, GROUND, *goal, 0.0),) if after_s > 0.1 else ()


def split(members: Sequence[Participant]) -> tuple[tuple[Participant, ...], Annex]:
    """The members that stay in the halls, and the annex with its robots. With few members the annex is empty."""
    if len(members) < FEWEST:
        return tuple(members), Annex(())
    free, players = list(members), []
    for vendor in ROLES:
        player = [member for member in free if member.make.vendor is vendor][-1]
        free.remove(player)
        players.append(player)
    players[TRAIN] = replace(players[TRAIN], make=TUG)
    return tuple(free), Annex(players)


def _step_at(steps: Sequence[ScriptStep], now_s: float) -> tuple[ScriptStep, Place, float]:
    """The present step of the script, and the robot's position and heading in it."""
    row = next(row for row, step in enumerate(steps) if now_s < step.until_s)
    step, before = steps[row], steps[row - 1]
    began_s = before.until_s if row else 0.0
    share = (now_s - began_s) / (step.until_s - began_s)
    place = (
        before.to[0] + share * (step.to[0] - before.to[0]),
        before.to[1] + share * (step.to[1] - before.to[1]),
    )
    return step, place, _heading_rad(steps, row)


def _heading_rad(steps: Sequence[ScriptStep], row: int) -> float:
    """The heading of the last step with a movement, or of the first later one."""
    around = [(row - back) % len(steps) for back in range(len(steps))]
    for index in around:
        (x, y), (to_x, to_y) = steps[index - 1].to, steps[index].to
        if hypot(to_x - x, to_y - y) > 0.01:
            return atan2(to_y - y, to_x - x) + (pi if steps[index].backs else 0.0)
    return 0.0


def _speed_mps(steps: Sequence[ScriptStep], step: ScriptStep) -> float:
    row = steps.index(step)
    began_s, (x, y) = (steps[row - 1].until_s if row else 0.0), steps[row - 1].to
    return hypot(step.to[0] - x, step.to[1] - y) / (step.until_s - began_s)


def _ahead(steps: Sequence[ScriptStep], row: int) -> list[Place]:
    """Where the robot drives without a stop or a sharp corner: the ends of this step and the next ones."""
    goals = [steps[row].to]
    for index in range(row, row + len(steps)):
        after = steps[(index + 1) % len(steps)]
        turn_rad = turn_between(_heading_rad(steps, index % len(steps)), _heading_rad(steps, (index + 1) % len(steps)))
        if after.state != "navigating" or after.means or abs(turn_rad) > 1.01 * CHORD_RAD:
            break
        goals.append(after.to)
    return goals


def _plan(place: Place, heading_rad: float, speed_mps: float, goals: Sequence[Place]) -> FleetPlan:
    """A plan straight from one goal to the next."""
    after_s, poses = [0.0], [(*place, heading_rad)]
    for x_m, y_m in goals:
        from_x_m, from_y_m, yaw_rad = poses[-1]
        left_m = hypot(x_m - from_x_m, y_m - from_y_m)
        if speed_mps > 0 and left_m > 1e-3:
            if len(goals) > 1:
                yaw_rad += turn_between(yaw_rad, atan2(y_m - from_y_m, x_m - from_x_m))
            after_s.append(after_s[-1] + left_m / speed_mps)
            poses.append((x_m, y_m, yaw_rad))
    return FleetPlan(np.array(after_s), np.array(poses), np.full(len(poses), GROUND))
