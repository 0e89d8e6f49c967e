"""The dashboard of the health of the engine, the ingest, the store and the stream."""

from metrics.monitoring.alert_rules import OBJECTIVE_S
from metrics.monitoring.panels import Dashboard, Panel, PanelRow, Query
from metrics.monitoring.promql import level, or_zero_by_vendor, quantile, rate, time_share
from metrics.monitoring.site_page import STATUS_WAIT, VENDOR, WINDOW, rare, rated

_STEP = "deconflict_sweep_duration_seconds"

ENGINE = Dashboard(
    "deconflict-engine",
    "Deconfliction: engine and ingest health",
    (
        PanelRow(
            "From message to advisory",
            (
                Panel(
                    "Message to advisory",
                    "s",
                    tuple(
                        Query(quantile(share, STATUS_WAIT, WINDOW), f"p{share * 100:g}") for share in (0.5, 0.95, 0.99)
                    ),
                    warn_above=OBJECTIVE_S,
                ),
                Panel(
                    "Duration of a pass",
                    "s",
                    tuple(Query(quantile(share, _STEP, WINDOW), f"p{share * 100:g}") for share in (0.5, 0.95, 0.99)),
                ),
                Panel(
                    "Share of time that the engine computes",
                    "percentunit",
                    (Query(time_share(_STEP, WINDOW), "engine"),),
                    warn_above=0.8,
                ),
                Panel("Ticks", "ops", (rated("deconflict_ticks_total", legend="ticks"),)),
                Panel(
                    "Work of the sweep",
                    "ops",
                    (
                        rated("deconflict_sweep_segment_pairs_total", legend="segment pairs"),
                        rated("deconflict_sweep_fcl_calls_total", legend="collision library"),
                    ),
                ),
                Panel(
                    "Watched pairs, by outcome",
                    "ops",
                    (
                        Query(
                            f"{rate('deconflict_probability_outcomes_total', WINDOW, ['outcome'])} or vector(0)",
                            "{{outcome}}",
                        ),
                    ),
                ),
                Panel(
                    "Forecasts that could not be used",
                    "ops",
                    (rare("deconflict_invalid_forecasts_total", "all reasons"),),
                ),
                Panel(
                    "Revisions that waited for a later pass",
                    "ops",
                    (rare("deconflict_revisions_deferred_total", "all vendors"),),
                ),
            ),
        ),
        PanelRow(
            "Ingest",
            (
                Panel(
                    "Messages by result",
                    "reqps",
                    (rated("deconflict_messages_total", ["result"], "{{result}}"),),
                ),
                Panel("Connections", "short", (Query(level("deconflict_connections"), "open"),)),
                Panel(
                    "Connections refused",
                    "ops",
                    (rare("deconflict_connections_refused_total", "all reasons"),),
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
                    "Messages over a vendor's rate limit",
                    "ops",
                    (Query(or_zero_by_vendor(rate("deconflict_messages_shed_total", WINDOW, VENDOR)), "{{vendor}}"),),
                ),
                Panel("Recording", "Bps", (rated("deconflict_recorded_bytes_total", legend="written"),)),
                Panel(
                    "Lines lost by the recording",
                    "ops",
                    (rated("deconflict_recorded_lines_dropped_total", legend="lost"),),
                ),
            ),
        ),
        PanelRow(
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
                        rated("deconflict_advisories_stored_total", legend="stored"),
                        rated("deconflict_store_failures_total", legend="failures"),
                    ),
                ),
                Panel(
                    "Failures to read or write what was learned",
                    "ops",
                    (rated("deconflict_learning_failures_total", ["what"], "{{what}}"),),
                ),
                Panel(
                    "Subscribers of the stream, and open pages",
                    "short",
                    (
                        Query(level("deconflict_stream_subscribers"), "stream"),
                        Query(level("deconflict_page_viewers"), "pages"),
                    ),
                ),
                Panel(
                    "Outlets: delivered and failed",
                    "ops",
                    (
                        rare("deconflict_outlet_deliveries_total", "delivered"),
                        rare("deconflict_outlet_failures_total", "failed"),
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
                Panel("Subscribers disconnected", "ops", (rated("deconflict_stream_dropped_total", legend="dropped"),)),
            ),
        ),
    ),
)
