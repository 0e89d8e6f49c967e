"""Robots that stand although their forecasts say that they go: how a late start changes what is expected of their
pairs."""

from typing import NamedTuple

import numpy as np

from deconflict.foresight.forecast_errors.pending_forecasts import PendingForecasts
from deconflict.foresight.forecast_errors.track_kernels import Looks, Robots
from deconflict.foresight.probability.error_band_kernels import most_sds, normal_shares
from deconflict.foresight.probability.pair_table import Pairs, row_of
from deconflict.foresight.probability.tracked_robots import TrackedRobots
from deconflict.foresight.rollout.start_times import LATE_S, StartTimes
from ingest.batch import Bools, Floats, Ints, Pair

NO_PAST: Floats = np.empty(0)
LONGEST_GAP_S = 5.0
"""Reports further apart do not tell when a robot started."""


class LateStarts(NamedTuple):
    """What late starts change of n pairs."""

    share: Floats
    """(2, n) shares of the error distribution within the clearance, averaged over the times at which a robot starts."""
    rows: Ints
    """(k,) the pairs that, if they come near, most probably do so because one of the two starts late."""
    near_s: Floats
    """(k,) when they then first come within the clearance, or are nearest; seconds since the epoch."""
    near_m: Floats
    """(k,) their smallest separation."""
    late_s: Floats
    """(k, 2) by how much later than its forecast says each robot then starts."""


def are_waiting(robots: Robots) -> Bools:
    """Which robots stand by their reports, and go at once by their forecasts."""
    return (robots["stood_since_s"] < np.inf) & robots["leaves"]


def record_starts(
    start_times: StartTimes,
    before: Robots,
    after: Robots,
    blocked: Bools,
    before_s: Floats,
    now_s: Floats,
    tick_s: float,
) -> None:
    """Count which waiting robots have started.

    `before` and `after` are the n robots as of their last reports but one and their last, at `before_s` and `now_s`
    (n,). `blocked` (n,) marks those that had to wait for another robot.
    """
    rows = np.flatnonzero(are_waiting(before) & (now_s > before_s) & (now_s - before_s < LONGEST_GAP_S))
    if len(rows):
        stood_s, lasted_s = before_s[rows] - before["stood_since_s"][rows], now_s[rows] - before_s[rows]
        started = (after["stood_since_s"][rows] == np.inf).astype(np.float64)
        start_times.record(before["kind"][rows], blocked[rows], stood_s, lasted_s, started, tick_s)


def shares_over_starts(
    share: Floats,
    a: Ints,
    b: Ints,
    tracked: TrackedRobots,
    *,
    pending: PendingForecasts,
    start_times: StartTimes,
    is_blocked: Bools,
    bands_m: Floats,
    now_s: float,
    ahead_s: Floats,
    horizon_s: float,
    clearance_m: float,
) -> LateStarts:
    """What is expected of the pairs `a` and `b` (n,) over the times at which a waiting robot may start.

    `share` (2, n) is that of the forecasts as sent. It is kept for pairs of which both robots wait, or neither.
    `is_blocked` (slots,) is whether a robot has to wait for another one.
    """
    robots = tracked.records
    waiting = are_waiting(robots)
    rows = np.flatnonzero(waiting[a] ^ waiting[b])
    if not len(rows):
        return LateStarts(share, rows, NO_PAST, NO_PAST, np.empty((0, 2)))
    waiter = np.where(waiting[a[rows]], a[rows], b[rows])
    weights = start_times.weights(robots["kind"][waiter], is_blocked[waiter], now_s - robots["stood_since_s"][waiter])
    delays_s = LATE_S[1:]
    each_a, each_b = np.repeat(a[rows], len(delays_s)), np.repeat(b[rows], len(delays_s))
    late_s = np.where(waiting[np.stack([each_a, each_b])], np.tile(delays_s, len(rows)), 0.0)
    looks = Looks(NO_PAST, ahead_s, now_s, late_s)
    poses, apart_m = tracked.relative_poses(pending.history, each_a, each_b, looks)
    sds = most_sds(each_a, each_b, apart_m, poses.is_same_floor, bands_m, robots, ahead_s, horizon_s, clearance_m)
    late = normal_shares(sds).reshape(2, len(rows), len(delays_s)) * weights[:, 1:]
    result = share.copy()
    result[:, rows] = weights[:, 0] * share[:, rows] + late.sum(axis=2)
    is_late = late[0].max(axis=1) > weights[:, 0] * share[0, rows]
    chosen = (np.arange(len(rows)) * len(delays_s) + late[0].argmax(axis=1))[is_late]
    look, near_m = _first_near(np.where(poses.is_same_floor[chosen], apart_m[chosen], np.inf), clearance_m)
    return LateStarts(result, rows[is_late], now_s + ahead_s[look], near_m, late_s[:, chosen].T)


def _first_near(apart_m: Floats, within_m: float) -> tuple[Ints, Floats]:
    """(n,) the first of the m looks at which pairs `apart_m` (n, m) are `within_m`, or nearest if they never are; and
    (n,) their smallest separation."""
    near_m = np.maximum(apart_m.min(axis=1), 0.0)
    return (apart_m <= np.maximum(near_m, within_m)[:, None]).argmax(axis=1), near_m


def late_starts(pair: Pair, tracked: TrackedRobots, pairs: Pairs) -> tuple[float, float]:
    """By how much later than its forecast says each robot of a pair most probably starts, if they come near so."""
    code = tracked.code_of(*pair)
    if code is None or (row := row_of(pairs, code)) is None:
        return 0.0, 0.0
    first_s, second_s = pairs["late_s"][row].tolist()
    return first_s, second_s
