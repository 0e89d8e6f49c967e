"""The measures of every role as Prometheus text."""

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

from ingest.measures.measures import Labels, combined
from metrics.monitoring.catalogue import CATALOGUE, UNCATALOGUED, UNCATALOGUED_HELP, CatalogueEntry


@dataclass(slots=True)
class HistogramBuckets:
    """Observations by bucket, not cumulative. The last bucket is above every bound."""

    bounds: list[float]
    counts: list[int]
    total: float


@dataclass(slots=True)
class CombinedSeries:
    """The series of all roles combined. Series that do not fit the catalogue are only counted, by name."""

    values: dict[str, dict[Labels, float]] = field(default_factory=dict)
    histograms: dict[str, dict[Labels, HistogramBuckets]] = field(default_factory=dict)
    uncatalogued: dict[str, int] = field(default_factory=dict)

    def add_value(self, name: str, labels: Labels, value: float) -> None:
        entry = CATALOGUE.get(name)
        if entry is None or entry.kind == "histogram" or len(labels) != len(entry.labels):
            self._count_uncatalogued(name)
            return
        series = self.values.setdefault(name, {})
        known = series.get(labels)
        if known is None:
            series[labels] = value
        else:
            series[labels] = combined(name, known, value)

    def add_histogram(self, name: str, labels: Labels, buckets: HistogramBuckets) -> None:
        entry = CATALOGUE.get(name)
        if entry is None or entry.kind != "histogram" or len(labels) != len(entry.labels):
            self._count_uncatalogued(name)
            return
        series = self.histograms.setdefault(name, {})
        known = series.setdefault(labels, HistogramBuckets(buckets.bounds, [0] * len(buckets.counts), 0.0))
        if known.bounds != buckets.bounds:
            self._count_uncatalogued(name)
            return
        known.counts = [a + b for a, b in zip(known.counts, buckets.counts, strict=True)]
        known.total += buckets.total

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

    def _count_uncatalogued(self, name: str) -> None:
        self.uncatalogued[name] = self.uncatalogued.get(name, 0) + 1


def combine(documents: Iterable[dict[str, Any]]) -> CombinedSeries:
    """Combine the series of several roles. Each document is a dictionary from `Measures.as_document`."""
    combined = CombinedSeries()
    for document in documents:
        for name, rows in document["values"].items():
            for labels, value in rows:
                combined.add_value(name, tuple(labels), value)
        for name, rows in document["histograms"].items():
            for labels, *buckets in rows:
                combined.add_histogram(name, tuple(labels), HistogramBuckets(*buckets))
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


def _histogram_family(name: str, entry: CatalogueEntry, series: dict[Labels, HistogramBuckets]) -> Metric:
    family = HistogramMetricFamily(name, entry.help, labels=entry.labels)
    for labels, histogram in sorted(series.items()):
        bounds = [*map(str, histogram.bounds), "+Inf"]
        family.add_metric(labels, list(zip(bounds, accumulate(histogram.counts), strict=True)), histogram.total)
    return family
