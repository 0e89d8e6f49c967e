"""The vendors' fleets on one floor. Each plans for its own robots and does not know the others."""

import numpy as np

from benchmarks.planned_floors.floors.driving.driving import Driving
from benchmarks.planned_floors.floors.driving.grid import Grid
from benchmarks.planned_floors.floors.driving.visits import Visits
from benchmarks.planned_floors.floors.planning.planner import Planner
from benchmarks.planned_floors.truth.motion import Bools
from ingest.batch import Floats

LEAST_ERRAND_CELLS = 5
PLANNED_AHEAD = 14
"""A robot gets its next errand when its plan holds fewer visits than this."""
COMMITTED = 2
"""A driving robot can't be made to wait within this many visits ahead."""
GOALS_TRIED = 4
CLEAR_M = 3.0
"""A robot that comes back is placed at least this far from all others."""


class Fleets:
    """Plans of all robots. A robot's fleet is the index of its vendor."""

    def __init__(self, grid: Grid, fleet_of: list[int], rng: np.random.Generator) -> None:
        n = len(fleet_of)
        self._grid, self._fleet_of, self._rng = grid, fleet_of, rng
        self._planners = [Planner(grid) for _ in range(max(fleet_of) + 1)]
        self._free = np.flatnonzero(~grid.blocked)
        self.visits = Visits(grid, fleet_of)
        self.goals: list[list[tuple[int, int]]] = [[] for _ in range(n)]
        """By robot: the visit and the cell at which each errand ends."""
        for robot, cell in enumerate(rng.choice(self._free, n, replace=False).tolist()):
            self._place(robot, cell, 0)

    def plan(self, driving: Driving, present: Bools) -> None:
        """Give new errands to robots whose plan ends soon."""
        visit = driving["visit"]
        for robot in np.flatnonzero(present & (self.visits.count - visit < PLANNED_AHEAD)).tolist():
            self._next_errand(robot, self._frontier(self._fleet_of[robot], driving, present) + 1)

    def withdraw(self, robot: int, visit: int) -> None:
        """Remove a robot that is carried away from the cell of a visit."""
        self._planners[self._fleet_of[robot]].remove(robot)
        self.visits.withdraw(robot, visit)
        self.goals[robot].clear()

    def put_back(self, robot: int, driving: Driving, poses: Floats, present: Bools) -> bool:
        """Place a robot in a cell that its fleet does not need. Returns False if none was found."""
        fleet = self._fleet_of[robot]
        step = self._frontier(fleet, driving, present) + 1
        for cell in self._rng.choice(self._free, 10, replace=False).tolist():
            away_m = np.hypot(*(poses[present, :2] - np.array(self._grid.place_m(cell))).T)
            if (away_m > CLEAR_M).all() and self._planners[fleet].unused_from(cell, step - 1):
                self._place(robot, cell, step)
                return True
        return False

    def _place(self, robot: int, cell: int, step: int) -> None:
        self._planners[self._fleet_of[robot]].place(robot, cell, step)
        self.visits.extend(robot, [(cell, step)])

    def _frontier(self, fleet: int, driving: Driving, present: Bools) -> int:
        """The latest step of the fleet's plan that a robot has begun, or can no longer wait before."""
        latest = 0
        for robot, of_fleet in enumerate(self._fleet_of):
            if of_fleet == fleet and present[robot]:
                visit = min(int(driving["visit"][robot]) + COMMITTED, int(self.visits.count[robot]) - 1)
                latest = max(latest, self.visits.step(robot, visit))
        return latest

    def _next_errand(self, robot: int, not_before: int) -> None:
        planner = self._planners[self._fleet_of[robot]]
        last = self.visits.cell(robot, int(self.visits.count[robot]) - 1)
        away = self._grid.distances(last)[self._free]
        far = self._free[(away >= LEAST_ERRAND_CELLS) & (away < len(self._grid.blocked))]
        for goal in self._rng.choice(far, GOALS_TRIED).tolist():
            if planner.is_kept(goal):
                continue
            if way := planner.extend(robot, goal, not_before):
                self.visits.extend(robot, way)
                self.goals[robot].append((int(self.visits.count[robot]) - 1, goal))
                return

    def errand(self, robot: int, visit: int) -> tuple[int, float, float] | None:
        """The end of a robot's present errand: the number of visits until then, and the cell."""
        goals = self.goals[robot]
        while goals and goals[0][0] <= visit:
            goals.pop(0)
        return (goals[0][0] - visit, *self._grid.place_m(goals[0][1])) if goals else None
