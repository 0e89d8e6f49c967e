"""What happens to a message if one of its keys is absent, odd, late or wrong: each is sent to a fleet, and looked at.

Nothing here knows a rule: what is printed is what the code does. The keys that it reads come from the types into which
it reads messages.
"""

import json
from collections.abc import Callable, Iterator
from copy import deepcopy
from dataclasses import dataclass
from math import nan
from typing import Any

import msgspec

from deconflict.settings.fleet_factory import fleet_of
from deconflict.settings.site import Site
from ingest.fleet import fleet_report
from ingest.fleet.fleet import Fleet
from ingest.languages import timestamps
from ingest.languages.front_ends import FRONT_ENDS
from ingest.languages.rules import Oddity
from ingest.measures.measures import Measures
from ingest.port.connection import Connection
from ingest.settings import Datum
from metrics.conformance.sample_messages import FLOOR, SAMPLE_LANGUAGES, TIMES, Sample, stamped

Path = tuple[str | int, ...]
"""Keys and positions in lists from the top of a message."""
Schema = dict[str, Any]
MOST_LEVELS = 8
VALUES: Schema = {"number": 1.0, "integer": 1, "string": "a", "boolean": True}
"""By type, a value of a key that no sample has."""


class MessageSchema:
    """The keys of one kind of message."""

    def __init__(self, model: Any) -> None:
        """`model` is a type of msgspec or pydantic."""
        if hasattr(model, "model_json_schema"):
            self._root: Schema = model.model_json_schema()
        else:
            self._root = msgspec.json.schema(model, schema_hook=lambda _: {"description": "anything"})
        self._definitions = self._root.get("$defs", {})

    def paths(self) -> list[Path]:
        """Each key once; of a list that of an item."""
        return [*dict.fromkeys(self._paths(self._root, 0))]

    def whole(self, at_s: float) -> Any:
        """A message that has every key, with values of the right types and no meaning."""
        return self._value(self._root, at_s, 0)

    def _paths(self, schema: Schema, level: int) -> Iterator[Path]:
        for part in self._parts(schema, level):
            if isinstance(items := part.get("items"), dict):
                yield from ((0, *path) for path in self._paths(items, level + 1))
            for key, inner in part.get("properties", {}).items():
                yield (key,)
                yield from ((key, *path) for path in self._paths(inner, level + 1))

    def _parts(self, schema: Schema, level: int) -> Iterator[Schema]:
        """The schemas that a schema refers to or is one of, and itself."""
        if level > MOST_LEVELS:
            return
        yield schema
        if name := schema.get("$ref"):
            yield from self._parts(self._definitions[name.rpartition("/")[2]], level + 1)
        for one_of in (*schema.get("anyOf", ()), *schema.get("oneOf", ()), *schema.get("allOf", ())):
            yield from self._parts(one_of, level + 1)

    def _value(self, schema: Schema, at_s: float, level: int) -> Any:
        for part in self._parts(schema, level):
            if isinstance(items := part.get("items"), dict):
                return [self._value(items, at_s, level + 1)]
            if properties := part.get("properties"):
                return {
                    key: timestamps.write(at_s) if key in TIMES else self._value(inner, at_s, level + 1)
                    for key, inner in properties.items()
                }
            if terms := [term for term in part.get("enum", ()) if term is not None]:
                return terms[0]
            if (kind := part.get("type")) in VALUES:
                return VALUES[kind]
        return 1.0


def keys_of(value: Any) -> Iterator[Path]:
    """The keys of a message; of a list those of its first item."""
    if isinstance(value, list):
        value = {0: value[0]} if value else {}
    for key, inner in value.items() if isinstance(value, dict) else ():
        if isinstance(key, str):
            yield (key,)
        yield from ((key, *path) for path in keys_of(inner))


Change = Callable[[Any], Any]
NOW_S, STEP_S, OLDER_S, HOUR_S = 1_790_000_000.0, 1.0, 2.5, 3600.0
ABSENT, MISSPELT = object(), object()
SITE = Site(datums=(Datum(id=FLOOR, name="Hall"),))


@dataclass(frozen=True, slots=True)
class Outcome:
    """What became of a message, and what the fleet knows of its robot after it."""

    rejected: str
    """The rule; "" if it is accepted."""
    deviations: dict[str, str]
    """By rule, how the value is read that shows it; "" if that is not named."""
    facts: dict[str, str]

    def beside(self, plain: "Outcome") -> str:
        """What is different from the outcome of the plain message, in words; "" if nothing is."""
        if self.rejected:
            return f"rejected: {self.rejected}"
        parts = []
        if new := sorted(self.deviations.keys() - plain.deviations.keys()):
            parts.append(f"counted: {', '.join(_with_note(rule, self.deviations[rule]) for rule in new)}")
        changed = [key for key in plain.facts if self.facts.get(key) != plain.facts[key]]
        if not self.facts:
            parts.append("no robot")
        elif self.facts["position"] == "none" != plain.facts["position"]:
            parts.append("no position")
        elif changed:
            parts.append(f"other {', '.join(changed)}")
        return "; ".join(parts)


ODD: dict[str, Change] = {
    "null": lambda _: None,
    "as text": lambda value: str(value) if isinstance(value, int | float) else value,
    "as number": lambda value: 3 if isinstance(value, str) else value,
    "another type": lambda value: {"a": 1} if not isinstance(value, dict) else "a",
    "not in its list": lambda value: value[0] if isinstance(value, list) and value else value,
    "in a list": lambda value: value if isinstance(value, list) else [value],
    "not finite": lambda value: nan if type(value) in (int, float) else value,
    "empty": lambda value: type(value)() if isinstance(value, str | list | dict) else value,
    "misspelt": lambda _: MISSPELT,
}
WRONG: dict[str, Change] = {
    "large": lambda value: 1e9 if type(value) in (int, float) else value,
    "negative": lambda value: -7 if type(value) in (int, float) else value,
    "unknown word": lambda value: "nonsense" if isinstance(value, str) else value,
    "the opposite": lambda value: not value if isinstance(value, bool) else value,
}
ABSENCE: dict[str, Change] = {"absent": lambda _: ABSENT}
LATE_S = {"an hour old": -HOUR_S, "an hour ahead": HOUR_S}


def paths(language: str, sample: Sample) -> list[Path]:
    """Every key of the sample, once. The first sample of a kind stands for the keys, too, that the code reads of it and
    no sample has."""
    known = SAMPLE_LANGUAGES[language]
    own = dict.fromkeys(keys_of(sample.document))
    same_kind = [each for each in known.samples if each.kind == sample.kind]
    if sample is not same_kind[0]:
        return [*own]
    sent = {path for each in same_kind for path in keys_of(each.document)}
    read = MessageSchema(known.model(sample.kind)).paths()
    return [*own, *(path for path in read if path not in sent)]


def _with_key(language: str, sample: Sample, path: Path) -> dict[str, Any]:
    """The sample's message, with that key and what belongs to it if it is missing."""
    document = stamped(deepcopy(sample.document), _sent_s(sample))
    whole = MessageSchema(SAMPLE_LANGUAGES[language].model(sample.kind)).whole(_sent_s(sample))
    for length in range(1, len(path) + 1):
        if _value(document, path[:length]) is ABSENT:
            changed: dict[str, Any] = _changed(document, path[:length], _value(whole, path[:length]))
            return changed
    return document


def trials(language: str, sample: Sample, path: Path) -> dict[str, dict[str, list[str]]]:
    """By `absent`, `odd` and `wrong`: what happens, with the ways in which the key is so. Nothing happens is ""."""
    document = _with_key(language, sample, path)
    value, plain = _value(document, path), _outcome(language, sample, document)
    found: dict[str, dict[str, list[str]]] = {}
    for title, changes in (("absent", ABSENCE), ("odd", ODD), ("wrong", WRONG)):
        ways = found[title] = {}
        for name, change in changes.items():
            if (other := change(value)) is not value:
                result = _outcome(language, sample, _changed(document, path, other)).beside(plain)
                ways.setdefault(result, []).append(name)
    return found


def plain_outcome(language: str, sample: Sample) -> Outcome:
    """What becomes of the sample as it is."""
    return _outcome(language, sample, stamped(sample.document, _sent_s(sample)))


def lateness(language: str, sample: Sample) -> dict[str, str]:
    """What happens to a message that comes late, or twice, by how."""
    sent_s = _sent_s(sample)
    document = stamped(sample.document, sent_s)
    plain, before = plain_outcome(language, sample), stamped(sample.document, sent_s - OLDER_S)
    if "headerId" in before:
        before["headerId"] -= 1
    found = {
        "again": _outcome(language, sample, document, document).beside(plain),
        "after a newer one": _outcome(language, sample, document, before).beside(plain),
    }
    for name, by_s in LATE_S.items():
        found[name] = _outcome(language, sample, stamped(sample.document, sent_s + by_s)).beside(plain)
    if topic := SAMPLE_LANGUAGES[language].topic(sample.kind):
        found["retained"] = "rejected: pose-retained" if FRONT_ENDS[language].has_pose(b"", topic) else ""
    return found


def _sent_s(sample: Sample) -> float:
    """When it is sent: after what comes before it."""
    return NOW_S + STEP_S * len(sample.before)


def _outcome(language: str, sample: Sample, *messages: dict[str, Any]) -> Outcome:
    """Send what comes before, the messages, and what comes after."""
    first = {each.kind: each for each in reversed(SAMPLE_LANGUAGES[language].samples)}
    fleet, rejected = fleet_of(SITE, Measures()), ""
    for number, kind in enumerate(sample.before):
        at_s = NOW_S + STEP_S * number
        _send(fleet, language, kind, stamped(first[kind].document, at_s), at_s)
    at_s = _sent_s(sample)
    for message in messages:
        rejected = _send(fleet, language, sample.kind, message, at_s) or rejected
    for kind in sample.after:
        at_s += STEP_S
        _send(fleet, language, kind, stamped(first[kind].document, at_s), at_s)
    return Outcome(rejected, _deviations(fleet), _facts(fleet, at_s))


def _send(fleet: Fleet, language: str, kind: str, document: dict[str, Any], at_s: float) -> str | None:
    topic = SAMPLE_LANGUAGES[language].topic(kind)
    connection = Connection(1, "trial", language=language, topic=topic)
    return fleet.receive(json.dumps(document).encode(), at_s, connection)


def _deviations(fleet: Fleet) -> dict[str, str]:
    """By rule that was counted, how the newest value is read that shows it."""
    counted = fleet.measures.values["deconflict_deviations_total"]
    named = fleet.newest.odd_values.newest_first() if fleet.newest else []
    readings = {value.newest.rule: value.newest for value in reversed(named)}
    return {rule: _reading(readings[rule]) if rule in readings else "" for _, rule in counted}


def _reading(oddity: Oddity) -> str:
    return f"{oddity.reading}{f', did you mean {oddity.nearest}?' if oddity.nearest else ''}"


def _with_note(rule: str, reading: str) -> str:
    return f"{rule} ({reading})" if reading else rule


def _facts(fleet: Fleet, now_s: float) -> dict[str, str]:
    """What is known of the robot of the newest message, as text by what it is; empty if there is none."""
    robot = fleet.newest
    if robot is None:
        return {}
    document = fleet_report.robot_document(fleet, robot, now_s)
    location, forecast, seen = document["location"], document["forecast"], robot.seen
    return {
        "robot": robot.uuid,
        "position": f"{location['x']:g}, {location['y']:g}" if location else "none",
        "map": str(document["floor"]),
        "heading": str(location and location["yaw_rad"]),
        "speed": str(seen and (seen.linear_mps, seen.turn_radps)),
        "state": document["state"],
        "size": str(document["envelope"]),
        "loads": str(robot.loads.box),
        "forecast": str(forecast),
        "destinations": str(robot.stops.tolist()),
        "doubt": f"{robot.doubt_m:g}",
        "amounts": str(robot.amounts),
        "name": f"{robot.vendor} {robot.name} {robot.model}",
        "top speed": str(robot.identity and robot.identity.max_speed_mps),
    }


def _value(document: Any, path: Path) -> Any:
    for key in path:
        try:
            document = document[key]
        except (KeyError, IndexError, TypeError):
            return ABSENT
    return document


def _changed(document: Any, path: Path, value: Any) -> Any:
    """The document with another value there; objects and lists on the way to it are made if need be."""
    key, inner = path[0], path[1:]
    if isinstance(key, int):
        rows = list(document) if isinstance(document, list) else []
        return [_changed(rows[0] if rows else {}, inner, value), *rows[1:]] if inner else [value, *rows[1:]]
    fields = dict(document) if isinstance(document, dict) else {}
    if inner:
        fields[key] = _changed(fields.get(key), inner, value)
    elif value is MISSPELT:
        fields[f"{key[:-1]}_{key[-1]}"] = fields.pop(key)
    elif value is ABSENT:
        fields.pop(key, None)
    else:
        fields[key] = value
    return fields
