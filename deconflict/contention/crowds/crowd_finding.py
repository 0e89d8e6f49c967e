"""The finding of a crowd: its text, location and evidence."""

from collections.abc import Mapping

from deconflict.advisories.finding_lifecycle import Finding, about_crowd
from deconflict.advisories.words import finding_words
from deconflict.contention.crowds.crowds import Crowd
from deconflict.foresight.presence.live_robots import LiveRobot
from deconflict_client.advisory import Location, Severity

NAMED_ROBOTS = 10
"""So many robots are named in the advisory, and the first three in its text."""


def crowd_finding(crowd: Crowd, robots: Mapping[str, LiveRobot], now_s: float) -> Finding:
    """Robots that can't all be where they report from."""
    location = Location(datum=crowd.datum, x=round(crowd.x_m, 3), y=round(crowd.y_m, 3))
    count = len(crowd.robots)
    return Finding(
        kind="crowd",
        about=about_crowd(crowd.label, crowd.datum),
        severity=Severity.WARNING,
        robots=crowd.robots[:NAMED_ROBOTS],
        predicted_s=now_s,
        location=location,
        words=lambda: finding_words.crowd(
            count, crowd.label, location.x, location.y, [robots[uuid].name for uuid in crowd.robots[:3]]
        ),
        evidence={"vendor": crowd.label, "crowded": count},
    )
