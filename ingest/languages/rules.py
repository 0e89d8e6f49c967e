"""A rule of a standard, and what reading a message against the rules finds. All languages share it."""

import json
import re
from collections.abc import Iterable
from dataclasses import dataclass
from itertools import islice
from typing import NamedTuple

from ingest.sizes.size_limit import LOAD_IN_OTHER_UNIT, LOAD_OVER_LIMIT, SIZE_IN_OTHER_UNIT, SIZE_OVER_LIMIT

POSITION_IN_OTHER_UNIT = "position-in-other-unit"
HEADING_IN_DEGREES, AXES_CONTRADICT_MOTION = "heading-in-degrees", "axes-contradict-motion"
MOST_ODDITIES, MOST_OF_LIST, MOST_LETTERS = 20, 3, 60
"""Oddities of a message that are kept, those of items of one list, and letters of each of their values."""
_IN_LIST = re.compile(r"\[\d+\]")
_AS_JSON = json.JSONEncoder(ensure_ascii=False)


class Oddity(NamedTuple):
    """One value of a message that deviates, named for whoever mends the sender."""

    rule: str
    """Code of the rule."""
    path: str
    """Where it stands in the message, as `agvPosition.mapId` or `loads[0].weight`."""
    value: str
    """As sent, in JSON; cut to `MOST_LETTERS`."""
    reading: str
    """How it is read, in a few words, as `"3"` or `left out`."""
    nearest: str = ""
    """The key that was probably meant, if the standard does not have this one."""

    @property
    def anywhere(self) -> str:
        """Its path without the number of a place in a list, as `path[*].timestamp`."""
        return _IN_LIST.sub("[*]", self.path) if "[" in self.path else self.path


class Findings(dict[str, None]):
    """Codes of the deviations of a message, each once, in the order in which they were found. The values are unused."""

    def __init__(self, codes: Iterable[str] = ()) -> None:
        super().__init__(dict.fromkeys(codes))
        self.oddities: list[Oddity] = []
        """The values that deviate, as far as they are named; at most `MOST_ODDITIES`, and `MOST_OF_LIST` of a list."""
        self._places: dict[tuple[str, str], int] = {}

    def note(self, rule: str, path: str, value: object, reading: str, nearest: str = "") -> None:
        """Add a deviation and the value that shows it."""
        self[rule] = None
        if len(self.oddities) < MOST_ODDITIES:
            oddity = Oddity(rule, path[:MOST_LETTERS], "", reading[:MOST_LETTERS], nearest)
            place = rule, oddity.anywhere
            self._places[place] = self._places.get(place, 0) + 1
            if self._places[place] <= MOST_OF_LIST:
                self.oddities.append(oddity._replace(value=_shown(value)))

    def name(self, oddities: Iterable[Oddity]) -> None:
        """Add values that show deviations which were found before."""
        self.oddities = [*self.oddities, *oddities][:MOST_ODDITIES]


@dataclass(frozen=True, slots=True)
class Rule:
    """One kind of deviation or rejection."""

    code: str
    """Its name in metrics. Languages that have the same rule share its code."""
    sentence: str
    """What the message has, and how it is read or what to change."""
    clause: str
    """Of the standard, or `schema` for its published JSON schema."""
    rejects: bool = False
    alone: bool = True
    """Whether one message by itself shows it. If not, it takes the robot's history, the site file or the socket."""


def rejecting(code: str, sentence: str, clause: str, *, alone: bool = True) -> Rule:
    """A rule that rejects a message."""
    return Rule(code, sentence, clause, rejects=True, alone=alone)


def in_context(code: str, sentence: str, clause: str) -> Rule:
    """A rule of a deviation that one message by itself does not show."""
    return Rule(code, sentence, clause, alone=False)


def json_rules(clause: str) -> tuple[Rule, ...]:
    """The rejections of what is no JSON, in languages of brokers."""
    return (
        rejecting("not-utf8", "Not UTF-8; send JSON text in UTF-8.", clause),
        rejecting("not-json", "Not JSON; send one JSON object a message.", clause),
        rejecting("too-deep", "Nested too deep; no message of the standard is.", clause),
    )


def owner_rules(clause: str) -> tuple[Rule, ...]:
    """The rejections of robots that are another sender's."""
    return (
        rejecting(
            "uuid-of-another-vendor",
            "The robot belongs to another vendor: the site file says so, or that vendor spoke for it first.",
            clause,
            alone=False,
        ),
        rejecting(
            "robot-in-two-languages", "The robot is heard in another standard already; send one.", clause, alone=False
        ),
    )


def stamp_rules(clause: str) -> tuple[Rule, ...]:
    """How timestamps are read, in languages of brokers."""
    return (
        Rule("stamp-unreadable", "The message's own timestamp is absent or can't be read; as of its arrival.", clause),
        Rule("stamp-absurd", "The message's own timestamp lies outside 1970 to 2100; as of its arrival.", clause),
        Rule("stamp-no-offset", "A timestamp has no offset from UTC; read as UTC.", clause),
        Rule("stamp-offset-no-colon", "An offset from UTC lacks its colon or its minutes; read.", clause),
        Rule("stamp-not-utc", "A timestamp has an offset from UTC; converted.", clause),
        Rule(
            "stamp-spelling",
            "A timestamp has a space, a comma, lower-case letters, or a Z after an offset; read.",
            clause,
        ),
        Rule("stamp-epoch", "A timestamp is a number since 1970; its size gives the unit.", clause),
    )


def late_rules(clause: str) -> tuple[Rule, ...]:
    """The rules of messages that are late, in languages of brokers."""
    return (
        in_context(
            "message-reordered",
            "An older message came after a newer one of the same topic; not used, unless the clock was set back.",
            clause,
        ),
        in_context("stamp-not-increasing", "The pose is older than the newest one; it is not used.", clause),
        in_context(
            "stamp-unchanged",
            "Another message came with the time of the last one, as if the clock stood; it counts from its arrival.",
            clause,
        ),
        in_context("stamp-stale", "The message took 2 s longer than the robot's quickest one.", clause),
        in_context("clock-off", "The robot's clock is off; its times are corrected.", clause),
    )


def motion_rules(clause: str) -> tuple[Rule, ...]:
    """The rules of speeds and headings that the motion contradicts, in languages of brokers."""
    return (
        in_context("speed-sign-lost", "It drives backwards with a positive speed; read as negative.", clause),
        in_context(
            "speed-contradicts-motion",
            "It moves much faster or slower than it says, twice; the observed speed is used.",
            clause,
        ),
        in_context("heading-contradicts-motion", "It moves in another direction than its heading.", clause),
        in_context("turn-rate-contradicts-motion", "The turn rate contradicts the headings; ignored.", clause),
    )


def point_rules(clause: str) -> tuple[Rule, ...]:
    """The rules of points of a path that can't be read."""
    return (
        Rule("point-unreadable", "A point has no place that can be read; the point is left out.", clause),
        Rule(
            "point-time-unreadable", "A point's time is missing or can't be read; it is between its neighbours.", clause
        ),
    )


def path_rules(clause: str) -> tuple[Rule, ...]:
    """The rules of paths that take the site file or the robot's speed."""
    return (
        in_context(
            "path-datum-unknown",
            "No site file and no robot has the map of the path; on the robot's own floor, unless it drives elsewhere.",
            clause,
        ),
        in_context("path-retimed", "The path was given new times by the robot's speed.", clause),
    )


def unit_rules(clause: str) -> tuple[Rule, Rule]:
    """The rules of positions that are in another unit, and of positions and headings that have other axes."""
    return (
        in_context(
            POSITION_IN_OTHER_UNIT,
            "Positions move 1000 or 100 times faster than the speed that is sent: millimetres or centimetres? Kept.",
            clause,
        ),
        in_context(
            AXES_CONTRADICT_MOTION,
            "Heading and motion fit each other if x and y are swapped, or one axis is reversed: are they? Kept.",
            clause,
        ),
    )


def value_rules(clause: str) -> tuple[Rule, ...]:
    """The rules by which values of another type, and keys of another spelling, are read."""
    return (
        Rule("byte-order-mark", "A byte order mark comes before the JSON; skipped.", clause),
        Rule("null-value", "A key has the value null; read as left out.", clause),
        Rule(
            "number-as-text", "A value has another type, but a clear meaning, as a number sent as text; read.", clause
        ),
        Rule("text-as-number", "A text was sent as a number; read as text.", clause),
        Rule(
            "single-not-list",
            "One value, or one with numbers as keys, stands where a list belongs, or a list where a value does; read.",
            clause,
        ),
        Rule("nested-otherwise", "A value stands one level deeper or flatter than in the schema; read.", clause),
        Rule("value-unreadable", "A value can't be read as what belongs there; left out.", clause),
        Rule("text-not-utf8", "A text has bytes that are no letters in UTF-8; marks stand for them.", clause),
        Rule(
            "json-spelling",
            "Not quite JSON: `+1`, `1.`, `.5`, `01`, `True`, `None`, a comma or NUL at the end, a tab in a text; read.",
            clause,
        ),
        Rule("key-absent", "A required key is missing or null; the message is read without it.", clause),
        Rule("key-spelling", "A key is spelt otherwise than in the schema; read as the key that is meant.", clause),
    )


def word_rules(clause: str) -> tuple[Rule, Rule]:
    """The rules of enumerations."""
    return (
        Rule("word-spelling", "A word has another case, or other hyphens, underscores or spaces; read.", clause),
        Rule(
            "word-unknown",
            "The standard does not have this word. Of a robot that drives it hinders nothing; one that stands, stands.",
            clause,
        ),
    )


def size_rules(clause: str) -> tuple[Rule, ...]:
    """The rules of a robot's size. Most take the site file and the other robots of its model."""
    return (
        Rule(
            "envelope-not-positive",
            "Length or width is absent or not above zero; its last size stays, else the default envelope.",
            clause,
        ),
        Rule(
            SIZE_IN_OTHER_UNIT,
            "A size is beyond `reading.largest_body_m`, and other figures show millimetres or centimetres; converted.",
            clause,
            alone=False,
        ),
        Rule(
            SIZE_OVER_LIMIT,
            "A size or an offset is beyond `reading.largest_body_m`; the robot is an obstacle of that size.",
            clause,
            alone=False,
        ),
    )


def degrees_rule(clause: str) -> Rule:
    """The rule of headings that are a number."""
    return Rule(
        HEADING_IN_DEGREES,
        "Headings beyond a full turn fit the motion as degrees, and not as radians: degrees? Read as radians.",
        clause,
        alone=False,
    )


def load_rules(clause: str) -> tuple[Rule, Rule]:
    """The same of loads."""
    return (
        Rule(
            LOAD_IN_OTHER_UNIT,
            "A load is beyond `reading.largest_body_m`; in millimetres or centimetres it fits the robot; converted.",
            clause,
            alone=False,
        ),
        Rule(
            LOAD_OVER_LIMIT,
            "A load, or the robot with it, is beyond `reading.largest_body_m`; it reaches as far as that.",
            clause,
            alone=False,
        ),
    )


def _shown(value: object) -> str:
    """A value as JSON spells it, cut to `MOST_LETTERS`. Of a long value only the first part is spelt."""
    try:
        if isinstance(value, list | dict):
            return "".join(islice(_AS_JSON.iterencode(value), MOST_LETTERS))[:MOST_LETTERS]
        return _AS_JSON.encode(value[:MOST_LETTERS] if isinstance(value, str) else value)[:MOST_LETTERS]
    except (TypeError, ValueError, RecursionError):
        return repr(type(value).__name__)


class RejectedError(ValueError):
    """A message that is not accepted: the rule that rejects it, and what the sender should change."""

    def __init__(self, rule: str, reason: str, sent_uuid: object = None) -> None:
        super().__init__(f"{rule}: {reason}")
        self.rule, self.reason, self.sent_uuid = rule, reason, sent_uuid
