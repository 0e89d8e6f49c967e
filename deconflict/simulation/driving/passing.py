"""Going past another robot: leaving one's way sideways where there is room, and coming back."""

from dataclasses import dataclass

import numpy as np

from deconflict.simulation.driving.protection import NOBODY, Traffic, centres
from ingest.batch import Floats, Ints

GAP_M = 0.33
"""Between the bodies when they are beside each other."""
HALF_AISLE_M = 1.75
"""From the middle of an aisle to where the robots in bays begin."""
BEYOND_M = 0.6
"""So far beyond the other the way beside must be free."""
ONCOMING_M = 5.0
"""And so much further, of those that come towards it."""
NEAR_M = 9.0
BACK_STEEPNESS = 2.0
"""So many metres of its way a robot needs to come back by one."""
STRAIGHT_RAD = 0.02
SWERVING_MPS, WALKING_MPS = 0.7, 0.5
"""The most at which a robot swerves, and at which it goes past one that it has stood for."""
LONGEST_S = 20.0
MOVING_MPS, ONCOMING_COS = 0.1, -0.7
SIDEWAYS_MPS = (0.15, 0.4)
"""At standstill, and at most."""
SIDEWAYS_SHARE = 0.5
"""Of its speed ahead that a robot has sideways."""
ON_ITS_WAY_M = 0.03


@dataclass(slots=True, eq=False)
class Passing:
    """A robot that goes past another."""

    other: int
    until_s: float
    """It gives up then."""
    back_m: float
    """Progress from which it means to come back to its way."""
    end_m: float
    """Progress at which it must be there."""


@dataclass(frozen=True, slots=True, eq=False)
class Beside:
    """n robots as one of them sees them from the middle of its own way."""

    ahead_m: Floats
    """(n,)"""
    left_m: Floats
    along_m: Floats
    """(n,) half of what their bodies take up along its way."""
    across_m: Floats
    oncoming: Floats
    """(n,) cosine of their heading to its own."""


class Passings:
    """Who goes past whom."""

    def __init__(self, lane_m: Floats) -> None:
        """`lane_m` is how far right of the middle of an aisle each of n robots keeps."""
        n = len(lane_m)
        self._lane_m = lane_m
        self._of: dict[int, Passing] = {}
        self.aside_to_m = np.zeros(n)
        """(n,) how far to the left of its way each means to be."""
        self.top_mps = np.full(n, np.inf)
        """(n,) the most that each goes while it goes past another."""
        self.past: Ints = np.full(n, NOBODY)
        """(n,) whom each goes past."""
        self.end_m = np.full(n, np.inf)
        """(n,) progress at which each has to be back on its way."""

    def __contains__(self, robot: int) -> bool:
        return robot in self._of

    def begin(self, traffic: Traffic, robot: int, other: int, now_s: float, top_mps: float) -> bool:
        """Go past another, no faster than `top_mps`; False where there is no room."""
        end_m = _straight_until_m(traffic, robot)
        beside = _beside(traffic, robot)
        aside_m = _room_aside_m(traffic, beside, robot, other, float(self._lane_m[robot]), end_m)
        if aside_m is None:
            return False
        back_m = float(traffic.progress_m[robot]) + _past_m(traffic, beside, robot, other)
        self.past[robot] = other
        self._of[robot] = Passing(other, now_s + LONGEST_S, back_m, end_m)
        self.aside_to_m[robot], self.top_mps[robot], self.end_m[robot] = aside_m, top_mps, end_m
        return True

    def go_on(self, traffic: Traffic, now_s: float) -> None:
        """Come back to the way where the other has been passed, and end what is over."""
        for robot, one in list(self._of.items()):
            near_end = traffic.progress_m[robot] > one.end_m - BACK_STEEPNESS * abs(traffic.aside_m[robot])
            if now_s > one.until_s or near_end or _has_passed(traffic, robot, one.other):
                self.aside_to_m[robot], self.past[robot] = 0.0, NOBODY
            if self.aside_to_m[robot] == 0.0 and abs(traffic.aside_m[robot]) < ON_ITS_WAY_M:
                del self._of[robot]
                self.top_mps[robot] = self.end_m[robot] = np.inf

    def aside_ahead_m(self, robot: int, aside_m: float, progress_m: float, gone_m: Floats) -> Floats:
        """(k,) how far to the left a robot means to be when it has gone so far from its present progress."""
        one, to_m = self._of.get(robot), float(self.aside_to_m[robot])
        out_m = _moved_m(aside_m, to_m, gone_m)
        if one is None or to_m == 0.0:
            return out_m
        back_m = one.back_m - progress_m
        return np.where(gone_m < back_m, out_m, _moved_m(to_m, 0.0, gone_m - back_m))

    def next_aside_m(self, traffic: Traffic, dt_s: float) -> Floats:
        """(n,) how far aside each robot means to be after `dt_s`; those that no longer drive stay where they are."""
        sideways_mps = np.clip(SIDEWAYS_SHARE * np.abs(traffic.speed_mps), *SIDEWAYS_MPS)
        most_m = np.where(traffic.going & ~traffic.backing, sideways_mps * dt_s, 0.0)
        aside_m: Floats = traffic.aside_m + np.clip(self.aside_to_m - traffic.aside_m, -most_m, most_m)
        return np.where(np.isfinite(self.end_m), aside_m, traffic.aside_m)


def _moved_m(from_m: float, to_m: float, along_m: Floats) -> Floats:
    """How far to the left a robot is that sets out from `from_m` to `to_m` and goes so far along its way."""
    most_m = np.maximum(along_m, 0.0) / BACK_STEEPNESS
    moved_m: Floats = from_m + np.clip(to_m - from_m, -most_m, most_m)
    return moved_m


def _straight_until_m(traffic: Traffic, robot: int) -> float:
    """Progress at which the way ahead begins to bend."""
    yaw = traffic.tracks.samples(robot)[2]
    step_m, progress_m = traffic.tracks.step_m[robot], traffic.progress_m[robot]
    first = int(progress_m / step_m)
    bent = np.flatnonzero(np.abs(yaw[first:] - yaw[first]) > STRAIGHT_RAD)
    return float(step_m * (first + bent[0] - 1 if len(bent) else len(yaw) - 1))


def _past_m(traffic: Traffic, beside: Beside, robot: int, other: int) -> float:
    """How far a robot goes until it is past another one that stands."""
    return float(beside.ahead_m[other] + beside.along_m[other] + traffic.length_m[robot] / 2)


def _room_aside_m(
    traffic: Traffic, beside: Beside, robot: int, other: int, lane_m: float, end_m: float
) -> float | None:
    """How far to the left of its way a robot can go past another; None where it can't.

    One that moves is gone past only where it comes towards the robot.
    """
    half_m = traffic.width_m[robot] / 2
    moves = abs(traffic.speed_mps[other]) > MOVING_MPS
    if beside.ahead_m[other] <= 0 or (moves and beside.oncoming[other] > ONCOMING_COS):
        return None
    away_m = beside.across_m[other] + half_m + GAP_M
    targets_m = sorted((beside.left_m[other] + away_m, beside.left_m[other] - away_m), key=abs)
    until_m = _past_m(traffic, beside, robot, other) + BEYOND_M
    for target_m in targets_m:
        back_m = BACK_STEEPNESS * abs(target_m)
        within = -(HALF_AISLE_M - lane_m) <= target_m - half_m and target_m + half_m <= HALF_AISLE_M + lane_m
        straight = traffic.progress_m[robot] + until_m + back_m <= end_m
        if within and straight and _is_free(traffic, beside, robot, other, float(target_m), until_m):
            return float(target_m)
    return None


def _is_free(traffic: Traffic, beside: Beside, robot: int, other: int, aside_m: float, until_m: float) -> bool:
    """Whether nobody else is, or comes, between the robot and the end of the way beside the other."""
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
    """Whether the other is behind the robot, or no longer near its way."""
    beside = _beside(traffic, robot)
    behind_m = -(traffic.length_m[robot] / 2 + beside.along_m[other] + 0.1)
    off_m = traffic.width_m[robot] / 2 + beside.across_m[other] + GAP_M / 2
    apart = traffic.floor[robot] != traffic.floor[other] or abs(beside.ahead_m[other]) > NEAR_M
    return bool(apart or beside.ahead_m[other] < behind_m or abs(beside.left_m[other]) > off_m)


def _beside(traffic: Traffic, robot: int) -> Beside:
    everybody = centres(traffic, np.arange(len(traffic.progress_m)), traffic.progress_m)
    x, y, yaw = everybody[:, robot]
    c, s = np.cos(yaw), np.sin(yaw)
    dx, dy, turn = everybody[0] - x, everybody[1] - y, everybody[2] - yaw
    cos_turn, sin_turn = np.cos(turn), np.sin(turn)
    return Beside(
        ahead_m=dx * c + dy * s,
        left_m=dy * c - dx * s + traffic.aside_m[robot],
        along_m=(traffic.length_m * np.abs(cos_turn) + traffic.width_m * np.abs(sin_turn)) / 2,
        across_m=(traffic.length_m * np.abs(sin_turn) + traffic.width_m * np.abs(cos_turn)) / 2,
        oncoming=cos_turn,
    )
