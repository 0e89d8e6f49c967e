"""The true losses of a simulated floor: how much later each robot is than on a free path, and because of whom."""

from collections import defaultdict

import numpy as np

from deconflict.foresight.losses.loss import LossKind, kind_of, root_of
from deconflict.foresight.losses.loss_places import LossPlaces
from deconflict.foresight.motion_assumptions import MOVES_MPS
from deconflict.simulation.driving.lost_time import CausedDelays
from deconflict.simulation.driving.protection import NOBODY
from deconflict.simulation.driving.traffic import World
from deconflict.simulation.vendors.dialects import GROUND_ID, MEZZANINE_ID

FLOORS = (GROUND_ID, MEZZANINE_ID)
LostBySecond = dict[tuple[int, int], dict[int, float]]
"""By robot and cause, and by whole second: the lost seconds."""
LostByLabel = dict[str, dict[int, float]]
"""By place or kind, and by whole second: the lost seconds."""


class TrueLosses:
    """Adds up the losses of a world. Call `update` after each step."""

    def __init__(self, world: World, places: LossPlaces) -> None:
        self._places = places
        self.by_place: LostByLabel = defaultdict(lambda: defaultdict(float))
        self.by_kind: LostByLabel = defaultdict(lambda: defaultdict(float))
        self._began: dict[int, tuple[str, LossKind]] = {}
        """By robot that loses time, the place where it began, and the kind then."""
        self._world, self._delays = world, CausedDelays(world)
        self.by_pair: LostBySecond = defaultdict(lambda: defaultdict(float))
        """The cause is a row of the world."""
        self.unexplained_s = 0.0
        """Lost without another robot: stuck robots, pauses of people, and errors of the steps."""

    def update(self, dt_s: float) -> None:
        world, delays, before = self._world, self._delays, self._delays.cause
        delays.update(dt_s)
        driving, lost_s = delays.driving, delays.lost_s
        second = int(world.t_s)
        for robot in np.flatnonzero(driving & (delays.cause != NOBODY)).tolist():
            if delays.cause[robot] != before[robot] or robot not in self._began:
                self._began[robot] = self._label(robot)
            place, kind = self._began[robot]
            self.by_pair[robot, int(delays.cause[robot])][second] += float(lost_s[robot])
            if not world.person[robot]:
                self.by_place[place][second] += float(lost_s[robot])
                self.by_kind[kind.value][second] += float(lost_s[robot])
        self.unexplained_s += float(lost_s[driving & (delays.cause == NOBODY)].sum())

    def _label(self, robot: int) -> tuple[str, LossKind]:
        world, cause = self._world, self._delays.cause
        by = int(cause[robot])
        x_m, y_m, yaw_rad = world.locations()[robot]
        _, for_each_other = root_of(cause, robot)
        kind = kind_of(
            float(world.locations()[by][2] - yaw_rad),
            stands=bool(abs(world.speed_mps[by]) < MOVES_MPS),
            waits=bool(cause[by] != NOBODY),
            for_each_other=for_each_other,
        )
        return self._places.place_at(FLOORS[int(world.floor[robot])], float(x_m), float(y_m)), kind
