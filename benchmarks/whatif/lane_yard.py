"""A yard where robots meet in a narrow lane between two sides.

Each robot drives between its station in the west and its station in the east. Most take the lane; the others, and those
that may not, take the bypass, where each direction has a lane of its own.
"""

from dataclasses import dataclass, replace
from itertools import pairwise
from math import hypot

import numpy as np
import shapely

from benchmarks.whatif.yards import MAKES, MadeYard, Yard
from deconflict.simulation.driving.routes import drive, standing
from deconflict.simulation.floor_layout import Place
from ingest.batch import Floats
from metrics.whatif.change import NamedOutline

LENGTH_M, BYPASS_Y_M, KEEPS_RIGHT_M = 24.0, 7.0, 1.1
LANE_HALF_M = 0.9
"""Distance from the middle of the lane to what is beside it."""
MIDDLE_MAKES = tuple(replace(make, lane_m=0.0) for make in MAKES)
BEFORE_MOUTH_M = 2.5
STAY_S = (10.0, 40.0)
BYPASS_SHARE = 0.2
"""Share of the trips that take the bypass though they may take the lane."""
LANE = NamedOutline(
    "Lane", 0, shapely.box(2.5, -LANE_HALF_M, LENGTH_M - 2.5, LANE_HALF_M), ((0.0, 0.0), (LENGTH_M, 0.0))
)


@dataclass(frozen=True, slots=True)
class LaneChange:
    """What is changed in the yard. The default is the yard as it is."""

    one_way: bool = False
    """Only towards larger x."""
    turned_make: int | None = None
    """Robots of this one of the makes have the one-way lane the wrong way round on their map."""
    wider_m: float = 0.0
    two_lanes: bool = False
    """Robots keep right in the lane."""


class LaneYard(Yard):
    """The robots of a yard with a lane. They drive in its middle."""

    step_s = 0.2

    def __init__(self, robots: int, change: LaneChange, rng: np.random.Generator) -> None:
        super().__init__(robots, rng, MIDDLE_MAKES, LANE_HALF_M)
        self._change, self._east = change, rng.random(robots) < 0.5
        """(n,) whether each is in the east."""
        self._mouth_m = np.zeros(robots)
        """(n,) progress of each where it enters the lane or the bypass."""
        self.until_s = rng.uniform(0.0, 2 * STAY_S[1], robots)
        for robot in range(robots):
            east = bool(self._east[robot])
            self._place(robot, standing(_station(robot, east=east), 0.0 if east else np.pi))

    def step(self, dt_s: float) -> None:
        if self._change.wider_m:
            self.passings.more_room_m = self._more_room_m()
        super().step(dt_s)

    def _more_room_m(self) -> Floats:
        x_m, y_m, _ = self.locations().T
        return np.where(LANE.holds(x_m, y_m), self._change.wider_m / 2, 0.0)

    def _leave(self, robot: int) -> None:
        from_east = bool(self._east[robot])
        is_against = from_east != (robot % len(MAKES) == self._change.turned_make)
        bypass = self._rng.random() < BYPASS_SHARE or (is_against and self._change.one_way)
        y_m = self._lane_y_m(bypass=bypass, from_east=from_east)
        corners = _corners(robot, y_m, from_east=from_east)
        self._east[robot] = not from_east
        self._mouth_m[robot] = sum(hypot(b[0] - a[0], b[1] - a[1]) for a, b in pairwise(corners[:3]))
        self._set_out(robot, drive(corners, self.heading_rad(robot), self._makes[robot]), [])

    def _lane_y_m(self, *, bypass: bool, from_east: bool) -> float:
        right_m = KEEPS_RIGHT_M if from_east else -KEEPS_RIGHT_M
        if bypass:
            return BYPASS_Y_M + right_m
        return right_m if self._change.two_lanes else 0.0

    def _end_mutual_wait(self, robot: int) -> None:
        """One of those that meet in the lane backs out of it."""
        self.back_off(robot)
        self.back_to_m[robot] = max(float(self._mouth_m[robot]) - BEFORE_MOUTH_M, 0.0)

    def _arrived(self, _robot: int) -> float:
        self.arrivals += 1
        return float(self._rng.uniform(*STAY_S))


def lane_yard(robots: int, change: LaneChange = LaneChange()) -> MadeYard:
    return lambda rng: LaneYard(robots, change, rng)


def _station(robot: int, *, east: bool) -> Place:
    """Stations are in a column below the lane on either side."""
    return (LENGTH_M + 5.0 if east else -5.0), -6.0 - 4.0 * robot


def _corners(robot: int, lane_y_m: float, *, from_east: bool) -> list[Place]:
    """The way from one side to the other. In the columns beside the stations robots keep right."""
    start, goal = _station(robot, east=from_east), _station(robot, east=not from_east)
    up_x_m, down_x_m = (
        (LENGTH_M + KEEPS_RIGHT_M, -KEEPS_RIGHT_M) if from_east else (KEEPS_RIGHT_M, LENGTH_M - KEEPS_RIGHT_M)
    )
    return [start, (up_x_m, start[1]), (up_x_m, lane_y_m), (down_x_m, lane_y_m), (down_x_m, goal[1]), goal]
