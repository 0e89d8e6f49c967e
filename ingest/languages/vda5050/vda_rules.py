"""The rules of VDA 5050 by code: rejections and deviations. Rules that MassRobotics has too keep their codes."""

from ingest.languages.rules import (
    Rule,
    degrees_rule,
    in_context,
    json_rules,
    late_rules,
    load_rules,
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
    rejecting("topic-unknown", "The topic ends in none of the names that are read.", "topics"),
    *json_rules("JSON"),
    rejecting("not-object", "JSON, but no object.", "schema"),
    rejecting("position-absurd", "The position lies more than ten thousand kilometres out.", "state"),
    rejecting("message-too-large", "Larger than the limit of the source.", "topics", alone=False),
    rejecting("pose-retained", "A retained state or visualization; it may be of any age.", "topics", alone=False),
    *owner_rules("topics"),
    rejecting(
        "robots-too-many",
        "A new robot, or a long message, beyond what a vendor or a source may have.",
        "topics",
        alone=False,
    ),
)
_HEADER = (
    *value_rules("schema"),
    Rule("key-unknown", "The standard does not have this key, but one like it; not used.", "schema"),
    *word_rules("schema"),
    Rule("version-unknown", "The version is neither 2.x nor 3.x; read as these.", "header"),
    Rule("robot-not-of-topic", "The header names another robot than the topic; the topic holds.", "header"),
    *stamp_rules("header"),
    in_context(
        "message-repeated",
        "The same message came again, as from a second broker; not used. A pose keeps the robot heard after 5 s.",
        "header",
    ),
    *late_rules("header"),
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
    in_context("identity-missing", "No factsheet has come yet; the default envelope is used.", "factsheet"),
    in_context("identity-changed", "Type or size changed; the newest factsheet is used.", "factsheet"),
)
_STATE = (
    Rule("battery-out-of-range", "The battery is not within 0 to 100 %; clamped.", "state"),
    Rule("speed-absurd", "A speed beyond 100 m/s; ignored.", "state"),
    *load_rules("state"),
    in_context("status-too-rare", "More than 30 s since the last state.", "state"),
    *motion_rules("state"),
)
_WHERE = (
    Rule(
        "position-missing",
        "No position, or 0, 0 far from the last one; the robot stays where it was last seen.",
        "state",
    ),
    in_context("position-by-node", "A state without position; the robot is on its way from the last node.", "state"),
    Rule("map-missing", "A position without mapId; on the one map of its nodes, else on the last one.", "state"),
    in_context(
        "map-of-state", "Visualizations name another map than states at the same place; on that.", "visualization"
    ),
    Rule("heading-missing", "A position without theta; the direction of travel is used.", "state"),
    in_context("datum-unknown", "The site file does not have this map; it is a floor of its own.", "state"),
    in_context("datum-too-many", "More unknown maps of one vendor than are kept; compared with nothing.", "state"),
    *unit_rules("state"),
    degrees_rule("state"),
)
_WHERE_TO = (
    Rule(
        "order-too-long",
        "More than three thousand nodes or edges; three thousand from the robot's last node used.",
        "order",
    ),
    Rule("sequence-ids-odd", "Sequence ids repeat, fall or begin anew; the ids and the order of nodes count.", "order"),
    Rule("edge-misfit", "An edge fits no two nodes that follow each other; not used, or by its sequence id.", "order"),
    Rule("trajectory-unreadable", "A trajectory is no clamped NURBS; not used, so that its edge is straight.", "order"),
    Rule("trajectory-odd", "Knots misfit, or all weights are 0: read as left out. It leads back: turned.", "order"),
    Rule("curves-too-many", "Curves of an order have over 12,000 control points; further edges are straight.", "order"),
    Rule("node-without-place", "Nobody said where a released node is; the path ends before it.", "order"),
    Rule(
        "order-unseen",
        "A state names an order or node that was not heard; its nodes are where it, or earlier orders, have them.",
        "order",
    ),
    in_context("node-passed", "A state names nodes before the last one that the robot passed; left out.", "state"),
    in_context("node-place-zero", "A state has a node at 0, 0; it is where the order says.", "state"),
    in_context("node-theta-zero", "All nodes have theta 0 on a way that leads across; left out.", "order"),
    in_context("order-outdated", "An update older than the order known; used while a state names it.", "order"),
    in_context("order-gap", "An update of an order does not continue its base; used from there on.", "order"),
    *point_rules("state"),
    Rule("point-absurd", "A waypoint lies beyond 10,000 km; left out.", "state"),
    Rule("path-past", "The times of all waypoints are over; new times by speed.", "state"),
    Rule("path-unordered", "The times are out of order; sorted if that shortens the way, else new ones.", "state"),
    *path_rules("state"),
    in_context("path-contradicts-motion", "The path jumps further than the robot can go; used to there.", "state"),
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
