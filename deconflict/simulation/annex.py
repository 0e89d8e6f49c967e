"""An annex south of the ground hall, played from a script: one charger for three robots, and a single lane for two.

Again and again robots queue for the charger, and two enter the lane from both ends, stand nose to nose until one
backs out, and change sides. Nobody else comes here.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import atan2, hypot, pi

import numpy as np

from deconflict.simulation.cast import Member, VendorName
from deconflict.simulation.fleet_plans import Plan
from deconflict.simulation.floor_layout import GROUND, Place
from deconflict.simulation.robot_state import Robot

FEWEST = 16
"""A smaller cast has nobody to spare for the annex."""
ROLES = (VendorName.ALDER, VendorName.CORVID, VendorName.BASALT, VendorName.ALDER, VendorName.CORVID)
"""The first two take the lane, the others the charger."""
LANE_Y_M, WEST_M, EAST_M = -5.0, 2.0, 26.0
HALF_S = 90.0
"""After which the two in the lane have changed sides."""
CHARGER: Place = (14.0, -11.0)
WAITING: tuple[Place, ...] = ((4.0, -11.0), (14.0, -18.0), (24.0, -11.0))
TURN_S = 55.0
"""From one robot's turn at the charger to the next one's."""
CHARGE_S = (10.0, 43.0)
"""When in its turn a robot comes to the charger and leaves it."""
WISHES_S = (25.0, 35.0)
"""When in another one's turn the next and the one after would come, were the charger free."""
BEGINS_S = 12.0
"""The script begins here, with the first robot at the charger."""
PACE_MPS = 1.0


@dataclass(frozen=True, slots=True)
class Act:
    """Straight to `to` by `until_s`, and what is said of it."""

    until_s: float
    to: Place
    state: str = "navigating"
    means: Place | None = None
    """Where it says that it drives, if not just to `to`."""
    backs: bool = False


_WEST, _EAST = (WEST_M, LANE_Y_M), (EAST_M, LANE_Y_M)
_NOSE, _OTHER_NOSE = (13.3, LANE_Y_M), (14.7, LANE_Y_M)
_NORTH, _SOUTH = (EAST_M, LANE_Y_M + 3), (EAST_M, LANE_Y_M - 3)
THROUGH = (
    Act(5.0, _WEST, "waitingExternalEvent"),
    Act(16.3, _NOSE, means=_EAST),
    Act(42.0, _NOSE, "waitingExternalEvent", means=_EAST),
    Act(54.7, _EAST),
    Act(57.7, _NORTH),
    Act(86.0, _NORTH, "idle"),
    Act(89.0, _EAST),
    Act(HALF_S, _EAST, "idle"),
)
"""Of the one in the lane that goes through, from the west."""
BACK_OUT = (
    Act(5.0, _EAST, "waitingExternalEvent"),
    Act(16.3, _OTHER_NOSE, means=_WEST),
    Act(26.0, _OTHER_NOSE, "waitingExternalEvent", means=_WEST),
    Act(39.0, _EAST, backs=True),
    Act(42.0, _SOUTH),
    Act(58.0, _SOUTH, "waitingExternalEvent"),
    Act(61.0, _EAST),
    Act(85.0, _WEST),
    Act(HALF_S, _WEST, "idle"),
)
"""Of the one that backs out, from the east."""


def _mirrored(acts: Sequence[Act]) -> list[Act]:
    """The same from the other end of the lane, later by a half."""

    def across(place: Place | None) -> Place | None:
        return None if place is None else (WEST_M + EAST_M - place[0], place[1])

    return [
        Act(one.until_s + HALF_S, across(one.to) or one.to, one.state, across(one.means), one.backs) for one in acts
    ]


def _turn(rank: int) -> list[Act]:
    """One round of the charger's three users, for the one whose turn is `rank`-th."""
    home, begins_s = WAITING[rank], rank * TURN_S
    away_s = hypot(CHARGER[0] - home[0], CHARGER[1] - home[1]) / PACE_MPS
    acts = [Act(begins_s, home, "waitingExternalEvent")] if rank else []
    acts += [Act(begins_s + CHARGE_S[0] - away_s, home, "waitingExternalEvent")] if away_s < CHARGE_S[0] else []
    acts += [
        Act(begins_s + CHARGE_S[0], CHARGER),
        Act(begins_s + CHARGE_S[1], CHARGER, "charging"),
        Act(begins_s + CHARGE_S[1] + away_s, home),
        Act(len(WAITING) * TURN_S, home, "waitingExternalEvent"),
    ]
    return acts


class Annex:
    """The players' script; `robots` says where everybody is at a time."""

    def __init__(self, members: Sequence[Member]) -> None:
        """`members` in the order of `ROLES`."""
        self.members = tuple(members)
        self._acts = [[*play, *_mirrored(play)] for play in (THROUGH, BACK_OUT)]
        self._acts += [_turn(rank) for rank in range(len(WAITING))]

    def robot(self, row: int, t_s: float) -> Robot:
        """One of the players, `t_s` after the start."""
        acts, now_s = self._acts[row], (t_s + BEGINS_S * (row > 1)) % self._acts[row][-1].until_s
        act, place, heading_rad = _now(acts, now_s)
        goal = act.means or act.to
        speed_mps = _speed_mps(acts, act)
        plan = _plan(place, goal, heading_rad, speed_mps if act.state == "navigating" else 0.0)
        charging = act.state == "charging"
        return Robot(
            member=self.members[row],
            t_s=t_s,
            floor=GROUND,
            x_m=place[0],
            y_m=place[1],
            yaw_rad=heading_rad,
            linear_mps=0.0 if act.state != "navigating" else -speed_mps if act.backs else speed_mps,
            turn_radps=0.0,
            state=act.state,
            battery_pct=50.0 if row < 2 else 30.0 + charging * (now_s % TURN_S),
            load_pct=0.0,
            errors=(),
            plan=plan,
            destinations=self._destinations(row, now_s, act, place),
        )

    def _destinations(
        self, row: int, now_s: float, act: Act, place: Place
    ) -> tuple[tuple[float, int, float, float, float], ...]:
        """Where it drives; of one that waits for the charger, when it would be there if it were free."""
        if row < 2 or act.state != "waitingExternalEvent":
            goal = act.means or act.to
            after_s = hypot(goal[0] - place[0], goal[1] - place[1]) / PACE_MPS
            return ((after_s, GROUND, *goal, 0.0),) if after_s > 0.1 else ()
        turn, into_s = divmod(now_s, TURN_S)
        behind = int(row - 2 - turn - 1) % len(WAITING)
        away_s = hypot(CHARGER[0] - place[0], CHARGER[1] - place[1]) / PACE_MPS
        if behind >= len(WISHES_S):
            return ((away_s, GROUND, *CHARGER, 0.0),) if into_s < CHARGE_S[0] else ()
        return ((max(WISHES_S[behind] - into_s, away_s), GROUND, *CHARGER, 0.0),)


def split(members: Sequence[Member]) -> tuple[tuple[Member, ...], Annex]:
    """Those who stay in the halls, and the annex with its players; nobody plays in a small cast."""
    if len(members) < FEWEST:
        return tuple(members), Annex(())
    free, players = list(members), []
    for vendor in ROLES:
        player = [one for one in free if one.make.vendor is vendor][-1]
        free.remove(player)
        players.append(player)
    return tuple(free), Annex(players)


def _now(acts: Sequence[Act], now_s: float) -> tuple[Act, Place, float]:
    """The act that is on, where the robot is in it, and its heading."""
    row = next(row for row, act in enumerate(acts) if now_s < act.until_s)
    act, before = acts[row], acts[row - 1]
    began_s = before.until_s if row else 0.0
    share = (now_s - began_s) / (act.until_s - began_s)
    place = (
        before.to[0] + share * (act.to[0] - before.to[0]),
        before.to[1] + share * (act.to[1] - before.to[1]),
    )
    return act, place, _heading_rad(acts, row)


def _heading_rad(acts: Sequence[Act], row: int) -> float:
    """Of the act that last went anywhere, or of the first that will."""
    around = [(row - back) % len(acts) for back in range(len(acts))]
    for index in around:
        (x, y), (to_x, to_y) = acts[index - 1].to, acts[index].to
        if hypot(to_x - x, to_y - y) > 0.01:
            return atan2(to_y - y, to_x - x) + (pi if acts[index].backs else 0.0)
    return 0.0


def _speed_mps(acts: Sequence[Act], act: Act) -> float:
    row = acts.index(act)
    began_s, (x, y) = (acts[row - 1].until_s if row else 0.0), acts[row - 1].to
    return hypot(act.to[0] - x, act.to[1] - y) / (act.until_s - began_s)


def _plan(place: Place, goal: Place, heading_rad: float, speed_mps: float) -> Plan:
    """Straight to the goal."""
    left_m = hypot(goal[0] - place[0], goal[1] - place[1])
    here = np.array([[*place, heading_rad]])
    if speed_mps <= 0 or left_m < 1e-3:
        return Plan(np.zeros(1), here, np.array([GROUND]))
    poses = np.vstack([here, [*goal, heading_rad]])
    return Plan(np.array([0.0, left_m / speed_mps]), poses, np.array([GROUND, GROUND]))
