"""The measures of every role as Prometheus text."""

from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from itertools import accumulate
from typing import Any

from prometheus_client.exposition import CONTENT_TYPE_PLAIN_0_0_4, generate_latest
from prometheus_client.metrics_core import (
    CounterMetricFamily,
    GaugeMetricFamily,
    HistogramMetricFamily,
    Metric,
)

from ingest.measures.measures import Histogram, Labels, combined
from metrics.monitoring.catalogue import CATALOGUE, UNCATALOGUED, UNCATALOGUED_HELP
from metrics.monitoring.catalogue_entry import CatalogueEntry, Kind

HistogramRow = list[Any]
"""A row of `histograms` in `Measures.as_document`."""


@dataclass(slots=True)
class CombinedSeries:
    """The series of all roles combined. Series that do not fit the catalogue are only counted, by name."""

    values: dict[str, dict[Labels, float]] = field(default_factory=dict)
    histograms: dict[str, dict[Labels, list[HistogramRow]]] = field(default_factory=dict)
    uncatalogued: Counter[str] = field(default_factory=Counter)

    def add_value(self, name: str, labels: Labels, value: float) -> None:
        if self._fits(name, labels, "counter", "gauge"):
            series = self.values.setdefault(name, {})
            series[labels] = combined(name, series[labels], value) if labels in series else value

    def add_histogram(self, name: str, row: HistogramRow) -> None:
        if self._fits(name, labels := tuple(row[0]), "histogram"):
            rows = self.histograms.setdefault(name, {}).setdefault(labels, [])
            if rows and rows[0][1] != row[1]:  # other bounds
                self.uncatalogued[name] += 1
            else:
                rows.append(row)

    def _fits(self, name: str, labels: Labels, *kinds: Kind) -> bool:
        entry = CATALOGUE.get(name)
        fits = entry is not None and entry.kind in kinds and len(labels) == len(entry.labels)
        if not fits:
            self.uncatalogued[name] += 1
        return fits

    def collect(self) -> Iterator[Metric]:
        """The metric families in the catalogue's order, without those that have no series."""
        for name, entry in CATALOGUE.items():
            if name in self.values:
                yield _family(name, entry, self.values[name])
            elif name in self.histograms:
                yield _histogram_family(name, entry, self.histograms[name])
        uncatalogued = GaugeMetricFamily(UNCATALOGUED, UNCATALOGUED_HELP, labels=["measure"])
        for name, count in sorted(self.uncatalogued.items()):
            uncatalogued.add_metric([name], count)
        yield uncatalogued


def combine(documents: Iterable[dict[str, Any]]) -> CombinedSeries:
    """Combine the series of several roles. Each document is a dictionary from `Measures.as_document`."""
    combined = CombinedSeries()
    for document in documents:
        for name, rows in document["values"].items():
            for labels, value in rows:
                combined.add_value(name, tuple(labels), value)
        for name, rows in document["histograms"].items():
            for row in rows:
                combined.add_histogram(name, row)
    return combined


def render(documents: list[dict[str, Any]]) -> tuple[bytes, str]:
    """The text of a scrape and its content type. A series that does not fit the catalogue is only counted."""
    return generate_latest(combine(documents)), CONTENT_TYPE_PLAIN_0_0_4


def _family(name: str, entry: CatalogueEntry, series: dict[Labels, float]) -> Metric:
    kind = CounterMetricFamily if entry.kind == "counter" else GaugeMetricFamily
    family = kind(name, entry.help, labels=entry.labels)
    for labels, value in sorted(series.items()):
        family.add_metric(labels, value)
    return family


def _histogram_family(name: str, entry: CatalogueEntry, series: dict[Labels, list[HistogramRow]]) -> Metric:
    family = HistogramMetricFamily(name, entry.help, labels=entry.labels)
    for labels, rows in sorted(series.items()):
        histogram = Histogram.joined(rows)
        bounds = [*map(str, histogram.bounds), "+Inf"]
        family.add_metric(labels, list(zip(bounds, accumulate(histogram.counts), strict=True)), histogram.total)
    return family
