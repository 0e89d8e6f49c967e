"""The dashboard of the vendors: messages, forecasts, clocks and conflicts of each."""

from ingest.measures import clock_changes
from metrics.monitoring.alert_rules import OBJECTIVE_S, OBJECTIVE_SHARE
from metrics.monitoring.panels import Dashboard, Query, panel, row
from metrics.monitoring.promql import level, or_zero, or_zero_by_vendor, rate, share_within
from metrics.monitoring.queries import (
    STATUS_WAIT,
    VENDOR,
    WINDOW,
    each,
    measured,
    rated,
    rated_by_vendor,
    share_came_true,
    share_warned_of,
    zero_if_absent,
)

_PER_MESSAGE = rate("deconflict_messages_total", WINDOW, VENDOR)
_DEVIATIONS = or_zero_by_vendor(f"{rate('deconflict_deviations_total', WINDOW, VENDOR)} / {_PER_MESSAGE}")
_REJECTED = or_zero_by_vendor(
    f"{rate('deconflict_messages_total', WINDOW, VENDOR, where={'result': 'rejected'})} / {_PER_MESSAGE}"
)
_CAME_TRUE, _WARNED_OF = share_came_true("1h", VENDOR), share_warned_of("1h", VENDOR)
_SINCE = f"1000 * {level(clock_changes.SINCE, ['vendor', 'what'], over='max')}"
_WITHIN = share_within(OBJECTIVE_S, STATUS_WAIT, WINDOW, VENDOR)


def _highest(name: str, legend: str = "") -> Query:
    """The highest value of each vendor."""
    return measured(name, VENDOR, legend, over="max")


def _size_of_change(what: str, legend: str) -> Query:
    return zero_if_absent(_highest(clock_changes.AMOUNTS[what], legend))


VENDORS = Dashboard(
    "deconflict-vendors",
    "Deconfliction: vendor scorecard",
    (
        row(
            "Scorecard",
            panel(
                "Vendors",
                "short",
                measured("deconflict_robots", VENDOR, "robots"),
                Query(_PER_MESSAGE, "messages per second"),
                Query(_DEVIATIONS, "deviations per message"),
                Query(_REJECTED, "share rejected"),
                _highest("deconflict_clock_offset_seconds", "clock offset, s"),
                _highest("deconflict_clock_delay_seconds", "delay, s"),
                _highest("deconflict_forecast_age_seconds", "forecast age, s"),
                Query(_WITHIN, "share within 250 ms"),
                Query(_CAME_TRUE, "share of warnings that came true"),
                kind="table",
                columns=24,
                rows=8,
            ),
        ),
        row(
            "Warnings",
            panel("Events warned of, last hour", "percentunit", Query(_WARNED_OF, "{{vendor}}")),
            panel("Came true, of warnings judged, last hour", "percentunit", Query(_CAME_TRUE, "{{vendor}}")),
            panel(
                "Conflicts that ended, by why they were cleared",
                "ops",
                zero_if_absent(rated("deconflict_conflicts_ended_total", ["vendor", "outcome"])),
            ),
        ),
        row(
            "Messages",
            panel(
                "Messages",
                "reqps",
                Query(_PER_MESSAGE, "{{vendor}}"),
                measured("deconflict_messages_per_second", VENDOR, "{{vendor}}, last minute"),
            ),
            panel("Deviations per message", "short", Query(_DEVIATIONS, "{{vendor}}")),
            panel("Share rejected", "percentunit", Query(_REJECTED, "{{vendor}}"), warn_above=0.05),
            panel("Deviations by rule", "ops", rated("deconflict_deviations_total", ["vendor", "rule"]), columns=12),
            panel(
                "Rejections by rule",
                "ops",
                zero_if_absent(rated("deconflict_rejections_total", ["vendor", "rule"])),
                columns=12,
            ),
        ),
        row(
            "Forecasts",
            panel(
                "80 % error of forecasts",
                "m",
                zero_if_absent(
                    measured(
                        "deconflict_forecast_error_metres",
                        ["vendor", "horizon_s"],
                        "{{vendor}} {{horizon_s}} s ahead",
                        over="max",
                        where={"share": "0.8"},
                    )
                ),
            ),
            panel(
                "Share of errors within the band",
                "percentunit",
                zero_if_absent(
                    measured(
                        "deconflict_forecast_band_coverage_ratio",
                        ["vendor", "share"],
                        "{{vendor}}, of {{share}}",
                        over="max",
                    )
                ),
            ),
            panel(
                "Grade",
                "short",
                zero_if_absent(measured("deconflict_forecast_grade", ["vendor", "grade"], over="max")),
                kind="stat",
            ),
        ),
        row(
            "Clocks and forecasts",
            panel("Clock offset", "s", _highest("deconflict_clock_offset_seconds")),
            panel("Delay from measurement to arrival", "s", _highest("deconflict_clock_delay_seconds")),
            panel("Age of forecasts", "s", _highest("deconflict_forecast_age_seconds")),
            panel("Statuses within 250 ms", "percentunit", Query(_WITHIN, "{{vendor}}"), warn_below=OBJECTIVE_SHARE),
            panel("Time since a change", "dateTimeFromNow", Query(or_zero(_SINCE), "{{vendor}} {{what}}"), kind="stat"),
            panel(
                "Size of a change, metres",
                "m",
                _size_of_change("forecast", "{{vendor}} forecast"),
                _size_of_change("datum", "{{vendor}} datum"),
            ),
            panel("Size of a change, seconds", "s", _size_of_change("clock", "{{vendor}} clock")),
            panel(
                "Robots whose motion contradicts their forecasts",
                "short",
                zero_if_absent(measured("deconflict_robots_distrusted", VENDOR, "{{vendor}} robots")),
                zero_if_absent(rated("deconflict_forecasts_distrusted_total", VENDOR, "{{vendor}} forecasts/s")),
            ),
            each("Drift of the coordinate frame", "m", "deconflict_datum_drift_metres", "vendor", warn_above=0.2),
            each(
                "Actual time to a destination, divided by the announced time",
                "short",
                "deconflict_arrival_time_ratio",
                "vendor",
            ),
            panel(
                "Median error of announced arrivals",
                "s",
                zero_if_absent(
                    measured(
                        "deconflict_arrival_error_seconds",
                        ["vendor", "ahead_up_to_s"],
                        "{{vendor}}, up to {{ahead_up_to_s}} s ahead",
                        over="max",
                        where={"share": "0.5"},
                    )
                ),
            ),
            panel(
                "Share of late arrivals",
                "percentunit",
                zero_if_absent(
                    measured(
                        "deconflict_arrivals_late_ratio",
                        ["vendor", "ahead_up_to_s"],
                        "{{vendor}}, up to {{ahead_up_to_s}} s ahead",
                        over="max",
                    )
                ),
            ),
            panel("Robots forgotten", "ops", rated_by_vendor("deconflict_robots_forgotten_total")),
        ),
    ),
)
