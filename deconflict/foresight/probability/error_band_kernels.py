"""How far from their forecast places robots may be, by the error bands of their kind, and how near pairs may come.

The functions are compiled. Arrays of robots are by slot. `measure_overlaps` is long because it is one loop over the
pairs and the moments, in which the nearest moment and the largest overlaps are found together.
"""

from math import erfc, sqrt
from typing import Any, NamedTuple

import numba
import numpy as np

from deconflict.foresight.forecast_errors.track_kernels import (
    ERROR,
    POSES,
    ROBOT,
    Errors,
    RelativePoses,
    Robots,
)
from deconflict.foresight.probability.pair_table import PAIR, Pairs
from deconflict.sweep.geometry.encounter import STANDING_MPS
from ingest.batch import Bools, Floats, Ints
from ingest.kernels import ANY_FLOATS, BOOL_MATRIX, CUBE, FLOAT, FLOATS, INTS, MATRIX, inner, kernel

EIGHTY = 1.28
"""80 % of a normal distribution is within this many standard deviations."""
EXACT_M = 0.02
"""Standard deviation, in metres, of a forecast that was never wrong."""
SURPRISE_KEEPS, SURPRISE_MOST = 0.7, 10.0
"""The share of a surprise that is left at the next error, and the largest surprise, in bands."""
FINEST_BAND_M = 0.05
"""Narrower bands count as so wide when an error is divided by its band."""
SOON = 0.2
"""The first part of the horizon, for which the overlap is measured apart: forecasts are best there."""
CREEPING_MPS = 0.01
"""Two robots are taken to approach each other at least so fast."""


class Bounds(NamedTuple):
    """The settings of a measurement."""

    clearance_m: float
    apart_m: float
    """An encounter is over once the two are farther apart than this."""
    horizon_s: float


_PAIRS, _ROBOTS, _ERRORS = (numba.from_dtype(dtype)[::1] for dtype in (PAIR, ROBOT, ERROR))
_BOUNDS = numba.types.NamedUniTuple(FLOAT, 3, Bounds)  # type: ignore[no-untyped-call]


@inner
def _reach(bands_m: Floats, kind: int, ahead_s: float) -> float:
    """Radius of the 80 % band of a kind at a time ahead, linear between and beyond the whole seconds."""
    whole = min(max(int(np.floor(ahead_s)), 0), bands_m.shape[1] - 1)
    before = bands_m[kind, whole - 1, 1] if whole else 0.0
    return float(before + max(ahead_s - whole, 0.0) * (bands_m[kind, whole, 1] - before))


@inner
def _widening(robot: Any) -> float:
    """The factor by which a robot's bands are wider than those of its kind."""
    return float(max(robot.surprise, 1.0))


@kernel(numba.void(_ROBOTS, _ERRORS))
def update_surprise(robots: Robots, errors: Errors) -> None:
    """Update by how much each robot's errors a second ahead exceed the bands of their kind. Of several errors of one
    robot the last counts."""
    surprise = np.empty(len(errors))
    for at, error in enumerate(errors):
        ratio = min(error.radial_m / max(error.bands_m[2], FINEST_BAND_M), SURPRISE_MOST)
        surprise[at] = SURPRISE_KEEPS * robots[error.robot].surprise + (1 - SURPRISE_KEEPS) * ratio
    for at, error in enumerate(errors):
        if error.horizon_s == 1:
            robots[error.robot].surprise = surprise[at]


@kernel(FLOATS(CUBE, INTS, _ROBOTS, MATRIX, *[FLOAT] * 3))
def reach_m(
    bands_m: Floats,
    slots: Ints,
    robots: Robots,
    half_m: Floats,
    beyond_m: float,
    horizon_s: float,
    most_grown_m: float,
) -> Floats:
    """(slots,) how far from its forecast place each robot of `slots` (n,) may reach: the radius of the circle around
    its half sides `half_m` (2, slots), plus `beyond_m`, its position doubt, and its 80 % band at the horizon."""
    reach = np.empty(len(robots))
    for slot in slots:
        robot = robots[slot]
        grown = min(_reach(bands_m, robot.kind, horizon_s) * _widening(robot), most_grown_m)
        reach[slot] = np.hypot(half_m[0, slot], half_m[1, slot]) + beyond_m + robot.doubt_m + grown
    return reach


@inner
def _update_encounter(pair: Any, past_s: Floats, apart_m: Floats, row: int, bounds: Bounds) -> None:
    """Set when a pair came within the clearance, when it was last so near, and whether it has not yet drawn apart
    since."""
    began, looks = pair.in_encounter, past_s.shape[1]
    for look in range(looks):
        if apart_m[row, look] <= bounds.clearance_m:
            if not began:
                pair.started_s, began = past_s[row, look], True
            pair.last_within_s = past_s[row, look]
    pair.in_encounter = began and not bounds.apart_m < apart_m[row, looks - 1] < np.inf


@inner
def _variance(bands_m: Floats, robot: Any, ahead_s: float) -> float:
    """Variance of a robot's place `ahead_s` seconds after its report, in square metres."""
    reach = _reach(bands_m, robot.kind, ahead_s) * _widening(robot) / EIGHTY
    return float(reach * reach + robot.doubt_m * robot.doubt_m)


@inner
def _sds(bands_m: Floats, a: Any, b: Any, a_s: float, b_s: float, within_m: float) -> float:
    """`within_m` in standard deviations of the distance between robots `a` and `b`, `a_s` and `b_s` seconds after their
    reports."""
    square = _variance(bands_m, a, a_s) + _variance(bands_m, b, b_s)
    return float(within_m / (np.sqrt(square) + EXACT_M))


@kernel(MATRIX(*[INTS] * 2, MATRIX, BOOL_MATRIX, CUBE, _ROBOTS, ANY_FLOATS, *[FLOAT] * 2))
def most_sds(
    a: Ints,
    b: Ints,
    apart_m: Floats,
    is_same_floor: Bools,
    bands_m: Floats,
    robots: Robots,
    ahead_s: Floats,
    horizon_s: float,
    within_m: float,
) -> Floats:
    """(2, n) as `measure_overlaps` returns, of robots `a` and `b` (n,) that are `apart_m` (n, m) apart at `ahead_s`
    (m,) seconds from now, where `is_same_floor` (n, m): both are known to be on one floor."""
    most = np.full((2, len(a)), -np.inf)
    for row in range(len(a)):
        robot_a, robot_b = robots[a[row]], robots[b[row]]
        for look in range(len(ahead_s)):
            if not is_same_floor[row, look]:
                continue
            sds = _sds(bands_m, robot_a, robot_b, ahead_s[look], ahead_s[look], within_m - apart_m[row, look])
            most[0, row] = max(most[0, row], sds)
            if ahead_s[look] <= SOON * horizon_s:
                most[1, row] = max(most[1, row], sds)
    return most


@kernel(MATRIX(_PAIRS, *[INTS] * 4, *[FLOATS] * 3, POSES, MATRIX, CUBE, _ROBOTS, MATRIX, ANY_FLOATS, FLOAT, _BOUNDS))
def measure_overlaps(
    pairs: Pairs,
    rows: Ints,
    a: Ints,
    b: Ints,
    swept_rows: Ints,
    swept_m: Floats,
    swept_s: Floats,
    contact_s: Floats,
    poses: RelativePoses,
    apart_m: Floats,
    bands_m: Floats,
    robots: Robots,
    newest: Floats,
    ahead_s: Floats,
    now_s: float,
    bounds: Bounds,
) -> Floats:
    """Set how near the pairs of `rows` (n,) came and will come, and the features 0, 3 and 4 of each.

    Of the robots `a` and `b` (n,) are known: their `poses`, and their separations `apart_m` (n, k + m) at the k moments
    of the past and at `ahead_s` (m,) seconds from now. The exact sweep found the pairs of `swept_rows` (c,): their
    smallest separation `swept_m` (c,), its time `swept_s` (c,), and when they first come within the clearance,
    `contact_s` (c,).

    Returns (2, n): by how many standard deviations of its distance a pair is within the clearance, at the time at which
    that is most, over the whole horizon and over its first part `SOON`. The place of a robot grows uncertain with the
    time since its report in `newest` (slots, 5), unless it stood: it is then taken to be there still.
    """
    past_s, is_same_floor, speed_mps = poses.past_s, poses.is_same_floor, poses.speed_mps
    within_m, horizon_s = bounds.clearance_m, bounds.horizon_s
    n, past = len(rows), past_s.shape[1]
    most, swept_at = np.full((2, n), -np.inf), np.full(len(pairs), -1)
    for at in range(len(swept_rows)):
        swept_at[swept_rows[at]] = at
    for row in range(n):
        pair, swept = pairs[rows[row]], swept_at[rows[row]]
        for look in range(apart_m.shape[1]):
            if not is_same_floor[row, look]:
                apart_m[row, look] = np.inf
        _update_encounter(pair, past_s, apart_m, row, bounds)
        robot_a, robot_b = robots[a[row]], robots[b[row]]
        silent_a_s = 0.0 if robot_a.rests else max(now_s - newest[a[row], 0], 0.0)
        silent_b_s = 0.0 if robot_b.rests else max(now_s - newest[b[row], 0], 0.0)
        nearest_m, nearest_s = apart_m[row, past], now_s + ahead_s[0]
        pair.contact_s = contact_s[swept] if swept >= 0 else np.inf
        for look in range(len(ahead_s) + (swept >= 0)):
            if look < len(ahead_s):
                separation_m, at_s = apart_m[row, past + look], now_s + ahead_s[look]
                is_nearest = separation_m < nearest_m
            else:
                separation_m, at_s = swept_m[swept], swept_s[swept]
                is_nearest = separation_m <= nearest_m
            if is_nearest:
                nearest_m, nearest_s = separation_m, at_s
            after_s = at_s - now_s
            a_s, b_s = after_s + silent_a_s, after_s + silent_b_s
            sds = _sds(bands_m, robot_a, robot_b, a_s, b_s, within_m - separation_m)
            most[0, row] = max(most[0, row], sds)
            if after_s <= SOON * horizon_s:
                most[1, row] = max(most[1, row], sds)
        pair.near_s, pair.near_m, pair.now_m = nearest_s, max(nearest_m, 0.0), max(apart_m[row, past], 0.0)
        needed_s = max(apart_m[row, past] - within_m, 0.0) / max(speed_mps[0, row] + speed_mps[1, row], CREEPING_MPS)
        stands = speed_mps[0, row] < STANDING_MPS or speed_mps[1, row] < STANDING_MPS
        pair.features[0], pair.features[3], pair.features[4] = (
            1.0,
            min(needed_s / horizon_s, 1.0),
            1.0 if stands else 0.0,
        )
    return most


@kernel(MATRIX(MATRIX))
def normal_shares(sds: Floats) -> Floats:
    """(k, n) the shares of a normal distribution that are below so many standard deviations (k, n)."""
    shares = np.empty_like(sds)
    for row in range(sds.shape[0]):
        for column in range(sds.shape[1]):
            shares[row, column] = 0.5 * erfc(-sds[row, column] / sqrt(2.0))
    return shares
