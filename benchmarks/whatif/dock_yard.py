"""A yard where robots queue for docks.

Robots drive counterclockwise around a loop from their own rack to the docks and back. They choose a dock with the
fewest robots on their way to it, and queue behind each other.
"""

import numpy as np
import shapely

from benchmarks.whatif.yards import MadeYard, Yard
from deconflict.simulation.driving.routes import drive, standing
from deconflict.simulation.floor_layout import Place
from metrics.whatif.change import NamedOutline

DOCK_S, RACK_S = (15.0, 25.0), (20.0, 60.0)
"""Ranges of the stay at a dock and at the rack."""
DOCK_X_M, NEXT_DOCK_M, RACKS_Y_M = 20.0, -1.9, 12.0
DOCK = NamedOutline("Dock", 0, shapely.box(DOCK_X_M - 1.5, -0.8, DOCK_X_M + 1.5, 0.8))


class DockYard(Yard):
    """The robots of a yard with docks."""

    def __init__(self, robots: int, docks: int, rng: np.random.Generator) -> None:
        super().__init__(robots, rng)
        self._racks = [(6.0 + 4.0 * number, RACKS_Y_M) for number in range(robots)]
        self._docks, self._dock_of = docks, np.full(robots, -1)
        """(n,) the dock at which, or on the way to which, each is."""
        self.until_s = rng.uniform(0.0, RACK_S[1], robots)
        for robot, rack in enumerate(self._racks):
            self._place(robot, standing(rack, np.pi / 2))

    def _leave(self, robot: int) -> None:
        yaw_rad = self.heading_rad(robot)
        if self._dock_of[robot] < 0:
            counts = [int((self._dock_of == dock).sum()) for dock in range(self._docks)]
            self._dock_of[robot] = int(np.argmin(counts))
            corners = _to_dock(self._racks[robot], int(self._dock_of[robot]))
        else:
            corners = _to_dock(self._racks[robot], int(self._dock_of[robot]), back=True)
            self._dock_of[robot] = -1
        self._set_out(robot, drive(corners, yaw_rad, self._makes[robot]), [])

    def _arrived(self, robot: int) -> float:
        self.arrivals += 1
        return float(self._rng.uniform(*(RACK_S if self._dock_of[robot] < 0 else DOCK_S)))


def dock_yard(robots: int, docks: int) -> MadeYard:
    return lambda rng: DockYard(robots, docks, rng)


def _to_dock(rack: Place, dock: int, *, back: bool = False) -> list[Place]:
    """The way from a rack to a dock, or back."""
    x_m, y_m = DOCK_X_M, NEXT_DOCK_M * dock
    if back:
        beyond = [(x_m + 3.0, y_m), (x_m + 6.0, 0.0)] if dock else []
        return [(x_m, y_m), *beyond, (50.0, 0.0), (50.0, 16.0), (rack[0], 16.0), rack]
    before = [(x_m - 6.0, 0.0), (x_m - 3.0, y_m)] if dock else []
    return [rack, (rack[0], 8.0), (0.0, 8.0), (0.0, 0.0), *before, (x_m, y_m)]
