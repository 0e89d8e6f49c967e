"""The way that a robot has left, along its forecast, until it meets another robot. Both are where they report to be.

The kernel is long because it takes the history of reports column by column, and compiled because it goes through looks,
places of a way and other robots number by number.
"""

from math import cos, hypot, inf, pi, sin
from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

from deconflict.foresight.interactions.progress_kernels import AHEAD_S, KEPT, STATE
from deconflict.foresight.motion_assumptions import BRAKES_MPS2
from deconflict.sweep.geometry.envelope_distances import rectangle_gap
from ingest.batch import Floats, Ints
from ingest.kernels import CUBES, FLOAT, FLOATS, INT, INTS, MATRIX, inner, kernel

BEYOND_M = 1.0
"""A robot is in the way of another one if it is on that one's way within its stopping distance plus this."""
TOUCHES_M = 0.1
"""A way leads to another robot if the envelopes come this near."""
NEARER_M = 0.05
"""They must also come nearer than they were by this: a robot that stands beside the way is not in it."""

_STATES = numba.from_dtype(STATE)[::1]


@inner
def _unwrap(poses: Floats, count: int) -> None:
    """Make the headings of the first poses (k, 3) continuous, as `np.unwrap` does."""
    before_rad, shift_rad = poses[0, 2], 0.0
    for at in range(1, count):
        turn_rad, before_rad = poses[at, 2] - before_rad, poses[at, 2]
        if abs(turn_rad) >= pi:
            shorter_rad = (turn_rad + pi) % (2 * pi) - pi
            if shorter_rad == -pi and turn_rad > 0.0:
                shorter_rad = pi
            shift_rad += shorter_rad - turn_rad
        poses[at, 2] += shift_rad


@inner
def _set_known(state: Any, t_s: Floats, tracks: Floats, known_s: Floats, known: Floats) -> int:
    """Write the times `known_s` (k,) and poses `known` (k, 3) of one robot: of its kept reports, the oldest first, and
    of the forecast of the newest. Returns k.

    `t_s` (KEPT,) and `tracks` (KEPT, AHEAD_S + 1, 3) are its history.
    """
    count = state.reports + AHEAD_S
    for at in range(count):
        after = at + 1 - state.reports
        place, ahead_s = (state.newest + min(after, 0)) % KEPT, max(after, 0)
        known_s[at] = t_s[place] + ahead_s
        for part in range(3):
            known[at, part] = tracks[place, ahead_s, part]
    _unwrap(known, count)
    return int(count)


@inner
def _set_poses(known_s: Floats, known: Floats, count: int, looks_s: Floats, poses: Floats) -> None:
    """Write the poses (n, 3) at ascending times (n,), by the first `count` that are known (k, 3) at times (k,)."""
    at = 0
    for look in range(len(looks_s)):
        while at + 1 < count and known_s[at + 1] <= looks_s[look]:
            at += 1
        is_between = at + 1 < count and looks_s[look] > known_s[0]
        for part in range(3):
            poses[look, part] = known[at, part]
            if is_between:
                per_s = (known[at + 1, part] - known[at, part]) / (known_s[at + 1] - known_s[at])
                poses[look, part] = per_s * (looks_s[look] - known_s[at]) + known[at, part]


@inner
def _set_along(way: Floats, poses: Floats, along_m: Floats) -> None:
    """Write how far along a way (k, 4) each of n poses is, never decreasing."""
    furthest_m = -inf
    for look in range(len(poses)):
        nearest, least_m = 0, inf
        for at in range(len(way)):
            away_m = hypot(way[at, 0] - poses[look, 0], way[at, 1] - poses[look, 1])
            if away_m < least_m:
                nearest, least_m = at, away_m
        furthest_m = max(furthest_m, way[nearest, 3])
        along_m[look] = furthest_m


@inner
def _set_reach(along_m: Floats, looks_s: Floats, most_mps: float, reach_m: Floats) -> None:
    """Write how far ahead robots are in the way at each look: the stopping distance, plus `BEYOND_M`. The speed is that
    from the look before to the look after, 0 if there is only one look."""
    last = len(looks_s) - 1
    for look in range(len(looks_s)):
        before, after, speed_mps = max(look - 1, 0), min(look + 1, last), 0.0
        if before < after:
            speed_mps = (along_m[after] - along_m[before]) / (looks_s[after] - looks_s[before])
        speed_mps = min(max(speed_mps, 0.0), most_mps)
        reach_m[look] = speed_mps * speed_mps / (2 * BRAKES_MPS2) + BEYOND_M


@inner
def _way_left_m(
    way: Floats, along_m: float, reach_m: float, pose: Floats, half: tuple[float, float], other: tuple[float, float]
) -> float:
    """The way that is left from `along_m` until the envelope touches that of another robot at `pose` (3,); inf if it
    does not within `reach_m`. `half` and `other` are half sides of the two."""
    turn, first_m = (cos(pose[2]), sin(pose[2])), inf
    for at in range(len(way)):
        ahead_m = way[at, 3] - along_m
        if ahead_m < 0.0:
            continue
        if ahead_m > reach_m:
            break
        dx, dy = pose[0] - way[at, 0], pose[1] - way[at, 1]
        apart_m = rectangle_gap(dx, dy, (cos(way[at, 2]), sin(way[at, 2])), turn, half, other)
        if first_m == inf:
            first_m = apart_m
        if apart_m < TOUCHES_M and apart_m < first_m - NEARER_M:
            return float(ahead_m)
    return inf


@kernel(FLOATS(_STATES, MATRIX, CUBES, INTS, MATRIX, INT, INTS, FLOATS, MATRIX, FLOAT, MATRIX))
def ways_left_m(
    states: NDArray[Any],
    t_s: Floats,
    tracks: Floats,
    row_of: Ints,
    rest: Floats,
    slot: int,
    others: Ints,
    looks_s: Floats,
    way: Floats,
    most_mps: float,
    half_m: Floats,
) -> Floats:
    """(r,) the shortest way that the robot of `slot` has left to each of the robots `others` (r,), at any of n looks;
    inf if it does not reach that robot within its stopping distance plus `BEYOND_M`.

    It drives along `way` (k, 4), at most at `most_mps`; the looks are at ascending times `looks_s` (n,). The history
    (`states`, `t_s` and `tracks`) is as in `add_reports`, by row. By slot are the row of each robot that does not rest,
    -1 for others, the poses `rest` (slots, 4) of those that rest, and half sides `half_m` (2, slots).
    """
    left_m, along_m, poses = np.full(len(others), inf), np.empty(len(looks_s)), np.empty((len(looks_s), 3))
    known_s, known, reach_m = np.empty(KEPT + AHEAD_S), np.empty((KEPT + AHEAD_S, 3)), np.empty(len(looks_s))
    for number in range(-1, len(others)):
        robot = slot if number < 0 else others[number]
        row = row_of[robot]
        if row >= 0:
            count = _set_known(states[row], t_s[row], tracks[row], known_s, known)
            _set_poses(known_s, known, count, looks_s, poses)
        else:
            for look in range(len(looks_s)):
                for part in range(3):
                    poses[look, part] = rest[robot, part]
        if number < 0:
            _set_along(way, poses, along_m)
            _set_reach(along_m, looks_s, most_mps, reach_m)
            continue
        half, other = (half_m[0, slot], half_m[1, slot]), (half_m[0, robot], half_m[1, robot])
        for look in range(len(looks_s)):
            nearest_m = min(reach_m[look], left_m[number])
            left_m[number] = min(left_m[number], _way_left_m(way, along_m[look], nearest_m, poses[look], half, other))
    return left_m
