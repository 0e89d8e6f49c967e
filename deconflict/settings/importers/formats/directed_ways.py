"""The floors of a plan whose ways have a direction: two ways that lead back and forth along one line are one lane."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import shapely

from deconflict.settings.importers.plan import Block, Lane, Level, Node, Spot, UnusedParts, unused

ONE_LANE_M = 0.5
"""Two ways between the same nodes that are no farther apart are one lane."""
MOST_NAMED = 3
"""So many ways between two floors are named by their ends."""


@dataclass(frozen=True, slots=True)
class Way:
    """A way that robots drive from one node to another."""

    start: str
    end: str
    bends: tuple[Spot, ...] = ()
    is_two_way: bool = False
    """Whether they also drive it from its end to its start."""


@dataclass(frozen=True, slots=True)
class Floor:
    """What a floor is called, and its id in messages of robots, if it is known."""

    name: str
    datum: str = ""


@dataclass(frozen=True, slots=True)
class PlanGraph:
    """Nodes and ways of all floors."""

    floors: Mapping[str, Floor]
    """By key, ordered from the lowest."""
    nodes: Mapping[str, Node]
    """By id."""
    floor_of: Mapping[str, str]
    """The key of each node's floor."""
    ways: tuple[Way, ...]

    def levels(self, blocks: tuple[Block, ...] = ()) -> tuple[Level, ...]:
        """The floors. A way between two floors is on none of them."""
        return tuple(
            Level(
                floor.name,
                tuple(node for node in self.nodes.values() if self.floor_of[node.id] == key),
                self._lanes(key),
                blocks=blocks,
                datum=floor.datum,
            )
            for key, floor in self.floors.items()
        )

    def ways_between_floors(self) -> Iterator[UnusedParts]:
        between = {
            tuple(sorted((way.start, way.end)))
            for way in self.ways
            if self.floor_of[way.start] != self.floor_of[way.end]
        }
        named = ", ".join(" to ".join(ends) for ends in sorted(between)[:MOST_NAMED])
        more = ", ..." if len(between) > MOST_NAMED else ""
        reason = f"{named}{more}: a lift or a ramp; add a lift as a resource with a cabin on each floor"
        yield from unused(len(between), "way between two floors", reason, "ways between two floors")

    def _lanes(self, key: str) -> tuple[Lane, ...]:
        lanes: dict[frozenset[str], list[Lane]] = {}
        for way in self.ways:
            if self.floor_of[way.start] == self.floor_of[way.end] == key:
                _join(lanes.setdefault(frozenset((way.start, way.end)), []), way, self.nodes)
        return tuple(_ordered(lane) for between in lanes.values() for lane in between)


def _join(lanes: list[Lane], way: Way, nodes: Mapping[str, Node]) -> None:
    """Add a way to the lanes between its ends: to the one along the same line, or as a lane of its own."""
    for row, lane in enumerate(lanes):
        if lane.bends == way.bends == () or _line(lane, nodes).hausdorff_distance(_line(way, nodes)) <= ONE_LANE_M:
            is_two_way = lane.two_way or way.is_two_way or (lane.start, lane.end) != (way.start, way.end)
            lanes[row] = replace(lane, two_way=is_two_way)
            return
    lanes.append(Lane(way.start, way.end, way.is_two_way, way.bends))


def _line(way: Way | Lane, nodes: Mapping[str, Node]) -> shapely.LineString:
    return shapely.LineString((nodes[way.start].at, *way.bends, nodes[way.end].at))


def _ordered(lane: Lane) -> Lane:
    """A two-way lane begins at the end whose id is first, whichever way the file has first."""
    if not lane.two_way or lane.start <= lane.end:
        return lane
    return Lane(lane.end, lane.start, lane.two_way, lane.bends[::-1])
