"""Passing another robot: a robot leaves its path sideways if there is room, and returns."""

from dataclasses import dataclass

import numpy as np

from deconflict.simulation.driving.protection import NOBODY, Traffic, centres
from deconflict_client.verbs import Side
from ingest.batch import Floats, Ints

GAP_M = 0.33
"""Gap between the bodies when they are side by side."""
HALF_AISLE_M = 1.75
"""Distance from the middle of an aisle to the robots in bays."""
BEYOND_M = 0.6
"""Length beyond the other robot for which the path must be free."""
ONCOMING_M = 5.0
"""Additional length for oncoming robots."""
NEAR_M = 9.0
BACK_STEEPNESS = 2.0
"""Metres of its path that a robot needs to return by one metre."""
STRAIGHT_RAD = 0.02
SWERVING_MPS, WALKING_MPS = 0.7, 0.5
"""Greatest speeds for swerving, and for passing a robot after standing for it."""
LONGEST_S = 20.0
MOVING_MPS, ONCOMING_COS = 0.1, -0.7
SIDEWAYS_MPS = (0.15, 0.4)
"""Sideways speed at standstill, and the greatest."""
SIDEWAYS_SHARE = 0.5
"""Sideways speed as a share of the forward speed."""
ON_ITS_WAY_M = 0.03


@dataclass(slots=True, eq=False)
class PassingManoeuvre:
    """A robot that passes another."""

    other: int
    until_s: float
    """When it gives up."""
    back_m: float
    """Progress from which it plans to return to its path."""
    end_m: float
    """Progress at which it must be back on its path."""


@dataclass(frozen=True, slots=True, eq=False)
class RelativePositions:
    """Positions of n robots relative to the middle of one robot's path."""

    ahead_m: Floats
    """(n,) along the path from the robot."""
    left_m: Floats
    """(n,) to the left of the path."""
    along_m: Floats
    """(n,) half extent of their bodies along its path; `across_m` is that across it."""
    across_m: Floats
    oncoming: Floats
    """(n,) cosine of the angle between their heading and its own."""


class Passings:
    """Which robot passes which."""

    def __init__(self, lane_m: Floats, half_aisle_m: float = HALF_AISLE_M) -> None:
        """`lane_m` (n,) is the distance of each robot's path to the right of the middle of an aisle."""
        n = len(lane_m)
        self._room_m = np.column_stack([half_aisle_m - lane_m, half_aisle_m + lane_m])
        """(n, 2) room to the right and to the left of each robot's path."""
        self.more_room_m = np.zeros(n)
        """(n,) further room to either side where each robot is now."""
        self._of: dict[int, PassingManoeuvre] = {}
        self.aside_to_m = np.zeros(n)
        """(n,) planned offset of each robot to the left of its path."""
        self.top_mps = np.full(n, np.inf)
        """(n,) speed limit of each robot while it passes another."""
        self.past: Ints = np.full(n, NOBODY)
        """(n,) the robot that each passes."""
        self.end_m = np.full(n, np.inf)
        """(n,) progress at which each has to be back on its path."""

    def __contains__(self, robot: int) -> bool:
        return robot in self._of

    def begin(
        self, traffic: Traffic, robot: int, other: int, now_s: float, top_mps: float, side: Side | None = None
    ) -> bool:
        """Start to pass another robot at no more than `top_mps`, on a side if it is named. Returns False if there is no
        room."""
        end_m = _straight_until_m(traffic, robot)
        beside = _beside(traffic, robot)
        room_m = self._room_m[robot] + self.more_room_m[robot]
        aside_m = _room_aside_m(traffic, beside, robot, other, room_m, end_m, side)
        if aside_m is None:
            return False
        back_m = float(traffic.progress_m[robot]) + _past_m(traffic, beside, robot, other)
        self.past[robot] = other
        self._of[robot] = PassingManoeuvre(other, now_s + LONGEST_S, back_m, end_m)
        self.aside_to_m[robot], self.top_mps[robot], self.end_m[robot] = aside_m, top_mps, end_m
        return True

    def update(self, traffic: Traffic, now_s: float) -> None:
        """Make robots return to their path after the other is passed, and end finished manoeuvres."""
        for robot, manoeuvre in list(self._of.items()):
            near_end = traffic.progress_m[robot] > manoeuvre.end_m - BACK_STEEPNESS * abs(traffic.aside_m[robot])
            if now_s > manoeuvre.until_s or near_end or _has_passed(traffic, robot, manoeuvre.other):
                self.aside_to_m[robot], self.past[robot] = 0.0, NOBODY
            if self.aside_to_m[robot] == 0.0 and abs(traffic.aside_m[robot]) < ON_ITS_WAY_M:
                del self._of[robot]
                self.top_mps[robot] = self.end_m[robot] = np.inf

    def aside_ahead_m(self, robot: int, aside_m: float, progress_m: float, driven_m: Floats) -> Floats:
        """(k,) planned offset to the left of a robot after it has driven `driven_m` from its present progress."""
        manoeuvre, to_m = self._of.get(robot), float(self.aside_to_m[robot])
        out_m = _moved_m(aside_m, to_m, driven_m)
        if manoeuvre is None or to_m == 0.0:
            return out_m
        back_m = manoeuvre.back_m - progress_m
        return np.where(driven_m < back_m, out_m, _moved_m(to_m, 0.0, driven_m - back_m))

    def next_aside_m(self, traffic: Traffic, dt_s: float) -> Floats:
        """(n,) offset of each robot after `dt_s`. Robots that do not drive keep theirs."""
        sideways_mps = np.clip(SIDEWAYS_SHARE * np.abs(traffic.speed_mps), *SIDEWAYS_MPS)
        most_m = np.where(traffic.going & ~traffic.backing, sideways_mps * dt_s, 0.0)
        aside_m: Floats = traffic.aside_m + np.clip(self.aside_to_m - traffic.aside_m, -most_m, most_m)
        return np.where(np.isfinite(self.end_m), aside_m, traffic.aside_m)


def _moved_m(from_m: float, to_m: float, along_m: Floats) -> Floats:
    """Offset to the left of a robot that moves from `from_m` to `to_m` while it drives `along_m` on its path."""
    most_m = np.maximum(along_m, 0.0) / BACK_STEEPNESS
    return from_m + np.clip(to_m - from_m, -most_m, most_m)


def _straight_until_m(traffic: Traffic, robot: int) -> float:
    """Progress at which the path ahead begins to bend."""
    yaw = traffic.tracks.samples(robot)[2]
    step_m, progress_m = traffic.tracks.step_m[robot], traffic.progress_m[robot]
    first = int(progress_m / step_m)
    bent = np.flatnonzero(np.abs(yaw[first:] - yaw[first]) > STRAIGHT_RAD)
    return float(step_m * (first + bent[0] - 1 if len(bent) else len(yaw) - 1))


def _past_m(traffic: Traffic, beside: RelativePositions, robot: int, other: int) -> float:
    """How far a robot drives until it has passed a standing robot."""
    return float(beside.ahead_m[other] + beside.along_m[other] + traffic.length_m[robot] / 2)


def _room_aside_m(
    traffic: Traffic,
    beside: RelativePositions,
    robot: int,
    other: int,
    room_m: Floats,
    end_m: float,
    side: Side | None,
) -> float | None:
    """The offset to the left at which a robot can pass another, on a side if it is named. None if it can't.

    A moving robot is passed only if it is oncoming.
    """
    half_m = traffic.width_m[robot] / 2
    moves = abs(traffic.speed_mps[other]) > MOVING_MPS
    if beside.ahead_m[other] <= 0 or (moves and beside.oncoming[other] > ONCOMING_COS):
        return None
    away_m = beside.across_m[other] + half_m + GAP_M
    on_side_m: dict[Side, float] = {"left": beside.left_m[other] + away_m, "right": beside.left_m[other] - away_m}
    targets_m = [on_side_m[side]] if side else sorted(on_side_m.values(), key=abs)
    until_m = _past_m(traffic, beside, robot, other) + BEYOND_M
    for target_m in targets_m:
        back_m = BACK_STEEPNESS * abs(target_m)
        within = -room_m[0] <= target_m - half_m and target_m + half_m <= room_m[1]
        straight = traffic.progress_m[robot] + until_m + back_m <= end_m
        if within and straight and _is_free(traffic, beside, robot, other, float(target_m), until_m):
            return float(target_m)
    return None


def _is_free(
    traffic: Traffic, beside: RelativePositions, robot: int, other: int, aside_m: float, until_m: float
) -> bool:
    """Whether no third robot is, or comes, between the robot and the end of the path beside the other."""
    comes = (beside.oncoming < ONCOMING_COS) & (np.abs(traffic.speed_mps) > MOVING_MPS)
    reach_m = until_m + np.where(comes, ONCOMING_M, 0.0)
    behind_m = traffic.length_m[robot] / 2 + 0.2
    low_m, high_m = sorted((aside_m, float(traffic.aside_m[robot])))
    half_m = traffic.width_m[robot] / 2 + GAP_M / 2
    across = (beside.left_m + beside.across_m > low_m - half_m) & (beside.left_m - beside.across_m < high_m + half_m)
    along = (beside.ahead_m + beside.along_m > -behind_m) & (beside.ahead_m - beside.along_m < reach_m)
    in_way = across & along & (traffic.floor == traffic.floor[robot])
    in_way[[robot, other]] = False
    return not in_way.any()


def _has_passed(traffic: Traffic, robot: int, other: int) -> bool:
    """Whether the other is behind the robot, or no longer near its path."""
    beside = _beside(traffic, robot)
    behind_m = -(traffic.length_m[robot] / 2 + beside.along_m[other] + 0.1)
    off_m = traffic.width_m[robot] / 2 + beside.across_m[other] + GAP_M / 2
    apart = traffic.floor[robot] != traffic.floor[other] or abs(beside.ahead_m[other]) > NEAR_M
    return bool(apart or beside.ahead_m[other] < behind_m or abs(beside.left_m[other]) > off_m)


def _beside(traffic: Traffic, robot: int) -> RelativePositions:
    poses = centres(traffic, np.arange(len(traffic.progress_m)), traffic.progress_m)
    x, y, yaw = poses[:, robot]
    c, s = np.cos(yaw), np.sin(yaw)
    dx, dy, turn = poses[0] - x, poses[1] - y, poses[2] - yaw
    cos_turn, sin_turn = np.cos(turn), np.sin(turn)
    return RelativePositions(
        ahead_m=dx * c + dy * s,
        left_m=dy * c - dx * s + traffic.aside_m[robot],
        along_m=(traffic.length_m * np.abs(cos_turn) + traffic.width_m * np.abs(sin_turn)) / 2,
        across_m=(traffic.length_m * np.abs(sin_turn) + traffic.width_m * np.abs(cos_turn)) / 2,
        oncoming=cos_turn,
    )
