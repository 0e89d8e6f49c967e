"""Reads Open-RMF building files, as the traffic editor writes them (`NAME.building.yaml`, or the same as JSON).

Vertices are in pixels of the floor's drawing with y downwards, in metres, or in longitude and latitude. Those in
degrees come into metres of the grid that the file names. Open-RMF's tools write their navigation graphs in that grid,
east and north, and robots of Open-RMF report in it. The offset that the file suggests is for simulators only.
"""

from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from math import dist, hypot, isfinite
from typing import Any

from deconflict.settings.importers.formats.openrmf.rmf_entries import (
    PlanLevel,
    Properties,
    mapping,
    number,
    plan_levels,
)
from deconflict.settings.importers.formats.openrmf.rmf_frames import LevelFrame, drawn_frames, metric_frames
from deconflict.settings.importers.formats.openrmf.rmf_unused import unused_parts
from deconflict.settings.importers.plan import (
    Block,
    Door,
    ImportedPlan,
    Lane,
    Level,
    Lift,
    Node,
    PlanError,
    Spot,
    UnusedParts,
    Use,
    unused,
)


@dataclass(slots=True)
class RmfLifts:
    """The lifts of one file, and what they lack."""

    tables: Mapping[str, Any]
    levels: Mapping[str, Level]
    frames: Mapping[str, LevelFrame]
    reference: str
    y_sign: int
    doubts: list[str] = field(default_factory=list)
    closed: list[str] = field(default_factory=list)
    """Levels with a vertex in a cabin that has no doors there."""
    homeless: list[str] = field(default_factory=list)
    """Lifts whose reference floor is not in the file."""
    doors: int = 0

    def found(self) -> tuple[Lift, ...]:
        """The lifts whose floor is in the file. Raises `PlanError`."""
        return tuple(filter(None, (self._lift(str(name), table) for name, table in self.tables.items())))

    def left_out(self) -> Iterator[UnusedParts]:
        reason = f"their reference floor is no level of the file: {', '.join(self.homeless)}"
        yield from unused(len(self.homeless), "lift", reason)
        reason = f"the lift has no doors there: {', '.join(self.closed)}"
        yield from unused(len(self.closed), "vertex in a lift", reason, "vertices in lifts")
        cabins = [node.lift for level in self.levels.values() for node in level.nodes if node.lift]
        unknown = [name for name in cabins if name not in map(str, self.tables)]
        reason = f"the file has no lift of that name: {', '.join(sorted(set(unknown)))}"
        yield from unused(len(unknown), "vertex in a lift", reason, "vertices in lifts")
        yield from unused(self.doors, "lift door", "the site file has the outline of the cabin")

    def _lift(self, name: str, entry: Any) -> Lift | None:
        where = f"lifts.{name}"
        table = mapping(entry, where)
        level = str(table.get("reference_floor_name") or self.reference)
        if level not in self.levels:
            self.homeless.append(f"{name} on {level}")
            return None
        x, y, yaw, width, depth = (
            number(table.get(key), f"{where}.{key}") for key in ("x", "y", "yaw", "width", "depth")
        )
        if width <= 0 or depth <= 0:
            raise PlanError(f"{where}: width and depth must be above 0, not {width:g} and {depth:g}")
        self.doors += len(table.get("doors") or ())
        frame = self.frames[level]
        at = frame.to_metres((x, y * self.y_sign))
        landings = tuple(self._landings(name, table, level, at, hypot(width, depth) / 2))
        return Lift(name, level, at, yaw + frame.turn_rad, (width, depth), landings)

    def _landings(
        self, name: str, table: Mapping[str, Any], own: str, at: Spot, reach_m: float
    ) -> Iterator[tuple[str, Spot]]:
        """The other floors on which a lift opens, with its place there.

        Where floors share a frame, that is the place on its own floor, from which a vertex in the cabin may differ by
        `reach_m`. Elsewhere it is that vertex.
        """
        doors = mapping(table.get("level_doors") or {}, f"lifts.{name}.level_doors")
        opens = {str(level) for level, names in doors.items() if names}
        for level, floor in self.levels.items():
            node = next((node for node in floor.nodes if node.lift == name), None)
            is_above = level == own or (self.frames[level].is_shared and self.frames[own].is_shared)
            if node and is_above and dist(node.at, at) > reach_m:
                raise PlanError(
                    f"levels.{level}.vertices.{node.id}: is in the cabin of {name}, but {dist(node.at, at):.1f} m from"
                    " it; correct the vertex, the lift, or the fiducials of the level"
                )
            if level == own:
                continue
            if opens and level not in opens:
                self.closed += [f"{name} on {level}"] if node else []
            elif is_above and (opens or node):
                yield level, at
            elif node:
                yield level, node.at
            elif opens:
                self.doubts.append(f"{name} has doors on {level}, but no vertex in its cabin; it does not open there")


STRETCHED = 0.01
"""Share by which a grid may stretch distances."""


def grid_of(document: Mapping[str, Any], levels: Mapping[str, PlanLevel]) -> tuple[str, Callable[[Spot], Spot]]:
    """The grid's name, and from longitude and latitude to metres on it."""
    from pyproj import CRS, Proj, Transformer  # noqa: PLC0415 - takes 18 MB, and most plans are in pixels
    from pyproj.exceptions import CRSError  # noqa: PLC0415

    longitude, latitude = _first_spot(levels)
    utm = f"EPSG:{32601 + int((longitude + 180) // 6) % 60 + (100 if latitude < 0 else 0)}"
    where = "parameters.generate_crs"
    named = (document.get("parameters") or {}).get("generate_crs")
    if not named:
        raise PlanError(f"{where}: is missing; name the grid of your robots, in metres, such as {utm}")
    name = str(named[1] if isinstance(named, list) else named)
    try:
        grid = CRS(name)
    except CRSError as error:
        raise PlanError(f"{where}: {name!r} is no known grid; name one in metres, such as {utm}") from error
    if not grid.is_projected or any(axis.unit_name != "metre" for axis in grid.axis_info):
        raise PlanError(f"{where}: {name} is not in metres; name a grid in metres, such as {utm}")
    factors = Proj(grid).get_factors(longitude, latitude)
    stretch = max(abs(factors.meridional_scale - 1), abs(factors.parallel_scale - 1))
    if not stretch <= STRETCHED:
        raise PlanError(f"{where}: {name} is wrong by {stretch:.0%} in distances there; name another, such as {utm}")
    to_grid = Transformer.from_crs("EPSG:4326", grid, always_xy=True)

    def to_metres(at: Spot) -> Spot:
        east, north = to_grid.transform(*at)
        if not (isfinite(east) and isfinite(north)):
            raise PlanError(f"longitude {at[0]:g} and latitude {at[1]:g} are not on the grid {name}; correct them")
        return float(east), float(north)

    return name, to_metres


def _first_spot(levels: Mapping[str, PlanLevel]) -> Spot:
    for level in levels.values():
        for row, vertex in enumerate(level.vertices):
            if abs(vertex.at[0]) > 180 or abs(vertex.at[1]) > 90:
                raise PlanError(f"levels.{level.name}.vertices.{row}: must be longitude and latitude in degrees")
    return next(vertex.at for level in levels.values() for vertex in level.vertices)


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
