"""Open-RMF building files, as its traffic editor writes them (`NAME.building.yaml`, or the same as JSON).

Vertices are in pixels of the floor's drawing, y down; `measurements` give the metres of a pixel, as the traffic
editor's own export takes them: the mean over all. A property is `[type, value]`.
"""

from collections.abc import Mapping, Sequence
from math import dist
from statistics import fmean
from typing import Any

from deconflict.settings.importers.plan import Door, Lane, Level, Lift, Node, Plan, PlanError, Spot, Use

METRES = "cartesian_meters"


def read_building(told: Mapping[str, Any]) -> Plan:
    """Raises `PlanError`, also for a floor without measurements."""
    metric = told.get("coordinate_system") == METRES
    levels = told["levels"]
    scales = {name: 1.0 if metric else _metres_per_pixel(name, level) for name, level in levels.items()}
    turns = {name: (scale, scale if metric else -scale) for name, scale in scales.items()}
    ordered = sorted(levels, key=lambda name: float(levels[name].get("elevation", 0)))
    lifts = told.get("lifts") or {}
    return Plan(
        str(told.get("name", "site")),
        tuple(_level(name, levels[name], turns[name]) for name in ordered),
        tuple(_lift(name, one, turns) for name, one in lifts.items() if one.get("reference_floor_name") in turns),
    )


def _metres_per_pixel(name: str, level: Mapping[str, Any]) -> float:
    vertices = level["vertices"]
    scales = [
        float(told["distance"][1]) / pixels
        for start, end, told in level.get("measurements") or ()
        if (pixels := dist(vertices[start][:2], vertices[end][:2])) > 0
    ]
    if not scales:
        raise PlanError(f"levels.{name}.measurements: is missing; measure a distance in the traffic editor")
    return fmean(scales)


def _level(name: str, level: Mapping[str, Any], turn: Spot) -> Level:
    nodes = tuple(_node(str(row), vertex, turn) for row, vertex in enumerate(level["vertices"]))
    lanes = tuple(
        Lane(str(start), str(end), bool(_property(rest, "bidirectional")))
        for start, end, *rest in level.get("lanes") or ()
    )
    doors = tuple(
        Door(str(_property(rest, "name") or f"door {row}"), (nodes[start].at, nodes[end].at))
        for row, (start, end, *rest) in enumerate(level.get("doors") or ())
    )
    used = {end for lane in lanes for end in (lane.start, lane.end)}
    return Level(name, tuple(node for node in nodes if node.id in used or node.use or node.lift), lanes, doors)


def _node(number: str, vertex: Sequence[Any], turn: Spot) -> Node:
    x, y, _, name, *rest = vertex
    return Node(
        number,
        (float(x) * turn[0], float(y) * turn[1]),
        str(name),
        _use(rest),
        str(_property(rest, "lift_cabin") or ""),
    )


def _use(rest: Sequence[Any]) -> Use | None:
    if _property(rest, "is_charger"):
        return "charger"
    if any(_property(rest, key) for key in ("pickup_dispenser", "dropoff_ingestor", "dock_name")):
        return "dock"
    return "parking" if _property(rest, "is_parking_spot") else None


def _property(rest: Sequence[Any], key: str) -> Any:
    found = rest[0].get(key) if rest and isinstance(rest[0], Mapping) else None
    return found[1] if found else None


def _lift(name: str, told: Mapping[str, Any], turns: Mapping[str, Spot]) -> Lift:
    level = str(told["reference_floor_name"])
    turn = turns[level]
    at = (float(told["x"]) * turn[0], float(told["y"]) * turn[1])
    return Lift(name, level, at, float(told.get("yaw", 0)), (float(told["width"]), float(told["depth"])))
