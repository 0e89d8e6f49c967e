"""The cells of a floor: racks with aisles between them, and distances along the free cells."""

from collections import deque
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from benchmarks.planned_floors.truth.motion import Bools
from ingest.batch import Ints

CELL_M = 1.5
RACK_CELLS = 4
"""Length of a rack, along y."""
LONG_RACK_CELLS = 38
"""Length of a rack of a warehouse, along x."""
Step = tuple[int, int]
"""A cell, and the step at which a robot is in it."""
UNREACHED = np.iinfo(np.int64).max


@dataclass(frozen=True, eq=False)
class Grid:
    """Cells by one index: `x * height + y`."""

    width: int
    height: int
    blocked: Bools
    """(width * height,)"""
    one_way_x: tuple[int, ...] = ()
    """Columns in which nobody drives towards larger y, but at their ends."""

    def place_m(self, cell: int) -> tuple[float, float]:
        """The centre of a cell."""
        x, y = divmod(cell, self.height)
        return x * CELL_M, y * CELL_M

    def free(self, x_m: float, y_m: float) -> bool:
        """Whether a position is in a free cell of the floor."""
        x, y = round(x_m / CELL_M), round(y_m / CELL_M)
        return 0 <= x < self.width and 0 <= y < self.height and not self.blocked[x * self.height + y]

    def neighbours(self, cell: int) -> tuple[int, ...]:
        return _neighbours(self)[cell]

    def distances(self, goal: int) -> Ints:
        """(cells,) steps from each cell to `goal`."""
        return _distances(self, goal)


def racks(width: int, height: int, aisle_cells: int, rng: np.random.Generator, one_way_x: tuple[int, ...] = ()) -> Grid:
    """Racks one cell wide with aisles of `aisle_cells` between them, a fifth of them missing."""
    blocked = np.zeros((width, height), bool)
    for x in range(2, width - 2, aisle_cells + 1):
        for y in range(2, height - 1 - RACK_CELLS, RACK_CELLS + 1):
            blocked[x, y : y + RACK_CELLS] = rng.random() >= 0.2
    return Grid(width, height, blocked.ravel(), one_way_x)


def warehouse(width: int, height: int) -> Grid:
    """Long racks two cells deep along x. Aisles of one cell between them, and ways of three cells around them."""
    blocked = np.zeros((width, height), bool)
    for x in range(3, width - LONG_RACK_CELLS, LONG_RACK_CELLS + 3):
        for y in range(3, height - 4, 3):
            blocked[x : x + LONG_RACK_CELLS, y : y + 2] = True
    return Grid(width, height, blocked.ravel())


def sortation(width: int, height: int) -> Grid:
    """Chutes of one cell in rows, with lanes of two cells between them."""
    blocked = np.zeros((width, height), bool)
    blocked[2:-2:3, 2:-2:3] = True
    return Grid(width, height, blocked.ravel())


def scattered(width: int, height: int, rng: np.random.Generator) -> Grid:
    """A fifth of the cells are blocked at random, and those that cannot be reached from the largest free part."""
    blocked = rng.random(width * height) < 0.2
    grid = Grid(width, height, blocked)
    free = np.flatnonzero(~blocked)
    reached = max((grid.distances(int(cell)) < UNREACHED for cell in free[:: len(free) // 8]), key=np.count_nonzero)
    return Grid(width, height, blocked | ~reached)


@lru_cache(maxsize=16)
def _neighbours(grid: Grid) -> tuple[tuple[int, ...], ...]:
    found = []
    for cell in range(grid.width * grid.height):
        x, y = divmod(cell, grid.height)
        around = ((x + 1, y), (x, y + 1), (x - 1, y), (x, y - 1))
        inside = [a * grid.height + b for a, b in around if 0 <= a < grid.width and 0 <= b < grid.height]
        against = {cell + 1} if x in grid.one_way_x and 1 < y < grid.height - 3 else set()
        found.append(
            tuple(next_cell for next_cell in inside if not grid.blocked[next_cell] and next_cell not in against)
        )
    return tuple(found)


@lru_cache(maxsize=16)
def _sources(grid: Grid) -> tuple[tuple[int, ...], ...]:
    """By cell, the cells from which a robot can come."""
    found: list[list[int]] = [[] for _ in range(grid.width * grid.height)]
    for cell in range(len(found)):
        for after in grid.neighbours(cell):
            found[after].append(cell)
    return tuple(map(tuple, found))


@lru_cache(maxsize=4096)
def _distances(grid: Grid, goal: int) -> Ints:
    steps, waiting = np.full(grid.width * grid.height, UNREACHED, np.int64), deque([goal])
    steps[goal] = 0
    while waiting:
        cell = waiting.popleft()
        for source in _sources(grid)[cell]:
            if steps[source] == UNREACHED:
                steps[source] = steps[cell] + 1
                waiting.append(source)
    return steps
