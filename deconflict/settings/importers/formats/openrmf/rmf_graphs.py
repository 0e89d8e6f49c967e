"""Reads Open-RMF navigation graphs (`0.yaml`), as its building map tools and its site editor write them for one fleet.

They are in metres with y up, without elevations. Properties have no types, and a lane of two ways may be two lanes.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from deconflict.settings.importers.formats.openrmf.buildings import METRES, read_building
from deconflict.settings.importers.formats.openrmf.rmf_entries import entries, mapping
from deconflict.settings.importers.plan import ImportedPlan, PlanError, unused

OF_VERTICES = {"lift": "lift_cabin", "name": ""}
OF_LANES = {
    "is_bidirectional": "bidirectional",
    "orientation_constraint": "orientation",
    "dock_name": "",
    "undock_name": "",
    "door_name": "",
}
"""Properties by their names in a graph, with their names in a building; empty if they are none there."""
ONE_FLEET = "these are the lanes of one fleet; the building file has those of all"
NO_ORDER = "the floors have no elevations and are ordered by name; correct the level of each datum"


def is_graph(document: Mapping[str, Any]) -> bool:
    """Whether the properties of vertices are where a building has their height."""
    levels = document["levels"].values() if isinstance(document["levels"], Mapping) else ()
    lists = (level.get("vertices") for level in levels if isinstance(level, Mapping))
    vertices = (vertex for found in lists if isinstance(found, list) for vertex in found)
    return any(isinstance(vertex, list) and len(vertex) > 2 and isinstance(vertex[2], Mapping) for vertex in vertices)


def read_graph(document: Mapping[str, Any]) -> ImportedPlan:
    """Raises `PlanError`."""
    levels = {name: _level(document, name) for name in sorted(document["levels"], key=str)}
    lifts = {
        name: _lift(lift, f"lifts.{name}") | {"reference_floor_name": floor}
        for name, lift in mapping(document.get("lifts") or {}, "lifts").items()
        if (floor := _floor_of(name, levels)) is not None
    }
    plan = read_building({**document, "coordinate_system": METRES, "levels": levels, "lifts": lifts})
    doubts = (ONE_FLEET, NO_ORDER) if len(levels) > 1 else (ONE_FLEET,)
    untouched = len(document.get("lifts") or ()) - len(lifts)
    left = unused(untouched, "lift", "no vertex of the graph is in it")
    return replace(
        plan,
        format=plan.format.replace("building", "navigation graph"),
        left_out=(*plan.left_out, *left),
        doubts=(*plan.doubts, *doubts),
    )


def _level(document: Mapping[str, Any], name: str) -> dict[str, Any]:
    where = f"levels.{name}"
    table = mapping(document["levels"][name], where)
    vertices = [_vertex(entry, at) for at, entry in entries(table, where, "vertices")]
    lanes = []
    for at, entry in entries(table, where, "lanes"):
        *ends, properties = entry if len(entry) > 2 else (*entry, {})
        lanes.append([*ends, _typed(properties, OF_LANES, at)])
        if (dock := properties.get("dock_name")) and ends[-1] in range(len(vertices)):
            vertices[ends[-1]][4]["dock_name"] = [1, dock]
    doors = []
    for door, entry in mapping(document.get("doors") or {}, "doors").items():
        placed = mapping(entry, f"doors.{door}")
        if placed.get("map") == name:
            doors.append([len(vertices), len(vertices) + 1, {"name": [1, door]}])
            vertices += [[*end, 0, "", {}] for _, end in entries(placed, f"doors.{door}", "endpoints")]
    return {"vertices": vertices, "lanes": lanes, "doors": doors}


def _vertex(entry: Sequence[Any], where: str) -> list[Any]:
    if len(entry) != 3:
        raise PlanError(f"{where}: must be x, y and properties")
    name = mapping(entry[2], where).get("name", "")
    return [*entry[:2], 0, name, _typed(entry[2], OF_VERTICES, where)]


def _typed(properties: Any, names: Mapping[str, str], where: str) -> dict[str, Any]:
    found = mapping(properties, where)
    return {names.get(key, key): [1, value] for key, value in found.items() if names.get(key, key)}


def _lift(entry: Any, where: str) -> dict[str, Any]:
    lift = mapping(entry, where)
    parts = [lift.get("position"), lift.get("dims")]
    sides = [side for part in parts if isinstance(part, list) for side in part]
    if len(sides) != 5:
        raise PlanError(f"{where}: must have x, y and yaw as position, and width and depth as dims")
    return dict(zip(("x", "y", "yaw", "width", "depth"), sides, strict=True))


def _floor_of(lift: str, levels: Mapping[str, Any]) -> str | None:
    """The first level with a vertex in the cabin."""
    for name, level in levels.items():
        if any(vertex[4].get("lift_cabin", ("", ""))[1] == lift for vertex in level["vertices"]):
            return name
    return None
