"""A warehouse on two floors: aisles between racks, and bays beside the aisles where robots and people stop.

A larger number of robots gets further halls of the same pattern, so that the density stays the same.
"""

import heapq
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from itertools import pairwise
from math import atan2, ceil, inf, isclose

from ingest.batch import Floats

ROBOTS_PER_HALL = 80
BAY_DEPTH_M = 2.5
"""Distance from the middle of the aisle to the middle of the bay."""

GROUND, MEZZANINE = 0, 1

Place = tuple[float, float]
"""x, y in the floor's frame, metres."""


class BayKind(StrEnum):
    RACK = "rack"
    PICK = "pick"
    """A rack of the pick zone, where people work."""
    DOCK = "dock"
    CHARGER = "charger"
    PARKING = "parking"
    LIFT = "lift"


@dataclass(frozen=True, slots=True)
class BayRow:
    """Equal bays in a row beside an aisle."""

    kind: BayKind
    x_m: tuple[float, ...]
    """In the pattern's frame, as `y_m`. There is a bay at each x and each y."""
    y_m: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class FloorPattern:
    """One hall of a floor, or its part of the mezzanine."""

    width_m: float
    across_m: tuple[float, ...]
    """x of the aisles that run along y."""
    along_m: tuple[float, ...]
    """y of the aisles that run along x."""
    rows: tuple[BayRow, ...]


def _sides(*aisles_m: float) -> tuple[float, ...]:
    """The middle of the bays on both sides of each aisle."""
    return tuple(aisle_m + side_m for aisle_m in aisles_m for side_m in (-BAY_DEPTH_M, BAY_DEPTH_M))


AISLES_M = tuple(5.5 + 11.0 * rank for rank in range(9))
"""x of the aisles between the racks of a hall."""
SOUTH_M, LOWER_M, UPPER_M, NORTH_M = 6.0, 23.0, 31.0, 48.0
"""y of the aisles along the docks, and of the two in the middle."""
RACK_BAYS_M = (10.5, 13.4, 16.3, 19.2, 34.8, 37.7, 40.6, 43.5)
_BETWEEN_M = tuple((west + east) / 2 for west, east in pairwise(AISLES_M))
_WEST_M, _EAST_M = tuple(x - 1.5 for x in _BETWEEN_M), tuple(x + 1.5 for x in _BETWEEN_M)
HALL = FloorPattern(
    99.0,
    AISLES_M,
    (SOUTH_M, LOWER_M, UPPER_M, NORTH_M),
    (
        BayRow(BayKind.RACK, _sides(*AISLES_M[:7]), RACK_BAYS_M),
        BayRow(BayKind.PICK, _sides(*AISLES_M[7:]), RACK_BAYS_M),
        BayRow(BayKind.DOCK, _WEST_M + _EAST_M, (SOUTH_M - BAY_DEPTH_M,)),
        BayRow(BayKind.LIFT, _WEST_M[:1], (NORTH_M + BAY_DEPTH_M,)),
        BayRow(BayKind.DOCK, _WEST_M[1:] + _EAST_M, (NORTH_M + BAY_DEPTH_M,)),
        BayRow(BayKind.CHARGER, _EAST_M, (LOWER_M + BAY_DEPTH_M,)),
        BayRow(BayKind.PARKING, _WEST_M, (LOWER_M + BAY_DEPTH_M,)),
        BayRow(BayKind.PARKING, _WEST_M + _EAST_M, (UPPER_M - BAY_DEPTH_M,)),
    ),
)
"""Docks in the south and north, racks, the pick zone in the east, chargers and parking places in the middle, a lift."""
MEZZANINE_PART = FloorPattern(
    43.0,
    (5.0, 16.0, 27.0, 38.0),
    (4.5, 15.5),
    (
        BayRow(BayKind.LIFT, (9.0,), (18.0,)),
        BayRow(BayKind.RACK, (12.0, 20.0, 23.0, 31.0, 34.0), (18.0,)),
        BayRow(BayKind.RACK, (9.0, 12.0, 20.0, 23.0, 31.0, 34.0), (2.0, 7.0, 13.0)),
        BayRow(BayKind.CHARGER, (2.5, 7.5), (10.0,)),
        BayRow(BayKind.PARKING, (13.5, 18.5, 24.5, 29.5, 35.5, 40.5), (10.0,)),
    ),
)
PATTERNS = (HALL, MEZZANINE_PART)
"""By floor."""


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


def halls_for(robots: int) -> int:
    """How many halls this number of robots needs."""
    return max(1, ceil(robots / ROBOTS_PER_HALL))


def layout_for(robots: int) -> Layout:
    """Two floors that are large enough for this number of robots."""
    return layout_of(PATTERNS, halls_for(robots))


def layout_of(patterns: Sequence[FloorPattern], halls: int = 1) -> Layout:
    """A floor of each pattern, with this number of halls side by side."""
    layout, bays = Layout([], [], []), list[Bay]()
    for floor, pattern in enumerate(patterns):
        bays += _add_floor(layout, floor, pattern, [hall * pattern.width_m for hall in range(halls)])
    lifts = [
        [index for index, bay in enumerate(bays) if bay.kind is BayKind.LIFT and bay.floor == floor]
        for floor in (GROUND, MEZZANINE)
    ]
    layout.bays, layout.bay_nodes = tuple(bays), frozenset(bay.node for bay in bays)
    layout.other_lift = dict(zip(lifts[0], lifts[1], strict=True)) | dict(zip(lifts[1], lifts[0], strict=True))
    return layout


def _add_floor(layout: Layout, floor: int, pattern: FloorPattern, halls_m: list[float]) -> Iterator[Bay]:
    """Add crossings, the aisles between them and their bays. `halls_m` are the western ends of the halls."""
    xs, ys = [(rank, west_m + x) for rank, west_m in enumerate(halls_m) for x in pattern.across_m], pattern.along_m
    crossings = {(x, y): layout.add(floor, (x, y)) for _, x in xs for y in ys}
    layout.crossings |= set(crossings.values())
    kinds = [
        {(west_m + x, y): row.kind for row in pattern.rows for x in row.x_m for y in row.y_m} for west_m in halls_m
    ]
    ends = [(rank, (west, y), (east, y)) for y in ys for (rank, west), (_, east) in pairwise(xs)]
    ends += [(rank, (x, south), (x, north)) for rank, x in xs for south, north in pairwise(ys)]
    for rank, start, end in ends:
        for a, b in ((start, end), (end, start)):
            for node in _add_lane(layout, crossings[a], crossings[b], kinds[rank]):
                yield Bay(node, floor, layout.places[node], kinds[rank][layout.places[node]])


def _add_lane(layout: Layout, a: int, b: int, bays: Iterable[Place]) -> Iterator[int]:
    """Add the lane from one crossing to the next, with the bays that are to its right. Yields their nodes."""
    (ax, ay), (bx, by) = layout.places[a], layout.places[b]
    length_m = abs(bx - ax) + abs(by - ay)
    ux, uy = (bx - ax) / length_m, (by - ay) / length_m
    beside = [
        (along_m, (x, y))
        for x, y in bays
        if 0.0 < (along_m := (x - ax) * ux + (y - ay) * uy) < length_m
        and isclose((x - ax) * uy - (y - ay) * ux, BAY_DEPTH_M)
    ]
    last = a
    for along_m, place in sorted(beside):
        gate = layout.add(layout.floors[a], (ax + along_m * ux, ay + along_m * uy))
        bay = layout.add(layout.floors[a], place)
        layout.join(last, gate)
        layout.join(gate, bay, gate)
        last = gate
        yield bay
    layout.join(last, b)
