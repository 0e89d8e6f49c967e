"""Measuring pairs: how near each pair comes by its forecasts, and how much of the error distribution is within the
clearance.

A pair's separation is sampled over the horizon. At each sample, the share of the two robots' error distributions that
lies within the clearance is a first guess of the probability. A distribution is taken as a normal one, by the 80 %
bands of robots that were on their way.
"""

import numpy as np

from deconflict.foresight.forecast_errors.pending_forecasts import PendingForecasts
from deconflict.foresight.forecast_errors.track_kernels import Looks
from deconflict.foresight.probability.calibration import log_odds
from deconflict.foresight.probability.error_band_kernels import Bounds, measure_overlaps, normal_shares
from deconflict.foresight.probability.pair_candidates import SweptConflicts
from deconflict.foresight.probability.pair_table import Pairs, slots_of
from deconflict.foresight.probability.tracked_robots import TrackedRobots
from deconflict.foresight.probability.waiting_robots import shares_over_starts
from deconflict.foresight.rollout.start_times import StartTimes
from ingest.batch import Bools, Floats, Ints

LOOKS: Floats = np.concatenate([np.arange(0.0, 5.0, 0.5), np.arange(5.0, 11.0)])
"""Tenths of the horizon at which a pair is looked at."""
PAST_LOOKS: Floats = np.arange(1, 6) / 5
"""Parts of the time since both robots reported before at which a pair is looked at."""


class PairMeasuring:
    """Measures rows of the pair table."""

    def __init__(self, bounds: Bounds, robots: TrackedRobots, pending: PendingForecasts) -> None:
        self._bounds, self._robots, self._pending = bounds, robots, pending
        self._ahead_s = LOOKS * (bounds.horizon_s / LOOKS[-1])

    def measure(
        self,
        pairs: Pairs,
        rows: Ints,
        swept: SweptConflicts,
        swept_rows: Ints,
        *,
        bands_m: Floats,
        start_times: StartTimes,
        is_blocked: Bools,
        now_s: float,
    ) -> None:
        """Set how near the pairs of `rows` come, their shares of the error distribution, and the features of both.

        `swept` are the conflicts of the exact sweep, which are in the rows `swept_rows` (c,). `bands_m` are (kinds,
        horizons, 3). `is_blocked` (slots,) marks the standing robots that have to wait for another one.
        """
        robots, ahead_s, bounds = self._robots, self._ahead_s, self._bounds
        a, b = slots_of(pairs["code"][rows])
        looks = Looks(PAST_LOOKS, ahead_s, now_s, np.zeros((2, len(rows))))
        poses, apart_m = robots.relative_poses(self._pending.history, a, b, looks)
        exact = (swept_rows, swept.separation_m, swept.separation_at_s, swept.contact_s)
        of_robots = (bands_m, robots.records, self._pending.newest)
        sds = measure_overlaps(pairs, rows, a, b, *exact, poses, apart_m, *of_robots, ahead_s, now_s, bounds)
        starts = shares_over_starts(
            normal_shares(sds), a, b, robots,
            pending=self._pending, start_times=start_times, is_blocked=is_blocked, bands_m=bands_m,
            now_s=now_s, ahead_s=ahead_s, horizon_s=bounds.horizon_s, clearance_m=bounds.clearance_m,
        )  # fmt: skip
        pairs["late_s"][rows] = pairs["late_s"][swept_rows] = 0.0
        is_late = ~np.isin(rows[starts.rows], swept_rows)
        late = rows[starts.rows[is_late]]
        for name in ("near_s", "near_m", "late_s"):
            pairs[name][late] = getattr(starts, name)[is_late]
        pairs["share"][rows] = starts.share[0]
        pairs["features"][rows, 1:3] = log_odds(starts.share).T
