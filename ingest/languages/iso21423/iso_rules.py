"""The rules of ISO 21423 by code: rejections and deviations. Rules that other languages have too keep their codes."""

from ingest.languages.rules import Rule, axes_rule, degrees_rule, position_rule, size_rules, value_rules, word_rules


def _rejecting(code: str, sentence: str, clause: str, *, alone: bool = True) -> Rule:
    return Rule(code, sentence, clause, rejects=True, alone=alone)


def _in_context(code: str, sentence: str, clause: str) -> Rule:
    return Rule(code, sentence, clause, alone=False)


_REJECTING = (
    _rejecting("topic-unknown", "The topic names no resource of a robot that is read.", "topics"),
    _rejecting("not-utf8", "Not UTF-8; send JSON text in UTF-8.", "JSON"),
    _rejecting("not-json", "Not JSON; send one JSON object a message.", "JSON"),
    _rejecting("too-deep", "Nested too deep; no message of the standard is.", "JSON"),
    _rejecting("not-object", "JSON, but no object.", "JSON"),
    _rejecting("position-absurd", "The position is missing, or more than ten thousand kilometres out.", "odometry"),
    _rejecting("message-too-large", "Larger than the limit of the source.", "topics", alone=False),
    _rejecting("pose-retained", "A retained odometry or trajectory; it may be of any age.", "topics", alone=False),
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
_KEYS = (
    *value_rules("JSON"),
    Rule("key-unknown", "The standard does not have this key, but one like it; not used.", "JSON"),
    *word_rules("status"),
    Rule("stamp-unreadable", "The message's own timestamp is absent or can't be read; as of its arrival.", "times"),
    Rule("stamp-absurd", "The message's own timestamp lies outside 1970 to 2100; as of its arrival.", "times"),
    Rule("stamp-no-offset", "A timestamp has no offset from UTC; read as UTC.", "times"),
    Rule("stamp-offset-no-colon", "An offset from UTC lacks its colon or its minutes; read.", "times"),
    Rule("stamp-not-utc", "A timestamp has an offset from UTC; converted.", "times"),
    Rule(
        "stamp-spelling", "A timestamp has a space, a comma, lower-case letters, or a Z after an offset; read.", "times"
    ),
    Rule("stamp-epoch", "A timestamp is a number since 1970; its size gives the unit.", "times"),
    _in_context("message-repeated", "A message with the time of the last one came; not used.", "times"),
    _in_context("message-reordered", "An older message came after a newer one of the same topic; not used.", "times"),
    _in_context("stamp-not-increasing", "The pose is older than the newest one; it is not used.", "times"),
    _in_context("stamp-stale", "The message took 2 s longer than the robot's quickest one.", "times"),
    _in_context("clock-off", "The robot's clock is off; its times are corrected.", "times"),
)
_WHO = (
    Rule(
        "outline-not-usable",
        "The footprint crosses itself, has no area or over 32 corners; the rectangle around it is used.",
        "identity",
    ),
    *size_rules("identity"),
    Rule("speed-limit-not-positive", "The rated speed is not above zero; ignored.", "identity"),
    _in_context("identity-missing", "No identity has come yet; the default envelope is used.", "identity"),
    _in_context("identity-changed", "Model or footprint changed; the newest is used.", "identity"),
)
_STATE = (
    Rule("mode-missing", "The states have no operating mode; read as automatic.", "status"),
    Rule("battery-out-of-range", "The battery is not within 0 to 1; clamped.", "batteryStatus"),
    Rule("speed-absurd", "A speed beyond 100 m/s; ignored.", "odometry"),
    Rule("map-missing", "A position without ccsId; it is compared with nothing.", "odometry"),
    Rule("heading-missing", "A pose without yaw; the direction of travel is used.", "odometry"),
    _in_context("status-too-rare", "More than 30 s since the last odometry.", "odometry"),
    _in_context("speed-sign-lost", "It drives backwards with a positive speed; read as negative.", "odometry"),
    _in_context("speed-contradicts-motion", "It is said to stand, but moves; the observed speed is used.", "odometry"),
    _in_context("heading-contradicts-motion", "It moves in another direction than its heading.", "odometry"),
    _in_context("turn-rate-contradicts-motion", "The turn rate contradicts the headings; ignored.", "odometry"),
    _in_context("datum-unknown", "The site file does not have this coordinate system; a floor of its own.", "odometry"),
    _in_context("datum-too-many", "More unknown coordinate systems than are kept; compared with nothing.", "odometry"),
    position_rule("odometry"),
    axes_rule("odometry"),
    degrees_rule("odometry"),
)
_WHERE_TO = (
    Rule("point-unreadable", "A point has no place that can be read; the point is left out.", "localTrajectory"),
    Rule(
        "point-time-unreadable",
        "A point's time is missing or can't be read; it is between its neighbours.",
        "localTrajectory",
    ),
    Rule("point-absurd", "A point lies beyond 10,000 km; left out.", "localTrajectory"),
    Rule("path-times-equal", "Points have the same time; new times by speed.", "localTrajectory"),
    Rule("path-unordered", "Points are not in the order of their times; new times by speed.", "localTrajectory"),
    _in_context(
        "path-datum-unknown",
        "The path names a map that neither the site file nor any robot has; used on the robot's own floor.",
        "localTrajectory",
    ),
    _in_context("path-retimed", "The path was given new times by the robot's speed.", "localTrajectory"),
    _in_context(
        "path-contradicts-motion", "The path jumps further than the robot can go; used to there.", "localTrajectory"
    ),
)

CHAPTERS = {
    "What can't be understood": _REJECTING,
    "Keys and times": _KEYS,
    "Who": _WHO,
    "State": _STATE,
    "Where to": _WHERE_TO,
}
RULES = {rule.code: rule for rules in CHAPTERS.values() for rule in rules}
