from itertools import pairwise

import numpy as np
import pytest

from benchmarks.planned_floors.floors.driving.grid import Step, racks
from benchmarks.planned_floors.floors.planning.planner import Planner


@pytest.mark.parametrize("seed", range(3))
def test_a_cell_is_free_for_a_step_between_two_robots(seed: int) -> None:
    rng = np.random.default_rng(seed)
    grid = racks(12, 12, 1, rng)
    free = np.flatnonzero(~grid.blocked)
    planner = Planner(grid)
    used: dict[Step, int] = {}
    plans: dict[int, list[Step]] = {}
    for robot, cell in enumerate(rng.choice(free, 8, replace=False).tolist()):
        planner.place(robot, cell, 0)
        plans[robot] = [(cell, 0)]
    for _ in range(6):
        for robot, plan in plans.items():
            goal = int(rng.choice(free))
            if way := planner.extend(robot, goal, plan[-1][1]):
                assert way[0] == plan[-1]
                assert way[-1][0] == goal
                plan.extend(way[1:])
    latest = max(plan[-1][1] for plan in plans.values())
    for robot, plan in plans.items():
        assert all(
            after in (*grid.neighbours(cell), cell) and to == at + 1 for (cell, at), (after, to) in pairwise(plan)
        )
        stands = [(plan[-1][0], at) for at in range(plan[-1][1] + 1, latest + 1)]
        for step in [*plan, *stands]:
            assert used.setdefault(step, robot) == robot
    for (cell, at), robot in used.items():
        assert used.get((cell, at + 1), robot) == robot
