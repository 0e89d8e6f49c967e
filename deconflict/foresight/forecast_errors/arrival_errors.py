"""The ledger of destinations: how early or late robots came, by vendor and by how long ahead they had said when.

Counts by size, bounded in memory; old ones fade as those of forecasts do.
"""

import numpy as np

from deconflict.foresight.forecast_errors.ledger import HALF_LIFE_S
from deconflict.foresight.forecast_errors.quantile_sketch import BINS, bins, quantiles
from deconflict.runtime.learned_state import Part, UnreadableError, numbers
from ingest.batch import Floats
from ingest.measures.measures import Labels, Measures

AHEAD_S = (60.0, 300.0, 900.0)
"""Arrivals told of at most so long ahead are counted together."""
SHARES: Floats = np.array([0.5, 0.9])
UNIT_S = 10.0
"""What the sketch takes for a metre: sizes from a hundredth of a second to half an hour."""
FEWEST_CASES = 5.0
"""Of fewer nothing is told."""
EARLY, LATE = range(2)


class ArrivalErrors:
    """By vendor; vendors are few."""

    def __init__(self) -> None:
        self._counts: dict[str, Floats] = {}
        """(2, len(AHEAD_S), BINS) early and late, faded."""
        self._as_of_s: dict[str, float] = {}
        self._levels: dict[str, tuple[dict[Labels, float], dict[Labels, float]]] = {}
        """Sizes of errors and shares that came late, of vendors of whose robots none has come since."""

    def record(self, vendor: str, ahead_s: Floats, late_s: Floats, now_s: float) -> None:
        """Take in promises that came due: how long ahead each was given, and how late the robot was; (n,) each."""
        counts = self._counts.setdefault(vendor, np.zeros((2, len(AHEAD_S), BINS)))
        counts *= 0.5 ** (max(now_s - self._as_of_s.get(vendor, now_s), 0.0) / HALF_LIFE_S)
        self._as_of_s[vendor] = now_s
        self._levels.pop(vendor, None)
        column = np.searchsorted(AHEAD_S, ahead_s)
        known = column < len(AHEAD_S)
        at = ((late_s > 0).astype(np.int64), column, bins(np.abs(late_s) / UNIT_S))
        np.add.at(counts, tuple(index[known] for index in at), 1.0)

    def learned(self) -> Part:
        vendors = [[vendor, self._as_of_s[vendor]] for vendor in self._counts]
        return {"vendors": vendors, "counts": np.array(list(self._counts.values()))}

    def resume(self, part: Part) -> None:
        """Go on with what `learned` told. Raises `UnreadableError`."""
        try:
            as_of_s = {str(vendor): float(at_s) for vendor, at_s in part.get("vendors", ())}
        except (TypeError, ValueError) as error:
            raise UnreadableError(f"vendors that came late are not told: {error}") from error
        if as_of_s:
            counts = numbers(part, "counts", (len(as_of_s), 2, len(AHEAD_S), BINS))
            self._counts, self._as_of_s = dict(zip(as_of_s, counts, strict=True)), as_of_s
            self._levels.clear()

    def measure(self, measures: Measures) -> None:
        """Bring the levels of every vendor's arrivals up to date."""
        errors: dict[Labels, float] = {}
        late: dict[Labels, float] = {}
        for vendor, counts in self._counts.items():
            if vendor not in self._levels:
                self._levels[vendor] = _levels(vendor, counts)
            errors |= self._levels[vendor][0]
            late |= self._levels[vendor][1]
        measures.level("deconflict_arrival_error_seconds", errors)
        measures.level("deconflict_arrivals_late_ratio", late)


def _levels(vendor: str, counts: Floats) -> tuple[dict[Labels, float], dict[Labels, float]]:
    """Sizes of errors and shares that came late, of `counts` (2, len(AHEAD_S), BINS)."""
    errors: dict[Labels, float] = {}
    late: dict[Labels, float] = {}
    both = counts.sum(axis=0)
    for column, (ahead_s, cases) in enumerate(zip(AHEAD_S, both.sum(axis=1), strict=True)):
        if cases >= FEWEST_CASES:
            key = (vendor, f"{ahead_s:g}")
            sizes_s = quantiles(both[column], SHARES) * UNIT_S
            errors |= {(*key, str(share)): s for share, s in zip(SHARES.tolist(), sizes_s.tolist(), strict=True)}
            late[key] = float(counts[LATE, column].sum() / cases)
    return errors, late
