"""The catalogue of metrics. `docs/metrics.md` shows it as a table."""

from dataclasses import dataclass
from typing import Literal

from ingest.measures.measures import Labels

Kind = Literal["counter", "gauge", "histogram"]


@dataclass(frozen=True, slots=True)
class CatalogueEntry:
    """One metric of the catalogue."""

    kind: Kind
    labels: Labels
    help: str


CATALOGUE: dict[str, CatalogueEntry] = {
    "deconflict_messages_total": CatalogueEntry(
        "counter",
        ("vendor", "result"),
        "Messages received, by result: accepted, rejected, or overtaken (a newer message arrived before it was read).",
    ),
    "deconflict_messages_per_second": CatalogueEntry(
        "gauge", ("vendor",), "Messages per second in the last minute, with any result."
    ),
    "deconflict_deviations_total": CatalogueEntry(
        "counter", ("vendor", "rule"), "Departures from the standard in accepted messages."
    ),
    "deconflict_rejections_total": CatalogueEntry(
        "counter", ("vendor", "rule"), "Rejected messages, by the rule they broke."
    ),
    "deconflict_robots": CatalogueEntry("gauge", ("vendor", "state"), "Robots on the floors, by operational state."),
    "deconflict_connections": CatalogueEntry("gauge", (), "Open connections of robots and fleet managers."),
    "deconflict_connections_refused_total": CatalogueEntry(
        "counter", ("reason",), "Connections that the service refused or closed, by reason."
    ),
    "deconflict_clock_offset_seconds": CatalogueEntry(
        "gauge",
        ("vendor",),
        "Offset added to the vendor's timestamps to give the service's time. Negative if its clocks are fast.",
    ),
    "deconflict_clock_delay_seconds": CatalogueEntry(
        "gauge", ("vendor",), "Time from the measurement of a pose to its arrival, median of the vendor's robots."
    ),
    "deconflict_host_clock_off_seconds": CatalogueEntry(
        "gauge",
        (),
        "How far the host's clock is ahead of the service's clock, which does not jump when the host's clock is set.",
    ),
    "deconflict_forecast_age_seconds": CatalogueEntry(
        "gauge", ("vendor",), "Age of the poses on which forecasts are based, median of the vendor's robots."
    ),
    "deconflict_messages_shed_total": CatalogueEntry(
        "counter",
        ("vendor",),
        "Messages over the vendor's rate limit that a newer message overtook before they were read.",
    ),
    "deconflict_datum_drift_metres": CatalogueEntry(
        "gauge",
        ("vendor",),
        "Distance between where the vendor's robots now stop at docks and chargers and where they stopped at first.",
    ),
    "deconflict_changed_since_timestamp_seconds": CatalogueEntry(
        "gauge",
        ("vendor", "what"),
        "Time since which the vendor's forecasts, datum or clock differ from usual. Absent if nothing differs.",
    ),
    "deconflict_forecast_change_metres": CatalogueEntry(
        "gauge", ("vendor",), "How much larger than usual the 80 % error of forecasts 3 s ahead is."
    ),
    "deconflict_datum_change_metres": CatalogueEntry(
        "gauge", ("vendor",), "How far from the usual places the vendor's robots stop at docks and chargers."
    ),
    "deconflict_clock_change_seconds": CatalogueEntry(
        "gauge",
        ("vendor",),
        "Difference between the clock offset of the vendor and its usual offset. Negative if it is smaller than usual.",
    ),
    "deconflict_statuses_superseded_total": CatalogueEntry(
        "counter", ("vendor",), "Status messages that a newer one replaced before the engine read them."
    ),
    "deconflict_robots_forgotten_total": CatalogueEntry(
        "counter", ("vendor",), "Robots removed from the floor because they were silent for too long."
    ),
    "deconflict_silences_total": CatalogueEntry(
        "counter",
        ("vendor", "outcome"),
        "Silences that ended, by outcome: there (back at the same place), elsewhere (back at "
        "another place), or driven_through (removed because another robot drove through its "
        "place).",
    ),
    "deconflict_robots_probably_left": CatalogueEntry(
        "gauge", ("vendor",), "Silent robots whose probability to be still there is below one half."
    ),
    "deconflict_recorded_bytes_total": CatalogueEntry("counter", (), "Bytes written to the recording."),
    "deconflict_recorded_lines_dropped_total": CatalogueEntry(
        "counter", (), "Lines that were lost because the recording could not write them."
    ),
    "deconflict_ticks_total": CatalogueEntry(
        "counter", (), "Ticks of the engine. At each tick it receives the changes since the last one."
    ),
    "deconflict_sweep_duration_seconds": CatalogueEntry("histogram", (), "Duration of one pass of the engine."),
    "deconflict_advice_waiting": CatalogueEntry(
        "gauge", (), "Groups of conflicts that wait for advice to be requested."
    ),
    "deconflict_advice_late_total": CatalogueEntry(
        "counter", (), "Requests for advice whose answer came after its deadline."
    ),
    "deconflict_advice_failures_total": CatalogueEntry("counter", (), "Requests for advice that ended in an error."),
    "deconflict_advice_solve_seconds": CatalogueEntry("histogram", (), "Time to compute the advice for one request."),
    "deconflict_message_to_advisory_seconds": CatalogueEntry(
        "histogram",
        ("vendor",),
        "Time from the arrival of a valid status to the publication of the advisories that reflect it.",
    ),
    "deconflict_advisories_open": CatalogueEntry(
        "gauge", ("kind", "severity"), "Open advisories: raised and not yet cleared."
    ),
    "deconflict_advisories_total": CatalogueEntry(
        "counter", ("kind", "event"), "Revisions of advisories, by event: raised, updated or cleared."
    ),
    "deconflict_conflicts_ended_total": CatalogueEntry(
        "counter",
        ("vendor", "outcome"),
        "Published conflicts that ended, counted once for each vendor in them, by outcome: met, "
        "not_met (avoided, or a nuisance), or left.",
    ),
    "deconflict_revisions_deferred_total": CatalogueEntry(
        "counter",
        ("vendor",),
        "Revisions of conflicts with the vendor's robots that waited for a later pass, as one pass makes a bounded "
        "number of them for any two vendors.",
    ),
    "deconflict_forecast_error_metres": CatalogueEntry(
        "gauge",
        ("vendor", "horizon_s", "share"),
        "Forecast error at this horizon that is not exceeded in this share of cases. Old cases lose weight over days.",
    ),
    "deconflict_forecast_band_coverage_ratio": CatalogueEntry(
        "gauge", ("vendor", "share"), "Share of forecast errors within the band that should contain the given share."
    ),
    "deconflict_forecast_grade": CatalogueEntry(
        "gauge",
        ("vendor", "grade"),
        "1 for the vendor's grade: A to E by the 80 % error of forecasts 3 s ahead (up to 0.1, "
        "0.25, 0.5, 1 m, or more).",
    ),
    "deconflict_robots_distrusted": CatalogueEntry(
        "gauge",
        ("vendor",),
        "Robots whose motion contradicts their forecasts. Their forecasts get wider errors or are not used.",
    ),
    "deconflict_forecasts_distrusted_total": CatalogueEntry(
        "counter",
        ("vendor",),
        "Forecasts with wider errors or not used, because the robot's motion contradicted its earlier forecasts.",
    ),
    "deconflict_probability_outcomes_total": CatalogueEntry(
        "counter",
        ("outcome",),
        "Watched pairs, sampled each second, by outcome: met, passed, or left (became silent, or waits as advised).",
    ),
    "deconflict_conflicts": CatalogueEntry("gauge", (), "Pairs of robots in predicted conflict, confirmed or not."),
    "deconflict_invalid_forecasts_total": CatalogueEntry(
        "counter",
        ("reason",),
        "Forecasts that the engine could not use, by reason. The robot counts as standing where it was. Reason "
        "floor-not-listed: its batch does not list its floor; start all processes from one release.",
    ),
    "deconflict_sweep_segment_pairs_total": CatalogueEntry(
        "counter", (), "Pairs of path segments that passed the sweep's bounding box test."
    ),
    "deconflict_sweep_fcl_calls_total": CatalogueEntry(
        "counter", (), "Pairs of shapes that the collision library decided."
    ),
    "deconflict_resource_demand": CatalogueEntry(
        "gauge", ("resource",), "Robots that occupy a resource or zone or will need it within 15 minutes."
    ),
    "deconflict_resource_expected_demand": CatalogueEntry(
        "gauge",
        ("resource",),
        "Robots that will need a charger within 15 minutes by their battery level but have not announced it.",
    ),
    "deconflict_resource_occupancy": CatalogueEntry("gauge", ("resource",), "Robots in a resource or zone now."),
    "deconflict_resource_wait_seconds": CatalogueEntry(
        "gauge", ("resource",), "Longest expected wait at a resource or zone within 15 minutes."
    ),
    "deconflict_zone_flow_per_second": CatalogueEntry(
        "gauge", ("zone",), "Robots that leave a zone per second, averaged over minutes."
    ),
    "deconflict_zone_saturation_ratio": CatalogueEntry(
        "gauge", ("zone",), "Mean number of robots in a zone, divided by the number at which its flow is greatest."
    ),
    "deconflict_deadlocks_ahead": CatalogueEntry(
        "gauge", (), "Rings of robots that wait for each other now or are predicted to."
    ),
    "deconflict_arrival_time_ratio": CatalogueEntry(
        "gauge", ("vendor",), "Time that robots take to a destination divided by the time that they announce, median."
    ),
    "deconflict_arrival_error_seconds": CatalogueEntry(
        "gauge",
        ("vendor", "ahead_up_to_s", "share"),
        "Error of announced arrival times, by how far ahead they were announced, that is not "
        "exceeded in this share of cases. Old cases lose weight.",
    ),
    "deconflict_arrivals_late_ratio": CatalogueEntry(
        "gauge",
        ("vendor", "ahead_up_to_s"),
        "Share of arrivals later than announced, by how far ahead they were announced.",
    ),
    "deconflict_advisories_stored_total": CatalogueEntry(
        "counter", (), "Revisions of advisories stored and published."
    ),
    "deconflict_delivery_delay_seconds": CatalogueEntry(
        "gauge", (), "Age of the oldest decision of the engine that is not stored. Rises while the store refuses them."
    ),
    "deconflict_advisories_set_aside_total": CatalogueEntry(
        "counter",
        ("reason",),
        "Revisions of advisories that nobody receives, by reason: invalid (not a valid advisory), or unwritable "
        "(cannot be written though others can). The log names each.",
    ),
    "deconflict_store_failures_total": CatalogueEntry("counter", (), "Attempts to store advisories that failed."),
    "deconflict_learning_failures_total": CatalogueEntry(
        "counter",
        ("what",),
        "Failed attempts to read or write what was learned about vendors. Learning continues without it.",
    ),
    "deconflict_store_unstored": CatalogueEntry("gauge", (), "Published revisions that are not yet stored on disk."),
    "deconflict_page_viewers": CatalogueEntry("gauge", (), "Open operator pages that follow the live view."),
    "deconflict_stream_subscribers": CatalogueEntry("gauge", (), "Open subscriptions to the advisory stream."),
    "deconflict_stream_dropped_total": CatalogueEntry(
        "counter", (), "Subscribers of the stream that were disconnected because they stopped reading."
    ),
    "deconflict_outlet_deliveries_total": CatalogueEntry(
        "counter", ("outlet",), "Revisions that a webhook or broker accepted."
    ),
    "deconflict_outlet_failures_total": CatalogueEntry(
        "counter", ("outlet",), "Failed attempts to deliver a revision."
    ),
    "deconflict_outlet_waiting": CatalogueEntry(
        "gauge", ("outlet",), "Revisions that wait because an outlet does not accept any."
    ),
    "deconflict_near_misses_total": CatalogueEntry(
        "counter",
        (),
        "Near misses: two robots came within the clearance by their forecasts, and at least one of them moved.",
    ),
    "deconflict_blackboxes_total": CatalogueEntry(
        "counter", ("outcome",), "Requested black boxes, by outcome: kept, unfounded, failed or beyond."
    ),
    "deconflict_role_up": CatalogueEntry("gauge", ("role",), "1 if this role of the service answers, else 0."),
    "deconflict_deadlines_missed_total": CatalogueEntry(
        "counter", (), "Passes of the engine that took longer than engine.deadline_s."
    ),
    "deconflict_engine_effort_reduced": CatalogueEntry(
        "gauge",
        (),
        "What the engine skips because it is overloaded: 0 nothing, 1 exact smallest separations, "
        "2 also conflicts later than conflict.warning_s and most checks of queues.",
    ),
    "deconflict_site_reloads_total": CatalogueEntry(
        "counter", ("result",), "Changed site files, by result: applied, or refused (the old settings stay in use)."
    ),
    "deconflict_role_restarts_total": CatalogueEntry("counter", ("role",), "Restarts of this role's process."),
    "deconflict_build_info": CatalogueEntry("gauge", ("version",), "1 for the running release."),
}
"""Every metric by name. The values of labels are bounded sets: vendors, rules, states, roles, places; never robots."""

UNCATALOGUED = "deconflict_uncatalogued_measures"
UNCATALOGUED_HELP = "Series of a role that do not fit the catalogue: an error in the program."


def table() -> str:
    """The catalogue as the Markdown table of `docs/metrics.md`."""
    rows = ["| metric | kind | labels | meaning |", "| --- | --- | --- | --- |"]
    for name, entry in CATALOGUE.items():
        labels = ", ".join(f"`{label}`" for label in entry.labels)
        rows.append(f"| `{name}` | {entry.kind} | {labels} | {entry.help} |")
    rows.append(f"| `{UNCATALOGUED}` | gauge | `measure` | {UNCATALOGUED_HELP} |")
    return "\n".join(rows) + "\n"
