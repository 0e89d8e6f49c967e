"""Fleets whose plans for all steps are made before the floor begins, all robots of a vendor at once."""

from itertools import pairwise

import numpy as np

from benchmarks.planned_floors.floors.driving.driving import Driving
from benchmarks.planned_floors.floors.driving.grid import Grid
from benchmarks.planned_floors.floors.driving.visits import Visits
from benchmarks.planned_floors.floors.planning.step_plans import StepPlanner
from benchmarks.planned_floors.truth.motion import Bools
from ingest.batch import Floats

STEPS_PER_S = 1.0
"""A robot drives less than a cell in a second."""


class StepFleets:
    """Plans of all robots. A robot's fleet is the index of its vendor."""

    def __init__(self, grid: Grid, fleet_of: list[int], rng: np.random.Generator, seconds: float) -> None:
        self._grid = grid
        self.visits = Visits(grid, fleet_of)
        self.goals: list[list[tuple[int, int]]] = [[] for _ in fleet_of]
        """By robot: the visit and the cell at which each errand ends."""
        cells = rng.choice(np.flatnonzero(~grid.blocked), len(fleet_of), replace=False).tolist()
        for fleet in range(max(fleet_of) + 1):
            robots = [robot for robot, of_fleet in enumerate(fleet_of) if of_fleet == fleet]
            planner = StepPlanner(grid, [cells[robot] for robot in robots], rng)
            planner.plan(round(seconds * STEPS_PER_S) + 20)
            for robot, steps, ends in zip(robots, planner.steps, planner.ends, strict=True):
                visit_of_step = np.cumsum([0, *(a[0] != b[0] for a, b in pairwise(steps))])
                self.visits.extend(robot, steps)
                self.goals[robot] = [(int(visit_of_step[step]), cell) for step, cell in ends]

    def plan(self, driving: Driving, present: Bools) -> None:
        """All is planned."""

    def withdraw(self, robot: int, visit: int) -> None:
        raise NotImplementedError("robots of these floors are not carried away")

    def put_back(self, robot: int, driving: Driving, poses: Floats, present: Bools) -> bool:
        raise NotImplementedError("robots of these floors are not carried away")

    def errand(self, robot: int, visit: int) -> tuple[int, float, float] | None:
        """The end of a robot's present errand: the number of visits until then, and the cell."""
        goals = self.goals[robot]
        while goals and goals[0][0] <= visit:
            goals.pop(0)
        return (goals[0][0] - visit, *self._grid.place_m(goals[0][1])) if goals else None
