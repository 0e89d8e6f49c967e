"""The roadmap of a hall: streets with one lane for both directions, or with two; junctions where they cross."""

import heapq
from collections.abc import Collection, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from math import hypot

import numpy as np

from ingest.batch import Floats

LANE_M = 0.8
"""From the middle of a wide street to each of its lanes."""
WIDE_HALF_M, NARROW_HALF_M = 1.75, 0.85
PER_ROBOT_M = 1.9
TURN_COST_M = 1.5


@dataclass(frozen=True, slots=True)
class Street:
    """A straight street from `start` to `end` in metres, along x or y, in ascending order."""

    start: tuple[float, float]
    end: tuple[float, float]
    wide: bool = False
    stations: tuple[float, ...] = ()
    """Where robots work, in metres from its start."""
    stub: int = 0
    """1 if its end is a bay, -1 if its start is, at which robots work too."""

    @property
    def along_x(self) -> bool:
        return self.start[1] == self.end[1]

    def area(self) -> tuple[float, float, float, float]:
        """West, south, east and north of its ground."""
        half_m = WIDE_HALF_M if self.wide else NARROW_HALF_M
        more_m = half_m if self.wide else NARROW_HALF_M + 0.1 if self.stub else 0.0
        x, y = (more_m, half_m) if self.along_x else (half_m, more_m)
        (a, b), (c, d) = self.start, self.end
        return min(a, c) - x, min(b, d) - y, max(a, c) + x, max(b, d) + y


@dataclass(frozen=True, slots=True)
class Segment:
    """A lane between two junctions."""

    length_m: float
    narrow: bool
    dead_end: bool

    @property
    def room(self) -> int:
        return 1 if self.dead_end else max(1, int(self.length_m / PER_ROBOT_M))


@dataclass(slots=True)
class Edge:
    """From one node to the next. `segment` is -1 within a junction; `sign` is the direction in it."""

    length_m: float
    segment: int
    sign: int


@dataclass(slots=True)
class Roadmap:
    xy: list[tuple[float, float]] = field(default_factory=list)
    junction: list[int] = field(default_factory=list)
    """By node; -1 for none."""
    edges: list[dict[int, Edge]] = field(default_factory=list)
    """By node: the edges to other nodes."""
    segments: list[Segment] = field(default_factory=list)
    stations: list[int] = field(default_factory=list)
    bays: list[int] = field(default_factory=list)
    """Nodes at the ends of stubs."""
    distance_m: Floats = field(default_factory=lambda: np.zeros((0, 0)))

    def route(
        self, start: int, goal: int, closed: Collection[tuple[int, int]] = (), cost: Floats | None = None
    ) -> list[int]:
        """The nodes of the way of least cost; empty if there is none. `closed` edges are not used."""
        best, before, done = {start: 0.0}, {start: -1}, set()
        queue = [(0.0, start)]
        while queue:
            spent_m, node = heapq.heappop(queue)
            if node in done:
                continue
            done.add(node)
            if node == goal:
                return self._back(before, goal)
            for to, edge in self.edges[node].items():
                turns = before[node] >= 0 and not self._straight(before[node], node, to)
                factor = 1.0 if cost is None or edge.segment < 0 else float(cost[edge.segment])
                new_m = spent_m + edge.length_m * factor + TURN_COST_M * turns
                if (node, to) not in closed and new_m < best.get(to, np.inf):
                    best[to], before[to] = new_m, node
                    heapq.heappush(queue, (new_m, to))
        return []

    def _straight(self, a: int, b: int, c: int) -> bool:
        (x, y), (x2, y2), (x3, y3) = self.xy[a], self.xy[b], self.xy[c]
        return (
            abs((x2 - x) * (y3 - y2) - (y2 - y) * (x3 - x2)) < 1e-9 and (x2 - x) * (x3 - x2) + (y2 - y) * (y3 - y2) > 0
        )

    @staticmethod
    def _back(before: dict[int, int], node: int) -> list[int]:
        found = [node]
        while before[found[-1]] >= 0:
            found.append(before[found[-1]])
        return found[::-1]


def roadmap_of(streets: Sequence[Street]) -> Roadmap:
    """Lanes, cut where they cross. Wide streets have a lane on the right for each direction."""
    made = Roadmap()
    lanes = [(k, *lane) for k, street in enumerate(streets) for lane in _lanes(street)]
    nodes: dict[tuple[float, float], int] = {}
    junctions: dict[tuple[int, int], int] = {}
    for k, street, a, b, sign in [(k, streets[k], a, b, sign) for k, a, b, sign in lanes]:
        along = 0 if street.along_x else 1
        cuts: dict[float, int] = {}
        for other, c, d, _ in lanes:
            across = 1 - along
            if (
                streets[other].along_x != street.along_x
                and _between(a[along], c[along], b[along])
                and _between(c[across], a[across], d[across])
            ):
                cuts[c[along]] = junctions.setdefault((min(k, other), max(k, other)), len(junctions))
        for away_m in street.stations:
            cuts.setdefault(street.start[along] + away_m, -1)
        if street.stub:
            cuts[(street.end if street.stub > 0 else street.start)[along]] = -1
        _add_lane(made, nodes, street, sorted(cuts.items()), a, sign)
    _finish(made)
    return made


def _lanes(street: Street) -> list[tuple[tuple[float, float], tuple[float, float], int]]:
    """Start and end of each lane, and its one direction; 0 for both."""
    (a, b), (c, d) = street.start, street.end
    x, y = (LANE_M, 0.0) if street.along_x else (0.0, LANE_M)
    if not street.wide:
        return [((a - x, b - y), (c + x, d + y), 0)]
    lanes = ((-1, 1), (1, -1)) if street.along_x else ((1, 1), (-1, -1))
    return [((a - x + s * y, b - y + s * x), (c + x + s * y, d + y + s * x), sign) for s, sign in lanes]


def _between(low: float, value: float, high: float) -> bool:
    return low - 1e-6 <= value <= high + 1e-6


def _add_lane(
    made: Roadmap,
    nodes: dict[tuple[float, float], int],
    street: Street,
    cuts: list[tuple[float, int]],
    start: tuple[float, float],
    sign: int,
) -> None:
    row = []
    for at_m, junction in cuts:
        xy = (at_m, start[1]) if street.along_x else (start[0], at_m)
        key = (round(xy[0], 3), round(xy[1], 3))
        if key not in nodes:
            nodes[key] = len(made.xy)
            made.xy.append(xy)
            made.junction.append(junction)
            made.edges.append({})
        row.append(nodes[key])
    inside: list[tuple[int, int]] = []
    for a, b in pairwise(row):
        if made.junction[a] >= 0 and made.junction[a] == made.junction[b]:
            _join(made, a, b, -1, sign)
            continue
        inside.append((a, b))
        if made.junction[b] >= 0 or b == row[-1]:
            _add_segment(made, inside, street, sign)
            inside = []


def _add_segment(made: Roadmap, inside: list[tuple[int, int]], street: Street, sign: int) -> None:
    length_m = sum(_away(made, a, b) for a, b in inside)
    made.segments.append(Segment(length_m, not street.wide, bool(street.stub)))
    for a, b in inside:
        _join(made, a, b, len(made.segments) - 1, sign)
    for node in {node for pair in inside for node in pair if made.junction[node] < 0}:
        made.stations.append(node)
        if street.stub:
            made.bays.append(node)


def _away(made: Roadmap, a: int, b: int) -> float:
    return hypot(made.xy[a][0] - made.xy[b][0], made.xy[a][1] - made.xy[b][1])


def _join(made: Roadmap, a: int, b: int, segment: int, sign: int) -> None:
    if sign >= 0:
        made.edges[a][b] = Edge(_away(made, a, b), segment, 1)
    if sign <= 0:
        made.edges[b][a] = Edge(_away(made, a, b), segment, -1)


def _finish(made: Roadmap) -> None:
    """Distances between all nodes."""
    count = len(made.xy)
    away_m = np.full((count, count), np.inf)
    np.fill_diagonal(away_m, 0.0)
    for a, edges in enumerate(made.edges):
        for b, edge in edges.items():
            away_m[a, b] = edge.length_m
    for k in range(count):
        np.minimum(away_m, away_m[:, k, None] + away_m[None, k], out=away_m)
    made.distance_m = away_m
