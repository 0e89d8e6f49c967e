"""Which robot is in the way of another one that loses time.

The nearest robot on its way counts: as it stood since the last report, or as it will by its forecast within the next
seconds. Robots of one vendor know each other's plans, and so look further ahead. If there is none, a robot of the same
vendor ahead whose way crosses comes into question: fleets keep crossings free for their own robots.

The file is long because its functions are compiled: they take what they need number by number.
"""

from math import cos, hypot, inf, sin
from typing import NamedTuple

import numpy as np

from deconflict.foresight.losses.losing import KnownRobots, nearest_rows
from deconflict.foresight.losses.loss import NOBODY
from deconflict.foresight.losses.planned_times import TURN_M
from deconflict.foresight.motion_assumptions import BRAKES_MPS2, MOVES_MPS
from deconflict.sweep.geometry.envelope_distances import rectangle_gap
from ingest.batch import Floats
from ingest.frames.angles import turn_between
from ingest.kernels import inner

WAY_STEP_M, FARTHEST_M = 0.2, 6.5
"""Distance between two samples of a way, and its length."""
SAMPLES = 48
NEAR_M = 9.0
"""Robots whose centres are further away are not looked at."""
TOUCHES_M, BESIDE_M = 0.15, 0.45
"""A robot is on the way if the envelopes come this near. If they come no nearer than `BESIDE_M`, it is beside it."""
NEARER_M = 0.02
"""They must also come nearer than they were by this."""
BESIDE_COST_M, STAYS_M = 999.0, 1.0
"""A robot beside the way counts as this much further away. The robot that was in the way before counts as `STAYS_M`
nearer."""
BEYOND_M, BEYOND_OWN_M = 3.0, 6.0
"""How far beyond its stopping distance a robot reacts; within its vendor, how far at all."""
AHEAD_S, AHEAD_OWN_S = 2, 3
"""How far ahead the forecasts of others count, in whole seconds."""
AHEAD_MPS, AHEAD_OWN_MPS = 1.0, 0.5
"""A robot that is on the way a second later counts as this much further away."""
STOOD_S, STANDS_M = 1.0, 0.05
"""A robot that came less far in this time stands."""
BEHIND_M, ALIKE_RAD = -0.2, 1.05
"""A robot that is further behind, and heads the same way, follows."""
CROSSES_M, CROSSES_GAP_M, CROSSES_S = 5.5, 0.8, 4
"""A robot crosses if it is this near, and its way of the next seconds comes as near as this to that of the other."""
CROSSES_RAD = (0.5, 2.6)
"""Range of the angle between the two ways."""
CROSSES_AHEAD_M = 0.3
NEAR_WAY_M, NEAR_WAY_GAP_M, BESIDE_BEHIND_M = 4.5, 1.3, 0.8
"""A robot is near the way of one that stands if it is this near to the way, so far ahead."""
SILENT_S = 30.0
"""A robot that has not reported for longer is not looked at."""

_turn_between = inner(turn_between)


class LosingRobot(NamedTuple):
    """A robot that loses time between its last two reports."""

    slot: int
    begin_s: float
    end_s: float
    speed_mps: float
    """The greater of its last two speeds."""
    way: Floats
    """(n, 4) its way from the report before the last on: x_m, y_m, yaw_rad and metres from there."""
    came_m: float
    """How far it came on it."""
    blocker: int
    """The robot that was in its way before; `NOBODY` if none was."""


@inner
def pose_of(robots: KnownRobots, slot: int, at_s: float) -> tuple[float, float, float]:
    """x_m, y_m, yaw_rad of a robot: between its reports, and after the newest one by its forecast."""
    kept = robots.t_s.shape[1]
    later = robots.newest[slot]
    later_s = robots.t_s[slot, later]
    if at_s >= later_s:
        track = robots.tracks[slot, later]
        since_s = min(at_s - later_s, len(track) - 1.0)
        leg = min(int(since_s), len(track) - 2)
        return _between(track[leg], track[leg + 1], since_s - leg)
    for back in range(1, robots.reports[slot]):
        before = (robots.newest[slot] - back) % kept
        before_s = robots.t_s[slot, before]
        if before_s <= at_s:
            share = (at_s - before_s) / (later_s - before_s)
            return _between(robots.tracks[slot, before, 0], robots.tracks[slot, later, 0], share)
        later, later_s = before, before_s
    first = robots.tracks[slot, later, 0]
    return first[0], first[1], first[2]


@inner
def _between(pose: Floats, following: Floats, share: float) -> tuple[float, float, float]:
    turn = _turn_between(pose[2], following[2])
    return (
        pose[0] + share * (following[0] - pose[0]),
        pose[1] + share * (following[1] - pose[1]),
        pose[2] + share * turn,
    )


@inner
def way_ahead(track: Floats, x_m: float, y_m: float, yaw_rad: float, length_m: float) -> Floats:
    """(n, 4) the way of a forecast `track` (k, 3) from its place nearest to a pose on: x_m, y_m, yaw_rad and metres
    from there, every `WAY_STEP_M`."""
    way, n = np.empty((SAMPLES, 4)), 0
    least_m, nearest = inf, 0
    for at in range(len(track)):
        turn_m = TURN_M * _turn_between(track[at, 2], yaw_rad)
        off_m = hypot(hypot(track[at, 0] - x_m, track[at, 1] - y_m), turn_m)
        if off_m < least_m - 1e-9:
            least_m, nearest = off_m, at
    way[0, 0], way[0, 1], way[0, 2], way[0, 3] = x_m, y_m, yaw_rad, 0.0
    n, along_m, next_m = 1, 0.0, WAY_STEP_M
    from_x, from_y, from_yaw = x_m, y_m, yaw_rad
    for at in range(nearest + 1, len(track)):
        leg_m = hypot(track[at, 0] - from_x, track[at, 1] - from_y)
        turn = _turn_between(from_yaw, track[at, 2])
        while n < SAMPLES and next_m <= min(along_m + leg_m, length_m):
            share = (next_m - along_m) / leg_m
            way[n, 0], way[n, 1] = from_x + share * (track[at, 0] - from_x), from_y + share * (track[at, 1] - from_y)
            way[n, 2], way[n, 3] = from_yaw + share * turn, next_m
            n, next_m = n + 1, next_m + WAY_STEP_M
        along_m += leg_m
        from_x, from_y, from_yaw = track[at, 0], track[at, 1], track[at, 2]
    return way[:n]


@inner
def half_sides_m(robots: KnownRobots, slot: int, other: int) -> tuple[tuple[float, float], tuple[float, float], float]:
    """The half sides of two robots, and how far apart their centres are at most where their bodies touch."""
    half_m = robots.half_m
    half, other_half = (half_m[0, slot], half_m[1, slot]), (half_m[0, other], half_m[1, other])
    return half, other_half, hypot(half[0], half[1]) + hypot(other_half[0], other_half[1])


@inner
def _way_left_m(
    robots: KnownRobots, losing: LosingRobot, other: int, at_s: float, gone_m: float, most_m: float
) -> tuple[float, bool]:
    """How far a robot can drive on its way, of which it has gone `gone_m`, until it is at another one as that stands at
    `at_s`, and whether it only passes beside it; inf if it does not come near within `most_m`."""
    way = losing.way
    x, y, yaw = pose_of(robots, other, at_s)
    turn = cos(yaw), sin(yaw)
    half, other_half, touch_m = half_sides_m(robots, losing.slot, other)
    reach_m = touch_m + BESIDE_M
    beside_m, first_m, is_first = inf, inf, True
    for at in range(len(way)):
        ahead_m = way[at, 3] - gone_m
        if ahead_m > most_m:
            break
        if ahead_m < -WAY_STEP_M / 2:
            continue
        dx, dy = x - way[at, 0], y - way[at, 1]
        gap_m = inf
        if dx * dx + dy * dy < reach_m * reach_m:
            gap_m = rectangle_gap(dx, dy, (cos(way[at, 2]), sin(way[at, 2])), turn, half, other_half)
        if is_first:
            first_m, is_first = gap_m, False
        elif gap_m < first_m - NEARER_M:
            if gap_m < TOUCHES_M:
                return max(ahead_m, 0.0), False
            if gap_m < BESIDE_M:
                beside_m = min(beside_m, max(ahead_m, 0.0))
    return beside_m, True


@inner
def _stands(robots: KnownRobots, slot: int, now_s: float) -> bool:
    x, y, _ = pose_of(robots, slot, min(now_s, robots.t_s[slot, robots.newest[slot]]))
    before_x, before_y, _ = pose_of(robots, slot, now_s - STOOD_S)
    return bool(hypot(x - before_x, y - before_y) < STANDS_M)


@inner
def _cost_on_way(robots: KnownRobots, losing: LosingRobot, other: int) -> float:
    """How far away another robot on the way counts as; inf if it is not on it, or out of reach."""
    is_own = robots.vendor[losing.slot] == robots.vendor[other]
    reach_m = BEYOND_OWN_M if is_own else losing.speed_mps**2 / (2 * BRAKES_MPS2) + BEYOND_M
    each_s = AHEAD_OWN_MPS if is_own else AHEAD_MPS
    stands = _stands(robots, other, losing.end_s)
    least = inf
    looks = 0 if stands else AHEAD_OWN_S if is_own else AHEAD_S
    for look in range(-2, looks + 1):
        share = 1.0 + min(look, 0) / 2
        at_s = losing.begin_s + share * (losing.end_s - losing.begin_s) + max(look, 0)
        left_m, is_beside = _way_left_m(robots, losing, other, at_s, share * losing.came_m, reach_m)
        if left_m <= reach_m:
            later_m = max(look, 0) * each_s
            least = min(least, left_m + later_m + (BESIDE_COST_M if is_beside else 0.0))
    return least


@inner
def _crosses(robots: KnownRobots, losing: LosingRobot, other: int) -> bool:
    """Whether the way that another robot has come, or goes, crosses the way of a robot."""
    way = losing.way
    half, other_half, touch_m = half_sides_m(robots, losing.slot, other)
    reach_m = touch_m + CROSSES_GAP_M
    x, y, _ = pose_of(robots, other, losing.end_s)
    track, nearest, least_m = robots.ways[other], 0, inf
    if robots.has_way[other]:
        for at in range(len(track)):
            off_m = hypot(track[at, 0] - x, track[at, 1] - y)
            if off_m < least_m:
                least_m, nearest = off_m, at
    for half_second in range(-2, 2 * CROSSES_S + 1 if robots.has_way[other] else 1):
        if half_second <= 0:
            x, y, yaw = pose_of(robots, other, losing.end_s + half_second / 2)
        else:
            since = min(nearest + half_second / 2, len(track) - 1.0)
            leg = min(int(since), len(track) - 2)
            x, y, yaw = _between(track[leg], track[leg + 1], since - leg)
        turn = cos(yaw), sin(yaw)
        for at in range(len(way)):
            if way[at, 3] < losing.came_m - WAY_STEP_M / 2:
                continue
            dx, dy = x - way[at, 0], y - way[at, 1]
            if dx * dx + dy * dy >= reach_m * reach_m:
                continue
            between_rad = abs(_turn_between(way[at, 2], yaw))
            if not CROSSES_RAD[0] < between_rad < CROSSES_RAD[1]:
                continue
            if rectangle_gap(dx, dy, (cos(way[at, 2]), sin(way[at, 2])), turn, half, other_half) < CROSSES_GAP_M:
                return True
    return False


@inner
def _cost_near_way(robots: KnownRobots, losing: LosingRobot, other: int, near_m: float) -> float:
    """How far away another robot counts as that is not further than `near_m` beside the way ahead; inf if none is."""
    way = losing.way
    half, other_half, touch_m = half_sides_m(robots, losing.slot, other)
    reach_m = touch_m + near_m
    x, y, yaw = pose_of(robots, other, losing.end_s)
    turn, least = (cos(yaw), sin(yaw)), inf
    for at in range(len(way)):
        ahead_m = way[at, 3] - losing.came_m
        if ahead_m > NEAR_WAY_M:
            break
        dx, dy = x - way[at, 0], y - way[at, 1]
        if ahead_m < 0.0 or dx * dx + dy * dy >= reach_m * reach_m:
            continue
        gap_m = rectangle_gap(dx, dy, (cos(way[at, 2]), sin(way[at, 2])), turn, half, other_half)
        if gap_m < near_m:
            least = min(least, ahead_m + gap_m)
    return least


@inner
def _may_be_in_way(ahead_m: float, yaw_rad: float) -> bool:
    """Whether another robot, `ahead_m` ahead and turned by `yaw_rad`, comes into question at all."""
    return not (ahead_m < BEHIND_M and abs(yaw_rad) < ALIKE_RAD)


@inner
def find_blocker(robots: KnownRobots, losing: LosingRobot) -> tuple[int, bool]:
    """The robot in the way of another one, and whether it is on it rather than only crossing it; `NOBODY` if there is
    none."""
    slot, t_s = losing.slot, losing.end_s
    x, y, yaw = pose_of(robots, slot, t_s)
    best, blocker = inf, NOBODY
    best_crossing, crossing = inf, NOBODY
    best_near, near = inf, NOBODY
    for other in np.sort(nearest_rows(robots, slot, x, y, NEAR_M)):
        if t_s - robots.t_s[other, robots.newest[other]] > SILENT_S:
            continue
        other_x, other_y, other_yaw = pose_of(robots, other, t_s)
        ahead_m = (other_x - x) * cos(yaw) + (other_y - y) * sin(yaw)
        if not _may_be_in_way(ahead_m, _turn_between(yaw, other_yaw)):
            continue
        stays_m = STAYS_M if other == losing.blocker else 0.0
        cost = _cost_on_way(robots, losing, other) - stays_m
        if cost < best:
            best, blocker = cost, other
        away_m = hypot(other_x - x, other_y - y)
        is_own = robots.vendor[slot] == robots.vendor[other]
        may_cross = is_own and blocker == NOBODY and ahead_m > CROSSES_AHEAD_M and away_m < CROSSES_M
        if may_cross and away_m - stays_m < best_crossing and _crosses(robots, losing, other):
            best_crossing, crossing = away_m - stays_m, other
        may_be_near = losing.speed_mps < MOVES_MPS and losing.blocker in (NOBODY, other)
        if may_be_near and ahead_m > -BESIDE_BEHIND_M:
            cost = _cost_near_way(robots, losing, other, NEAR_WAY_GAP_M if ahead_m > CROSSES_AHEAD_M else BESIDE_M)
            cost -= stays_m
            if cost < best_near:
                best_near, near = cost, other
    if blocker != NOBODY:
        return blocker, True
    return crossing if crossing != NOBODY else near, False
