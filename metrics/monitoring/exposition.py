"""Prometheus text from the measures of every role. `docs/metrics.md` shows the catalogue of what there is."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from itertools import accumulate
from typing import Any, Literal

from prometheus_client.exposition import CONTENT_TYPE_PLAIN_0_0_4, generate_latest
from prometheus_client.metrics_core import (
    CounterMetricFamily,
    GaugeMetricFamily,
    HistogramMetricFamily,
    Metric,
)

from ingest.measures.measures import Labels, together

Kind = Literal["counter", "gauge", "histogram"]


@dataclass(frozen=True, slots=True)
class CatalogueEntry:
    """One metric."""

    kind: Kind
    labels: Labels
    help: str


CATALOGUE: dict[str, CatalogueEntry] = {
    "deconflict_messages_total": CatalogueEntry(
        "counter",
        ("vendor", "result"),
        "Messages received: accepted, rejected, or overtaken by a newer one before they were read.",
    ),
    "deconflict_messages_per_second": CatalogueEntry(
        "gauge", ("vendor",), "Messages a second in the last minute, whatever became of them."
    ),
    "deconflict_deviations_total": CatalogueEntry(
        "counter", ("vendor", "rule"), "Departures from the standard in messages that were understood."
    ),
    "deconflict_rejections_total": CatalogueEntry(
        "counter", ("vendor", "rule"), "Messages that could not be used, by the rule they broke."
    ),
    "deconflict_robots": CatalogueEntry("gauge", ("vendor", "state"), "Robots on the floors, by operational state."),
    "deconflict_connections": CatalogueEntry("gauge", (), "Open connections of robots and fleet managers."),
    "deconflict_connections_refused_total": CatalogueEntry(
        "counter",
        ("reason",),
        "Connections refused or closed by us.",
    ),
    "deconflict_clock_offset_seconds": CatalogueEntry(
        "gauge",
        ("vendor",),
        "Added to the vendor's stamps it gives our time: below 0 where its clocks are fast.",
    ),
    "deconflict_clock_delay_seconds": CatalogueEntry(
        "gauge",
        ("vendor",),
        "Time from a pose being true to its arrival, median of the vendor's robots.",
    ),
    "deconflict_host_clock_off_seconds": CatalogueEntry(
        "gauge",
        (),
        "What the host's clock is ahead of the service's, which does not leap when that is set.",
    ),
    "deconflict_forecast_age_seconds": CatalogueEntry(
        "gauge",
        ("vendor",),
        "Age of the poses that forecasts rest on, median of the vendor's robots.",
    ),
    "deconflict_messages_shed_total": CatalogueEntry(
        "counter", ("vendor",), "Messages beyond the vendor's share, overtaken by newer ones before they were read."
    ),
    "deconflict_datum_drift_metres": CatalogueEntry(
        "gauge",
        ("vendor",),
        "How far the vendor's robots rest at docks and chargers from where they did at first.",
    ),
    "deconflict_changed_since_timestamp_seconds": CatalogueEntry(
        "gauge",
        ("vendor", "what"),
        "Since when the vendor's forecast, datum or clock is not as it usually was; absent where all is as usual.",
    ),
    "deconflict_forecast_change_metres": CatalogueEntry(
        "gauge",
        ("vendor",),
        "How much further off than usual 80 % of forecasts are 3 s ahead.",
    ),
    "deconflict_datum_change_metres": CatalogueEntry(
        "gauge",
        ("vendor",),
        "How far from usual the vendor's robots rest at docks and chargers.",
    ),
    "deconflict_clock_change_seconds": CatalogueEntry(
        "gauge",
        ("vendor",),
        "How much more than usual is added to the vendor's stamps; below 0: less.",
    ),
    "deconflict_statuses_superseded_total": CatalogueEntry(
        "counter", ("vendor",), "Status messages replaced by a newer one before the engine read them."
    ),
    "deconflict_robots_forgotten_total": CatalogueEntry(
        "counter", ("vendor",), "Robots that left the floor after being silent for too long."
    ),
    "deconflict_silences_total": CatalogueEntry(
        "counter",
        ("vendor", "outcome"),
        "Silences that have ended: there (back where it was), elsewhere (back at another place), or driven_through "
        "(another robot drove through its place, and it was taken off).",
    ),
    "deconflict_robots_probably_left": CatalogueEntry(
        "gauge", ("vendor",), "Silent robots that are less than half likely to be there still."
    ),
    "deconflict_recorded_bytes_total": CatalogueEntry("counter", (), "Bytes written to the recording."),
    "deconflict_recorded_lines_dropped_total": CatalogueEntry("counter", (), "Lines the recording could not take."),
    "deconflict_ticks_total": CatalogueEntry("counter", (), "Ticks at which the engine was handed what had changed."),
    "deconflict_sweep_duration_seconds": CatalogueEntry("histogram", (), "Duration of one step of the engine."),
    "deconflict_advice_waiting": CatalogueEntry(
        "gauge", (), "Groups of conflicts whose advice is yet to be asked for."
    ),
    "deconflict_advice_late_total": CatalogueEntry(
        "counter", (), "Answers that were not worked out when their time had come, and were given later."
    ),
    "deconflict_advice_failures_total": CatalogueEntry("counter", (), "Questions for advice that ended in an error."),
    "deconflict_advice_solve_seconds": CatalogueEntry("histogram", (), "Time to work out advice for one question."),
    "deconflict_message_to_advisory_seconds": CatalogueEntry(
        "histogram",
        ("vendor",),
        "Time from the arrival of a valid status to the publishing of the advisories that reflect it.",
    ),
    "deconflict_advisories_open": CatalogueEntry(
        "gauge", ("kind", "severity"), "Advisories raised and not yet cleared."
    ),
    "deconflict_advisories_total": CatalogueEntry(
        "counter", ("kind", "event"), "Revisions of advisories decided, by what happened."
    ),
    "deconflict_conflicts_ended_total": CatalogueEntry(
        "counter",
        ("vendor", "outcome"),
        "Conflicts told of and over, once for each vendor in them: met, not_met (avoided, or a nuisance), or left.",
    ),
    "deconflict_forecast_error_metres": CatalogueEntry(
        "gauge",
        ("vendor", "horizon_s", "share"),
        "Forecasts that far ahead were off by at most this, in that share of cases; old cases fade over days.",
    ),
    "deconflict_forecast_band_coverage_ratio": CatalogueEntry(
        "gauge",
        ("vendor", "share"),
        "Share of errors within the band that was to hold `share` of them.",
    ),
    "deconflict_forecast_grade": CatalogueEntry(
        "gauge",
        ("vendor", "grade"),
        "1 for the vendor's grade: A to E by what 80 % of forecasts are off 3 s ahead (0.1, 0.25, 0.5, 1 m, more).",
    ),
    "deconflict_robots_distrusted": CatalogueEntry(
        "gauge",
        ("vendor",),
        "Robots that do other than they say: their forecasts are given wider errors, or set aside.",
    ),
    "deconflict_forecasts_distrusted_total": CatalogueEntry(
        "counter", ("vendor",), "Forecasts of robots that did other than they had said, not taken as they were."
    ),
    "deconflict_probability_outcomes_total": CatalogueEntry(
        "counter",
        ("outcome",),
        "Pairs under watch at a whole second, by what became of them: met, passed, or left (silent, or told to wait).",
    ),
    "deconflict_conflicts": CatalogueEntry("gauge", (), "Pairs of robots in predicted conflict, confirmed or not."),
    "deconflict_invalid_forecasts_total": CatalogueEntry(
        "counter", ("reason",), "Forecasts the engine could not use; the robot stands where it was."
    ),
    "deconflict_sweep_segment_pairs_total": CatalogueEntry(
        "counter", (), "Pairs of path segments that passed the sweep's bounding boxes."
    ),
    "deconflict_sweep_fcl_calls_total": CatalogueEntry(
        "counter", (), "Pairs of shapes decided by the collision library."
    ),
    "deconflict_resource_demand": CatalogueEntry(
        "gauge", ("resource",), "Robots that have a resource or zone or will want it within 15 minutes."
    ),
    "deconflict_resource_expected_demand": CatalogueEntry(
        "gauge",
        ("resource",),
        "Robots that will need a charger within 15 minutes by the level of their batteries, and have not said so.",
    ),
    "deconflict_resource_occupancy": CatalogueEntry("gauge", ("resource",), "Robots in a resource or zone now."),
    "deconflict_resource_wait_seconds": CatalogueEntry(
        "gauge", ("resource",), "Longest wait expected at a resource or zone within 15 minutes."
    ),
    "deconflict_zone_flow_per_second": CatalogueEntry(
        "gauge", ("zone",), "Robots that leave a zone a second, mean of minutes."
    ),
    "deconflict_zone_saturation_ratio": CatalogueEntry(
        "gauge", ("zone",), "Mean number of robots in a zone over the number at which its flow is greatest."
    ),
    "deconflict_deadlocks_ahead": CatalogueEntry("gauge", (), "Rings of robots that wait for each other, or will."),
    "deconflict_arrival_time_ratio": CatalogueEntry(
        "gauge",
        ("vendor",),
        "Time that robots take to a destination over the time that they tell, median.",
    ),
    "deconflict_arrival_error_seconds": CatalogueEntry(
        "gauge",
        ("vendor", "ahead_up_to_s", "share"),
        "Arrivals told of so long ahead were early or late by at most this, in that share of cases; old cases fade.",
    ),
    "deconflict_arrivals_late_ratio": CatalogueEntry(
        "gauge",
        ("vendor", "ahead_up_to_s"),
        "Share of arrivals told of so long ahead that came late.",
    ),
    "deconflict_advisories_stored_total": CatalogueEntry(
        "counter", (), "Revisions of advisories stored and published."
    ),
    "deconflict_store_failures_total": CatalogueEntry("counter", (), "Attempts to store advisories that failed."),
    "deconflict_learning_failures_total": CatalogueEntry(
        "counter",
        ("what",),
        "Attempts that failed to read, or to write, what was learned of vendors; learning goes on without.",
    ),
    "deconflict_store_unstored": CatalogueEntry("gauge", (), "Revisions that are told and wait for the disk."),
    "deconflict_page_viewers": CatalogueEntry("gauge", (), "Pages that follow the live picture."),
    "deconflict_stream_subscribers": CatalogueEntry("gauge", (), "Open subscriptions to the advisory stream."),
    "deconflict_stream_dropped_total": CatalogueEntry(
        "counter", (), "Subscribers dropped because they stopped reading."
    ),
    "deconflict_outlet_deliveries_total": CatalogueEntry(
        "counter", ("outlet",), "Revisions that a webhook or broker has taken."
    ),
    "deconflict_outlet_failures_total": CatalogueEntry("counter", ("outlet",), "Attempts to deliver that failed."),
    "deconflict_outlet_waiting": CatalogueEntry(
        "gauge", ("outlet",), "Revisions that wait for an outlet that takes none."
    ),
    "deconflict_near_misses_total": CatalogueEntry(
        "counter", (), "Times that two robots of which one moves came within the clearance, by their forecasts."
    ),
    "deconflict_blackboxes_total": CatalogueEntry(
        "counter",
        ("outcome",),
        "Black boxes by what became of them: kept, unfounded, failed or beyond.",
    ),
    "deconflict_role_up": CatalogueEntry("gauge", ("role",), "1 if this role of the service answers, else 0."),
    "deconflict_deadlines_missed_total": CatalogueEntry(
        "counter", (), "Passes of the engine that took longer than engine.deadline_s."
    ),
    "deconflict_engine_effort_reduced": CatalogueEntry(
        "gauge",
        (),
        "What the engine leaves out because it can't keep up: 0 nothing, 1 exact smallest separations, "
        "2 also conflicts later than conflict.warning_s and most looks at queues.",
    ),
    "deconflict_site_reloads_total": CatalogueEntry(
        "counter", ("result",), "Changed site files that were applied, or refused with the old settings kept."
    ),
    "deconflict_role_restarts_total": CatalogueEntry("counter", ("role",), "Times this role's process was restarted."),
    "deconflict_build_info": CatalogueEntry("gauge", ("version",), "1 for the release that runs."),
}
"""Every metric by name. Label values are bounded sets: vendors, rules, states, roles, places, never robots."""

UNCATALOGUED = "deconflict_uncatalogued_measures"
UNCATALOGUED_HELP = "Series that a role tells and that do not fit the catalogue; a fault of the program."


@dataclass(slots=True)
class HistogramBuckets:
    """Observations by bucket, not cumulated; the last bucket is above every bound."""

    bounds: list[float]
    counts: list[int]
    total: float


@dataclass(slots=True)
class CombinedSeries:
    """Every role's series together, those that fit the catalogue and, by name, how many do not."""

    values: dict[str, dict[Labels, float]] = field(default_factory=dict)
    histograms: dict[str, dict[Labels, HistogramBuckets]] = field(default_factory=dict)
    uncatalogued: dict[str, int] = field(default_factory=dict)

    def add_value(self, name: str, labels: Labels, value: float) -> None:
        entry = CATALOGUE.get(name)
        if entry is None or entry.kind == "histogram" or len(labels) != len(entry.labels):
            self._leave_out(name)
            return
        series = self.values.setdefault(name, {})
        known = series.get(labels)
        if known is None:
            series[labels] = value
        else:
            series[labels] = together(name, known, value)

    def add_histogram(self, name: str, labels: Labels, buckets: HistogramBuckets) -> None:
        entry = CATALOGUE.get(name)
        if entry is None or entry.kind != "histogram" or len(labels) != len(entry.labels):
            self._leave_out(name)
            return
        series = self.histograms.setdefault(name, {})
        known = series.setdefault(labels, HistogramBuckets(buckets.bounds, [0] * len(buckets.counts), 0.0))
        if known.bounds != buckets.bounds:
            self._leave_out(name)
            return
        known.counts = [a + b for a, b in zip(known.counts, buckets.counts, strict=True)]
        known.total += buckets.total

    def collect(self) -> Iterator[Metric]:
        """The metric families, in the catalogue's order; those without a series are left out."""
        for name, entry in CATALOGUE.items():
            if name in self.values:
                yield _family(name, entry, self.values[name])
            elif name in self.histograms:
                yield _histogram_family(name, entry, self.histograms[name])
        left_out = GaugeMetricFamily(UNCATALOGUED, UNCATALOGUED_HELP, labels=["measure"])
        for name, count in sorted(self.uncatalogued.items()):
            left_out.add_metric([name], count)
        yield left_out

    def _leave_out(self, name: str) -> None:
        self.uncatalogued[name] = self.uncatalogued.get(name, 0) + 1


def combine(documents: Iterable[dict[str, Any]]) -> CombinedSeries:
    """The series of several roles, each a dictionary of `Measures.as_document`."""
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
    """The text of a scrape and its content type. What does not fit the catalogue is counted, never an error."""
    return generate_latest(combine(documents)), CONTENT_TYPE_PLAIN_0_0_4


def table() -> str:
    """The catalogue as the Markdown table of `docs/metrics.md`."""
    rows = ["| metric | kind | labels | meaning |", "| --- | --- | --- | --- |"]
    for name, entry in CATALOGUE.items():
        labels = ", ".join(f"`{label}`" for label in entry.labels)
        rows.append(f"| `{name}` | {entry.kind} | {labels} | {entry.help} |")
    rows.append(f"| `{UNCATALOGUED}` | gauge | `measure` | {UNCATALOGUED_HELP} |")
    return "\n".join(rows) + "\n"


def _family(name: str, entry: CatalogueEntry, series: dict[Labels, float]) -> Metric:
    kind = CounterMetricFamily if entry.kind == "counter" else GaugeMetricFamily
    family = kind(name, entry.help, labels=entry.labels)
    for labels, value in sorted(series.items()):
        family.add_metric(labels, value)
    return family


def _histogram_family(name: str, entry: CatalogueEntry, series: dict[Labels, HistogramBuckets]) -> Metric:
    family = HistogramMetricFamily(name, entry.help, labels=entry.labels)
    for labels, one in sorted(series.items()):
        bounds = [*map(str, one.bounds), "+Inf"]
        family.add_metric(labels, list(zip(bounds, accumulate(one.counts), strict=True)), one.total)
    return family
