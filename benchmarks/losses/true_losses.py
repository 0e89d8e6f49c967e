"""The true losses of a simulated floor: how much later each robot is than on a free path, and because of which robot.

The loss of a step is the part of it that a robot would not have needed on a free path: 1 less its speed over the speed
that its path allows there. So the losses of a drive add up to its delay. What limits a robot names the cause. The cause
stands until the robot is as fast again as its path allows.
"""

from collections import defaultdict

import numpy as np

from deconflict.foresight.losses.loss import LossKind, kind_of, root_of
from deconflict.foresight.losses.loss_places import LossPlaces
from deconflict.foresight.motion_assumptions import MOVES_MPS
from deconflict.simulation.driving.protection import NOBODY
from deconflict.simulation.driving.traffic import Activity, World
from deconflict.simulation.vendors.dialects import GROUND_ID, MEZZANINE_ID
from ingest.batch import Ints

FREE_SHARE = 0.97
"""A robot that is this fast, as a share of what its path allows, is free again."""
LEAST_MPS = 0.06
"""Least allowed speed of a path."""

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
        self._world, self._rows = world, np.arange(len(world))
        self._cause: Ints = np.full(len(world), NOBODY)
        self.by_pair: LostBySecond = defaultdict(lambda: defaultdict(float))
        """The cause is a row of the world."""
        self.unexplained_s = 0.0
        """Lost without another robot: stuck robots, pauses of people, and errors of the steps."""

    def update(self, dt_s: float) -> None:
        world = self._world
        driving = np.isin(world.doing, (Activity.DRIVING, Activity.BACKING, Activity.HOLDING))
        free_mps = np.maximum(world.tracks.speed_mps(self._rows, world.progress_m) * world.pace, LEAST_MPS)
        share = world.speed_mps / free_mps
        slowed_by = np.where(driving, world.braking.slowed_by, NOBODY)
        is_free = (world.doing == Activity.STANDING) | (driving & (slowed_by == NOBODY) & (share >= FREE_SHARE))
        before = self._cause
        self._cause = np.where(slowed_by != NOBODY, slowed_by, np.where(is_free, NOBODY, self._cause))
        lost_s = np.where(driving, 1.0 - share, 0.0) * dt_s
        second = int(world.t_s)
        for robot in np.flatnonzero(driving & (self._cause != NOBODY)).tolist():
            if self._cause[robot] != before[robot] or robot not in self._began:
                self._began[robot] = self._label(robot)
            place, kind = self._began[robot]
            self.by_pair[robot, int(self._cause[robot])][second] += float(lost_s[robot])
            if not world.person[robot]:
                self.by_place[place][second] += float(lost_s[robot])
                self.by_kind[kind.value][second] += float(lost_s[robot])
        self.unexplained_s += float(lost_s[driving & (self._cause == NOBODY)].sum())

    def _label(self, robot: int) -> tuple[str, LossKind]:
        world, by = self._world, int(self._cause[robot])
        x_m, y_m, yaw_rad = world.locations()[robot]
        _, for_each_other = root_of(self._cause, robot)
        kind = kind_of(
            float(world.locations()[by][2] - yaw_rad),
            stands=bool(abs(world.speed_mps[by]) < MOVES_MPS),
            waits=bool(self._cause[by] != NOBODY),
            for_each_other=for_each_other,
        )
        return self._places.place_at(FLOORS[int(world.floor[robot])], float(x_m), float(y_m)), kind
