"""Whether the robots that are heard can be compared with others, and whether brokers have robots that are not heard."""

from collections.abc import Sequence
from typing import Any

from deconflict.cluster.members_health import health_part
from deconflict.roles.health.refusal_health import MOST_NAMED
from deconflict_client.counted_nouns import count_of
from ingest.fleet.fleet_report import NOT_COMPARED
from ingest.fleet.owners.comparability import NOT_READ, REMEDIES, TOO_MANY_MAPS
from ingest.measures.measures import joined_values
from ingest.settings import UNKNOWN

INVENTED = (TOO_MANY_MAPS,)
"""Faults of senders that make up maps without end. Their robots say so, and others are not concerned."""
NOBODY_HEARS = "no ingest is connected to this broker; if this lasts for longer than 10 s, see the logs of the ingests"
WHERE = "GET /robots says of each robot why it is not compared (not_compared_reason)"


def positions_document(documents: Sequence[dict[str, Any]], senders: Sequence[dict[str, Any]] = ()) -> dict[str, Any]:
    """The part `positions` of the health. `documents` are the measures of all receivers, `senders` what vendors should
    mend (`fleet_report.senders`), from which messages that are rejected have an example."""
    values = joined_values(documents)
    robots = {
        (vendor, fault): int(count)
        for (vendor, fault), count in values.get(NOT_COMPARED, {}).items()
        if count and fault not in INVENTED
    }
    reasons = [
        f"{count} of {vendor} ({fault}): {REMEDIES.get(fault, 'see the robot')}{_example(vendor, fault, senders)}"
        for (vendor, fault), count in sorted(robots.items())[:MOST_NAMED]
    ]
    if reasons:
        heard = count_of(sum(robots.values()), "robot is", "robots are")
        reasons = [f"{heard} heard and compared with nobody: {'; '.join(reasons)}; {WHERE}"]
    messages, per_s = values.get("deconflict_messages_total", {}), values.get("deconflict_messages_per_second", {})
    unread = sorted(
        vendor
        for (vendor,), rate in per_s.items()
        if rate and vendor != UNKNOWN and messages.get((vendor, "rejected")) and not messages.get((vendor, "accepted"))
    )
    if unread:
        named = ", ".join(unread[:MOST_NAMED])
        reasons.append(f"all messages of {named} are rejected: GET /quarantine says why, and what to change")
    return health_part(reasons, robots=sum(robots.values()))


def _example(vendor: str, fault: str, senders: Sequence[dict[str, Any]]) -> str:
    """Why the messages of one of these robots are rejected, as text to append."""
    rows = (row for sender in senders if sender["vendor"] == vendor for row in sender["not_compared"])
    row = next((row for row in rows if row["fault"] == fault == NOT_READ), None)
    return f" ({row['name']}: {row['reason']})" if row else ""


def brokers_document(brokers: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """The part `brokers` of the health. `brokers` are the documents of all receivers.

    Degraded if a broker has robots of the standard and none of them is heard, or if no ingest of a cluster hears it.
    """
    notes, heard_by = broker_notes(brokers), _heard_by(brokers)
    quiet = [broker["name"] for broker in brokers if broker["other_topics"] and not broker["heard"]]
    unheard = quiet + [name for name, ingests in heard_by.items() if not ingests]
    document: dict[str, Any] = {"status": "ok", "notes": notes} | ({"heard_by": heard_by} if heard_by else {})
    if unheard:
        document |= health_part([f"no robot is heard at {', '.join(unheard)}: {'; '.join(notes)}"])
    return document


def broker_notes(brokers: Sequence[dict[str, Any]]) -> list[str]:
    """The shared brokers that nobody hears; and of each with topics of robots that are not heard, what to set."""
    unheard = [f"{name}: {NOBODY_HEARS}" for name, ingests in _heard_by(brokers).items() if not ingests]
    return unheard + [
        f"{broker['name']}: {topics['advice']}" for broker in brokers for topics in broker["other_topics"]
    ]


def _heard_by(brokers: Sequence[dict[str, Any]]) -> dict[str, list[str]]:
    """The ingests that are connected to each broker that several ingests share."""
    heard_by: dict[str, list[str]] = {}
    for broker in brokers:
        if "ingest" in broker:
            heard_by.setdefault(broker["name"], []).extend(filter(None, [broker["ingest"]]))
    return heard_by
