"""Which pairs are worth a look: those that the exact sweep found, and those that may come near."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from deconflict.foresight.forecast_errors.pending_forecasts import PendingForecasts
from deconflict.foresight.probability.error_band_kernels import reach_m
from deconflict.foresight.probability.pair_table import codes
from deconflict.foresight.probability.tracked_robots import TrackedRobots
from deconflict.sweep.geometry.heights import heights_overlap
from ingest.batch import Bools, Floats, Ints, Pair

MOST_GROWN_M = 0.75
"""To find candidates, an envelope grows by its 80 % band at the horizon, but at most by this."""


class SweptConflicts(NamedTuple):
    """What the exact sweep found: c pairs whose forecasts come within the clearance. Arrays are (c,)."""

    pairs: Sequence[Pair]
    separation_m: Floats
    """Smallest separation of the envelopes over the horizon."""
    separation_at_s: Floats
    """When it is reached."""
    contact_s: Floats
    """First time within the clearance."""


class PairCandidates:
    """Finds the codes of the candidates of each look."""

    def __init__(self, robots: TrackedRobots, clearance_m: float, horizon_s: float) -> None:
        self._robots, self._clearance_m, self._horizon_s = robots, clearance_m, horizon_s

    def swept_codes(self, swept: SweptConflicts) -> Ints:
        """(c,) the codes of the pairs that the sweep found."""
        slots_of = self._robots.slots
        slots = np.array([slots_of[uuid] for pair in swept.pairs for uuid in pair], np.int64)
        return codes(slots[::2], slots[1::2])

    def nearby_codes(self, has_news: Bools, pending: PendingForecasts, bands_m: Floats, now_s: float) -> Ints:
        """(p,) the codes of the pairs that may come near at any whole second of the horizon. At least one robot of each
        pair is marked by `has_news` (slots,), and none is in a crowd.

        Envelopes are taken as circles, which hold the trailers, grown by the 80 % bands `bands_m` (kinds, horizons, 3)
        at the horizon.
        """
        if not has_news.any():
            return np.empty(0, np.int64)
        robots, slots = self._robots, np.flatnonzero(self._robots.is_used)
        columns = (slots, robots.records, robots.half_m)
        near_m = reach_m(bands_m, *columns, self._clearance_m / 2, self._horizon_s, MOST_GROWN_M)
        trains, reaches_m = robots.trailers.reaches_m()
        near_m[trains] += np.maximum(reaches_m - np.hypot(*robots.half_m[:, trains]), 0.0)
        a, b = pending.candidate_pairs(has_news, slots, robots.rank, near_m, now_s, self._horizon_s).T
        is_level = heights_overlap(*robots.levels_m[:, a], *robots.levels_m[:, b])
        is_crowded = robots.is_crowded()
        is_level &= ~(is_crowded[a] | is_crowded[b])
        return codes(a[is_level], b[is_level])
