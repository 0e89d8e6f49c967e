"""Reads layouts in JSON that are in metres: `levels` with `nodes`, `lanes` and `doors`, as published with test data."""

from collections.abc import Mapping, Sequence
from typing import Any

from deconflict.settings.importers.formats.location_uses import use_of
from deconflict.settings.importers.plan import Block, Door, ImportedPlan, Lane, Level, Lift, Node, Use

SEPARATOR = " --- "
"""Between the ends of a block's member."""


def read_layout(document: Mapping[str, Any]) -> ImportedPlan:
    stations = {point: station for station in document.get("stations", ()) for point in station["points"]}
    blocks = tuple(
        Block(block["name"], tuple(tuple(member.split(SEPARATOR, 1)) for member in block["members"]))
        for block in document.get("single_vehicle_blocks", ())
    )
    return ImportedPlan(
        str(document["name"]),
        "a layout in metres",
        tuple(_level(level, stations, blocks) for level in document["levels"]),
        tuple(map(_lift, document.get("lifts", ()))),
    )


def _lift(lift: Mapping[str, Any]) -> Lift:
    at, size_m = (lift["x"], lift["y"]), (lift["width_m"], lift["depth_m"])
    return Lift(lift["name"], lift["reference_level"], at, lift["yaw"], size_m)


def _level(level: Mapping[str, Any], stations: Mapping[str, Mapping[str, Any]], blocks: tuple[Block, ...]) -> Level:
    return Level(
        str(level["name"]),
        tuple(_node(node, stations) for node in level["nodes"]),
        tuple(Lane(str(lane["from"]), str(lane["to"]), lane["bidirectional"]) for lane in level["lanes"]),
        tuple(Door(door["name"], (_spot(door["from"]), _spot(door["to"]))) for door in level.get("doors", ())),
        blocks,
    )


def _node(node: Mapping[str, Any], stations: Mapping[str, Mapping[str, Any]]) -> Node:
    station = stations.get(str(node["id"]))
    use: Use | None = None
    if node.get("charger"):
        use = "charger"
    elif station:
        use = use_of(station["type"])
    elif node.get("pickup_dispenser") or node.get("dropoff_ingestor"):
        use = "dock"
    elif node.get("parking"):
        use = "parking"
    name = station["name"] if station else str(node.get("name", ""))
    return Node(str(node["id"]), (node["x"], node["y"]), name, use, str(node.get("lift", "")))


def _spot(point: Sequence[float]) -> tuple[float, float]:
    x, y = point
    return x, y
