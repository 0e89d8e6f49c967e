"""The rules of ISO 21423 by code: rejections and deviations. Rules that other languages have too keep their codes."""

from ingest.languages.rules import (
    Rule,
    degrees_rule,
    in_context,
    json_rules,
    late_rules,
    motion_rules,
    owner_rules,
    path_rules,
    point_rules,
    rejecting,
    size_rules,
    stamp_rules,
    unit_rules,
    value_rules,
    word_rules,
)

_REJECTING = (
    rejecting("topic-unknown", "The topic names no resource of a robot that is read.", "topics"),
    *json_rules("JSON"),
    rejecting("not-object", "JSON, but no object.", "JSON"),
    rejecting("position-absurd", "The position is missing, or more than ten thousand kilometres out.", "odometry"),
    rejecting("message-too-large", "Larger than the limit of the source.", "topics", alone=False),
    rejecting("pose-retained", "A retained odometry or trajectory; it may be of any age.", "topics", alone=False),
    *owner_rules("topics"),
    rejecting(
        "robots-too-many",
        "A new robot, or a long message, beyond what a vendor or a source may have.",
        "topics",
        alone=False,
    ),
)
_KEYS = (
    *value_rules("JSON"),
    Rule("key-unknown", "The standard does not have this key, but one like it; not used.", "JSON"),
    *word_rules("status"),
    *stamp_rules("times"),
    in_context(
        "message-repeated",
        "The same message came again, as from a second broker; not used. A pose keeps the robot heard after 5 s.",
        "times",
    ),
    *late_rules("times"),
)
_WHO = (
    Rule(
        "outline-not-usable",
        "The footprint crosses itself, has no area or over 32 corners; the rectangle around it is used.",
        "identity",
    ),
    *size_rules("identity"),
    Rule("speed-limit-not-positive", "The rated speed is not above zero; ignored.", "identity"),
    in_context("identity-missing", "No identity has come yet; the default envelope is used.", "identity"),
    in_context("identity-changed", "Model or footprint changed; the newest is used.", "identity"),
)
_STATE = (
    Rule("mode-missing", "The states have no operating mode; read as automatic.", "status"),
    Rule("battery-out-of-range", "The battery is not within 0 to 1; above 1.5, in percent; clamped.", "batteryStatus"),
    Rule("speed-absurd", "A speed beyond 100 m/s; ignored.", "odometry"),
    Rule("map-missing", "A position without ccsId; in that of its paths, else in the last one.", "odometry"),
    Rule("heading-missing", "A pose without yaw; the direction of travel is used.", "odometry"),
    in_context("status-too-rare", "More than 30 s since the last odometry.", "odometry"),
    *motion_rules("odometry"),
    in_context("datum-unknown", "The site file does not have this coordinate system; a floor of its own.", "odometry"),
    in_context("datum-too-many", "More unknown coordinate systems than are kept; compared with nothing.", "odometry"),
    *unit_rules("odometry"),
    degrees_rule("odometry"),
)
_WHERE_TO = (
    *point_rules("localTrajectory"),
    Rule("point-absurd", "A point lies beyond 10,000 km; left out.", "localTrajectory"),
    Rule(
        "path-times-equal",
        "Points have the same time; repeated ones are left out, others get new times.",
        "localTrajectory",
    ),
    Rule(
        "path-unordered",
        "The times are out of order; sorted if that shortens the way, else new ones.",
        "localTrajectory",
    ),
    *path_rules("localTrajectory"),
    Rule("trajectory-unreadable", "A global path is no clamped NURBS; not used.", "globalPath"),
    Rule("trajectory-odd", "Knots misfit, or all weights are 0: read as left out.", "globalPath"),
    in_context(
        "path-outdated",
        "The trajectory is over 3 s old, and over, or not where the robot is; not followed.",
        "localTrajectory",
    ),
    in_context(
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
