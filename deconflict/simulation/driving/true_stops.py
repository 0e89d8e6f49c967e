"""For whom robots really gave way in a simulated span, to hold advisories against."""

from dataclasses import dataclass

from deconflict.simulation.driving.protection import NOBODY
from deconflict.simulation.driving.traffic import Doing, World

FAST_MPS = 0.3
"""A robot that was slower did not give way: it stood already."""
SAME_S = 1.0
"""A robot that gives way to the same other again this soon has not stopped doing so."""
FRESH_S = 15.0
"""A stop is fresh where the pair had none so shortly before."""
LEAST_STANDING_S = 1.0


@dataclass(slots=True)
class Stop:
    """One robot that brakes, slows down or swerves for another. Times are the world's."""

    robot: int
    other: int
    start_s: float
    start_mps: float
    """How fast it was before."""
    last_s: float
    """When it gave way last."""
    ordered: bool
    """Whether both are of one fleet, which orders who goes first."""
    fresh: bool
    """Whether it was fast, and neither of the pair had given way to the other lately."""
    standing_s: float = 0.0
    passed: bool = False
    """Whether it left its way to go past the other."""

    @property
    def counts(self) -> bool:
        """Whether somebody should have been told of it before."""
        return self.fresh and not self.ordered and (self.passed or self.standing_s >= LEAST_STANDING_S)


class Stops:
    """Every stop so far, by start; `look` after each step of the world."""

    def __init__(self, world: World) -> None:
        self.found: list[Stop] = []
        self._world = world
        self._now: list[Stop | None] = [None] * len(world)
        self._last_s: dict[tuple[int, int], float] = {}
        """When either of a pair gave way to the other last."""
        self._before_mps = world.speed_mps.copy()

    def look(self, dt_s: float) -> None:
        """Take in what happened in the last `dt_s`."""
        world = self._world
        for robot in range(len(world)):
            other = int(world.yields_to[robot])
            ordered = other == NOBODY and world.waits.blocker[robot] != NOBODY
            if ordered:
                other = int(world.waits.blocker[robot])
            if other != NOBODY and world.doing[robot] in {Doing.DRIVING, Doing.BACKING}:
                self._go_on(robot, other, ordered, dt_s)
        self._before_mps = world.speed_mps.copy()

    def _go_on(self, robot: int, other: int, ordered: bool, dt_s: float) -> None:
        world, stop = self._world, self._now[robot]
        pair = (min(robot, other), max(robot, other))
        if stop is None or stop.other != other or world.t_s - stop.last_s > SAME_S:
            before_mps = abs(float(self._before_mps[robot]))
            fresh = before_mps > FAST_MPS and world.t_s - self._last_s.get(pair, -FRESH_S) >= FRESH_S
            stop = self._now[robot] = Stop(robot, other, world.t_s, before_mps, world.t_s, ordered, fresh)
            self.found.append(stop)
        stop.last_s = self._last_s[pair] = world.t_s
        stop.passed |= bool(world.passings.past[robot] == other)
        stop.standing_s += dt_s * (abs(float(world.speed_mps[robot])) < 0.05)
