"""The path believer, a baseline for comparison: it alerts when the forecasts of a pair come within the clearance.

It trusts forecasts as they are reported, and has neither memory nor probabilities. It runs once a second and ignores
silent robots.
"""

from collections.abc import Iterable
from dataclasses import replace
from math import floor

import numpy as np

from deconflict.sweep.contact_intervals import PairConflicts
from deconflict.sweep.geometry.encounter import CLASSES
from deconflict.sweep.incremental import Sweeper
from ingest.batch import Batch, Ints, Pair
from metrics.scoring.warnings.outcomes_by_moment import HORIZON_S
from metrics.scoring.warnings.precision_by_encounters import Alert

LOOK_S = 1.0


class PathBeliever:
    """The alerts of one clearance. Each is a run of seconds at which a conflict of its pair is predicted within
    10 s."""

    def __init__(self, clearance_m: float) -> None:
        self._clearance_m = clearance_m
        self._sweeper = Sweeper(clearance_m=clearance_m, horizon_s=HORIZON_S)
        self._vendor_of: dict[str, str] = {}
        """By robot that has reported."""
        self._standing: dict[Pair, Alert] = {}
        """Cleared a second after the last look, unless the next look finds the conflict again."""
        self._closed: list[Alert] = []
        self._second: int | None = None

    def add_batch(self, batch: Batch) -> None:
        """Add the robots of a batch that have reported, without those whose older report is only repeated."""
        if batch.gone:
            self._sweeper.discard(batch.gone)
            self._sweeper.slots.release(batch.gone)
        if not len(batch):
            return
        reported = batch.statuses > 0
        if not reported.all():
            reported |= np.array([robot not in self._vendor_of for robot in batch.robots])
            batch = batch.take(np.flatnonzero(reported))
        self._vendor_of.update(zip(batch.robots, batch.vendors, strict=True))
        self._sweeper.update(batch.robots, batch.forecasts)

    def advance(self, now_s: float, fallen_silent: Iterable[str]) -> None:
        """Update the alerts at the first pass of each second. `fallen_silent` robots became silent since the
        last call."""
        before, self._second = self._second, floor(now_s)
        if before == self._second:
            return
        self._sweeper.discard(fallen_silent)
        standing = self._standing if before is not None and before + 1 == self._second else {}
        found = self._sweeper.find_conflicts(now_s)
        ahead = np.flatnonzero(found.start_separation_m > self._clearance_m)
        pairs = [found.pairs[row] for row in ahead.tolist()]
        new = [at for at, pair in enumerate(pairs) if pair not in standing]
        alerts = self._raised(found, ahead[new], now_s)
        stays = {pair: replace(standing[pair], cleared_s=now_s + LOOK_S) for pair in pairs if pair in standing}
        self._closed += [alert for pair, alert in self._standing.items() if pair not in stays]
        self._standing = stays | {alert.pair: alert for alert in alerts}

    def alerts(self) -> list[Alert]:
        """All alerts, closed and open."""
        return [*self._closed, *self._standing.values()]

    def _raised(self, found: PairConflicts, rows: Ints, now_s: float) -> list[Alert]:
        """New alerts for the conflicts in `rows` (n,)."""
        if not len(rows):
            return []
        pairs, contact_s = [found.pairs[row] for row in rows.tolist()], found.contact_s[rows]
        kinds = self._sweeper.encounters(pairs, contact_s)["kind"].tolist()
        return [
            Alert(
                pair,
                (self._vendor_of[pair[0]], self._vendor_of[pair[1]]),
                raised_s=now_s,
                cleared_s=now_s + LOOK_S,
                predicted_s=predicted_s,
                left_s=np.inf,
                encounter_class=CLASSES[kind].value,
            )
            for pair, predicted_s, kind in zip(pairs, contact_s.tolist(), kinds, strict=True)
        ]
