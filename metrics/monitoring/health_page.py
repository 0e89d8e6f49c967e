"""The dashboard of the health of the engine, the ingest, the store and the stream."""

from metrics.monitoring.alert_rules import OBJECTIVE_S
from metrics.monitoring.panels import Dashboard, Query, panel, row
from metrics.monitoring.promql import quantile, time_share
from metrics.monitoring.queries import STATUS_WAIT, WINDOW, measured, rated, rated_by_vendor, zero_if_absent

_STEP = "deconflict_sweep_duration_seconds"


def _quantiles(name: str) -> list[Query]:
    return [Query(quantile(share, name, WINDOW), f"p{share * 100:g}") for share in (0.5, 0.95, 0.99)]


ENGINE = Dashboard(
    "deconflict-engine",
    "Deconfliction: engine and ingest health",
    (
        row(
            "From message to advisory",
            panel("Message to advisory", "s", *_quantiles(STATUS_WAIT), warn_above=OBJECTIVE_S),
            panel("Duration of a pass", "s", *_quantiles(_STEP)),
            panel(
                "Share of time that the engine computes",
                "percentunit",
                Query(time_share(_STEP, WINDOW), "engine"),
                warn_above=0.8,
            ),
            panel("Ticks", "ops", rated("deconflict_ticks_total", legend="ticks")),
            panel(
                "Work of the sweep",
                "ops",
                rated("deconflict_sweep_segment_pairs_total", legend="segment pairs"),
                rated("deconflict_sweep_fcl_calls_total", legend="collision library"),
            ),
            panel(
                "Watched pairs, by outcome",
                "ops",
                zero_if_absent(rated("deconflict_probability_outcomes_total", ["outcome"])),
            ),
            panel(
                "Forecasts that could not be used",
                "ops",
                zero_if_absent(rated("deconflict_invalid_forecasts_total", legend="all reasons")),
            ),
            panel(
                "Revisions that waited for a later pass",
                "ops",
                zero_if_absent(rated("deconflict_revisions_deferred_total", legend="all vendors")),
            ),
        ),
        row(
            "Ingest",
            panel("Messages by result", "reqps", rated("deconflict_messages_total", ["result"])),
            panel("Connections", "short", measured("deconflict_connections", legend="open")),
            panel(
                "Connections refused",
                "ops",
                zero_if_absent(rated("deconflict_connections_refused_total", legend="all reasons")),
            ),
            panel(
                "Statuses replaced before they were read",
                "ops",
                rated_by_vendor("deconflict_statuses_superseded_total"),
            ),
            panel("Messages over a vendor's rate limit", "ops", rated_by_vendor("deconflict_messages_shed_total")),
            panel("Recording", "Bps", rated("deconflict_recorded_bytes_total", legend="written")),
            panel(
                "Lines lost by the recording", "ops", rated("deconflict_recorded_lines_dropped_total", legend="lost")
            ),
        ),
        row(
            "Roles, store and stream",
            panel("Roles up", "short", measured("deconflict_role_up", ["role"], over="min"), kind="stat"),
            panel(
                "Members of a cluster, and expected ones",
                "short",
                zero_if_absent(measured("deconflict_members", ["part"], over="min")),
                zero_if_absent(measured("deconflict_members_expected", ["part"], "{{part}} expected", over="max")),
            ),
            panel("Restarts", "short", zero_if_absent(rated("deconflict_role_restarts_total", legend="all"))),
            panel("Release", "short", measured("deconflict_build_info", ["version"], over="max"), kind="stat"),
            panel(
                "Revisions stored, and failures",
                "ops",
                rated("deconflict_advisories_stored_total", legend="stored"),
                rated("deconflict_store_failures_total", legend="failures"),
            ),
            panel(
                "Delay from the engine to the store",
                "s",
                measured("deconflict_delivery_delay_seconds", legend="delay", over="max"),
            ),
            panel(
                "From made-up messages to a stored advisory",
                "s",
                measured("deconflict_canary_latency_seconds", legend="canary", over="max"),
            ),
            panel("Advisory database", "bytes", measured("deconflict_store_bytes", legend="size", over="max")),
            panel(
                "Database begun anew after damage",
                "short",
                measured("deconflict_store_renewed", legend="begun anew", over="max"),
            ),
            panel("Advisories removed", "ops", rated("deconflict_advisories_pruned_total", ["reason"])),
            panel(
                "Revisions set aside, which nobody receives",
                "ops",
                rated("deconflict_advisories_set_aside_total", ["reason"]),
            ),
            panel(
                "Failures to read or write what was learned",
                "ops",
                rated("deconflict_learning_failures_total", ["what"]),
            ),
            panel(
                "Subscribers of the stream, and open pages",
                "short",
                measured("deconflict_stream_subscribers", legend="stream"),
                measured("deconflict_page_viewers", legend="pages"),
            ),
            panel(
                "Outlets: delivered and failed",
                "ops",
                zero_if_absent(rated("deconflict_outlet_deliveries_total", legend="delivered")),
                zero_if_absent(rated("deconflict_outlet_failures_total", legend="failed")),
            ),
            panel(
                "Outlets: waiting",
                "short",
                zero_if_absent(measured("deconflict_outlet_waiting", ["outlet"], over="max")),
            ),
            panel("Subscribers disconnected", "ops", rated("deconflict_stream_dropped_total", legend="dropped")),
        ),
    ),
)
