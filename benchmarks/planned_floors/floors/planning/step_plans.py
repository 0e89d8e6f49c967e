"""Plans of one vendor for all its robots at once, step by step: priority inheritance with backtracking.

Source: Okumura et al. 2022, "Priority Inheritance with Backtracking for Iterative Multi-agent Path Finding". Two things
differ. No ring of robots turns at once, because robots that keep an order cannot do that. A robot whose heading is not
that of its next cell needs one step to turn. Aisles have a preferred direction, which is the vendor's own.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from benchmarks.planned_floors.floors.driving.grid import Grid, Step
from ingest.batch import Floats

AGAINST = 4.0
"""Cost of a cell against the preferred direction of a row or column; with it a cell costs 1."""
LEAST_ERRAND_CELLS = 5


@dataclass(eq=False)
class StepPlanner:
    """Plans for the robots of one vendor. `cells` (n,) are those in which they begin."""

    grid: Grid
    cells: list[int]
    rng: np.random.Generator
    goals: list[int] = field(default_factory=list)
    steps: list[list[Step]] = field(default_factory=list)
    """By robot: the cell of each step."""
    ends: list[list[tuple[int, int]]] = field(default_factory=list)
    """By robot: the step and the cell at which each errand ends."""

    def __post_init__(self) -> None:
        n = len(self.cells)
        self._heading = [0] * n
        self._waited: Floats = np.zeros(n) + self.rng.random(n)
        self.goals = [self._errand(cell) for cell in self.cells]
        self.steps = [[(cell, 0)] for cell in self.cells]
        self.ends = [[] for _ in self.cells]

    def plan(self, steps: int) -> None:
        """Plan the first `steps` steps of all robots."""
        for step in range(1, steps + 1):
            self._step(step)

    def _step(self, step: int) -> None:
        next_cells = _Moves(self).decided(np.argsort(-self._waited, kind="stable").tolist())
        held = [
            robot
            for robot, (cell, after) in enumerate(zip(self.cells, next_cells, strict=True))
            if after != cell and self._heading[robot] != after - cell
        ]
        for robot in held:
            self._heading[robot] = next_cells[robot] - self.cells[robot]
        self._hold(held, next_cells)
        for robot, cell in enumerate(next_cells):
            self.cells[robot] = cell
            self.steps[robot].append((cell, step))
            self._waited[robot] += 1
            if cell == self.goals[robot]:
                self.ends[robot].append((step, cell))
                self.goals[robot] = self._errand(cell)
                self._waited[robot] = self.rng.random()

    def _hold(self, held: list[int], next_cells: list[int]) -> None:
        """Robots that turn stay, and those that were to follow into their cells."""
        into = {cell: robot for robot, cell in enumerate(next_cells) if cell != self.cells[robot]}
        while held:
            robot = held.pop()
            next_cells[robot] = self.cells[robot]
            if (follower := into.pop(self.cells[robot], None)) is not None and follower != robot:
                held.append(follower)

    def _errand(self, cell: int) -> int:
        away = self.distances(cell)
        far = np.flatnonzero((away >= LEAST_ERRAND_CELLS) & np.isfinite(away))
        return int(self.rng.choice(far))

    def distances(self, goal: int) -> Floats:
        """(cells,) cost of the way from each cell to `goal`."""
        if goal not in self._distances:
            self._distances[goal] = dijkstra(self._costs, indices=goal)
        return self._distances[goal]

    @cached_property
    def _distances(self) -> dict[int, Floats]:
        return {}

    @cached_property
    def _costs(self) -> csr_array:
        """Cost of each move, by the cell that it leads to and the cell that it comes from."""
        height = self.grid.height
        preferred = {1: self.rng.choice((-1, 1), self.grid.width), height: self.rng.choice((-1, 1), height)}
        to, come_from, costs = [], [], []
        for cell in np.flatnonzero(~self.grid.blocked).tolist():
            x, y = divmod(cell, height)
            for after in self.grid.neighbours(cell):
                axis = abs(after - cell)
                with_it = np.sign(after - cell) == preferred[axis][x if axis == 1 else y]
                to.append(after)
                come_from.append(cell)
                costs.append(1.0 if with_it else AGAINST)
        cells = len(self.grid.blocked)
        return csr_array((costs, (to, come_from)), shape=(cells, cells))


class _Moves:
    """The moves of one step."""

    def __init__(self, planner: StepPlanner) -> None:
        self._planner = planner
        self._at = {cell: robot for robot, cell in enumerate(planner.cells)}
        self._next: list[int | None] = [None] * len(planner.cells)
        self._taken: dict[int, int] = {}

    def decided(self, order: Sequence[int]) -> list[int]:
        """(n,) the next cell of each robot. Those first in `order` choose first."""
        for robot in order:
            if self._next[robot] is None:
                self._moves(robot, ())
        return [cell if cell is not None else own for cell, own in zip(self._next, self._planner.cells, strict=True)]

    def _moves(self, robot: int, pushing: tuple[int, ...]) -> bool:
        planner, cell = self._planner, self._planner.cells[robot]
        away = planner.distances(planner.goals[robot])
        choices = sorted((*planner.grid.neighbours(cell), cell), key=lambda after: (away[after], planner.rng.random()))
        for after in choices:
            other = self._at.get(after)
            if after in self._taken or other in pushing:
                continue
            self._next[robot], self._taken[after] = after, robot
            if other is None or other == robot or self._next[other] is not None:
                if other is None or other == robot or self._next[other] != cell:
                    return True
            elif self._moves(other, (*pushing, robot)):
                return True
            del self._taken[after]
            self._next[robot] = None
        if cell not in self._taken:
            self._next[robot], self._taken[cell] = cell, robot
        return False
