"""The robots of a floor at one step, as protective stops see them."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from benchmarks.planned_floors.floors.driving.driving import Driving
from benchmarks.planned_floors.floors.driving.grid import Grid
from benchmarks.planned_floors.floors.driving.visits import Visits
from benchmarks.planned_floors.truth.motion import Bools
from ingest.batch import Floats

LENGTH_M, WIDTH_M = 0.9, 0.7
HALF_M: Floats = np.array([LENGTH_M / 2, WIDTH_M / 2])


@dataclass(frozen=True, slots=True, eq=False)
class Scene:
    """All n robots. Arrays are (n,) unless stated."""

    now_s: float
    grid: Grid
    visits: Visits
    driving: Driving
    poses: Floats
    """(n, 3) x, y, yaw"""
    present: Bools
    wanting: Bools
    """Whether it would drive or turn without obstacles."""
    turning: Bools

    def straight_cells(self, robot: int) -> int:
        """The number of cells straight ahead in its plan."""
        visit, count = int(self.driving["visit"][robot]), int(self.visits.count[robot])
        cells = [self.visits.cell(robot, index) for index in range(visit, min(visit + 8, count))]
        ways = [after - before for before, after in pairwise(cells)]
        straight = 0
        while straight < len(ways) and ways[straight] == ways[0]:
            straight += 1
        return straight
