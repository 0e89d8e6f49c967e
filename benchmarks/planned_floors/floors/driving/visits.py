"""The order in which one fleet's robots use the cells: each visit waits for the one planned before it.

Plans say at which step; robots are late. What is kept is the order: a robot enters a cell when the robot of its own
fleet that was to use it before has gone most of the way to its next.
"""

from bisect import bisect_left, insort

import numpy as np

from benchmarks.planned_floors.floors.driving.driving import VISIT, Ways
from benchmarks.planned_floors.floors.driving.grid import Grid, Step
from ingest.batch import Ints

NOBODY = -1


class Visits:
    """The cells that n robots visit, in order, and for whom of its own fleet each visit waits.

    Rows are robots, columns their visits.
    """

    def __init__(self, grid: Grid, fleet_of: list[int]) -> None:
        robots = len(fleet_of)
        self._grid, self._fleet_of = grid, fleet_of
        self._uses: dict[tuple[int, int], list[tuple[int, int, int]]] = {}
        """By fleet and cell: its visits as step, robot and visit, ascending."""
        self._steps: list[list[int]] = [[] for _ in range(robots)]
        self._cells: list[list[int]] = [[] for _ in range(robots)]
        self.count: Ints = np.zeros(robots, np.int64)
        """(n,) number of known visits."""
        self.ways: Ways = np.zeros((robots, 64), VISIT)
        """(n, k)"""

    def extend(self, robot: int, way: list[Step]) -> None:
        """Append the visits of a path. Steps in the cell where the last visit ends belong to that visit."""
        for cell, step in way:
            if not self._cells[robot] or self._cells[robot][-1] != cell:
                self._append(robot, cell, step)

    def step(self, robot: int, visit: int) -> int:
        """When a visit was planned to begin."""
        return self._steps[robot][visit]

    def cell(self, robot: int, visit: int) -> int:
        return self._cells[robot][visit]

    def withdraw(self, robot: int, from_visit: int) -> None:
        """Remove a robot that is carried away from the order. Its visits from the given one on are dropped."""
        for visit in range(from_visit, int(self.count[robot])):
            uses = self._uses[self._fleet_of[robot], self._cells[robot][visit]]
            index = bisect_left(uses, (self._steps[robot][visit], robot, visit))
            del uses[index]
            if index < len(uses):
                self._wait_for_previous(uses, index)
        del self._steps[robot][from_visit:], self._cells[robot][from_visit:]
        self.count[robot] = from_visit

    def _append(self, robot: int, cell: int, step: int) -> None:
        visit = int(self.count[robot])
        if visit == self.ways.shape[1]:
            self.ways = np.concatenate([self.ways, np.zeros_like(self.ways)], axis=1)
        self._steps[robot].append(step)
        self._cells[robot].append(cell)
        self.count[robot] = visit + 1
        way = self.ways[robot]
        way["x_m"][visit], way["y_m"][visit] = self._grid.place_m(cell)
        if visit:
            dx_m, dy_m = (way[name][visit] - way[name][visit - 1] for name in ("x_m", "y_m"))
            way["heading_rad"][visit - 1] = np.arctan2(dy_m, dx_m)
        uses = self._uses.setdefault((self._fleet_of[robot], cell), [])
        entry = (step, robot, visit)
        insort(uses, entry)
        index = bisect_left(uses, entry)
        self._wait_for_previous(uses, index)
        if index + 1 < len(uses):
            self._wait_for_previous(uses, index + 1)

    def _wait_for_previous(self, uses: list[tuple[int, int, int]], index: int) -> None:
        _, robot, visit = uses[index]
        before = uses[index - 1] if index else (0, NOBODY, 0)
        self.ways["first_robot"][robot, visit] = NOBODY if before[1] == robot else before[1]
        self.ways["first_visit"][robot, visit] = before[2]
