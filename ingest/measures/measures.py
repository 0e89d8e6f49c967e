"""Counts, levels and distributions of a role, by metric name.

`metrics/monitoring/exposition.py` derives the Prometheus text from them. A role sends its measures to another process
as the dictionary of `as_document`.
"""

from collections import defaultdict
from collections.abc import Callable, Collection, Iterable, Sequence
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

Labels = tuple[str, ...]

MOST_SERIES, OTHER = 5_000, "other"
"""A count or distribution has so many series at most: pairs of vendors, places and rules multiply. What comes later is
counted with `OTHER` for each label. `OTHER` is also the vendor of makers that are too many."""

LATENCY_BOUNDS_S = (0.005, 0.01, 0.025, 0.05, 0.075, 0.1, 0.15, 0.2, 0.25, 0.35, 0.5, 0.75, 1.0, 2.5, 5.0, 10.0)

LARGEST = frozenset(
    {
        "deconflict_clock_delay_seconds",
        "deconflict_forecast_age_seconds",
        "deconflict_datum_drift_metres",
        "deconflict_changed_since_timestamp_seconds",
        "deconflict_forecast_change_metres",
        "deconflict_datum_change_metres",
        "deconflict_forecast_error_metres",
        "deconflict_forecast_band_coverage_ratio",
        "deconflict_forecast_grade",
        "deconflict_robots_distrusted",
        "deconflict_arrival_time_ratio",
        "deconflict_arrival_error_seconds",
        "deconflict_arrivals_late_ratio",
        "deconflict_role_up",
        "deconflict_members",
        "deconflict_members_expected",
        "deconflict_broker_connected",
        "deconflict_delivery_delay_seconds",
        "deconflict_engine_effort_reduced",
        "deconflict_build_info",
    }
)
"""Levels that are not summed over roles or machines: the largest value is used."""
FURTHEST = frozenset(
    {"deconflict_clock_offset_seconds", "deconflict_clock_change_seconds", "deconflict_host_clock_off_seconds"}
)
"""Levels of either sign: the value furthest from 0 is used. All other counts and levels are summed."""


class Histogram:
    """Observations counted by upper bound, as in Prometheus."""

    def __init__(self, bounds: tuple[float, ...] = LATENCY_BOUNDS_S) -> None:
        self.bounds = bounds
        self.counts = [0] * (len(bounds) + 1)
        self.total = 0.0

    @classmethod
    def joined(cls, rows: Sequence[Sequence[Any]]) -> Self:
        """The sum of one or more rows of one name in `Measures.as_document`."""
        histogram = cls(tuple(rows[0][1]))
        histogram.counts = [sum(counts) for counts in zip(*(row[2] for row in rows), strict=True)]
        histogram.total = sum(row[3] for row in rows)
        return histogram

    def observe(self, values: ArrayLike) -> None:
        """Count each of n values, (n,)."""
        values = np.asarray(values, np.float64)
        bounds = np.searchsorted(self.bounds, values)
        self.counts = (self.counts + np.bincount(bounds, minlength=len(self.counts))).tolist()
        self.total += float(values.sum())

    def quantile(self, share: float) -> float:
        """The `share` quantile, interpolated within its bucket. The last bound if it lies beyond."""
        wanted, seen, low = share * sum(self.counts), 0, 0.0
        for bound, count in zip(self.bounds, self.counts, strict=False):
            if count and seen + count >= wanted:
                return low + (bound - low) * (wanted - seen) / count
            seen, low = seen + count, bound
        return low


def combined(name: str, a: float, b: float) -> float:
    """The value of a count or level for two roles or machines that have it in the same series."""
    if name in FURTHEST:
        return max(a, b, key=abs)
    return max(a, b) if name in LARGEST else a + b


def joined_values(documents: Iterable[dict[str, Any]]) -> dict[str, dict[Labels, float]]:
    """The counts and levels of several roles' `Measures.as_document`, by name and labels."""
    values: dict[str, dict[Labels, float]] = {}
    for document in documents:
        for name, rows in document["values"].items():
            series = values.setdefault(name, {})
            for label_list, value in rows:
                labels = tuple(label_list)
                series[labels] = combined(name, series[labels], value) if labels in series else value
    return values


class Measures:
    """The measures of one role. Labels are vendors, places, rules, states, never robots."""

    def __init__(self) -> None:
        self.values: dict[str, dict[Labels, float]] = defaultdict(dict)
        self.histograms: dict[str, dict[Labels, Histogram]] = defaultdict(dict)
        self._updates: list[Callable[[], None]] = []

    def call_before_reading(self, update: Callable[[], None]) -> None:
        """Call `update` before each `as_document`, so that it can set its levels."""
        self._updates.append(update)

    def count(self, name: str, *labels: str, by: float = 1) -> None:
        series = self.values[name]
        labels = _bounded(labels, series)
        series[labels] = series.get(labels, 0) + by

    def count_each(self, name: str, label: str, second_labels: Iterable[str]) -> None:
        """Count 1 for the first label with each of the second labels."""
        series = self.values[name]
        for second in second_labels:
            labels: Labels = (label, second)
            if labels not in series:
                labels = _bounded(labels, series)
            series[labels] = series.get(labels, 0) + 1

    def begin(self, *names: str) -> None:
        """Begin counters at 0. If a counter appears only with its first event, its rise can't be seen."""
        for name in names:
            self.count(name, by=0)

    def level(self, name: str, series: dict[Labels, float]) -> None:
        """Replace all series of a level, so that series that no longer exist disappear."""
        self.values[name] = dict(series)

    def observe(self, name: str, values: ArrayLike, *labels: str, bounds: tuple[float, ...] = LATENCY_BOUNDS_S) -> None:
        series = self.histograms[name]
        series.setdefault(_bounded(labels, series), Histogram(bounds)).observe(values)

    def as_document(self) -> dict[str, Any]:
        """JSON-ready: `values` and `histograms`, each name to a list of `[labels, ...]` rows."""
        for update in self._updates:
            update()
        return {
            "values": {
                name: [[list(labels), value] for labels, value in sorted(series.items())]
                for name, series in sorted(self.values.items())
            },
            "histograms": {
                name: [
                    [list(labels), list(histogram.bounds), list(histogram.counts), histogram.total]
                    for labels, histogram in sorted(series.items())
                ]
                for name, series in sorted(self.histograms.items())
            },
        }


def _bounded(labels: Labels, series: Collection[Labels]) -> Labels:
    """The labels that a value counts with."""
    return labels if labels in series or len(series) < MOST_SERIES else (OTHER,) * len(labels)
