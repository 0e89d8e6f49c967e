"""Counts of each vendor's deviations from the standard: a part of every replay, and the whole of `conform`."""

from collections.abc import Iterable, Iterator
from typing import Any

from deconflict.settings.fleet_factory import fleet_of
from deconflict.settings.site import Site
from deconflict_client.counted_nouns import count_of
from ingest.fleet import fleet_report
from ingest.fleet.fleet import Fleet
from ingest.languages.front_ends import FRONT_ENDS
from ingest.languages.model import Rejection
from ingest.languages.rules import Rule
from ingest.languages.visible_text import visible
from ingest.measures.measures import Measures
from ingest.recording.log_reader import Event, LogReader, Received

Vendor = dict[str, Any]
COUNTS = ("deconflict_rejections_total", "deconflict_deviations_total")
EXAMPLE_BYTES = 2000


def feed(fleet: Fleet, event: Received) -> None:
    """Feed one message of a log to the fleet. A message that was refused when it was recorded is refused again: some
    rules concern the socket, not the message. One that shows by itself why is read, which names its robot."""
    if event.refused and not _shows_why(fleet, event):
        rejection = Rejection(event.refused, "refused when it was recorded")
        fleet.reject(rejection, event.raw, event.arrival_s, event.connection)
    else:
        fleet.receive_recorded(event)


def _shows_why(fleet: Fleet, event: Received) -> bool:
    connection = event.connection
    names_as_uuid = fleet.owners.names_as_uuid(connection)
    message, _ = FRONT_ENDS[connection.language].read(event.raw, connection.topic, None, names_as_uuid)
    return isinstance(message, Rejection) and message.rule == event.refused


def findings(measures: Measures) -> list[Vendor]:
    """By vendor: messages accepted and rejected, and the count of each rule, those that
    reject first, then the largest."""
    messages = measures.values.get("deconflict_messages_total", {})
    languages: dict[str, list[str]] = {}
    for vendor, language in sorted(measures.values.get("deconflict_robots_by_language", {})):
        languages.setdefault(vendor, []).append(language)
    broken: dict[str, dict[str, int]] = {}
    for name in COUNTS:
        for (vendor, rule), count in measures.values.get(name, {}).items():
            broken.setdefault(vendor, {})[rule] = int(count)
    return [
        {
            "vendor": vendor,
            "languages": languages.get(vendor, []),
            "accepted": int(messages.get((vendor, "accepted"), 0)),
            "rejected": int(messages.get((vendor, "rejected"), 0)),
            "findings": sorted(
                (
                    _finding(rule, count, languages.get(vendor, []))
                    for rule, count in _most_first(broken.get(vendor, {}))
                    if count
                ),
                key=lambda finding: not finding["rejects"],
            ),
        }
        for vendor in sorted({vendor for vendor, _ in messages} | broken.keys())
        if any(messages.get((vendor, outcome)) for outcome in ("accepted", "rejected"))
    ]


def conform(reader: LogReader, events: Iterable[Event], site: Site) -> dict[str, Any]:
    """The deviations and rejections in the events that `reader` reads. No engine runs."""
    measures = Measures()
    fleet = fleet_of(site, measures)
    messages, now_s, examples = 0, 0.0, Examples(measures)
    for event in events:
        if isinstance(event, Received):
            messages += 1
            feed(fleet, event)
            examples.note(event.raw)
            now_s = max(now_s, event.arrival_s)
    fleet_report.measure(fleet, now_s)
    vendors = findings(measures)
    rejected = {(row["vendor"], row["rule"]): row["odd_values"] for row in fleet.quarantine.documents()}
    to_mend = {sender["vendor"]: sender for sender in fleet_report.senders(fleet, now_s)}
    for vendor in vendors:
        sender = to_mend.get(vendor["vendor"], {"odd_values": [], "not_compared": []})
        vendor["not_compared"] = sender["not_compared"]
        for finding in vendor["findings"]:
            finding["example"] = examples.first.get((vendor["vendor"], finding["rule"]), "")
            finding["values"] = [value for value in sender["odd_values"] if value["rule"] == finding["rule"]]
            finding["values"] += rejected.get((vendor["vendor"], finding["rule"]), [])
    return {"messages": messages, **lines(reader), "conformance": vendors}


class Examples:
    """The first message that broke each rule, by vendor."""

    def __init__(self, measures: Measures) -> None:
        self._values = measures.values
        self.first: dict[tuple[str, ...], str] = {}
        self._known = 0

    def note(self, raw: bytes) -> None:
        """Call it after each message."""
        counts = [self._values[name] for name in COUNTS if name in self._values]
        known = sum(map(len, counts))
        if known == self._known:
            return
        self._known = known
        for labels in (labels for count in counts for labels in count):
            self.first.setdefault(labels, raw[:EXAMPLE_BYTES].decode(errors="backslashreplace"))


def lines(reader: LogReader) -> dict[str, Any]:
    """How many lines of the log could not be read. If messages are out of order, also how many and by how much."""
    late = {"late_messages": reader.late, "late_by_s": round(reader.late_by_s, 6)} if reader.late else {}
    return {"unreadable_lines": reader.unreadable, **late}


def page(result: dict[str, Any]) -> str:
    """The result of `conform` as text for a person."""
    return "\n".join([*map(visible, _lines(result)), ""])


def value_in_words(value: dict[str, Any]) -> str:
    """A value that deviates, as a line for whoever mends the sender. It may have the number of `robots`."""
    meant = f"; did you mean {value['nearest']}?" if value["nearest"] else ""
    robots = f" ({count_of(value['robots'], 'robot')})" if "robots" in value else ""
    reading = value["reading"].removeprefix("read as ")
    return f"{value['path']}: sent {value['value']}, read: {reading}{meant}{robots}"


def _finding(rule: str, count: int, languages: list[str]) -> dict[str, Any]:
    known = _rule(rule, languages)
    meaning = (known.sentence, known.clause, known.rejects) if known else ("", "", False)
    return {"rule": rule, "count": count, **dict(zip(("meaning", "clause", "rejects"), meaning, strict=True))}


def _rule(code: str, languages: list[str]) -> Rule | None:
    """The rule of one of the languages that the vendor speaks; of any if nothing else is known."""
    spoken = (FRONT_ENDS[language] for language in (*languages, *FRONT_ENDS))
    return next((front_end.rules[code] for front_end in spoken if code in front_end.rules), None)


def _most_first(counts: dict[str, int]) -> list[tuple[str, int]]:
    return sorted(counts.items(), key=lambda item: (-item[1], item[0]))


def standards(vendor: Vendor) -> str:
    """The standards that a vendor speaks, as text."""
    return ", ".join(FRONT_ENDS[language].standard for language in vendor["languages"]) or "the standard"


def _lines(result: dict[str, Any]) -> Iterator[str]:
    yield f"{count_of(result['messages'], 'message')}, {count_of(result['unreadable_lines'], 'unreadable line')}"
    for vendor in result["conformance"]:
        yield ""
        speaks = f" ({standards(vendor)})" if vendor["languages"] else ""
        yield f"{vendor['vendor']}{speaks}: {vendor['accepted']} accepted, {vendor['rejected']} rejected"
        if not vendor["findings"]:
            yield "  no deviations from the standard"
        for finding in vendor["findings"]:
            yield f"  {finding['count']:>8}  {finding['rule']} ({finding['clause']}): {finding['meaning']}"
            yield from (f"            {value_in_words(value)}" for value in finding["values"])
        for robot in vendor["not_compared"]:
            yield f"  {robot['name']} is compared with nobody: {robot['reason']}"
