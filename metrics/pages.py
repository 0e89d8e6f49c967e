"""What the dashboards show: the site, its vendors, and the engine with what feeds it."""

from collections.abc import Iterable

from metrics.panels import Dashboard, Panel, Query, Row
from metrics.promql import level, or_zero_by_vendor, quantile, rate, share_within, time_share
from metrics.rules import OBJECTIVE_S, OBJECTIVE_SHARE

WINDOW = "$__rate_interval"
VENDOR = ["vendor"]

_STATUS_WAIT = "deconflict_message_to_advisory_seconds"
_STEP = "deconflict_sweep_duration_seconds"
_PER_MESSAGE = rate("deconflict_messages_total", WINDOW, VENDOR)

_DEVIATIONS = or_zero_by_vendor(f"{rate('deconflict_deviations_total', WINDOW, VENDOR)} / {_PER_MESSAGE}")
_REJECTED = or_zero_by_vendor(
    f"{rate('deconflict_messages_total', WINDOW, VENDOR, where={'result': 'rejected'})} / {_PER_MESSAGE}"
)
_NUISANCE = or_zero_by_vendor(
    f"{rate('deconflict_conflicts_ended_total', '1h', VENDOR, where={'outcome': 'not_met'})}"
    f" / {rate('deconflict_conflicts_ended_total', '1h', VENDOR)}"
)
_WITHIN = share_within(OBJECTIVE_S, _STATUS_WAIT, WINDOW, VENDOR)


def _rate(name: str, by: Iterable[str] = (), legend: str = "") -> Query:
    return Query(rate(name, WINDOW, by), legend)


def _rare(name: str, legend: str) -> Query:
    """A counter with labels that may not have begun: 0 until then."""
    return Query(f"{rate(name, WINDOW)} or vector(0)", legend)


def _each(title: str, unit: str, name: str, label: str, warn_above: float | None = None) -> Panel:
    """One line for each value of a label; 0 where the site has none."""
    query = f"{level(name, [label], over='max')} or vector(0)"
    return Panel(title, unit, (Query(query, f"{{{{{label}}}}}"),), warn_above=warn_above)


SITE = Dashboard(
    "deconflict-site",
    "Deconfliction: site overview",
    (
        Row(
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
                    (Query(share_within(OBJECTIVE_S, _STATUS_WAIT, WINDOW)),),
                    "stat",
                    4,
                    5,
                    warn_below=OBJECTIVE_SHARE,
                ),
            ),
        ),
        Row(
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
                    (_rate("deconflict_advisories_total", ["kind", "event"], "{{kind}} {{event}}"),),
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
        Row(
            "What is shared",
            (
                _each("Robots at each resource and zone", "short", "deconflict_resource_occupancy", "resource"),
                _each("Robots that have it or will want it", "short", "deconflict_resource_demand", "resource"),
                _each("Longest wait expected", "s", "deconflict_resource_wait_seconds", "resource"),
                _each("Robots that leave a zone", "ops", "deconflict_zone_flow_per_second", "zone"),
                _each("Saturation of zones", "percentunit", "deconflict_zone_saturation_ratio", "zone", warn_above=1.0),
                Panel("Deadlocks ahead", "short", (Query(level("deconflict_deadlocks_ahead"), "rings"),), warn_above=1),
            ),
        ),
    ),
)

VENDORS = Dashboard(
    "deconflict-vendors",
    "Deconfliction: vendor scorecard",
    (
        Row(
            "Scorecard",
            (
                Panel(
                    "Vendors",
                    "short",
                    (
                        Query(level("deconflict_robots", VENDOR), "robots"),
                        Query(_PER_MESSAGE, "messages a second"),
                        Query(_DEVIATIONS, "deviations a message"),
                        Query(_REJECTED, "share rejected"),
                        Query(level("deconflict_clock_offset_seconds", VENDOR, over="max"), "clock offset, s"),
                        Query(level("deconflict_clock_delay_seconds", VENDOR, over="max"), "delay, s"),
                        Query(level("deconflict_forecast_age_seconds", VENDOR, over="max"), "forecast age, s"),
                        Query(_WITHIN, "share within 250 ms"),
                        Query(_NUISANCE, "conflicts that did not come about"),
                    ),
                    "table",
                    24,
                    8,
                ),
            ),
        ),
        Row(
            "Messages",
            (
                Panel("Messages", "reqps", (Query(_PER_MESSAGE, "{{vendor}}"),)),
                Panel("Deviations a message", "short", (Query(_DEVIATIONS, "{{vendor}}"),)),
                Panel("Share rejected", "percentunit", (Query(_REJECTED, "{{vendor}}"),), warn_above=0.05),
                Panel(
                    "Deviations by rule",
                    "ops",
                    (_rate("deconflict_deviations_total", ["vendor", "rule"], "{{vendor}} {{rule}}"),),
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
        Row(
            "Clocks and forecasts",
            (
                Panel(
                    "Clock offset",
                    "s",
                    (Query(level("deconflict_clock_offset_seconds", VENDOR, over="max"), "{{vendor}}"),),
                ),
                Panel(
                    "From true to arrived",
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
                _each("Drift of the frame", "m", "deconflict_datum_drift_meters", "vendor", warn_above=0.2),
                _each("Time to a destination over the time told", "short", "deconflict_arrival_time_ratio", "vendor"),
                Panel(
                    "Conflicts that did not come about, of those ended in an hour",
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

ENGINE = Dashboard(
    "deconflict-engine",
    "Deconfliction: engine and ingest health",
    (
        Row(
            "From message to advisory",
            (
                Panel(
                    "Message to advisory",
                    "s",
                    tuple(
                        Query(quantile(share, _STATUS_WAIT, WINDOW), f"p{share * 100:g}") for share in (0.5, 0.95, 0.99)
                    ),
                    warn_above=OBJECTIVE_S,
                ),
                Panel(
                    "Duration of a pass",
                    "s",
                    tuple(Query(quantile(share, _STEP, WINDOW), f"p{share * 100:g}") for share in (0.5, 0.95, 0.99)),
                ),
                Panel(
                    "Share of time computing",
                    "percentunit",
                    (Query(time_share(_STEP, WINDOW), "engine"),),
                    warn_above=0.8,
                ),
                Panel("Ticks", "ops", (_rate("deconflict_ticks_total", legend="ticks"),)),
                Panel(
                    "Work of the sweep",
                    "ops",
                    (
                        _rate("deconflict_sweep_segment_pairs_total", legend="segment pairs"),
                        _rate("deconflict_sweep_fcl_calls_total", legend="collision library"),
                    ),
                ),
                Panel(
                    "Forecasts that could not be used",
                    "ops",
                    (_rare("deconflict_invalid_forecasts_total", "all reasons"),),
                ),
            ),
        ),
        Row(
            "Ingest",
            (
                Panel(
                    "Messages by result",
                    "reqps",
                    (_rate("deconflict_messages_total", ["result"], "{{result}}"),),
                ),
                Panel("Connections", "short", (Query(level("deconflict_connections"), "open"),)),
                Panel(
                    "Connections refused",
                    "ops",
                    (_rare("deconflict_connections_refused_total", "all reasons"),),
                ),
                Panel(
                    "Statuses replaced before they were read",
                    "ops",
                    (
                        Query(
                            or_zero_by_vendor(rate("deconflict_statuses_superseded_total", WINDOW, VENDOR)),
                            "{{vendor}}",
                        ),
                    ),
                ),
                Panel(
                    "Messages beyond a vendor's share",
                    "ops",
                    (Query(or_zero_by_vendor(rate("deconflict_messages_shed_total", WINDOW, VENDOR)), "{{vendor}}"),),
                ),
                Panel("Recording", "Bps", (_rate("deconflict_recorded_bytes_total", legend="written"),)),
                Panel("Lines not recorded", "ops", (_rate("deconflict_recorded_lines_dropped_total", legend="lost"),)),
            ),
        ),
        Row(
            "Roles, store and stream",
            (
                Panel(
                    "Roles up", "short", (Query(level("deconflict_role_up", ["role"], over="min"), "{{role}}"),), "stat"
                ),
                Panel(
                    "Restarts",
                    "short",
                    (Query(f"{rate('deconflict_role_restarts_total', WINDOW)} or vector(0)", "all"),),
                ),
                Panel(
                    "Release",
                    "short",
                    (Query(level("deconflict_build_info", ["version"], over="max"), "{{version}}"),),
                    "stat",
                ),
                Panel(
                    "Revisions stored, and failures",
                    "ops",
                    (
                        _rate("deconflict_advisories_stored_total", legend="stored"),
                        _rate("deconflict_store_failures_total", legend="failures"),
                    ),
                ),
                Panel("Followers of the stream", "short", (Query(level("deconflict_stream_subscribers"), "open"),)),
                Panel(
                    "Outlets: delivered and failed",
                    "ops",
                    (
                        _rare("deconflict_outlet_deliveries_total", "delivered"),
                        _rare("deconflict_outlet_failures_total", "failed"),
                    ),
                ),
                Panel(
                    "Outlets: waiting",
                    "short",
                    (
                        Query(
                            f"{level('deconflict_outlet_waiting', ['outlet'], over='max')} or vector(0)",
                            "{{outlet}}",
                        ),
                    ),
                ),
                Panel("Followers dropped", "ops", (_rate("deconflict_stream_dropped_total", legend="dropped"),)),
            ),
        ),
    ),
)
