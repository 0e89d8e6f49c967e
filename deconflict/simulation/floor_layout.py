"""Two floors of aisles that cross at right angles, with bays beside them where robots and people stop.

A floor consists of equal tiles, so that the floor grows with the number of robots and the density stays the same.
"""

import heapq
from collections.abc import Iterator
from dataclasses import dataclass, field
from enum import StrEnum
from itertools import pairwise
from math import atan2, ceil, inf

from ingest.batch import Floats

ROBOTS_PER_TILE = 24
BAY_DEPTH_M = 2.5
"""Distance from the middle of the aisle to the middle of the bay."""
LONG_AISLE_M = 7.8
"""Aisles between two crossings that are at least this long have bays."""

GROUND, MEZZANINE = 0, 1

Place = tuple[float, float]
"""x, y in the floor's frame, metres."""


class BayKind(StrEnum):
    DOCK = "dock"
    CHARGER = "charger"
    PARKING = "parking"
    LIFT = "lift"


@dataclass(frozen=True, slots=True)
class FloorTile:
    """The pattern that a floor repeats: its size, and the positions of its aisles, in metres."""

    size_m: Place
    across_m: tuple[float, ...]
    """x of the aisles that run along y."""
    along_m: tuple[float, ...]
    """y of the aisles that run along x."""
    cross_bays: bool
    """Whether aisles along y have bays too."""


TILES = (
    FloorTile((40.0, 25.0), (5.0, 15.0, 25.0, 35.0), (4.0, 12.5, 21.0), cross_bays=True),
    FloorTile((25.0, 15.0), (4.0, 12.5, 21.0), (4.0, 11.0), cross_bays=False),
)
"""The ground hall and the mezzanine."""


@dataclass(frozen=True, slots=True)
class Bay:
    """A place to stop. A robot drives in forwards."""

    node: int
    floor: int
    place: Place
    kind: BayKind


@dataclass(slots=True, eq=False)
class Layout:
    """Nodes, and the lanes between them. Traffic keeps right: each aisle has a lane in each direction. A bay opens on
    the lane that passes it on the right, so robots cross a lane only at crossings.
    """

    places: list[Place]
    floors: list[int]
    onward: list[dict[int, float]]
    """By node: the next nodes, with the length of the lane to each in metres."""
    bays: tuple[Bay, ...] = ()
    bay_nodes: frozenset[int] = frozenset()
    crossings: set[int] = field(default_factory=set)
    other_lift: dict[int, int] = field(default_factory=dict)
    """By index of a lift bay: the index of the same lift's bay on the other floor."""

    def heading_rad(self, bay: Bay) -> float:
        """Heading of a robot that has driven in forwards."""
        x, y = self.places[next(iter(self.onward[bay.node]))]
        return atan2(bay.place[1] - y, bay.place[0] - x)

    def route(self, start: int, goal: int, detours: Floats) -> list[int]:
        """Nodes of a shortest path between two nodes of a floor, without U-turns.

        `detours` (nodes,) are factors of at least 1 for the length of the lanes from each node. A* over lanes: aisles
        are axis-parallel, so |dx| + |dy| never overestimates the remaining length. Raises ValueError if there is no
        path.
        """
        first = (start, start)
        best, came = {first: 0.0}, dict[_Lane, _Lane]()
        queue = [(self._left_m(start, goal), first)]
        while queue:
            _, lane = heapq.heappop(queue)
            node = lane[1]
            if node == goal:
                return [node for _, node in _back(came, lane)][::-1]
            for after, length_m in self.onward[node].items():
                so_far_m, further = best[lane] + length_m * detours[node], (node, after)
                if not self._turns_back(*lane, after) and so_far_m < best.get(further, inf):
                    best[further], came[further] = so_far_m, lane
                    heapq.heappush(queue, (so_far_m + self._left_m(after, goal), further))
        raise ValueError(f"no path from node {start} to node {goal}")

    def _turns_back(self, before: int, node: int, after: int) -> bool:
        (ax, ay), (bx, by), (cx, cy) = (self.places[number] for number in (before, node, after))
        return (bx - ax) * (cx - bx) + (by - ay) * (cy - by) < 0

    def _left_m(self, node: int, goal: int) -> float:
        (x, y), (goal_x, goal_y) = self.places[node], self.places[goal]
        return abs(goal_x - x) + abs(goal_y - y)

    def add(self, floor: int, place: Place) -> int:
        self.places.append(place)
        self.floors.append(floor)
        self.onward.append({})
        return len(self.places) - 1

    def join(self, *nodes: int) -> None:
        """Add a lane through `nodes`, in that direction."""
        for a, b in pairwise(nodes):
            self.onward[a][b] = self._left_m(a, b)


_Lane = tuple[int, int]


def _back(came: dict[_Lane, _Lane], lane: _Lane) -> Iterator[_Lane]:
    yield lane
    while lane in came:
        lane = came[lane]
        yield lane


def layout_for(robots: int) -> Layout:
    """Two floors that are large enough for this number of robots."""
    columns, rows = _tiles(ceil(robots / ROBOTS_PER_TILE))
    layout, bays = Layout([], [], []), list[Bay]()
    for floor, tile in enumerate(TILES):
        xs = [column * tile.size_m[0] + x for column in range(columns) for x in tile.across_m]
        ys = [row * tile.size_m[1] + y for row in range(rows) for y in tile.along_m]
        nodes = list(_add_floor(layout, floor, xs, ys, tile.cross_bays))
        bays += _named(layout, nodes, lifts=columns * rows)
    lifts = [
        [index for index, bay in enumerate(bays) if bay.kind is BayKind.LIFT and bay.floor == floor]
        for floor in (GROUND, MEZZANINE)
    ]
    layout.bays, layout.bay_nodes = tuple(bays), frozenset(bay.node for bay in bays)
    layout.other_lift = dict(zip(lifts[0], lifts[1], strict=True)) | dict(zip(lifts[1], lifts[0], strict=True))
    return layout


def _tiles(count: int) -> tuple[int, int]:
    """Columns and rows of the hall that is nearest to a square and has at least `count` tiles."""
    width_m, depth_m = TILES[GROUND].size_m
    columns = max(1, round((count * depth_m / width_m) ** 0.5))
    return columns, ceil(count / columns)


def _add_floor(layout: Layout, floor: int, xs: list[float], ys: list[float], cross_bays: bool) -> Iterator[int]:
    """Add crossings and the aisles between them. Yields the nodes of the bays."""
    crossings = {(x, y): layout.add(floor, (x, y)) for x in xs for y in ys}
    layout.crossings |= set(crossings.values())
    for y in ys:
        for left, right in pairwise(xs):
            middle, wide = (left + right) / 2, right - left >= LONG_AISLE_M
            gates = [(x, y) for x in (middle - 1.5, middle + 1.5) if wide]
            yield from _add_aisle(layout, crossings[left, y], crossings[right, y], gates)
    for x in xs:
        for low, high in pairwise(ys):
            gates = [(x, (low + high) / 2)] if cross_bays and high - low >= LONG_AISLE_M else []
            yield from _add_aisle(layout, crossings[x, low], crossings[x, high], gates)


def _add_aisle(layout: Layout, start: int, end: int, gates: list[Place]) -> Iterator[int]:
    """Add two lanes between two crossings, one in each direction, with a bay to the right of each at every gate."""
    for a, b, way in ((start, end, gates), (end, start, gates[::-1])):
        (ax, ay), (bx, by) = layout.places[a], layout.places[b]
        length_m = abs(bx - ax) + abs(by - ay)
        right = ((by - ay) / length_m * BAY_DEPTH_M, -(bx - ax) / length_m * BAY_DEPTH_M)
        nodes = [layout.add(layout.floors[a], gate) for gate in way]
        layout.join(a, *nodes, b)
        for gate in nodes:
            x, y = layout.places[gate]
            bay = layout.add(layout.floors[a], (x + right[0], y + right[1]))
            layout.join(gate, bay, gate)
            yield bay


def _named(layout: Layout, nodes: list[int], lifts: int) -> Iterator[Bay]:
    """Bays at `nodes`. `lifts` of them, evenly distributed, are lifts."""
    every = len(nodes) // lifts
    for rank, node in enumerate(nodes):
        kind = BayKind.LIFT if rank % every == 0 and rank // every < lifts else _kind(rank)
        yield Bay(node, layout.floors[node], layout.places[node], kind)


def _kind(rank: int) -> BayKind:
    """One bay in six is a charger, one in six a parking place, the others are docks."""
    return {2: BayKind.CHARGER, 5: BayKind.PARKING}.get(rank % 6, BayKind.DOCK)
