"""Which robots have come within the clearance, by the forecasts as they stand: what a black box is made for."""

import numpy as np

from deconflict.sweep.incremental import PairConflicts
from ingest.batch import Pair


class Trigger:
    """Tells of each pair once, until it has drawn apart by the clearance and a margin."""

    def __init__(self, clearance_m: float, margin_m: float) -> None:
        self._clearance_m, self._apart_m = clearance_m, clearance_m + margin_m
        self._inside: set[Pair] = set()

    def step(self, conflicts: PairConflicts) -> list[Pair]:
        """The pairs that are within the clearance and were not at the last step, ascending."""
        start_m = conflicts.start_separation_m
        rows = np.flatnonzero(start_m <= self._apart_m).tolist()
        self._inside &= {conflicts.pairs[row] for row in rows}
        within = {conflicts.pairs[row] for row in rows if start_m[row] <= self._clearance_m}
        began = sorted(within - self._inside)
        self._inside |= within
        return began
