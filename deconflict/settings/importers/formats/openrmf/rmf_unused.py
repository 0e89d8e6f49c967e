"""What an Open-RMF building file has beside that which a site file gets, counted by kind, with the reason."""

from collections import Counter
from collections.abc import Iterator, Mapping
from typing import Any

from deconflict.settings.importers.formats.openrmf.rmf_entries import PlanEdge, PlanLevel
from deconflict.settings.importers.plan import UnusedParts, unused

USED_PARTS = frozenset(
    [
        "doors",
        "drawing",
        "elevation",
        "fiducials",
        "flattened_x_offset",
        "flattened_y_offset",
        "lanes",
        "measurements",
        "vertices",
        "walls",
        "x_meters",
        "y_meters",
    ]
)
PARTS = {
    "floors": ("floor polygon", "", "the site file has no outline of a floor"),
    "holes": ("hole", "", "the site file has no holes; draw them as obstacles"),
    "human_lanes": ("lane of people", "lanes of people", "people are heard as they walk"),
    "layers": ("image layer", "", "a layer places nothing"),
    "models": ("model", "", "furniture has no outline; draw what robots must avoid as obstacles"),
}
"""Noun, plural and reason of each part of a level."""
USED_OF_VERTICES = frozenset(
    ["dock_name", "dropoff_ingestor", "is_charger", "is_parking_spot", "lift_cabin", "mutex", "pickup_dispenser"]
)
VERTICES = {
    "human_goal_set_name": ("goal of simulated people", "goals of simulated people", "people are heard as they walk"),
    "is_cleaning_zone": ("cleaning zone", "", "it has no outline"),
    "is_holding_point": ("holding point", "", "robots may wait wherever nobody passes"),
    "merge_radius": ("merge radius", "merge radii", "it is a setting of a fleet's adapter"),
    "spawn_robot_name": ("simulated robot", "", "robots are heard"),
    "spawn_robot_type": ("type of a simulated robot", "types of simulated robots", "robots are heard"),
}
USED_OF_LANES = frozenset(["bidirectional", "graph_idx", "mutex"])
LANES = {
    "demo_mock_floor_name": ("lane of a pretended floor", "lanes of a pretended floor", "it is drawn as any lane"),
    "demo_mock_lift_name": ("lane of a pretended lift", "lanes of a pretended lift", "it is drawn as any lane"),
    "orientation": ("lane with an orientation", "lanes with an orientation", "headings are heard from robots"),
    "speed_limit": ("speed limit", "", "speeds are heard from robots"),
}


def unused_parts(document: Mapping[str, Any], levels: Mapping[str, PlanLevel]) -> Iterator[UnusedParts]:
    """One entry for each kind."""
    parts = Counter[str]()
    for level in levels.values():
        parts.update({key: len(part) for key, part in level.table.items() if isinstance(part, list | dict) and part})
    yield from _counted(parts, USED_PARTS, PARTS, "")
    vertices = [vertex for level in levels.values() for vertex in level.vertices]
    properties = Counter(key for vertex in vertices for key, value in vertex.properties.items() if value)
    yield from _counted(properties, USED_OF_VERTICES, VERTICES, " of vertices")
    named = sum(bool(vertex.name) and not USED_OF_VERTICES & _true(vertex.properties) for vertex in vertices)
    yield from unused(named, "named vertex", "robots only pass: no charger, dock or parking", "named vertices")
    lanes = [edge for level in levels.values() for edge in level.lanes]
    properties = Counter(key for edge in lanes for key, value in edge.properties.items() if value)
    yield from _counted(properties, USED_OF_LANES, LANES, " of lanes")
    twice = sum(_repeated(level.lanes) for level in levels.values())
    yield from unused(twice, "lane", "the same as others, for another fleet")
    yield from unused(sum(edge.start == edge.end for edge in lanes), "lane", "from a vertex to itself")
    doors = [edge for level in levels.values() for edge in level.doors]
    hinged = sum("hinged" in str(edge.properties.get("type")) for edge in doors)
    yield from unused(hinged, "swing of a door", "a door is drawn as its doorway", "swings of doors")
    zones = len(document.get("zones") or ())
    yield from unused(zones, "zone", "the plan does not say what it is for; draw it in the site file")


def _counted(
    found: Counter[str], used: frozenset[str], known: Mapping[str, tuple[str, str, str]], of: str
) -> Iterator[UnusedParts]:
    for key, count in sorted(found.items()):
        if key in known:
            noun, plural, reason = known[key]
            yield from unused(count, noun, reason, plural)
        elif key not in used:
            yield UnusedParts(f"{count:,} x {key}{of}", "the import does not know it")


def _true(properties: Mapping[str, Any]) -> frozenset[str]:
    return frozenset(key for key, value in properties.items() if value)


def _repeated(lanes: tuple[PlanEdge, ...]) -> int:
    """The lanes that lead nowhere that a lane before does not lead."""
    known: set[tuple[int, int]] = set()
    count = 0
    for edge in lanes:
        ways = {(edge.start, edge.end)}
        if edge.properties.get("bidirectional"):
            ways.add((edge.end, edge.start))
        count += ways <= known
        known |= ways
    return count
