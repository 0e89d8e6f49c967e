"""Reads Open-RMF building files, as the traffic editor writes them (`NAME.building.yaml`, or the same as JSON).

Vertices are in pixels of the floor's drawing, with y downwards. The metres of a pixel are the mean over `measurements`,
as in the traffic editor's own export. A property is `[type, value]`.
"""

from collections.abc import Mapping, Sequence
from math import dist
from statistics import fmean
from typing import Any

from deconflict.settings.importers.plan import Door, ImportedPlan, Lane, Level, Lift, Node, PlanError, Spot, Use

METRES = "cartesian_meters"


def read_building(document: Mapping[str, Any]) -> ImportedPlan:
    """Raises `PlanError`, also for a floor without measurements."""
    metric = document.get("coordinate_system") == METRES
    levels = document["levels"]
    scales = {name: 1.0 if metric else _metres_per_pixel(name, level) for name, level in levels.items()}
    scale_of = {name: (scale, scale if metric else -scale) for name, scale in scales.items()}
    ordered = sorted(levels, key=lambda name: float(levels[name].get("elevation", 0)))
    lifts = document.get("lifts") or {}
    return ImportedPlan(
        str(document.get("name", "site")),
        "an Open-RMF building",
        tuple(_level(name, levels[name], scale_of[name]) for name in ordered),
        tuple(
            _lift(name, lift, scale_of) for name, lift in lifts.items() if lift.get("reference_floor_name") in scale_of
        ),
    )


def _metres_per_pixel(name: str, level: Mapping[str, Any]) -> float:
    vertices = level["vertices"]
    scales = [
        float(measurement["distance"][1]) / pixels
        for start, end, measurement in level.get("measurements") or ()
        if (pixels := dist(vertices[start][:2], vertices[end][:2])) > 0
    ]
    if not scales:
        raise PlanError(f"levels.{name}.measurements: is missing; measure a distance in the traffic editor")
    return fmean(scales)


def _level(name: str, level: Mapping[str, Any], scale: Spot) -> Level:
    nodes = tuple(_node(str(row), vertex, scale) for row, vertex in enumerate(level["vertices"]))
    lanes = tuple(
        Lane(str(start), str(end), bool(_property(rest, "bidirectional")))
        for start, end, *rest in level.get("lanes") or ()
    )
    doors = tuple(
        Door(str(_property(rest, "name") or f"door {row}"), (nodes[start].at, nodes[end].at))
        for row, (start, end, *rest) in enumerate(level.get("doors") or ())
    )
    walls = tuple((nodes[start].at, nodes[end].at) for start, end, *_ in level.get("walls") or ())
    used = {end for lane in lanes for end in (lane.start, lane.end)}
    kept = tuple(node for node in nodes if node.id in used or node.use or node.lift)
    return Level(name, kept, lanes, doors, walls=walls)


def _node(number: str, vertex: Sequence[Any], scale: Spot) -> Node:
    x, y, _, name, *rest = vertex
    return Node(
        number,
        (float(x) * scale[0], float(y) * scale[1]),
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


def _lift(name: str, lift: Mapping[str, Any], scale_of: Mapping[str, Spot]) -> Lift:
    level = str(lift["reference_floor_name"])
    scale = scale_of[level]
    at = (float(lift["x"]) * scale[0], float(lift["y"]) * scale[1])
    return Lift(name, level, at, float(lift.get("yaw", 0)), (float(lift["width"]), float(lift["depth"])))
