"""The dashboard of the site."""

from metrics.monitoring.alert_rules import OBJECTIVE_S, OBJECTIVE_SHARE
from metrics.monitoring.panels import Dashboard, Query, panel, row
from metrics.monitoring.promql import level, or_zero, share_within
from metrics.monitoring.queries import (
    OUTCOMES,
    STATUS_WAIT,
    VENDOR,
    WINDOW,
    ahead_by,
    each,
    measured,
    number,
    rated,
    share_came_true,
    share_warned_of,
    warnings,
    zero_if_absent,
)

_LOST = "deconflict_lost_seconds_total"
_OPEN, _SITUATIONS = "deconflict_advisories_open", "deconflict_situations_open"
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
            "Situations",
            number("Open situations", "short", zero_if_absent(measured(_SITUATIONS, legend="open"))),
            number(
                "Critical situations",
                "short",
                zero_if_absent(measured(_SITUATIONS, where={"severity": "critical"})),
                warn_above=1,
            ),
            panel(
                "Open situations by kind and severity",
                "short",
                zero_if_absent(measured(_SITUATIONS, ["kind", "severity"])),
                columns=8,
            ),
            panel(
                "Situations raised, updated and cleared",
                "ops",
                zero_if_absent(rated("deconflict_situations_total", ["kind", "event"])),
                columns=8,
            ),
        ),
        row(
            "Warnings in the last hour",
            number("Events warned of", "percentunit", Query(share_warned_of("1h"), "warned of")),
            number("Came true, of those judged", "percentunit", Query(share_came_true("1h"), "came true")),
            number("Ahead by, median", "s", Query(ahead_by("1h"), "ahead by")),
            panel(
                "What came of warnings",
                "short",
                *(Query(warnings(outcome, "1h"), outcome.replace("_", " ")) for outcome in OUTCOMES),
                columns=12,
                rows=5,
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
            "Lost time",
            panel("Lost by whose robots", "percentunit", rated(_LOST, VENDOR)),
            panel("Lost to whose robots", "percentunit", rated(_LOST, ["by"])),
            panel("Lost by place", "percentunit", rated(_LOST, ["zone"])),
        ),
        row(
            "Shared places",
            each("Robots at each resource and zone", "short", "deconflict_resource_occupancy", "resource"),
            each("Robots that occupy or will need each resource", "short", "deconflict_resource_demand", "resource"),
            each("Longest expected wait", "s", "deconflict_resource_wait_seconds", "resource"),
            each("Robots that leave a zone", "ops", "deconflict_zone_flow_per_second", "zone"),
            each("Saturation of zones", "percentunit", "deconflict_zone_saturation_ratio", "zone", warn_above=1.0),
            panel(
                "Robots in ordinary waits, without an advisory",
                "short",
                rated("deconflict_ordinary_wait_seconds_total", ["kind"]),
            ),
            panel("Deadlocks ahead", "short", measured("deconflict_deadlocks_ahead", legend="rings"), warn_above=1),
        ),
    ),
)
