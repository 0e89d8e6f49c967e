"""Whether a vendor's forecasts have become worse, since when, and by how much.

Errors of its moving robots three seconds ahead are gathered for two minutes; the size within which four in five of them
lie is one value for the test of `ingest.levels`, as a logarithm, so that a vendor is held to its own usual errors.
"""

from dataclasses import dataclass, field
from math import exp, log

import numpy as np

from deconflict.foresight.grades import GRADED_S
from deconflict.foresight.ledger import Errors, Kind
from deconflict.foresight.sketch import BINS, bins, quantiles
from deconflict.learned import Part, UnreadableError
from ingest.levels import Change, Level, Limits
from ingest.seam import Basis, Floats

GATHERED_S, FEWEST = 120.0, 20
"""A value is of so long, and of so many errors."""
SHARE: Floats = np.array([0.8])
FINE_M = 0.2
"""Errors smaller than this hardly differ."""
LIMITS = Limits(least_spread=0.15, least_change=0.4, rises_only=True)
"""Of logarithms: a change by less than half as much again is none."""


@dataclass(slots=True)
class Gathered:
    """Errors since a time, by size."""

    since_s: float
    counts: Floats = field(default_factory=lambda: np.zeros(BINS))


class ForecastChanges:
    """By vendor."""

    def __init__(self) -> None:
        self._gathered: dict[str, Gathered] = {}
        self._levels: dict[str, Level] = {}

    def take(self, errors: Errors, kinds: list[Kind], now_s: float) -> None:
        """Take in errors of robots; `kinds` are the rows of the ledger."""
        graded = np.flatnonzero(errors.horizon_s == GRADED_S)
        place = errors.kind[graded] * BINS + bins(errors.radial_m[graded])
        counts = np.bincount(place, minlength=len(kinds) * BINS).reshape(-1, BINS).astype(np.float64)
        for row in np.flatnonzero(counts.any(axis=1)).tolist():
            if kinds[row].basis is not Basis.STATIONARY:
                self._gather(kinds[row].vendor, counts[row], now_s)

    def changed(self) -> dict[str, Change]:
        """By how many metres forecasts three seconds ahead are further off than they were, of vendors that changed."""
        return {
            vendor: Change(level.change.since_s, exp(level.usual + level.change.by) - exp(level.usual))
            for vendor, level in self._levels.items()
            if level.change
        }

    def learned(self) -> Part:
        return {vendor: level.learned() for vendor, level in self._levels.items()}

    def resume(self, part: Part) -> None:
        """Go on with what `learned` told. Raises `UnreadableError`."""
        try:
            self._levels = {vendor: Level.resumed(LIMITS, told) for vendor, told in part.items()}
        except ValueError as error:
            raise UnreadableError(str(error)) from error

    def _gather(self, vendor: str, counts: Floats, now_s: float) -> None:
        gathered = self._gathered.setdefault(vendor, Gathered(now_s))
        gathered.since_s = min(gathered.since_s, now_s)
        gathered.counts += counts
        if now_s - gathered.since_s >= GATHERED_S and gathered.counts.sum() >= FEWEST:
            size_m = float(quantiles(gathered.counts, SHARE)[0])
            level = self._levels.setdefault(vendor, Level(LIMITS))
            level.take(log(size_m + FINE_M), gathered.since_s)
            del self._gathered[vendor]
