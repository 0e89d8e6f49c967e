"""Whether all robots, and all their pairs, are examined, as the operator face sees it."""

from collections.abc import Sequence
from typing import Any

from deconflict.cluster.members_health import health_part
from deconflict.roles.health.refusal_health import MOST_NAMED
from deconflict_client.counted_nouns import count_of
from ingest.fleet.owners.admission import PARTLY_EXAMINED, UNEXAMINED, remedy
from ingest.measures.measures import joined_values


def admission_document(documents: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """The part `admission` of the health. `documents` are the measures of all receivers."""
    by_source = {source: int(count) for (source,), count in joined_values(documents).get(UNEXAMINED, {}).items()}
    waiting = sum(by_source.values())
    named = ", ".join(f"{count} of {source}" for source, count in sorted(by_source.items()))
    reason = (
        f"{waiting} new robots are shown, but not yet compared with others: {named}; "
        f"a few are each minute; for all at once, {remedy(by_source)}"
    )
    return health_part([reason] if waiting else [], waiting=waiting)


def pairs_document(documents: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """The part `pairs` of the health. `documents` are the measures of all engines."""
    by_vendor = {vendor: int(count) for (vendor,), count in joined_values(documents).get(PARTLY_EXAMINED, {}).items()}
    robots = sum(by_vendor.values())
    named = ", ".join(f"{count} of {vendor}" for vendor, count in sorted(by_vendor.items())[:MOST_NAMED])
    reason = (
        f"{count_of(robots, 'robot is', 'robots are')} compared with some others only: {named}; "
        "they report from one place, or more robots come "
        "near them than have room there; check their places and sizes (partly_examined in GET /presence)"
    )
    return health_part([reason] if robots else [], robots=robots)


def off_floor_document(robots: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """The part `off_floor` of the health: how many robots are off the floor, and which of these are still heard."""
    off = [robot for robot in robots if robot["back_s"] is None]
    heard = sorted(robot["name"] for robot in off if robot["still_heard"])
    return {"status": "ok", "robots": len(off), "still_heard": heard[:MOST_NAMED]}
