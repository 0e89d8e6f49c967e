"""The recorded demand, driven by simulated robots.

Each robot drives its recorded ways in their order, and stays at the end of each as long as in the log. It does not set
out for a place before those that left that place before it in the log have set out. Robots that wait for each other for
long pass through each other: how a jam is cleared on the floor is not known.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from deconflict.simulation.driving.crossings import CrossingPassage
from deconflict.simulation.driving.motion import MovingRobots
from deconflict.simulation.driving.routes import Drive, standing
from deconflict.simulation.floor_layout import Place
from deconflict.simulation.participants import Chassis
from ingest.batch import Floats, Ints
from metrics.whatif.change import WiderPlace

LOOKS_AGAIN_S = 1.0
"""A robot whose next place is not left yet waits this long before it looks again."""
SHIFT_S = 4.0
"""Stays are made longer or shorter at random by at most this, differently with each seed."""
CLEARS_S = 2.0
"""Robots pass through each other for at least this long, and until they are apart."""
LONGEST_HOLD_S = 60.0
"""A robot sets out at the latest after this, even if its place is not left yet."""


@dataclass(frozen=True, slots=True, eq=False)
class SimulatedTrip:
    """A trip as a simulated robot drives it."""

    drive: Drive
    passages: tuple[CrossingPassage, ...]
    floor: int
    stay_s: float
    """At its end."""
    counts: bool
    """Whether its end counts as an arrival."""
    after: tuple[int, int] | None = None
    """A robot, and the number of the trip with which it leaves the place before."""


class RobotIdentity(NamedTuple):
    """What a robot says of itself."""

    uuid: str
    name: str
    vendor: str
    model: str


@dataclass(frozen=True, slots=True, eq=False)
class SimulatedRobot:
    """A simulated robot and its trips."""

    identity: RobotIdentity

    chassis: Chassis
    fleet: int
    start: Place
    yaw_rad: float
    floor: int
    from_s: float
    """When it appears."""
    stay_s: float
    """At the start."""
    trips: tuple[SimulatedTrip, ...]
    goes_first: bool = False
    """Whether all others let it go first."""


class ReplayedFloor(MovingRobots):
    """All robots of a plan. A robot that has driven all its trips stays where it is."""

    def __init__(
        self,
        robots: Sequence[SimulatedRobot],
        crossing_places: Sequence[Place],
        rng: np.random.Generator,
        room_m: float,
        wider: Sequence[WiderPlace] = (),
    ) -> None:
        self._robots, self._wider = robots, wider
        self.identities = [robot.identity for robot in robots]
        n = len(robots)
        fleet: Ints = np.array([robot.fleet for robot in robots], np.int64)
        super().__init__([robot.chassis for robot in robots], fleet, crossing_places, rng, room_m)
        self.goes_first = np.array([robot.goes_first for robot in robots], np.bool_)
        self._jam_s = np.zeros(n)
        self._next = np.zeros(n, np.int64)
        """(n,) number of the next trip of each."""
        self._on_floor: Ints = np.array([robot.floor for robot in robots], np.int64)
        self._hidden = np.ones(n, np.bool_)
        """(n,) whether each has not appeared yet."""
        self._held_s = np.zeros(n)
        bodies = [robot.chassis.body for robot in robots]
        self._radius_m = np.array([np.hypot(body.length_m, body.width_m) / 2 for body in bodies])
        self._cleared_s = np.full(n, np.inf)
        """(n,) since when each passes through others; inf if it does not."""
        self.arrivals = np.zeros(n)
        """(n,) trips that count and have ended."""
        self._shifts_s: list[Floats] = [rng.uniform(-SHIFT_S, SHIFT_S, len(robot.trips) + 1) for robot in robots]
        for row, robot in enumerate(robots):
            self._place(row, standing(robot.start, robot.yaw_rad))
            self.until_s[row] = robot.from_s

    @property
    def floor(self) -> Ints:
        """(n,) A robot that is not there has a floor of its own."""
        apart = self._hidden | np.isfinite(self._cleared_s)
        return np.where(apart, -1 - np.arange(len(self)), self._on_floor)

    def step(self, dt_s: float) -> None:
        if self._wider:
            self.passings.more_room_m, self._jam_s = self._wider_now()
        super().step(dt_s)
        for robot in np.flatnonzero(np.isfinite(self._cleared_s)).tolist():
            if self.t_s - self._cleared_s[robot] > CLEARS_S and self._is_free(robot):
                self._cleared_s[robot] = np.inf

    def _wider_now(self) -> tuple[Floats, Floats]:
        """(n,) further room where each is, and (n,) how long a jam lasts there."""
        x_m, y_m, _ = self.locations().T
        room_m, jam_s = np.zeros(len(self)), np.zeros(len(self))
        for place in self._wider:
            inside = place.outline.holds(x_m, y_m) & (self._on_floor == place.outline.floor)
            room_m[inside], jam_s[inside] = place.beside_m, place.jam_s
        return room_m, jam_s

    def _end_mutual_wait(self, robot: int) -> None:
        if self.waits.waited_s[robot] < self._jam_s[robot]:
            return
        self._cleared_s[robot] = self.t_s
        self.braking.let_go(robot)
        self.braking.creep(robot, self.t_s)
        self.waits.restart(robot)

    def _is_free(self, robot: int) -> bool:
        """Whether no other is where a robot is."""
        here = self.locations()[:, :2]
        reach_m = self._radius_m + self._radius_m[robot]
        near = (np.hypot(*(here - here[robot]).T) < reach_m) & (self.floor == self._on_floor[robot])
        near[robot] = False
        return not near.any()

    def _leave(self, robot: int) -> None:
        plan = self._robots[robot]
        if self._hidden[robot]:
            self._hidden[robot] = False
            self.until_s[robot] = self.t_s + self._shifted_s(robot, plan.stay_s, 0)
            return
        number = int(self._next[robot])
        if number >= len(plan.trips):
            self.until_s[robot] = np.inf
            return
        trip = plan.trips[number]
        if trip.after and self._next[trip.after[0]] <= trip.after[1] and self._held_s[robot] < LONGEST_HOLD_S:
            self._held_s[robot] += LOOKS_AGAIN_S
            self.until_s[robot] = self.t_s + LOOKS_AGAIN_S
            return
        self._held_s[robot] = 0.0
        self._next[robot] += 1
        self._on_floor[robot] = trip.floor
        self._set_out(robot, trip.drive, list(trip.passages))

    def _arrived(self, robot: int) -> float:
        number = int(self._next[robot])
        trip = self._robots[robot].trips[number - 1]
        self.arrivals[robot] += trip.counts
        return self._shifted_s(robot, trip.stay_s, number)

    def _shifted_s(self, robot: int, stay_s: float, number: int) -> float:
        return max(stay_s + float(self._shifts_s[robot][number]) * min(stay_s / SHIFT_S, 1.0), 0.0)
