"""Two floors of aisles that cross at right angles, with bays beside them where robots and people stop.

A floor is made of like tiles, so that more robots get more floor and not a denser one.
"""

import heapq
from collections.abc import Iterator
from dataclasses import dataclass
from enum import StrEnum
from itertools import pairwise
from math import ceil

ROBOTS_PER_TILE = 24
BAY_DEPTH_M = 2.2
"""From the middle of the aisle to the middle of the bay."""
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
class Tile:
    """The pattern a floor repeats: its size, and where aisles run along it and across it, metres."""

    size_m: Place
    across_m: tuple[float, ...]
    """x of the aisles that run along y."""
    along_m: tuple[float, ...]
    """y of the aisles that run along x."""
    cross_bays: bool
    """Whether aisles along y have bays too."""


TILES = (
    Tile((40.0, 25.0), (5.0, 15.0, 25.0, 35.0), (4.0, 12.5, 21.0), cross_bays=True),
    Tile((25.0, 15.0), (4.0, 12.5, 21.0), (4.0, 11.0), cross_bays=False),
)
"""The ground hall and the mezzanine."""


@dataclass(frozen=True, slots=True)
class Bay:
    """A place to stop; a robot drives in head first."""

    node: int
    floor: int
    place: Place
    kind: BayKind


@dataclass(slots=True, eq=False)
class Layout:
    """Nodes with their neighbours and lengths; bays are nodes with one neighbour, the aisle in front of them."""

    places: list[Place]
    floors: list[int]
    neighbours: list[dict[int, float]]
    bays: tuple[Bay, ...] = ()
    other_lift: dict[int, int] | None = None
    """Index of each lift bay to that of the same lift on the other floor."""

    def is_bay(self, node: int) -> bool:
        return len(self.neighbours[node]) == 1

    def route(self, start: int, goal: int) -> list[int]:
        """Nodes of a shortest way between two nodes of a floor (A*; aisles are axis-parallel, so |dx| + |dy|
        never over-estimates what is left). Raises ValueError where there is none.
        """
        best, came = {start: 0.0}, dict[int, int]()
        queue = [(self._left_m(start, goal), start)]
        while queue:
            _, node = heapq.heappop(queue)
            if node == goal:
                return list(_back(came, goal))[::-1]
            for near, length_m in self.neighbours[node].items():
                so_far_m = best[node] + length_m
                if so_far_m < best.get(near, float("inf")):
                    best[near], came[near] = so_far_m, node
                    heapq.heappush(queue, (so_far_m + self._left_m(near, goal), near))
        raise ValueError(f"no way from node {start} to node {goal}")

    def _left_m(self, node: int, goal: int) -> float:
        (x, y), (goal_x, goal_y) = self.places[node], self.places[goal]
        return abs(goal_x - x) + abs(goal_y - y)

    def add(self, floor: int, place: Place) -> int:
        self.places.append(place)
        self.floors.append(floor)
        self.neighbours.append({})
        return len(self.places) - 1

    def join(self, a: int, b: int) -> None:
        length_m = self._left_m(a, b)
        self.neighbours[a][b] = self.neighbours[b][a] = length_m


def _back(came: dict[int, int], node: int) -> Iterator[int]:
    yield node
    while node in came:
        node = came[node]
        yield node


def layout_for(robots: int) -> Layout:
    """Two floors large enough for so many robots."""
    columns, rows = _tiles(ceil(robots / ROBOTS_PER_TILE))
    layout = Layout([], [], [])
    spots: list[tuple[int, Place]] = []
    for floor, tile in enumerate(TILES):
        xs = [column * tile.size_m[0] + x for column in range(columns) for x in tile.across_m]
        ys = [row * tile.size_m[1] + y for row in range(rows) for y in tile.along_m]
        spots += [(floor, place) for place in _add_aisles(layout, floor, xs, ys, tile.cross_bays)]
    lifts = columns * rows
    layout.bays = tuple(_add_bays(layout, spots, lifts))
    first, second = (
        [index for index, bay in enumerate(layout.bays) if bay.kind is BayKind.LIFT and bay.floor == floor]
        for floor in (GROUND, MEZZANINE)
    )
    layout.other_lift = dict(zip(first, second, strict=True)) | dict(zip(second, first, strict=True))
    return layout


def _tiles(count: int) -> tuple[int, int]:
    """Columns and rows of the most nearly square hall of at least so many tiles."""
    width_m, depth_m = TILES[GROUND].size_m
    columns = max(1, round((count * depth_m / width_m) ** 0.5))
    return columns, ceil(count / columns)


def _add_aisles(layout: Layout, floor: int, xs: list[float], ys: list[float], cross_bays: bool) -> list[Place]:
    """Add crossings and aisles; returns where bays can be."""
    crossings = {(x, y): layout.add(floor, (x, y)) for x in xs for y in ys}
    spots: list[Place] = []
    for y in ys:
        for left, right in pairwise(xs):
            middle = (left + right) / 2
            gates = [middle - 1.5, middle + 1.5] if right - left >= LONG_AISLE_M else []
            _add_aisle(layout, [crossings[left, y], *(layout.add(floor, (x, y)) for x in gates), crossings[right, y]])
            spots += [(x, y + side) for x in gates for side in (-BAY_DEPTH_M, BAY_DEPTH_M)]
    for x in xs:
        for low, high in pairwise(ys):
            gates = [(low + high) / 2] if cross_bays and high - low >= LONG_AISLE_M else []
            _add_aisle(layout, [crossings[x, low], *(layout.add(floor, (x, y)) for y in gates), crossings[x, high]])
            spots += [(x + side, y) for y in gates for side in (-BAY_DEPTH_M, BAY_DEPTH_M)]
    return spots


def _add_aisle(layout: Layout, nodes: list[int]) -> None:
    for a, b in pairwise(nodes):
        layout.join(a, b)


def _add_bays(layout: Layout, spots: list[tuple[int, Place]], lifts: int) -> Iterator[Bay]:
    """A bay at each spot, joined to its gate; `lifts` of each floor's bays, evenly spread, are lifts."""
    gates = {(layout.floors[node], place): node for node, place in enumerate(layout.places)}
    for floor in (GROUND, MEZZANINE):
        places = [place for one, place in spots if one == floor]
        every = len(places) // lifts
        for rank, (x, y) in enumerate(places):
            node = layout.add(floor, (x, y))
            reach = ((0.0, BAY_DEPTH_M), (0.0, -BAY_DEPTH_M), (BAY_DEPTH_M, 0.0), (-BAY_DEPTH_M, 0.0))
            gate = next(gates[key] for dx, dy in reach if (key := (floor, (x + dx, y + dy))) in gates)
            layout.join(node, gate)
            is_lift = rank % every == 0 and rank // every < lifts
            yield Bay(node, floor, (x, y), BayKind.LIFT if is_lift else _kind(rank))


def _kind(rank: int) -> BayKind:
    """One bay in six is a charger, one in six a parking place, the others are docks."""
    return {2: BayKind.CHARGER, 5: BayKind.PARKING}.get(rank % 6, BayKind.DOCK)
