"""One vendor's planner: prioritised space-time A*, each robot around the plans of its own fleet.

Time is counted in steps of one cell. A robot keeps the last cell of its plan until it gets a new one, so that standing
there is always allowed (token passing, Ma et al. 2017). A cell is left free for one step between two robots: so the
order in which robots use the cells can be kept however late some of them are, and never closes a ring.
"""

import heapq
from collections.abc import Iterator

from benchmarks.planned_floors.floors.driving.grid import UNREACHED, Grid, Step

MOST_EXPANDED = 3000
MOST_EXTRA_STEPS = 40
"""A plan may take this many steps more than the shortest path."""
TURN_COST = 0.01
"""Cost of a turn. Of two equally long paths the one with fewer turns is taken."""


class Planner:
    """The reservations of the robots of one vendor."""

    def __init__(self, grid: Grid) -> None:
        self._grid = grid
        self._reserved: dict[int, dict[int, int]] = {}
        """By cell and step, the robot."""
        self._ends: dict[int, tuple[int, int]] = {}
        """By robot: the last cell of its plan, and the step from which it keeps it."""
        self._kept: dict[int, int] = {}
        """By cell: the robot that keeps it."""

    def place(self, robot: int, cell: int, step: int) -> None:
        """Place a robot without a plan in a cell."""
        self._keep(robot, cell, step)

    def remove(self, robot: int) -> None:
        """Drop all reservations of a robot."""
        cell, _ = self._ends.pop(robot)
        del self._kept[cell]
        for steps in self._reserved.values():
            for step in [step for step, owner in steps.items() if owner == robot]:
                del steps[step]

    def is_kept(self, cell: int) -> bool:
        """Whether a robot's plan ends there."""
        return cell in self._kept

    def unused_from(self, cell: int, step: int) -> bool:
        """Whether no robot will use a cell from a step on."""
        return cell not in self._kept and all(used < step for used in self._reserved.get(cell, ()))

    def extend(self, robot: int, goal: int, not_before: int) -> list[Step]:
        """The steps from the end of a robot's plan to `goal`, reserved; empty where there is no way.

        The robot leaves its cell at `not_before` or later.
        """
        cell, step = self._ends[robot]
        starts = max(step, not_before)
        way = self._search(robot, cell, starts, goal)
        if not way:
            return []
        waited = [(cell, at) for at in range(step, starts)]
        for place, at in [*waited, *way]:
            self._reserved.setdefault(place, {})[at] = robot
        del self._kept[cell]
        self._keep(robot, *way[-1])
        return way

    def _keep(self, robot: int, cell: int, step: int) -> None:
        self._ends[robot] = cell, step
        self._kept[cell] = robot

    def _search(self, robot: int, start: int, starts: int, goal: int) -> list[Step]:
        """Steps from the start on, in time."""
        to_go = self._grid.distances(goal).tolist()
        if to_go[start] == UNREACHED or self._kept.get(goal, robot) != robot:
            return []
        last_used = max((at for at, owner in self._reserved.get(goal, {}).items() if owner != robot), default=-1)
        latest = starts + to_go[start] + MOST_EXTRA_STEPS
        came_from: dict[Step, Step | None] = {(start, starts): None}
        waiting: list[tuple[float, int, int, int, int]] = [(float(to_go[start]), 0, start, starts, 0)]
        for _ in range(MOST_EXPANDED):
            if not waiting:
                break
            cost, _, cell, at, before = heapq.heappop(waiting)
            if cell == goal and at > last_used + 1:
                return list(_back(came_from, (cell, at)))
            for after in (*self._grid.neighbours(cell), cell):
                reached = (after, at + 1)
                if reached in came_from or at + 1 > latest or not self._free(robot, after, at + 1):
                    continue
                came_from[reached] = (cell, at)
                turn = TURN_COST if after != cell and before not in (0, after - cell) else 0.0
                step_cost = 1 + to_go[after] - to_go[cell] + turn
                direction = after - cell if after != cell else before
                heapq.heappush(waiting, (cost + step_cost, -at, after, at + 1, direction))
        return []

    def _free(self, robot: int, cell: int, at: int) -> bool:
        keeper = self._kept.get(cell, robot)
        if keeper != robot and at >= self._ends[keeper][1] - 1:
            return False
        reserved = self._reserved.get(cell)
        return not reserved or all(reserved.get(at + k, robot) == robot for k in (-1, 0, 1))


def _back(came_from: dict[Step, Step | None], step: Step) -> Iterator[Step]:
    way = [step]
    while (before := came_from[way[-1]]) is not None:
        way.append(before)
    return reversed(way)
