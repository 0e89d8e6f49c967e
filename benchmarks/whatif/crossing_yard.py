"""A yard where two single lanes cross.

Robots of all makes drive from the end of one of the four arms to that of another one. With an order they are let in
from one side at a time, whoever comes first; without one each robot has only its protective stop.
"""

import numpy as np
import shapely

from benchmarks.whatif.lane_yard import LANE_HALF_M, MIDDLE_MAKES
from benchmarks.whatif.yards import MadeYard, Yard
from deconflict.simulation.driving.crossings import CrossingEntry
from deconflict.simulation.driving.routes import drive, standing
from deconflict.simulation.floor_layout import Place
from metrics.whatif.change import NamedOutline
from metrics.whatif.simulated.ordered_places import with_order

ARMS = 4
HALF_M, OUTER_M, MOUTH_M, KEEPS_RIGHT_M = 9.0, 14.0, 2.6, 1.1
FIRST_BAY_M, NEXT_BAY_M = 6.0, 4.0
STAY_S = (20.0, 50.0)
LONG_M = HALF_M + MOUTH_M
CROSSING = NamedOutline(
    "Crossing",
    0,
    shapely.box(-LONG_M, -MOUTH_M, LONG_M, MOUTH_M).union(shapely.box(-MOUTH_M, -LONG_M, MOUTH_M, LONG_M)),
)


class CrossingYard(Yard):
    """The robots of a yard with a crossing."""

    def __init__(self, robots: int, rng: np.random.Generator, *, is_ordered: bool) -> None:
        super().__init__(robots, rng, MIDDLE_MAKES, LANE_HALF_M)
        self._is_ordered, self._arm = is_ordered, rng.integers(0, ARMS, robots)
        """(n,) the arm at whose end each is."""
        if is_ordered:
            self.crossings.shared = frozenset({0})
            self.lines = CrossingEntry(self.crossings, [(0.0, 0.0)], robots)
        self.until_s = rng.uniform(0.0, 2 * STAY_S[1], robots)
        for robot in range(robots):
            self._place(robot, standing(_out(robot, int(self._arm[robot]))[0], 0.0))

    def _leave(self, robot: int) -> None:
        start, goal = int(self._arm[robot]), int((self._arm[robot] + self._rng.integers(1, ARMS)) % ARMS)
        way = drive(_corners(robot, start, goal), self.heading_rad(robot), self._makes[robot])
        self._arm[robot] = goal
        self._set_out(robot, way, list(with_order(way, 0, (), [CROSSING], 0) if self._is_ordered else ()))

    def _arrived(self, _robot: int) -> float:
        self.arrivals += 1
        return float(self._rng.uniform(*STAY_S))


def _out(robot: int, arm: int) -> list[Place]:
    """The way from a robot's bay beside an arm into the arm."""
    bay_m, column_m = FIRST_BAY_M + NEXT_BAY_M * robot, KEEPS_RIGHT_M - HALF_M
    return [_turned(place, arm) for place in ((-OUTER_M, -bay_m), (column_m, -bay_m), (column_m, 0.0))]


def _corners(robot: int, start: int, goal: int) -> list[Place]:
    """The way from the bay at the end of one arm to that at another one."""
    out, bay_m, column_m = _out(robot, start), FIRST_BAY_M + NEXT_BAY_M * robot, -KEEPS_RIGHT_M - HALF_M
    way_in = [_turned(place, goal) for place in ((column_m, 0.0), (column_m, -bay_m), (-OUTER_M, -bay_m))]
    return [*out, *([(0.0, 0.0)] if (goal - start) % 2 else []), *way_in]


def _turned(place: Place, quarters: int) -> Place:
    for _ in range(quarters):
        place = -place[1], place[0]
    return place


def crossing_yard(robots: int, *, is_ordered: bool) -> MadeYard:
    return lambda rng: CrossingYard(robots, rng, is_ordered=is_ordered)
