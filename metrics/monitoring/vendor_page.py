"""The dashboard of the vendors: messages, forecasts, clocks and conflicts of each."""

from ingest.measures import clock_changes
from metrics.monitoring.alert_rules import OBJECTIVE_S, OBJECTIVE_SHARE
from metrics.monitoring.panels import Dashboard, Panel, PanelRow, Query
from metrics.monitoring.promql import level, or_zero_by_vendor, rate, share_within
from metrics.monitoring.site_page import STATUS_WAIT, VENDOR, WINDOW, each, rated

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
