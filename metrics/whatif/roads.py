"""Roads as robots show them: where they drove and in which directions, as cells of a grid.

A way along the roads keeps to directions that were seen where it can. What nobody drove near is no road.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from math import hypot

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from deconflict.simulation.floor_layout import Place
from ingest.batch import Bools, Floats, Ints
from metrics.whatif.demand import simplified

CELL_M = 0.5
BESIDE_M = 0.75
"""Robots may drive this far beside where others drove."""
STEPS = np.array([(1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1)])
"""By direction, the step to the next cell."""
LENGTHS_M = np.hypot(*STEPS.T) * CELL_M
UNUSUAL = 3.0
"""Driving in a direction that nobody drove there counts as this many times its length, and off all ways as the
second."""
OFF_WAYS = 2.0
TURN_M = 0.4
"""A turn by 45 degrees counts as this many metres more."""
SAMPLE_M = 0.2
CORNERS_M = 0.35
"""Ways along cells are simplified to corners from which they deviate by at most this."""

IsForbidden = Callable[[Floats, Floats, Floats], Bools]
"""Of points x, y (k,) and unit directions (k, 2): whether nobody may drive there in that direction."""


@dataclass(frozen=True, slots=True)
class FloorWay:
    """A way on a floor."""

    corners: tuple[Place, ...]
    floor: int


class Roads:
    """The roads of one floor."""

    def __init__(self, ways: Iterable[tuple[Place, ...]], is_forbidden: IsForbidden | None) -> None:
        sampled = [sampled_way(np.array(way)) for way in ways if len(way) > 1]
        points = np.vstack(sampled) if sampled else np.zeros((1, 2))
        self._low_m = points.min(axis=0) - 2 * BESIDE_M
        self._shape = tuple((np.ceil((points.max(axis=0) - self._low_m + 2 * BESIDE_M) / CELL_M).astype(int)).tolist())
        seen = np.zeros((len(STEPS), *self._shape), np.bool_)
        for way in sampled:
            self._add(seen, way)
        driven: Bools = np.any(seen, axis=0, keepdims=True)[0]
        near = _grown(driven, round(BESIDE_M / CELL_M))
        self._cells = np.flatnonzero(near.ravel())
        """(c,) numbers of the cells that are road."""
        self._graph = self._joined(seen, driven, is_forbidden)
        self._found: dict[tuple[int, int], Ints] = {}

    def way(self, start: Place, goal: Place) -> tuple[Place, ...] | None:
        """The corners of the shortest way; None if there is none."""
        first, last = self._nearest(start), self._nearest(goal)
        if (first, last) not in self._found:
            self._found[first, last] = self._search(first, last)
        cells = self._found[first, last]
        if not len(cells):
            return None
        points = self._middles(self._cells[cells])
        inner = points[1:-1] if len(points) > 2 else np.empty((0, 2))
        return tuple(map(tuple, simplified(np.vstack([[start], inner, [goal]]), CORNERS_M).tolist()))

    def _add(self, seen: Bools, way: Floats) -> None:
        steps = np.diff(way, axis=0)
        direction = np.round(np.arctan2(steps[:, 1], steps[:, 0]) / (np.pi / 4)).astype(int) % len(STEPS)
        x, y = ((way[:-1] - self._low_m) / CELL_M).astype(int).T
        seen[direction, x, y] = True

    def _joined(self, seen: Bools, driven: Bools, is_forbidden: IsForbidden | None) -> csr_array:
        """Nodes are direction and cell, direction first: a robot that has come into a cell in that direction."""
        count, rows, columns, costs = len(self._cells), [], [], []
        number = np.full(driven.size, -1)
        number[self._cells] = np.arange(count)
        x, y = np.unravel_index(self._cells, self._shape)
        middles = self._middles(self._cells)
        for way, step in enumerate(STEPS):
            to_x, to_y = x + step[0], y + step[1]
            inside = (to_x >= 0) & (to_x < self._shape[0]) & (to_y >= 0) & (to_y < self._shape[1])
            target = np.where(inside, number[np.where(inside, to_x * self._shape[1] + to_y, 0)], -1)
            unit = np.repeat([step / hypot(*step)], count, axis=0)
            may = target >= 0
            if is_forbidden:
                may &= ~is_forbidden(middles[:, 0], middles[:, 1], unit)
            usual = _usual(seen, way)[x, y]
            cost_m = LENGTHS_M[way] * np.where(usual, 1.0, np.where(driven[x, y], UNUSUAL, OFF_WAYS * UNUSUAL / 2))
            for came in range(len(STEPS)):
                turns = min((way - came) % 8, (came - way) % 8)
                if turns > 2:
                    continue
                rows.append(came * count + np.flatnonzero(may))
                columns.append(way * count + target[may])
                costs.append(cost_m[may] + turns * TURN_M)
        size = len(STEPS) * count
        return csr_array((np.concatenate(costs), (np.concatenate(rows), np.concatenate(columns))), shape=(size, size))

    def _search(self, first: int, last: int) -> Ints:
        """Cells, as rows of `_cells`, of the shortest way; none if there is none."""
        count = len(self._cells)
        starts = first + count * np.arange(len(STEPS))
        cost_m, before, _ = dijkstra(self._graph, indices=starts, return_predecessors=True, min_only=True)
        ends = last + count * np.arange(len(STEPS))
        node = int(ends[np.argmin(cost_m[ends])])
        if not np.isfinite(cost_m[node]):
            return np.empty(0, np.int64)
        nodes = [node]
        while before[nodes[-1]] >= 0:
            nodes.append(int(before[nodes[-1]]))
        return np.array(nodes[::-1]) % count

    def _middles(self, cells: Ints) -> Floats:
        return self._low_m + (np.column_stack(np.unravel_index(cells, self._shape)) + 0.5) * CELL_M

    def _nearest(self, place: Place) -> int:
        return int(np.argmin(np.hypot(*(self._middles(self._cells) - place).T)))


def sampled_way(corners: Floats) -> Floats:
    """Points (k, 2) of a way at most `SAMPLE_M` apart."""
    legs_m = np.hypot(*np.diff(corners, axis=0).T)
    along_m = np.concatenate([[0.0], np.cumsum(legs_m)])
    at_m = np.linspace(0.0, along_m[-1], max(2, int(along_m[-1] / SAMPLE_M) + 1))
    return np.column_stack([np.interp(at_m, along_m, corners[:, axis]) for axis in range(2)])


def _usual(seen: Bools, way: int) -> Bools:
    """Cells in or beside which somebody drove in about this direction."""
    return _grown(seen[way] | seen[(way + 1) % 8] | seen[(way - 1) % 8], 1)


def _grown(cells: Bools, by: int) -> Bools:
    """The cells and those around them."""
    grown = cells.copy()
    for _ in range(by):
        before = grown.copy()
        grown[1:] |= before[:-1]
        grown[:-1] |= before[1:]
        grown[:, 1:] |= before[:, :-1]
        grown[:, :-1] |= before[:, 1:]
    return grown
