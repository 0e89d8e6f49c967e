"""The true stops in a simulated time span: which robot yielded to which. To compare advisories with."""

from dataclasses import dataclass

from deconflict.simulation.driving.motion import Activity
from deconflict.simulation.driving.protection import NOBODY
from deconflict.simulation.driving.traffic import World

FAST_MPS = 0.3
"""A robot that was slower than this did not yield: it already stood."""
SAME_S = 1.0
"""If a robot yields to the same other again after at most this time, it is the same stop."""
FRESH_S = 15.0
"""A stop is fresh if the pair had none in this time before it."""
LEAST_STANDING_S = 1.0


@dataclass(slots=True)
class TrueStop:
    """One robot that brakes, slows down or swerves for another. Times are the world's."""

    robot: int
    other: int
    start_s: float
    start_mps: float
    """Its speed before."""
    last_s: float
    """When it last yielded."""
    ordered: bool
    """Whether both are of one fleet, which decides who goes first."""
    fresh: bool
    """Whether it was fast, and neither of the pair had recently yielded to the other."""
    standing_s: float = 0.0
    passed: bool = False
    """Whether it left its path to pass the other."""

    @property
    def counts(self) -> bool:
        """Whether it should have been predicted."""
        return self.fresh and not self.ordered and (self.passed or self.standing_s >= LEAST_STANDING_S)


class Stops:
    """Every stop so far, by start. Call `update` after each step of the world."""

    def __init__(self, world: World) -> None:
        self.found: list[TrueStop] = []
        self._world = world
        self._now: list[TrueStop | None] = [None] * len(world)
        self._last_s: dict[tuple[int, int], float] = {}
        """By pair: when one last yielded to the other."""
        self._before_mps = world.speed_mps.copy()

    def update(self, dt_s: float) -> None:
        """Add what happened in the last `dt_s`."""
        world = self._world
        for robot in range(len(world)):
            other = int(world.braking.yields_to[robot])
            ordered = other == NOBODY and world.waits.blocker[robot] != NOBODY
            if ordered:
                other = int(world.waits.blocker[robot])
            if other != NOBODY and world.doing[robot] in {Activity.DRIVING, Activity.BACKING}:
                self._add_yield(robot, other, ordered, dt_s)
        self._before_mps = world.speed_mps.copy()

    def _add_yield(self, robot: int, other: int, ordered: bool, dt_s: float) -> None:
        world, stop = self._world, self._now[robot]
        pair = (min(robot, other), max(robot, other))
        if stop is None or stop.other != other or world.t_s - stop.last_s > SAME_S:
            before_mps = abs(float(self._before_mps[robot]))
            fresh = before_mps > FAST_MPS and world.t_s - self._last_s.get(pair, -FRESH_S) >= FRESH_S
            stop = self._now[robot] = TrueStop(robot, other, world.t_s, before_mps, world.t_s, ordered, fresh)
            self.found.append(stop)
        stop.last_s = self._last_s[pair] = world.t_s
        stop.passed |= bool(world.passings.past[robot] == other)
        stop.standing_s += dt_s * (abs(float(world.speed_mps[robot])) < 0.05)
