"""The dashboard of the site, and the queries and panels that all dashboards use."""

from collections.abc import Iterable
from dataclasses import replace

from metrics.monitoring.alert_rules import OBJECTIVE_S, OBJECTIVE_SHARE
from metrics.monitoring.panels import Dashboard, Panel, Query, panel, row
from metrics.monitoring.promql import Where, level, or_zero, or_zero_by_vendor, rate, share_within

WINDOW = "$__rate_interval"
VENDOR = ["vendor"]

STATUS_WAIT = "deconflict_message_to_advisory_seconds"


def rated(name: str, by: Iterable[str] = (), legend: str = "") -> Query:
    """A counter per second. Its legend names the labels unless another is given."""
    return Query(rate(name, WINDOW, by), legend or labels_of(by))


def rated_by_vendor(name: str) -> Query:
    """A counter per second; 0 for each vendor that has robots but no result."""
    return Query(or_zero_by_vendor(rate(name, WINDOW, VENDOR)), labels_of(VENDOR))


def measured(
    name: str, by: Iterable[str] = (), legend: str = "", *, over: str = "sum", where: Where | None = None
) -> Query:
    """A gauge. Its legend names the labels unless another is given."""
    return Query(level(name, by, where=where, over=over), legend or labels_of(by))


def zero_if_absent(query: Query) -> Query:
    """A query of series that do not always exist; 0 while there is none."""
    return replace(query, promql=or_zero(query.promql))


def labels_of(by: Iterable[str]) -> str:
    """The legend that shows the values of these labels."""
    return " ".join(f"{{{{{label}}}}}" for label in by)


def each(title: str, unit: str, name: str, label: str, warn_above: float | None = None) -> Panel:
    """One line for each value of a label; 0 if the site has none."""
    return panel(title, unit, zero_if_absent(measured(name, [label], over="max")), warn_above=warn_above)


def number(title: str, unit: str, query: Query, **warn: float) -> Panel:
    """One number at the top of the page."""
    return panel(title, unit, query, kind="stat", columns=4, rows=5, **warn)


_OPEN = "deconflict_advisories_open"
_DOWN = f"count ({level('deconflict_role_up', ['role'], over='min')} == 0)"

SITE = Dashboard(
    "deconflict-site",
    "Deconfliction: site overview",
    (
        row(
            "Now",
            number("Open advisories", "short", zero_if_absent(measured(_OPEN, legend="open"))),
            number("Deadlocks", "short", zero_if_absent(measured(_OPEN, where={"kind": "deadlock"})), warn_above=1),
            number("Robots", "short", measured("deconflict_robots", legend="robots")),
            number(
                "Silent robots",
                "short",
                zero_if_absent(measured("deconflict_robots", legend="silent", where={"state": "silent"})),
                warn_above=1,
            ),
            number("Roles down", "short", Query(or_zero(_DOWN), "down"), warn_above=1),
            number(
                "Statuses within 250 ms",
                "percentunit",
                Query(share_within(OBJECTIVE_S, STATUS_WAIT, WINDOW)),
                warn_below=OBJECTIVE_SHARE,
            ),
        ),
        row(
            "The floor",
            panel(
                "Open advisories by kind and severity",
                "short",
                zero_if_absent(measured(_OPEN, ["kind", "severity"])),
                columns=12,
            ),
            panel(
                "Advisories raised, updated and cleared",
                "ops",
                rated("deconflict_advisories_total", ["kind", "event"]),
                columns=12,
            ),
            panel("Robots by state", "short", measured("deconflict_robots", ["state"])),
            panel("Robots by vendor", "short", measured("deconflict_robots", VENDOR)),
            panel("Pairs in predicted conflict", "short", measured("deconflict_conflicts", legend="pairs")),
        ),
        row(
            "Shared places",
            each("Robots at each resource and zone", "short", "deconflict_resource_occupancy", "resource"),
            each("Robots that occupy or will need each resource", "short", "deconflict_resource_demand", "resource"),
            each("Longest expected wait", "s", "deconflict_resource_wait_seconds", "resource"),
            each("Robots that leave a zone", "ops", "deconflict_zone_flow_per_second", "zone"),
            each("Saturation of zones", "percentunit", "deconflict_zone_saturation_ratio", "zone", warn_above=1.0),
            panel("Deadlocks ahead", "short", measured("deconflict_deadlocks_ahead", legend="rings"), warn_above=1),
        ),
    ),
)
