"""Draws a plan as datums, resources, zones and obstacles of a site file.

A resource is a square around its point. A two-way lane is an aisle, in which two robots can't pass each other. A block
of lanes that only one robot may use is a crossing. One-way lanes need no section: no robots meet head-on there.
"""

import re
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from math import dist
from uuid import UUID, uuid5

import shapely

from deconflict.settings.importers.plan import ImportedPlan, Level, Lift, Node, Spot, UnusedParts, unused
from deconflict.settings.shared_places import Landing, Obstacle, Point, Polygon, Resource, Zone, outlines
from ingest.frames.corners import corners_of
from ingest.settings import Datum

IMPORTED = UUID("7f1f6a54-3f0e-5d0c-9d55-0c6c0a3c9a10")
"""Namespace of the ids of imported floors."""
DOOR_DEPTH_M = 1.0
WALL_DEPTH_M = 0.1
BEND_M = 0.05
"""How far a bent outline may lie beside the bend."""
NARROWEST_M = 0.01
"""Doors and walls from end to end; narrower ones have no outline."""
DIGITS = 3


@dataclass(frozen=True, slots=True)
class DrawnSite:
    """The sections of a site file that a plan gives."""

    name: str
    datums: tuple[Datum, ...]
    resources: tuple[Resource, ...]
    zones: tuple[Zone, ...]
    obstacles: tuple[Obstacle, ...]
    left_out: tuple[UnusedParts, ...]
    """Parts of the plan that need no section, or can have none."""

    def drawn_on(self, datum: str) -> Iterator[tuple[str, str, Polygon]]:
        """Kind, name and outline of each place and obstacle on a floor."""
        places: tuple[Zone | Resource, ...] = (*self.zones, *self.resources)
        for place in places:
            for floor, outline in outlines(place):
                if floor == datum:
                    yield place.kind, place.name, tuple(outline)
        for obstacle in self.obstacles:
            if obstacle.floor == datum:
                yield obstacle.kind, obstacle.name, obstacle.outline_m


@dataclass(slots=True)
class Names:
    """Unique ids: a name that is taken gets a number."""

    given: Counter[str] = field(default_factory=Counter)

    def new(self, *parts: str) -> str:
        slug = re.sub(r"[^a-z0-9]+", "-", " ".join(parts).casefold()).strip("-") or "place"
        self.given[slug] += 1
        return slug if self.given[slug] == 1 else self.new(slug, str(self.given[slug]))


def drawn_site(plan: ImportedPlan, width_m: float) -> DrawnSite:
    """The sections of a plan. `width_m` is the side of a resource's square and the width of a lane, metres."""
    names = Names()
    ids = {level.name: level.datum or str(uuid5(IMPORTED, f"{plan.name} {level.name}")) for level in plan.levels}
    datums = tuple(Datum(id=ids[level.name], name=level.name, level=row) for row, level in enumerate(plan.levels))
    resources = [resource for level in plan.levels for resource in _resources(level, ids[level.name], width_m, names)]
    resources += [_lift(lift, plan.levels, ids, names) for lift in plan.lifts]
    zones = [zone for level in plan.levels for zone in _zones(level, ids[level.name], width_m, names)]
    walls = [
        Obstacle(kind="wall", floor=ids[level.name], outline_m=_along(ends, WALL_DEPTH_M))
        for level in plan.levels
        for ends in level.walls
        if dist(*ends) > NARROWEST_M
    ]
    left_out = plan.left_out + tuple(_undrawn(plan, width_m))
    return DrawnSite(plan.name, datums, tuple(resources), tuple(zones), tuple(walls), left_out)


def _undrawn(plan: ImportedPlan, width_m: float) -> Iterator[UnusedParts]:
    narrow = sum(dist(*door.ends) <= NARROWEST_M for level in plan.levels for door in level.doors)
    yield from unused(narrow, "door", "without width")
    by_level = [(level.spots(), level.lanes) for level in plan.levels]
    lanes = [(lane.way(at), lane.two_way) for at, found in by_level for lane in found]
    yield from unused(sum(not two_way for _, two_way in lanes), "one-way lane", "robots do not meet head-on there")
    short = sum(two_way and _is_short(way, width_m) for way, two_way in lanes)
    yield from unused(short, "two-way lane", f"shorter than {2 * width_m:g} m: no room for two robots")


def _is_short(way: tuple[Spot, ...], width_m: float) -> bool:
    """A lane in which two robots have no room one behind the other needs no section."""
    return shapely.LineString(way).length <= 2 * width_m


def _resources(level: Level, datum: str, width_m: float, names: Names) -> Iterator[Resource]:
    for node in level.nodes:
        if node.use:
            yield Resource(
                kind=node.use,
                id=names.new(level.name, node.name or f"{node.use} {node.id}"),
                name=node.name,
                datum=datum,
                polygon=_square(node.at, width_m),
            )


def _lift(lift: Lift, levels: tuple[Level, ...], ids: dict[str, str], names: Names) -> Resource:
    """A lift: its cabin on its own floor, and on each other floor that it opens on."""
    landings = lift.landings
    if landings is None:
        cabins = ((level.name, _cabin(level.nodes, lift.name)) for level in levels if level.name != lift.level)
        landings = tuple((level, at) for level, at in cabins if at is not None)
    return Resource(
        kind="lift",
        id=names.new(lift.name),
        name=lift.name,
        datum=ids[lift.level],
        polygon=_turned(lift.at, lift.yaw_rad, lift.size_m),
        floors=tuple(
            Landing(datum=ids[level], polygon=_turned(at, lift.yaw_rad, lift.size_m)) for level, at in landings
        ),
    )


def _cabin(nodes: tuple[Node, ...], lift: str) -> Spot | None:
    return next((node.at for node in nodes if node.lift == lift), None)


def _zones(level: Level, datum: str, width_m: float, names: Names) -> Iterator[Zone]:
    for door in level.doors:
        if dist(*door.ends) <= NARROWEST_M:
            continue
        outline = _along(door.ends, DOOR_DEPTH_M)
        yield Zone(kind="door", id=names.new(level.name, door.name), name=door.name, datum=datum, polygon=outline)
    at = level.spots()
    bends = {(lane.end, lane.start): lane.bends[::-1] for lane in level.lanes}
    bends |= {(lane.start, lane.end): lane.bends for lane in level.lanes}
    for block in level.blocks:
        ways = [[at[a], *bends.get((a, b), ()), at[b]] for a, b in block.lanes if {a, b} <= at.keys()]
        if not ways:
            continue  # the block is on another floor
        outline = _around(ways, width_m)
        yield Zone(kind="crossing", id=names.new(level.name, block.name), name=block.name, datum=datum, polygon=outline)
    for lane in level.lanes:
        way = lane.way(at)
        if not lane.two_way or _is_short(way, width_m):
            continue
        for part in _straight_parts(way, width_m):
            yield Zone(
                kind="aisle",
                id=names.new(level.name, "lane", lane.start, lane.end),
                datum=datum,
                polygon=_along(part, width_m),
                axis=(_rounded(part[0]), _rounded(part[-1])),
            )


def _straight_parts(way: tuple[Spot, ...], width_m: float) -> Iterator[tuple[Spot, ...]]:
    """A bent way in parts that lie by their axes: the places of robots in an aisle are told along a straight line.

    A part in which two robots have no room one behind the other stays with its neighbour.
    """
    axis = shapely.LineString((way[0], way[-1]))
    beside_m = shapely.distance(axis, shapely.points(way))
    if beside_m.max() > width_m / 2:
        for row in sorted(range(1, len(way) - 1), key=lambda row: -beside_m[row]):
            before, after = way[: row + 1], way[row:]
            if not _is_short(before, width_m) and not _is_short(after, width_m):
                yield from _straight_parts(before, width_m)
                yield from _straight_parts(after, width_m)
                return
    if way[0] != way[-1]:
        yield way


def _square(at: Spot, side_m: float) -> Polygon:
    return _turned(at, 0.0, (side_m, side_m))


def _turned(at: Spot, yaw_rad: float, size_m: tuple[float, float]) -> Polygon:
    """A rectangle around a point, with its first side along the yaw."""
    left_front, left_back, right_back, right_front = map(_rounded, corners_of(*at, yaw_rad, *size_m))
    return right_back, right_front, left_front, left_back


def _around(ways: list[list[Spot]], width_m: float) -> Polygon:
    """The bands along lines if they are one piece without a hole, or else all that lies between them."""
    lines = shapely.MultiLineString(ways)
    bands = lines.buffer(width_m / 2, cap_style="square", join_style="mitre")
    if bands.geom_type != "Polygon" or bands.interiors:
        bands = lines.convex_hull.buffer(width_m / 2, cap_style="square", join_style="mitre")
    return _corners(bands)


def _along(way: tuple[Spot, ...], width_m: float) -> Polygon:
    """The band along a line, with flat ends. Bends are drawn with few corners."""
    line = shapely.LineString(way).simplify(BEND_M)
    return _corners(line.buffer(width_m / 2, cap_style="flat", join_style="mitre"))


def _corners(shape: shapely.Polygon) -> Polygon:
    return tuple(_rounded((x, y)) for x, y in shapely.normalize(shape).exterior.coords[:-1])


def _rounded(spot: Spot) -> Point:
    return round(spot[0], DIGITS) + 0.0, round(spot[1], DIGITS) + 0.0
