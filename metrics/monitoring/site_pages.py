"""The dashboards of the site and of its vendors. The dashboard of the service is in `health_page`."""

from collections.abc import Iterable

from ingest.measures import clock_changes
from metrics.monitoring.alert_rules import OBJECTIVE_S, OBJECTIVE_SHARE
from metrics.monitoring.panels import Dashboard, Panel, PanelRow, Query
from metrics.monitoring.promql import level, or_zero_by_vendor, rate, share_within

WINDOW = "$__rate_interval"
VENDOR = ["vendor"]

STATUS_WAIT = "deconflict_message_to_advisory_seconds"
_PER_MESSAGE = rate("deconflict_messages_total", WINDOW, VENDOR)

_DEVIATIONS = or_zero_by_vendor(f"{rate('deconflict_deviations_total', WINDOW, VENDOR)} / {_PER_MESSAGE}")
_REJECTED = or_zero_by_vendor(
    f"{rate('deconflict_messages_total', WINDOW, VENDOR, where={'result': 'rejected'})} / {_PER_MESSAGE}"
)
_NUISANCE = or_zero_by_vendor(
    f"{rate('deconflict_conflicts_ended_total', '1h', VENDOR, where={'outcome': 'not_met'})}"
    f" / {rate('deconflict_conflicts_ended_total', '1h', VENDOR)}"
)
_OFF = "deconflict_forecast_error_metres"
_WITHIN = share_within(OBJECTIVE_S, STATUS_WAIT, WINDOW, VENDOR)


def _sometimes_absent(query: str, legend: str) -> Query:
    """A query of a series that is absent at times; 0 at these times."""
    return Query(f"{query} or vector(0)", legend)


def rated(name: str, by: Iterable[str] = (), legend: str = "") -> Query:
    return Query(rate(name, WINDOW, by), legend)


def rare(name: str, legend: str) -> Query:
    """A counter with labels that may not exist yet; 0 until it does."""
    return Query(f"{rate(name, WINDOW)} or vector(0)", legend)


def each(title: str, unit: str, name: str, label: str, warn_above: float | None = None) -> Panel:
    """One line for each value of a label; 0 if the site has none."""
    query = f"{level(name, [label], over='max')} or vector(0)"
    return Panel(title, unit, (Query(query, f"{{{{{label}}}}}"),), warn_above=warn_above)


SITE = Dashboard(
    "deconflict-site",
    "Deconfliction: site overview",
    (
        PanelRow(
            "Now",
            (
                Panel(
                    "Open advisories",
                    "short",
                    (Query(f"{level('deconflict_advisories_open')} or vector(0)", "open"),),
                    "stat",
                    4,
                    5,
                ),
                Panel(
                    "Deadlocks",
                    "short",
                    (Query(f"{level('deconflict_advisories_open', where={'kind': 'deadlock'})} or vector(0)"),),
                    "stat",
                    4,
                    5,
                    warn_above=1,
                ),
                Panel("Robots", "short", (Query(level("deconflict_robots"), "robots"),), "stat", 4, 5),
                Panel(
                    "Silent robots",
                    "short",
                    (Query(f"{level('deconflict_robots', where={'state': 'silent'})} or vector(0)", "silent"),),
                    "stat",
                    4,
                    5,
                    warn_above=1,
                ),
                Panel(
                    "Roles down",
                    "short",
                    (Query(f"count ({level('deconflict_role_up', ['role'], over='min')} == 0) or vector(0)", "down"),),
                    "stat",
                    4,
                    5,
                    warn_above=1,
                ),
                Panel(
                    "Statuses within 250 ms",
                    "percentunit",
                    (Query(share_within(OBJECTIVE_S, STATUS_WAIT, WINDOW)),),
                    "stat",
                    4,
                    5,
                    warn_below=OBJECTIVE_SHARE,
                ),
            ),
        ),
        PanelRow(
            "The floor",
            (
                Panel(
                    "Open advisories by kind and severity",
                    "short",
                    (
                        Query(
                            f"{level('deconflict_advisories_open', ['kind', 'severity'])} or vector(0)",
                            "{{kind}} {{severity}}",
                        ),
                    ),
                    columns=12,
                ),
                Panel(
                    "Advisories raised, updated and cleared",
                    "ops",
                    (rated("deconflict_advisories_total", ["kind", "event"], "{{kind}} {{event}}"),),
                    columns=12,
                ),
                Panel(
                    "Robots by state",
                    "short",
                    (Query(level("deconflict_robots", ["state"]), "{{state}}"),),
                ),
                Panel("Robots by vendor", "short", (Query(level("deconflict_robots", VENDOR), "{{vendor}}"),)),
                Panel("Pairs in predicted conflict", "short", (Query(level("deconflict_conflicts"), "pairs"),)),
            ),
        ),
        PanelRow(
            "Shared places",
            (
                each("Robots at each resource and zone", "short", "deconflict_resource_occupancy", "resource"),
                each(
                    "Robots that occupy or will need each resource", "short", "deconflict_resource_demand", "resource"
                ),
                each("Longest expected wait", "s", "deconflict_resource_wait_seconds", "resource"),
                each("Robots that leave a zone", "ops", "deconflict_zone_flow_per_second", "zone"),
                each("Saturation of zones", "percentunit", "deconflict_zone_saturation_ratio", "zone", warn_above=1.0),
                Panel("Deadlocks ahead", "short", (Query(level("deconflict_deadlocks_ahead"), "rings"),), warn_above=1),
            ),
        ),
    ),
)

VENDORS = Dashboard(
    "deconflict-vendors",
    "Deconfliction: vendor scorecard",
    (
        PanelRow(
            "Scorecard",
            (
                Panel(
                    "Vendors",
                    "short",
                    (
                        Query(level("deconflict_robots", VENDOR), "robots"),
                        Query(_PER_MESSAGE, "messages per second"),
                        Query(_DEVIATIONS, "deviations per message"),
                        Query(_REJECTED, "share rejected"),
                        Query(level("deconflict_clock_offset_seconds", VENDOR, over="max"), "clock offset, s"),
                        Query(level("deconflict_clock_delay_seconds", VENDOR, over="max"), "delay, s"),
                        Query(level("deconflict_forecast_age_seconds", VENDOR, over="max"), "forecast age, s"),
                        Query(_WITHIN, "share within 250 ms"),
                        Query(_NUISANCE, "share of conflicts that did not happen"),
                    ),
                    "table",
                    24,
                    8,
                ),
            ),
        ),
        PanelRow(
            "Messages",
            (
                Panel(
                    "Messages",
                    "reqps",
                    (
                        Query(_PER_MESSAGE, "{{vendor}}"),
                        Query(level("deconflict_messages_per_second", VENDOR), "{{vendor}}, last minute"),
                    ),
                ),
                Panel("Deviations per message", "short", (Query(_DEVIATIONS, "{{vendor}}"),)),
                Panel("Share rejected", "percentunit", (Query(_REJECTED, "{{vendor}}"),), warn_above=0.05),
                Panel(
                    "Deviations by rule",
                    "ops",
                    (rated("deconflict_deviations_total", ["vendor", "rule"], "{{vendor}} {{rule}}"),),
                    columns=12,
                ),
                Panel(
                    "Rejections by rule",
                    "ops",
                    (
                        Query(
                            f"{rate('deconflict_rejections_total', WINDOW, ['vendor', 'rule'])} or vector(0)",
                            "{{vendor}} {{rule}}",
                        ),
                    ),
                    columns=12,
                ),
            ),
        ),
        PanelRow(
            "Forecasts",
            (
                Panel(
                    "80 % error of forecasts",
                    "m",
                    (
                        Query(
                            level(_OFF, ["vendor", "horizon_s"], where={"share": "0.8"}, over="max") + " or vector(0)",
                            "{{vendor}} {{horizon_s}} s ahead",
                        ),
                    ),
                ),
                Panel(
                    "Share of errors within the band",
                    "percentunit",
                    (
                        Query(
                            f"{level('deconflict_forecast_band_coverage_ratio', ['vendor', 'share'], over='max')}"
                            " or vector(0)",
                            "{{vendor}}, of {{share}}",
                        ),
                    ),
                ),
                Panel(
                    "Grade",
                    "short",
                    (
                        Query(
                            f"{level('deconflict_forecast_grade', ['vendor', 'grade'], over='max')} or vector(0)",
                            "{{vendor}} {{grade}}",
                        ),
                    ),
                    "stat",
                ),
            ),
        ),
        PanelRow(
            "Clocks and forecasts",
            (
                Panel(
                    "Clock offset",
                    "s",
                    (Query(level("deconflict_clock_offset_seconds", VENDOR, over="max"), "{{vendor}}"),),
                ),
                Panel(
                    "Delay from measurement to arrival",
                    "s",
                    (Query(level("deconflict_clock_delay_seconds", VENDOR, over="max"), "{{vendor}}"),),
                ),
                Panel(
                    "Age of forecasts",
                    "s",
                    (Query(level("deconflict_forecast_age_seconds", VENDOR, over="max"), "{{vendor}}"),),
                ),
                Panel(
                    "Statuses within 250 ms",
                    "percentunit",
                    (Query(_WITHIN, "{{vendor}}"),),
                    warn_below=OBJECTIVE_SHARE,
                ),
                Panel(
                    "Time since a change",
                    "dateTimeFromNow",
                    (
                        _sometimes_absent(
                            f"1000 * {level(clock_changes.SINCE, ['vendor', 'what'], over='max')}",
                            "{{vendor}} {{what}}",
                        ),
                    ),
                    "stat",
                ),
                Panel(
                    "Size of a change, metres",
                    "m",
                    tuple(
                        _sometimes_absent(
                            level(clock_changes.AMOUNTS[what], VENDOR, over="max"), f"{{{{vendor}}}} {what}"
                        )
                        for what in ("forecast", "datum")
                    ),
                ),
                Panel(
                    "Size of a change, seconds",
                    "s",
                    (_sometimes_absent(level(clock_changes.AMOUNTS["clock"], VENDOR, over="max"), "{{vendor}} clock"),),
                ),
                Panel(
                    "Robots whose motion contradicts their forecasts",
                    "short",
                    (
                        _sometimes_absent(level("deconflict_robots_distrusted", VENDOR), "{{vendor}} robots"),
                        _sometimes_absent(
                            rate("deconflict_forecasts_distrusted_total", WINDOW, VENDOR),
                            "{{vendor}} forecasts/s",
                        ),
                    ),
                ),
                each("Drift of the coordinate frame", "m", "deconflict_datum_drift_metres", "vendor", warn_above=0.2),
                each(
                    "Actual time to a destination, divided by the announced time",
                    "short",
                    "deconflict_arrival_time_ratio",
                    "vendor",
                ),
                Panel(
                    "Median error of announced arrivals",
                    "s",
                    (
                        _sometimes_absent(
                            level(
                                "deconflict_arrival_error_seconds",
                                ["vendor", "ahead_up_to_s"],
                                over="max",
                                where={"share": "0.5"},
                            ),
                            "{{vendor}}, up to {{ahead_up_to_s}} s ahead",
                        ),
                    ),
                ),
                Panel(
                    "Share of late arrivals",
                    "percentunit",
                    (
                        _sometimes_absent(
                            level("deconflict_arrivals_late_ratio", ["vendor", "ahead_up_to_s"], over="max"),
                            "{{vendor}}, up to {{ahead_up_to_s}} s ahead",
                        ),
                    ),
                ),
                Panel(
                    "Share of conflicts that did not happen, last hour",
                    "percentunit",
                    (Query(_NUISANCE, "{{vendor}}"),),
                ),
                Panel(
                    "Robots forgotten",
                    "ops",
                    (
                        Query(
                            or_zero_by_vendor(rate("deconflict_robots_forgotten_total", WINDOW, VENDOR)), "{{vendor}}"
                        ),
                    ),
                ),
            ),
        ),
    ),
)
