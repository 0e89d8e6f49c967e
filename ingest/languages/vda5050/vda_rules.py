"""The rules of VDA 5050 by code: rejections and deviations. Rules that MassRobotics has too keep their codes."""

from ingest.languages.rules import (
    Rule,
    axes_rule,
    degrees_rule,
    load_rules,
    position_rule,
    size_rules,
    value_rules,
    word_rules,
)


def _rejecting(code: str, sentence: str, clause: str, *, alone: bool = True) -> Rule:
    return Rule(code, sentence, clause, rejects=True, alone=alone)


def _in_context(code: str, sentence: str, clause: str) -> Rule:
    return Rule(code, sentence, clause, alone=False)


_REJECTING = (
    _rejecting("topic-unknown", "The topic ends in none of the names that are read.", "topics"),
    _rejecting("not-utf8", "Not UTF-8; send JSON text in UTF-8.", "JSON"),
    _rejecting("not-json", "Not JSON; send one JSON object a message.", "JSON"),
    _rejecting("too-deep", "Nested too deep; no message of the standard is.", "JSON"),
    _rejecting("not-object", "JSON, but no object.", "schema"),
    _rejecting("position-absurd", "The position lies more than ten thousand kilometres out.", "state"),
    _rejecting("message-too-large", "Larger than the limit of the source.", "topics", alone=False),
    _rejecting("pose-retained", "A retained state or visualization; it may be of any age.", "topics", alone=False),
    _rejecting(
        "uuid-of-another-vendor",
        "The robot belongs to another vendor: the site file says so, or that vendor spoke for it first.",
        "topics",
        alone=False,
    ),
    _rejecting(
        "robot-in-two-languages", "The robot is heard in another standard already; send one.", "topics", alone=False
    ),
    _rejecting(
        "robots-too-many", "A new robot beyond those that the site allows a vendor or a source.", "topics", alone=False
    ),
)
_HEADER = (
    *value_rules("schema"),
    Rule("key-unknown", "The standard does not have this key, but one like it; not used.", "schema"),
    *word_rules("schema"),
    Rule("version-unknown", "The version is neither 2.x nor 3.x; read as these.", "header"),
    Rule("robot-not-of-topic", "The header names another robot than the topic; the topic holds.", "header"),
    Rule("stamp-unreadable", "The message's own timestamp is absent or can't be read; as of its arrival.", "header"),
    Rule("stamp-absurd", "The message's own timestamp lies outside 1970 to 2100; as of its arrival.", "header"),
    Rule("stamp-no-offset", "A timestamp has no offset from UTC; read as UTC.", "header"),
    Rule("stamp-offset-no-colon", "An offset from UTC lacks its colon or its minutes; read.", "header"),
    Rule("stamp-not-utc", "A timestamp has an offset from UTC; converted.", "header"),
    Rule(
        "stamp-spelling",
        "A timestamp has a space, a comma, lower-case letters, or a Z after an offset; read.",
        "header",
    ),
    Rule("stamp-epoch", "A timestamp is a number since 1970; its size gives the unit.", "header"),
    _in_context("message-repeated", "The same message came again, as from a second broker; not used.", "header"),
    _in_context("message-reordered", "An older message came after a newer one of the same topic; not used.", "header"),
    _in_context("stamp-not-increasing", "The pose is older than the newest one; it is not used.", "header"),
    _in_context("stamp-stale", "The message took 2 s longer than the robot's quickest one.", "header"),
    _in_context("clock-off", "The robot's clock is off; its times are corrected.", "header"),
)
_WHO = (
    Rule("outline-unreadable", "An outline of the factsheet has no three corners; left out.", "factsheet"),
    Rule(
        "outline-not-usable",
        "The outline crosses itself, has no area or over 32 corners; the rectangle around it is used.",
        "factsheet",
    ),
    *size_rules("factsheet"),
    Rule("speed-limit-not-positive", "The greatest speed is not above zero; ignored.", "factsheet"),
    _in_context("identity-missing", "No factsheet has come yet; the default envelope is used.", "factsheet"),
    _in_context("identity-changed", "Type or size changed; the newest factsheet is used.", "factsheet"),
)
_STATE = (
    Rule("battery-out-of-range", "The battery is not within 0 to 100 %; clamped.", "state"),
    Rule("speed-absurd", "A speed beyond 100 m/s; ignored.", "state"),
    *load_rules("state"),
    _in_context("status-too-rare", "More than 30 s since the last state.", "state"),
    _in_context("speed-sign-lost", "It drives backwards with a positive speed; read as negative.", "state"),
    _in_context("speed-contradicts-motion", "It is said to stand, but moves; the observed speed is used.", "state"),
    _in_context("heading-contradicts-motion", "It moves in another direction than its heading.", "state"),
    _in_context("turn-rate-contradicts-motion", "The turn rate contradicts the headings; ignored.", "state"),
)
_WHERE = (
    Rule("position-missing", "A state without position; the robot stays where it was last seen.", "state"),
    Rule("map-missing", "A position without mapId; it is compared with nothing.", "state"),
    Rule("heading-missing", "A position without theta; the direction of travel is used.", "state"),
    _in_context("datum-unknown", "The site file does not have this map; it is a floor of its own.", "state"),
    _in_context("datum-too-many", "More unknown maps of one vendor than are kept; compared with nothing.", "state"),
    position_rule("state"),
    axes_rule("state"),
    degrees_rule("state"),
)
_WHERE_TO = (
    Rule("order-too-long", "More than three thousand nodes; three thousand from the robot's last node used.", "order"),
    Rule("sequence-ids-odd", "Sequence ids repeat, fall or begin anew; the ids and the order of nodes count.", "order"),
    Rule("edge-misfit", "An edge fits no two nodes that follow each other; not used, or by its sequence id.", "order"),
    Rule("trajectory-unreadable", "A trajectory is no clamped NURBS; the edge counts as straight.", "order"),
    Rule("node-without-place", "Nobody said where a released node is; the path ends before it.", "order"),
    Rule("order-unseen", "A state names an order that was not heard; only what the state says is used.", "order"),
    _in_context("order-outdated", "An update of an order older than the one known; not used.", "order"),
    _in_context("order-gap", "An update of an order does not continue its base; used from there on.", "order"),
    Rule("point-unreadable", "A point has no place that can be read; the point is left out.", "state"),
    Rule("point-time-unreadable", "A point's time is missing or can't be read; it is between its neighbours.", "state"),
    Rule("point-absurd", "A waypoint lies beyond 10,000 km; left out.", "state"),
    Rule("path-past", "The times of all waypoints are over; new times by speed.", "state"),
    Rule("path-unordered", "Waypoints are not in the order of their times; new times by speed.", "state"),
    _in_context(
        "path-datum-unknown",
        "The path names a map that neither the site file nor any robot has; used on the robot's own floor.",
        "state",
    ),
    _in_context("path-retimed", "The path was given new times by the robot's speed.", "state"),
    _in_context("path-contradicts-motion", "The path jumps further than the robot can go; used to there.", "state"),
)

CHAPTERS = {
    "What can't be understood": _REJECTING,
    "Keys and headers": _HEADER,
    "Who": _WHO,
    "State": _STATE,
    "Where": _WHERE,
    "Where to": _WHERE_TO,
}
RULES = {rule.code: rule for rules in CHAPTERS.values() for rule in rules}
