"""What each vendor's messages departed from, counted: the conformance part of a replay, or that alone."""

from collections.abc import Iterable, Iterator
from typing import Any

from deconflict.settings.fleet_factory import fleet_of
from deconflict.settings.site import Site
from ingest.fleet.fleet import Fleet
from ingest.languages.massrobotics.conformance_rules import RULES
from ingest.measures.measures import Measures
from ingest.recording.log_reader import Event, Reader, Received

Vendor = dict[str, Any]


def take(fleet: Fleet, event: Received) -> None:
    """One message of a log, also one that the recording refused: some rules are the socket's, not the message's."""
    if event.refused:
        fleet.refuse(event.refused, "refused when it was recorded", event.raw, event.arrival_s, event.connection)
    else:
        fleet.receive(event.raw, event.arrival_s, event.connection)


def findings(measures: Measures) -> list[Vendor]:
    """By vendor: messages accepted and rejected, and each rule that they broke with how often, most often first."""
    messages = measures.values.get("deconflict_messages_total", {})
    broken: dict[str, dict[str, int]] = {}
    for name in ("deconflict_rejections_total", "deconflict_deviations_total"):
        for (vendor, rule), count in measures.values.get(name, {}).items():
            broken.setdefault(vendor, {})[rule] = int(count)
    return [
        {
            "vendor": vendor,
            "accepted": int(messages.get((vendor, "accepted"), 0)),
            "rejected": int(messages.get((vendor, "rejected"), 0)),
            "findings": [_finding(rule, count) for rule, count in _most_first(broken.get(vendor, {})) if count],
        }
        for vendor in sorted({vendor for vendor, _ in messages} | broken.keys())
        if any(messages.get((vendor, outcome)) for outcome in ("accepted", "rejected"))
    ]


def conform(reader: Reader, events: Iterable[Event], site: Site) -> dict[str, Any]:
    """The conformance findings of what `reader` reads, without a look at who meets whom."""
    measures = Measures()
    fleet = fleet_of(site, measures)
    messages = 0
    for event in events:
        if isinstance(event, Received):
            messages += 1
            take(fleet, event)
    return {"messages": messages, **lines(reader), "conformance": findings(measures)}


def lines(reader: Reader) -> dict[str, Any]:
    """How many lines of the log could not be read, and, where any stood out of order, how many messages and how far."""
    late = {"late_messages": reader.late, "late_by_s": round(reader.late_by_s, 6)} if reader.late else {}
    return {"unreadable_lines": reader.unreadable, **late}


def page(result: dict[str, Any]) -> str:
    """`conform`'s result for a person."""
    return "\n".join([*_lines(result), ""])


def _finding(rule: str, count: int) -> dict[str, Any]:
    known = RULES.get(rule)
    meaning = (known.sentence, known.clause, known.rejects) if known else ("", "", False)
    return {"rule": rule, "count": count, **dict(zip(("meaning", "clause", "rejects"), meaning, strict=True))}


def _most_first(counts: dict[str, int]) -> list[tuple[str, int]]:
    return sorted(counts.items(), key=lambda item: (-item[1], item[0]))


def _lines(result: dict[str, Any]) -> Iterator[str]:
    yield f"{result['messages']} messages, {result['unreadable_lines']} unreadable lines"
    for vendor in result["conformance"]:
        yield ""
        yield f"{vendor['vendor']}: {vendor['accepted']} accepted, {vendor['rejected']} rejected"
        if not vendor["findings"]:
            yield "  nothing departs from the standard"
        for one in vendor["findings"]:
            yield f"  {one['count']:>8}  {one['rule']} ({one['clause']}): {one['meaning']}"
