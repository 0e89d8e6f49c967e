"""Whether a vendor's forecasts have become worse, since when, and by how much.

Errors of its moving robots three seconds ahead are gathered for two minutes; the size within which four in five of them
lie is one value for the test of `ingest.levels`, as a logarithm, so that a vendor is held to its own usual errors.
"""

from dataclasses import dataclass, field
from math import exp, log

import numba
import numpy as np

from deconflict.foresight.grades import GRADED_S
from deconflict.foresight.ledger import RADIAL, Errors, Kind
from deconflict.foresight.sketch import BINS, quantiles
from deconflict.learned import Part, UnreadableError
from ingest.compiled import kernel
from ingest.levels import Change, Level, Limits
from ingest.seam import Basis, Floats, Ints

GATHERED_S, FEWEST = 120.0, 20
"""A value is of so long, and of so many errors."""
SHARE: Floats = np.array([0.8])
FINE_M = 0.2
"""Errors smaller than this hardly differ."""
_INTS = numba.types.Array(numba.int64, 1, "C", readonly=True)
LIMITS = Limits(least_spread=0.15, least_change=0.4, rises_only=True)
"""Of logarithms: a change by less than half as much again is none."""


@kernel(numba.void(*[_INTS] * 3, numba.int64, numba.float64[:, ::1]))
def _add(kind: Ints, horizon_s: Ints, size: Ints, graded_s: int, counts: Floats) -> None:
    """Add the errors so far ahead to `counts` (kinds, BINS + 1), by their bins and in all."""
    for at in range(len(kind)):
        if horizon_s[at] == graded_s:
            counts[kind[at], size[at]] += 1.0
            counts[kind[at], -1] += 1.0


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
        counts = np.zeros((len(kinds), BINS + 1))
        _add(errors.kind, errors.horizon_s, errors.size[RADIAL], GRADED_S, counts)
        for row in np.flatnonzero(counts[:, -1]).tolist():
            if kinds[row].basis is not Basis.STATIONARY:
                self._gather(kinds[row].vendor, counts[row, :-1], now_s)

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
        gathered = self._gathered.get(vendor)
        if gathered is None:
            gathered = self._gathered[vendor] = Gathered(now_s)
        gathered.since_s = min(gathered.since_s, now_s)
        gathered.counts += counts
        if now_s - gathered.since_s >= GATHERED_S and gathered.counts.sum() >= FEWEST:
            size_m = float(quantiles(gathered.counts, SHARE)[0])
            level = self._levels.setdefault(vendor, Level(LIMITS))
            level.take(log(size_m + FINE_M), gathered.since_s)
            del self._gathered[vendor]
