"""An annex south of the ground hall, in which robots follow a script: one charger for three robots, and a single lane.

The script repeats. Robots queue for the charger. Two robots enter the lane from both ends, stand face to face until
one backs out, and change sides. No other robot comes here.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import atan2, hypot, pi

import numpy as np

from deconflict.simulation.fleet_plans import FleetPlan
from deconflict.simulation.floor_layout import GROUND, Place
from deconflict.simulation.participants import Participant, VendorName
from deconflict.simulation.robot_state import RobotState

FEWEST = 16
"""With fewer participants there are no robots for the annex."""
ROLES = (VendorName.ALDER, VendorName.CORVID, VendorName.BASALT, VendorName.ALDER, VendorName.CORVID)
"""The first two use the lane, the others the charger."""
LANE_Y_M, WEST_M, EAST_M = -5.0, 2.0, 26.0
HALF_S = 90.0
"""After this time the two in the lane have changed sides."""
CHARGER: Place = (14.0, -11.0)
WAITING: tuple[Place, ...] = ((4.0, -11.0), (14.0, -18.0), (24.0, -11.0))
TURN_S = 55.0
"""Time from one robot's turn at the charger to the next robot's turn."""
CHARGE_S = (10.0, 43.0)
"""When in its turn a robot arrives at the charger and leaves it."""
WISHES_S = (25.0, 35.0)
"""When in another robot's turn the next and the second next would arrive if the charger were free."""
BEGINS_S = 12.0
"""Start time within the script, with the first robot at the charger."""
PACE_MPS = 1.0


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
    ScriptStep(42.0, _NOSE, "waitingExternalEvent", means=_EAST),
    ScriptStep(54.7, _EAST),
    ScriptStep(57.7, _NORTH),
    ScriptStep(86.0, _NORTH, "idle"),
    ScriptStep(89.0, _EAST),
    ScriptStep(HALF_S, _EAST, "idle"),
)
"""Script of the robot that drives through the lane, from the west."""
BACK_OUT = (
    ScriptStep(5.0, _EAST, "waitingExternalEvent"),
    ScriptStep(16.3, _OTHER_NOSE, means=_WEST),
    ScriptStep(26.0, _OTHER_NOSE, "waitingExternalEvent", means=_WEST),
    ScriptStep(39.0, _EAST, backs=True),
    ScriptStep(42.0, _SOUTH),
    ScriptStep(58.0, _SOUTH, "waitingExternalEvent"),
    ScriptStep(61.0, _EAST),
    ScriptStep(85.0, _WEST),
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
    steps = [ScriptStep(begins_s, home, "waitingExternalEvent")] if rank else []
    steps += [ScriptStep(begins_s + CHARGE_S[0] - away_s, home, "waitingExternalEvent")] if away_s < CHARGE_S[0] else []
    steps += [
        ScriptStep(begins_s + CHARGE_S[0], CHARGER),
        ScriptStep(begins_s + CHARGE_S[1], CHARGER, "charging"),
        ScriptStep(begins_s + CHARGE_S[1] + away_s, home),
        ScriptStep(len(WAITING) * TURN_S, home, "waitingExternalEvent"),
    ]
    return steps


class Annex:
    """The scripted robots of the annex."""

    def __init__(self, members: Sequence[Participant]) -> None:
        """`members` are in the order of `ROLES`."""
        self.members = tuple(members)
        self._steps = [[*play, *_mirrored(play)] for play in (THROUGH, BACK_OUT)]
        self._steps += [_turn(rank) for rank in range(len(WAITING))]

    def robot(self, row: int, t_s: float) -> RobotState:
        """The state of one robot, `t_s` after the start."""
        steps, now_s = self._steps[row], (t_s + BEGINS_S * (row > 1)) % self._steps[row][-1].until_s
        step, place, heading_rad = _step_at(steps, now_s)
        goal = step.means or step.to
        speed_mps = _speed_mps(steps, step)
        plan = _plan(place, goal, heading_rad, speed_mps if step.state == "navigating" else 0.0)
        charging = step.state == "charging"
        return RobotState(
            member=self.members[row],
            t_s=t_s,
            floor=GROUND,
            x_m=place[0],
            y_m=place[1],
            yaw_rad=heading_rad,
            linear_mps=0.0 if step.state != "navigating" else -speed_mps if step.backs else speed_mps,
            state=step.state,
            battery_pct=50.0 if row < 2 else 30.0 + charging * (now_s % TURN_S),
            plan=plan,
            destinations=self._destinations(row, now_s, step, place),
        )

    def _destinations(
        self, row: int, now_s: float, step: ScriptStep, place: Place
    ) -> tuple[tuple[float, int, float, float, float], ...]:
        """Its announced destinations. A robot that waits for the charger announces when it would arrive if that were
        free."""
        if row < 2 or step.state != "waitingExternalEvent":
            goal = step.means or step.to
            after_s = hypot(goal[0] - place[0], goal[1] - place[1]) / PACE_MPS
            return ((after_s, GROUND, *goal, 0.0),) if after_s > 0.1 else ()
        turn, into_s = divmod(now_s, TURN_S)
        behind = int(row - 2 - turn - 1) % len(WAITING)
        away_s = hypot(CHARGER[0] - place[0], CHARGER[1] - place[1]) / PACE_MPS
        if behind >= len(WISHES_S):
            return ((away_s, GROUND, *CHARGER, 0.0),) if into_s < CHARGE_S[0] else ()
        return ((max(WISHES_S[behind] - into_s, away_s), GROUND, *CHARGER, 0.0),)


def split(members: Sequence[Participant]) -> tuple[tuple[Participant, ...], Annex]:
    """The members that stay in the halls, and the annex with its robots. With few members the annex is empty."""
    if len(members) < FEWEST:
        return tuple(members), Annex(())
    free, players = list(members), []
    for vendor in ROLES:
        player = [member for member in free if member.make.vendor is vendor][-1]
        free.remove(player)
        players.append(player)
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


def _plan(place: Place, goal: Place, heading_rad: float, speed_mps: float) -> FleetPlan:
    """A plan straight to the goal."""
    left_m = hypot(goal[0] - place[0], goal[1] - place[1])
    here = np.array([[*place, heading_rad]])
    if speed_mps <= 0 or left_m < 1e-3:
        return FleetPlan(np.zeros(1), here, np.array([GROUND]))
    poses = np.vstack([here, [*goal, heading_rad]])
    return FleetPlan(np.array([0.0, left_m / speed_mps]), poses, np.array([GROUND, GROUND]))
