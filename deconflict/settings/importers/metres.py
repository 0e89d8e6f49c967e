"""Layouts in JSON that are in metres already: `levels` of `nodes`, `lanes` and `doors`, as published with test data."""

from collections.abc import Mapping, Sequence
from typing import Any

from deconflict.settings.importers.opentcs import use_of
from deconflict.settings.importers.plan import Block, Door, Lane, Level, Lift, Node, Plan, Use

SEPARATOR = " --- "
"""Between the ends of a block's member."""


def read_layout(told: Mapping[str, Any]) -> Plan:
    stations = {point: one for one in told.get("stations", ()) for point in one["points"]}
    blocks = tuple(
        Block(one["name"], tuple(tuple(member.split(SEPARATOR, 1)) for member in one["members"]))
        for one in told.get("single_vehicle_blocks", ())
    )
    return Plan(
        str(told["name"]),
        tuple(_level(one, stations, blocks) for one in told["levels"]),
        tuple(
            Lift(
                one["name"], one["reference_level"], (one["x"], one["y"]), one["yaw"], (one["width_m"], one["depth_m"])
            )
            for one in told.get("lifts", ())
        ),
    )


def _level(told: Mapping[str, Any], stations: Mapping[str, Mapping[str, Any]], blocks: tuple[Block, ...]) -> Level:
    return Level(
        str(told["name"]),
        tuple(_node(one, stations) for one in told["nodes"]),
        tuple(Lane(str(one["from"]), str(one["to"]), one["bidirectional"]) for one in told["lanes"]),
        tuple(Door(one["name"], (_spot(one["from"]), _spot(one["to"]))) for one in told.get("doors", ())),
        blocks,
    )


def _node(told: Mapping[str, Any], stations: Mapping[str, Mapping[str, Any]]) -> Node:
    station = stations.get(str(told["id"]))
    use: Use | None = None
    if told.get("charger"):
        use = "charger"
    elif station:
        use = use_of(station["type"])
    elif told.get("pickup_dispenser") or told.get("dropoff_ingestor"):
        use = "dock"
    elif told.get("parking"):
        use = "parking"
    name = station["name"] if station else str(told.get("name", ""))
    return Node(str(told["id"]), (told["x"], told["y"]), name, use, str(told.get("lift", "")))


def _spot(told: Sequence[float]) -> tuple[float, float]:
    x, y = told
    return x, y
