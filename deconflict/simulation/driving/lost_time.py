"""The time that robots lose on their way: standing, and driving more slowly than their path allows."""

from dataclasses import dataclass

import numpy as np

from deconflict.simulation.driving.motion import Activity, MovingRobots
from deconflict.simulation.driving.protection import NOBODY
from ingest.batch import Bools, Floats, Ints

STANDING_MPS, LONG_S = 0.05, 3.0
"""A slower robot stands. A stop of this length counts."""
FREE_SHARE = 0.97
"""A robot that is this fast, as a share of what its path allows, is free again."""
LEAST_MPS = 0.06
"""Least allowed speed of a path."""


@dataclass(frozen=True, slots=True)
class LostTime:
    """Sums over all robots, in seconds. What robots and people stop for by themselves does not count."""

    driven_s: float
    """On their way."""
    delay_s: float
    """Lost for whatever cause, compared with the speed that the path allows, without acceleration."""
    waited_s: float
    """Standing on the way, for others or because they were told to."""
    advised_s: float
    """The part of `waited_s` in which they were told to stand."""
    stops: int
    """Stops of `LONG_S` or more."""
    stopped_s: float
    """Total length of these."""
    trips: int
    """Arrivals at a bay."""


class LostTimeCounter:
    """Adds up the lost time of a world. Call `update` after each step."""

    def __init__(self, world: MovingRobots) -> None:
        self._world, self._rows = world, np.arange(len(world))
        self._driven_s = self._delay_s = self._waited_s = self._advised_s = self._stopped_s = 0.0
        self._stops = self._trips = 0
        self._standing_s = np.zeros(len(world))
        """(n,) how long each has stood on its way; 0 if it does not."""
        self._was_driving = np.zeros(len(world), np.bool_)

    def update(self, dt_s: float) -> None:
        world = self._world
        driving = np.isin(world.doing, (Activity.DRIVING, Activity.BACKING, Activity.HOLDING))
        open_mps = world.tracks.speed_mps(self._rows, world.progress_m) * world.pace
        share = np.where(open_mps > STANDING_MPS, world.speed_mps / np.maximum(open_mps, STANDING_MPS), 1.0)
        standing = driving & (np.abs(world.speed_mps) < STANDING_MPS)
        instructed = world.instructions.top_mps(world.t_s) == 0.0
        self._driven_s += dt_s * float(driving.sum())
        self._delay_s += dt_s * float((1.0 - np.minimum(share, 1.0))[driving].sum())
        self._waited_s += dt_s * float(standing.sum())
        self._advised_s += dt_s * float((standing & instructed).sum())
        ended_s = self._standing_s[(self._standing_s >= LONG_S) & ~standing]
        self._stops, self._stopped_s = self._stops + len(ended_s), self._stopped_s + float(ended_s.sum())
        self._standing_s = np.where(standing, self._standing_s + dt_s, 0.0)
        self._trips += int((self._was_driving & (world.doing == Activity.STANDING)).sum())
        self._was_driving = driving

    def now(self) -> LostTime:
        """The sums so far, with the stops that last."""
        lasting_s = self._standing_s[self._standing_s >= LONG_S]
        return LostTime(
            driven_s=round(self._driven_s, 1),
            delay_s=round(self._delay_s, 1),
            waited_s=round(self._waited_s, 1),
            advised_s=round(self._advised_s, 1),
            stops=self._stops + len(lasting_s),
            stopped_s=round(self._stopped_s + float(lasting_s.sum()), 1),
            trips=self._trips,
        )


class CausedDelays:
    """Who loses time because of whom. Call `update` after each step.

    The loss of a step is the part of it that a robot would not have needed on a free path: 1 less its speed over the
    speed that its path allows there. So the losses of a drive add up to its delay. What limits a robot names the cause.
    The cause stands until the robot is as fast again as its path allows.
    """

    def __init__(self, world: MovingRobots) -> None:
        self._world, self._rows = world, np.arange(len(world))
        self.cause: Ints = np.full(len(world), NOBODY)
        """(n,) the robot because of which each loses time now."""
        self.driving: Bools = np.zeros(len(world), np.bool_)
        """(n,) whether each is on its way."""
        self.lost_s: Floats = np.zeros(len(world))
        """(n,) lost in the last step, whatever the cause."""

    def update(self, dt_s: float) -> None:
        world = self._world
        self.driving = np.isin(world.doing, (Activity.DRIVING, Activity.BACKING, Activity.HOLDING))
        free_mps = np.maximum(world.tracks.speed_mps(self._rows, world.progress_m) * world.pace, LEAST_MPS)
        share = world.speed_mps / free_mps
        slowed_by = np.where(self.driving, world.braking.slowed_by, NOBODY)
        is_free = (world.doing == Activity.STANDING) | (self.driving & (slowed_by == NOBODY) & (share >= FREE_SHARE))
        self.cause = np.where(slowed_by != NOBODY, slowed_by, np.where(is_free, NOBODY, self.cause))
        self.lost_s = np.where(self.driving, 1.0 - share, 0.0) * dt_s
