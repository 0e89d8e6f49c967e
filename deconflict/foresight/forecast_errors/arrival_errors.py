"""How early or late robots reach their destinations, by vendor and by how long ahead they announced the time.

Errors are counted by size, so that memory is bounded. Old errors fade as in the ledger of forecasts.
"""

import numpy as np

from deconflict.foresight.forecast_errors.error_ledger import HALF_LIFE_S
from deconflict.foresight.forecast_errors.upper_quantiles import BINS, BINS_TEXT, bins, upper_quantiles
from deconflict.runtime.learned_state import Form, Part, count_column, time_column
from ingest.batch import Floats
from ingest.measures.measures import Labels, Measures

AHEAD_S = (60.0, 300.0, 900.0)
"""Upper limits of the groups of arrivals, by how long ahead they were announced."""
SHARES: Floats = np.array([0.5, 0.9])
"""Quantiles that are shown."""
UNIT_S = 10.0
"""So many seconds count as a metre of the sketch, which then covers 0.01 s to 30 min."""
FEWEST_CASES = 5.0
"""With fewer cases, no quantile is shown."""
EARLY, LATE = range(2)
FORM = Form(
    f"early and late arrivals announced up to {AHEAD_S} s ahead, by {BINS_TEXT} of {UNIT_S} s",
    {"vendors": list[str]},
    {"as_of_s": time_column("vendors"), "counts": count_column("vendors", 2, len(AHEAD_S), BINS)},
)


class ArrivalErrors:
    """By vendor. There are few vendors."""

    def __init__(self) -> None:
        self._counts: dict[str, Floats] = {}
        """(2, len(AHEAD_S), BINS) early and late arrivals of each vendor, faded."""
        self._as_of_s: dict[str, float] = {}

    def record(self, vendor: str, ahead_s: Floats, late_s: Floats, now_s: float) -> None:
        """Count n arrivals: how long ahead each was announced, and how late the robot was (negative if early); (n,)
        each."""
        counts = self._counts.setdefault(vendor, np.zeros((2, len(AHEAD_S), BINS)))
        counts *= 0.5 ** (max(now_s - self._as_of_s.get(vendor, now_s), 0.0) / HALF_LIFE_S)
        self._as_of_s[vendor] = now_s
        column = np.searchsorted(AHEAD_S, ahead_s)
        is_counted = column < len(AHEAD_S)
        at = ((late_s > 0).astype(np.int64), column, bins(np.abs(late_s) / UNIT_S))
        np.add.at(counts, tuple(index[is_counted] for index in at), 1.0)

    def learned(self) -> Part:
        """What is kept over a restart."""
        vendors, shape = list(self._counts), (len(self._counts), 2, len(AHEAD_S), BINS)
        counts = np.array(list(self._counts.values())).reshape(shape)
        as_of_s = np.array([self._as_of_s[vendor] for vendor in vendors], np.float64)
        return FORM.part({"vendors": vendors, "as_of_s": as_of_s, "counts": counts})

    def resume(self, part: Part) -> None:
        """Go on with what `learned` returned. Raises `UnreadableError`."""
        state = FORM.checked(part)
        self._counts = dict(zip(state["vendors"], state["counts"], strict=True))
        self._as_of_s = dict(zip(state["vendors"], state["as_of_s"].tolist(), strict=True))

    def measure(self, measures: Measures) -> None:
        """Update the metrics of every vendor's arrivals."""
        errors: dict[Labels, float] = {}
        late: dict[Labels, float] = {}
        for vendor, counts in self._counts.items():
            _add_levels(vendor, counts, errors, late)
        measures.level("deconflict_arrival_error_seconds", errors)
        measures.level("deconflict_arrivals_late_ratio", late)


def _add_levels(vendor: str, counts: Floats, errors: dict[Labels, float], late: dict[Labels, float]) -> None:
    """Add the quantiles of the errors, and the shares of late arrivals, of `counts` (2, len(AHEAD_S), BINS)."""
    both = counts.sum(axis=0)
    for column, (ahead_s, cases) in enumerate(zip(AHEAD_S, both.sum(axis=1), strict=True)):
        if cases >= FEWEST_CASES:
            key = (vendor, f"{ahead_s:g}")
            sizes_s = upper_quantiles(both[column], SHARES) * UNIT_S
            errors |= {(*key, str(share)): s for share, s in zip(SHARES.tolist(), sizes_s.tolist(), strict=True)}
            late[key] = float(counts[LATE, column].sum() / cases)
