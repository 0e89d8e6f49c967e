"""Which pairs have just come within the clearance by their newest forecasts: each makes a black box recording."""

import numpy as np

from deconflict.sweep.contact_intervals import PairConflicts
from ingest.batch import Pair


class NearMissTrigger:
    """Gives each pair once, until it has drawn apart by the clearance and a margin."""

    def __init__(self, clearance_m: float, apart_m: float) -> None:
        """A pair that is further apart than `apart_m` may come in again."""
        self._clearance_m, self._apart_m = clearance_m, apart_m
        self._inside: set[Pair] = set()

    def new_pairs(self, conflicts: PairConflicts) -> list[Pair]:
        """The pairs that are within the clearance now and were not in the last pass, in ascending order."""
        start_m = conflicts.start_separation_m
        rows = np.flatnonzero(start_m <= self._apart_m).tolist()
        self._inside &= {conflicts.pairs[row] for row in rows}
        within = {conflicts.pairs[row] for row in rows if start_m[row] <= self._clearance_m}
        new_pairs = sorted(within - self._inside)
        self._inside |= within
        return new_pairs
