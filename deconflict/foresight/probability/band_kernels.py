"""How far from where they will be robots may be found, by the bands of their kind, and so how near pairs of them come.

Compiled; robots are by slot.
"""

from typing import Any

import numba
import numpy as np

from deconflict.foresight.forecast_errors.track_kernels import ERROR, ROBOT, Errors, Robots
from deconflict.foresight.probability.pair_table import PAIR, Pairs
from ingest.batch import Bools, Floats, Ints
from ingest.kernels import inner, kernel

EIGHTY = 1.28
"""A normal distribution has 80 % within so many standard deviations."""
EXACT_M = 0.02
"""Standard deviation of a forecast that was never wrong."""
SURPRISE_KEEPS, SURPRISE_MOST = 0.7, 10.0
"""Of a surprise, how much is left at the next error, and how many bands it is at the most."""
FINEST_BAND_M = 0.05
SOON = 0.2
"""The part of the horizon in which an overlap is looked for apart: forecasts are at their best there."""
CREEPING_MPS = 0.01

_PAIRS, _ROBOTS, _ERRORS = (numba.from_dtype(one)[::1] for one in (PAIR, ROBOT, ERROR))
_INTS, _FLOATS, _MATRIX, _CUBE = numba.int64[::1], numba.float64[::1], numba.float64[:, ::1], numba.float64[:, :, ::1]
_LOOKS = numba.types.Array(numba.float64, 1, "A", readonly=True)


@inner
def _reach(bands_m: Floats, kind: int, ahead_s: float) -> float:
    """Radius of the 80 % band of a kind so far ahead; linear between and beyond the whole seconds."""
    whole = min(max(int(np.floor(ahead_s)), 0), bands_m.shape[1] - 1)
    before = bands_m[kind, whole - 1, 1] if whole else 0.0
    return float(before + max(ahead_s - whole, 0.0) * (bands_m[kind, whole, 1] - before))


@inner
def _trust(robot: Any) -> float:
    """How many times as wide as those of its kind a robot's bands are taken."""
    return float(max(robot.surprise, 1.0))


@kernel(numba.void(_ROBOTS, _ERRORS))
def wonder(robots: Robots, errors: Errors) -> None:
    """Remember by how much errors a second ahead exceed the bands of their kind; of several of one robot the last
    counts."""
    surprise = np.empty(len(errors))
    for at, error in enumerate(errors):
        ratio = min(error.radial_m / max(error.bands_m[2], FINEST_BAND_M), SURPRISE_MOST)
        surprise[at] = SURPRISE_KEEPS * robots[error.robot].surprise + (1 - SURPRISE_KEEPS) * ratio
    for at, error in enumerate(errors):
        if error.horizon_s == 1:
            robots[error.robot].surprise = surprise[at]


@kernel(_FLOATS(_CUBE, _INTS, _ROBOTS, _MATRIX, *[numba.float64] * 3))
def reach_m(
    bands_m: Floats,
    slots: Ints,
    robots: Robots,
    half: Floats,
    beyond_m: float,
    horizon_s: float,
    most_grown_m: float,
) -> Floats:
    """(slots,) how far from where they will be robots of `slots` (n,) may be met: within the circle around their `half`
    sides (2, slots), `beyond_m` and their doubt, grown by their 80 % bands at the horizon."""
    reach = np.empty(len(robots))
    for slot in slots:
        robot = robots[slot]
        grown = min(_reach(bands_m, robot.kind, horizon_s) * _trust(robot), most_grown_m)
        reach[slot] = np.hypot(half[0, slot], half[1, slot]) + beyond_m + robot.doubt_m + grown
    return reach


@inner
def _follow(pair: Any, past_s: Floats, apart_m: Floats, row: int, within_m: float, margin_m: float) -> None:
    """When a pair came within `within_m`, when it was last, and whether it has drawn apart by more than the margin
    since."""
    began, looks = pair.inside, past_s.shape[1]
    for look in range(looks):
        if apart_m[row, look] <= within_m:
            if not began:
                pair.started_s, began = past_s[row, look], True
            pair.below_s = past_s[row, look]
    pair.inside = began and not within_m + margin_m < apart_m[row, looks - 1] < np.inf


@inner
def _square(bands_m: Floats, robot: Any, ahead_s: float) -> float:
    """Of the deviation of a robot's place `ahead_s` of its report."""
    reach = _reach(bands_m, robot.kind, ahead_s) * _trust(robot) / EIGHTY
    return float(reach * reach + robot.doubt_m * robot.doubt_m)


@inner
def _sds(bands_m: Floats, one: Any, other: Any, one_s: float, other_s: float, within_m: float) -> float:
    """By how many standard deviations of the distance of two robots that is more than `within_m` from a bound, so long
    after their reports."""
    square = _square(bands_m, one, one_s) + _square(bands_m, other, other_s)
    return float(within_m / (np.sqrt(square) + EXACT_M))


@kernel(_MATRIX(*[_INTS] * 2, _MATRIX, numba.boolean[:, ::1], _CUBE, _ROBOTS, _LOOKS, *[numba.float64] * 2))
def most_sds(
    a: Ints,
    b: Ints,
    apart_m: Floats,
    same: Bools,
    bands_m: Floats,
    robots: Robots,
    ahead_s: Floats,
    horizon_s: float,
    within_m: float,
) -> Floats:
    """(2, n) as `judge` gives, of robots `a` and `b` (n,) that are `apart_m` (n, m) at `ahead_s` (m,) from now, where
    they are known to be on the `same` floor (n, m)."""
    most = np.full((2, len(a)), -np.inf)
    for row in range(len(a)):
        one, other = robots[a[row]], robots[b[row]]
        for look in range(len(ahead_s)):
            if not same[row, look]:
                continue
            sds = _sds(bands_m, one, other, ahead_s[look], ahead_s[look], within_m - apart_m[row, look])
            most[0, row] = max(most[0, row], sds)
            if ahead_s[look] <= SOON * horizon_s:
                most[1, row] = max(most[1, row], sds)
    return most


@kernel(
    _MATRIX(
        _PAIRS,
        *[_INTS] * 4,
        *[_FLOATS] * 3,
        *[_MATRIX] * 2,
        numba.boolean[:, ::1],
        _MATRIX,
        _CUBE,
        _ROBOTS,
        _MATRIX,
        _LOOKS,
        *[numba.float64] * 5,
    )
)
def judge(
    pairs: Pairs,
    rows: Ints,
    a: Ints,
    b: Ints,
    swept_rows: Ints,
    swept_m: Floats,
    swept_s: Floats,
    contact_s: Floats,
    past_s: Floats,
    apart_m: Floats,
    same: Bools,
    speed_mps: Floats,
    bands_m: Floats,
    robots: Robots,
    seen: Floats,
    ahead_s: Floats,
    now_s: float,
    horizon_s: float,
    within_m: float,
    margin_m: float,
    standing_mps: float,
) -> Floats:
    """Set how near the pairs of `rows` (n,) came and come, and the features of that but for odds, of robots `a` and `b`
    (n,): their separations at the times `past_s` (n, k) and `ahead_s` (m,) from now are `apart_m` (n, k + m), where
    both are known to be on the `same` floor (n, k + m), and they go at `speed_mps` (2, n). Those of `swept_rows` (c,)
    come within `swept_m` at the times `swept_s` (c,) besides, and within `within_m` first at `contact_s` (c,).

    (2, n) by how many standard deviations of their distance they are within `within_m`, where that is most: in the
    horizon, and soon. The place of a robot that was last `seen` some time ago grows uncertain, unless it stood: it is
    still there, for all that is known.
    """
    n, past = len(rows), past_s.shape[1]
    most, swept_at = np.full((2, n), -np.inf), np.full(len(pairs), -1)
    for at in range(len(swept_rows)):
        swept_at[swept_rows[at]] = at
    for row in range(n):
        pair, swept = pairs[rows[row]], swept_at[rows[row]]
        for look in range(apart_m.shape[1]):
            if not same[row, look]:
                apart_m[row, look] = np.inf
        _follow(pair, past_s, apart_m, row, within_m, margin_m)
        one, other = robots[a[row]], robots[b[row]]
        one_silent_s = 0.0 if one.rests else max(now_s - seen[a[row], 0], 0.0)
        other_silent_s = 0.0 if other.rests else max(now_s - seen[b[row], 0], 0.0)
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
            sds = _sds(bands_m, one, other, after_s + one_silent_s, after_s + other_silent_s, within_m - separation_m)
            most[0, row] = max(most[0, row], sds)
            if after_s <= SOON * horizon_s:
                most[1, row] = max(most[1, row], sds)
        pair.near_s, pair.near_m, pair.now_m = nearest_s, max(nearest_m, 0.0), max(apart_m[row, past], 0.0)
        needed_s = max(apart_m[row, past] - within_m, 0.0) / max(speed_mps[0, row] + speed_mps[1, row], CREEPING_MPS)
        stands = speed_mps[0, row] < standing_mps or speed_mps[1, row] < standing_mps
        pair.seen[0], pair.seen[3], pair.seen[4] = 1.0, min(needed_s / horizon_s, 1.0), 1.0 if stands else 0.0
    return most
