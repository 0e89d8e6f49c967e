"""Reads Open-RMF building files, as the traffic editor writes them (`NAME.building.yaml`, or the same as JSON).

Vertices are in pixels of the floor's drawing with y downwards, in metres, or in longitude and latitude.
"""

from collections import defaultdict
from collections.abc import Iterator, Mapping
from typing import Any

from deconflict.settings.importers.formats.openrmf.rmf_entries import PlanLevel, Properties, mapping, plan_levels
from deconflict.settings.importers.formats.openrmf.rmf_frames import LevelFrame, drawn_frames, metric_frames
from deconflict.settings.importers.formats.openrmf.rmf_globe import grid_of
from deconflict.settings.importers.formats.openrmf.rmf_lifts import RmfLifts
from deconflict.settings.importers.formats.openrmf.rmf_unused import unused_parts
from deconflict.settings.importers.plan import Block, Door, ImportedPlan, Lane, Level, Node, PlanError, Use

IMAGE, METRES, GLOBE = "reference_image", "cartesian_meters", "wgs84"


def read_building(document: Mapping[str, Any]) -> ImportedPlan:
    """Raises `PlanError` for what can't be read, and where the geometry would be wrong."""
    system = str(document.get("coordinate_system", IMAGE))
    if system not in {IMAGE, METRES, GLOBE}:
        raise PlanError(
            f"coordinate_system: must be {IMAGE}, {METRES} or {GLOBE}, not {system}; save it as one of them"
        )
    levels = plan_levels(document, y_sign=-1.0 if system == IMAGE else 1.0)
    reference = str(document.get("reference_level_name") or next(iter(document["levels"])))
    if reference not in levels:
        raise PlanError(f"reference_level_name: must be a level of the file, not {reference}")
    kind = "an Open-RMF building"
    doubts: list[str] = []
    if system == IMAGE:
        frames, doubts = drawn_frames(levels, reference)
    elif system == METRES:
        frames, doubts = metric_frames(levels)
    else:
        grid, to_metres = grid_of(document, levels)
        frames = {name: LevelFrame(to_metres) for name in levels}
        kind += f" in metres of {grid}"
    floors = {name: _level(level, frames[name]) for name, level in levels.items()}
    lifts = RmfLifts(
        mapping(document.get("lifts") or {}, "lifts"), floors, frames, reference, -1 if system == IMAGE else 1
    )
    found = lifts.found()
    return ImportedPlan(
        str(document.get("building_name") or document.get("name") or "site"),
        kind,
        tuple(floors.values()),
        found,
        (*unused_parts(document, levels), *lifts.left_out()),
        (*doubts, *lifts.doubts),
    )


def _level(level: PlanLevel, frame: LevelFrame) -> Level:
    nodes = tuple(
        Node(
            str(row),
            frame.to_metres(vertex.at),
            vertex.name,
            _use(vertex.properties),
            str(vertex.properties.get("lift_cabin") or ""),
        )
        for row, vertex in enumerate(level.vertices)
    )
    lanes = tuple(_lanes(level))
    blocks = tuple(_blocks(level))
    doors = tuple(
        Door(str(edge.properties.get("name") or f"door {row}"), (nodes[edge.start].at, nodes[edge.end].at))
        for row, edge in enumerate(level.doors)
    )
    walls = tuple((nodes[edge.start].at, nodes[edge.end].at) for edge in level.walls)
    used = {end for lane in lanes for end in (lane.start, lane.end)}
    used |= {end for block in blocks for lane in block.lanes for end in lane}
    kept = tuple(node for node in nodes if node.id in used or node.use or node.lift)
    return Level(level.name, kept, lanes, doors, blocks, walls)


def _lanes(level: PlanLevel) -> Iterator[Lane]:
    """Each lane once, whatever fleets drive it. Lanes of one way each, against each other, are one of two ways."""
    ways: dict[tuple[int, int], None] = {}
    for edge in level.lanes:
        ways[edge.start, edge.end] = None
        if edge.properties.get("bidirectional"):
            ways[edge.end, edge.start] = None
    given: set[tuple[int, int]] = set()
    for start, end in ways:
        if start != end and (end, start) not in given:
            given.add((start, end))
            yield Lane(str(start), str(end), (end, start) in ways)


def _blocks(level: PlanLevel) -> Iterator[Block]:
    """The mutex groups: only one robot at a time may be on their vertices and lanes."""
    groups: dict[str, list[tuple[str, str]]] = defaultdict(list)
    for edge in level.lanes:
        groups[str(edge.properties.get("mutex") or "")].append((str(edge.start), str(edge.end)))
    for row, vertex in enumerate(level.vertices):
        groups[str(vertex.properties.get("mutex") or "")].append((str(row), str(row)))
    return (Block(name, tuple(lanes)) for name, lanes in groups.items() if name)


def _use(properties: Properties) -> Use | None:
    if properties.get("is_charger"):
        return "charger"
    if any(properties.get(key) for key in ("pickup_dispenser", "dropoff_ingestor", "dock_name")):
        return "dock"
    return "parking" if properties.get("is_parking_spot") else None
