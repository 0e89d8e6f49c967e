"""Robots that stand and say that they go: how late they start, as far as their pairs are concerned."""

import numpy as np
from scipy.special import ndtr

from deconflict.foresight.forecast_errors.pending_forecasts import PendingForecasts
from deconflict.foresight.forecast_errors.track_kernels import Robots
from deconflict.foresight.probability.band_kernels import most_sds
from deconflict.foresight.probability.start_times import LATE_S, StartTimes
from deconflict.sweep.geometry.rectangles import signed_gap
from ingest.batch import Bools, Floats, Ints

NO_PAST: Floats = np.empty(0)


def waits(robots: Robots) -> Bools:
    """Which robots stand by their reports, and go at once by their forecasts."""
    waiting: Bools = (robots["stood_since_s"] < np.inf) & robots["leaves"]
    return waiting


def heard(
    starts: StartTimes, before: Robots, after: Robots, blocked: Bools, before_s: Floats, now_s: Floats, tick_s: float
) -> None:
    """Count which of n robots that waited as of the reports `before`, at `before_s` (n,), have started by the reports
    `after`, at `now_s` (n,); of those that had to wait for another robot, `blocked` (n,), apart."""
    rows = np.flatnonzero(waits(before) & (now_s > before_s) & (now_s - before_s < 5.0))
    if len(rows):
        stood_s, lasted_s = before_s[rows] - before["stood_since_s"][rows], now_s[rows] - before_s[rows]
        started = (after["stood_since_s"][rows] == np.inf).astype(np.float64)
        starts.record(before["kind"][rows], blocked[rows], stood_s, lasted_s, started, tick_s)


def mixed(
    share: Floats,
    a: Ints,
    b: Ints,
    now_s: float,
    ahead_s: Floats,
    bounds: tuple[float, float],
    robots: Robots,
    half: Floats,
    followed: PendingForecasts,
    starts: StartTimes,
    blocked: Bools,
    bands_m: Floats,
) -> Floats:
    """(2, n) shares of the error distribution of pairs `a` and `b` (n,) over the times at which a robot that waits may
    start.

    `share` (2, n) is that of the forecasts as told; which robots have to wait for another one is `blocked`, by slot;
    `bounds` are the horizon in seconds and the clearance in metres. Of pairs of which both wait, or neither, it is what
    it was.
    """
    waiting = waits(robots)
    rows = np.flatnonzero(waiting[a] ^ waiting[b])
    if not len(rows):
        return share
    waiter = np.where(waiting[a[rows]], a[rows], b[rows])
    weights = starts.weights(robots["kind"][waiter], blocked[waiter], now_s - robots["stood_since_s"][waiter])
    later_s = LATE_S[1:]
    ext_a, ext_b = np.repeat(a[rows], len(later_s)), np.repeat(b[rows], len(later_s))
    late_s = np.where(waiting[np.stack([ext_a, ext_b])], np.tile(later_s, len(rows)), 0.0)
    beside = followed.beside(ext_a, ext_b, NO_PAST, ahead_s, now_s, late_s)
    sizes = half.take(ext_a, axis=1), half.take(ext_b, axis=1)
    apart_m = signed_gap(beside.dx_m, beside.dy_m, beside.yaw_a_rad, beside.yaw_b_rad, *sizes)
    horizon_s, clearance_m = bounds
    sds = most_sds(ext_a, ext_b, apart_m, beside.same, bands_m, robots, ahead_s, horizon_s, clearance_m)
    late = ndtr(sds).reshape(2, len(rows), len(later_s))
    result = share.copy()
    result[:, rows] = weights[:, 0] * share[:, rows] + (late * weights[:, 1:]).sum(axis=2)
    return result
