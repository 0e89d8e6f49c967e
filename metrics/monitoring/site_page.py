"""The dashboard of the site, and the queries and panels that all dashboards use."""

from collections.abc import Iterable

from metrics.monitoring.alert_rules import OBJECTIVE_S, OBJECTIVE_SHARE
from metrics.monitoring.panels import Dashboard, Panel, PanelRow, Query
from metrics.monitoring.promql import level, rate, share_within

WINDOW = "$__rate_interval"
VENDOR = ["vendor"]

STATUS_WAIT = "deconflict_message_to_advisory_seconds"


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
