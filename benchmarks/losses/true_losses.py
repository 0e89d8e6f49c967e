"""The true losses of a simulated floor: how much later each robot is than on a free path, and because of which robot.

The loss of a step is the part of it that a robot would not have needed on a free path: 1 less its speed over the speed
that its path allows there. So the losses of a drive add up to its delay. What limits a robot names the cause. The cause
stands until the robot is as fast again as its path allows.
"""

from collections import defaultdict

import numpy as np

from deconflict.simulation.driving.protection import NOBODY
from deconflict.simulation.driving.traffic import Activity, World
from ingest.batch import Ints

FREE_SHARE = 0.97
"""A robot that is this fast, as a share of what its path allows, is free again."""
LEAST_MPS = 0.06
"""Least allowed speed of a path."""

LostBySecond = dict[tuple[int, int], dict[int, float]]
"""By robot and cause, and by whole second: the lost seconds."""


class TrueLosses:
    """Adds up the losses of a world. Call `update` after each step."""

    def __init__(self, world: World) -> None:
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
        self._cause = np.where(slowed_by != NOBODY, slowed_by, np.where(is_free, NOBODY, self._cause))
        lost_s = np.where(driving, 1.0 - share, 0.0) * dt_s
        second = int(world.t_s)
        for robot in np.flatnonzero(driving & (self._cause != NOBODY)).tolist():
            self.by_pair[robot, int(self._cause[robot])][second] += float(lost_s[robot])
        self.unexplained_s += float(lost_s[driving & (self._cause == NOBODY)].sum())
