"""Robots and people that drive along their paths, stop for each other, and resolve mutual waits.

A robot drives its own path and knows only the plans of its own fleet. For others it has a protective stop. If it has
stood for another for long, it passes it or backs off along its path. From outside, as by a site service, it is told to
wait, or to drive slowly for a while. Where they go, and how long they stay there, says
a subclass. Time advances only by `MovingRobots.step`. All randomness comes from the given generator.
"""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import replace
from enum import IntEnum

import numpy as np

from deconflict.simulation.driving.braking import MOVING_MPS, Braking
from deconflict.simulation.driving.crossings import CrossingEntry, CrossingPassage, Crossings
from deconflict.simulation.driving.drive_table import DriveTable
from deconflict.simulation.driving.mutual_waits import PATIENCE_S, MutualWaits
from deconflict.simulation.driving.passing import HALF_AISLE_M, WALKING_MPS, Passings
from deconflict.simulation.driving.protection import Traffic, centres, may_sidestep
from deconflict.simulation.driving.routes import Drive
from deconflict.simulation.floor_layout import Place
from deconflict.simulation.participants import BodySize, Chassis
from deconflict_client.verbs import Side
from ingest.batch import Bools, Floats, Ints


class Instructions:
    """The instructions that n robots follow. Times are the world's."""

    def __init__(self, robots: int) -> None:
        self._top_mps = np.full(robots, np.inf)
        self._until_s = np.zeros(robots)

    def wait(self, robot: int, seconds: float, now_s: float) -> None:
        """Let a robot stand, after what it was told before."""
        starts_s = max(self._until_s[robot], now_s) if self._top_mps[robot] == 0.0 else now_s
        self._top_mps[robot], self._until_s[robot] = 0.0, starts_s + seconds

    def slow_down(self, robot: int, top_mps: float, seconds: float, now_s: float) -> None:
        """Let a robot drive at most at this speed, instead of what it was told before."""
        self._top_mps[robot], self._until_s[robot] = top_mps, now_s + seconds

    def top_mps(self, now_s: float) -> Floats:
        """(n,) present speed limit of each robot; inf if there is none."""
        return np.where(self._until_s > now_s, self._top_mps, np.inf)

    def top_of_mps(self, robot: int, now_s: float) -> tuple[float, float]:
        """`top_mps` of one robot, and for how long that is."""
        left_s = float(self._until_s[robot] - now_s)
        return (float(self._top_mps[robot]), left_s) if left_s > 0 else (np.inf, 0.0)

    def waits(self, robot: int, now_s: float) -> bool:
        """Whether a robot has been told to stand now."""
        return self.top_of_mps(robot, now_s)[0] == 0.0


ARRIVED_M = 0.03
BACKING_MPS = 0.35
BACK_OFF_M = (1.2, 4.0)
NEAR_PLACE_M, FARTHEST_BACK_M = 1.2, 6.0
"""How near to a place a robot's path must have come so that it can back out to there, and how far it backs at most."""
HOLD_S = (2.0, 6.0)
CREEPS_SHARE = 0.4
"""Share of the robots that creep on after a long wait. The others back off."""
PACE_DRIFT, SLOWEST_PACE = 0.15, 0.5
"""How fast people change their speed, and their least share of the greatest speed."""
STUCK_S, PAUSE_S = (8.0, 15.0), (1.0, 4.0)
"""How long a robot is stuck and a person pauses."""
SWAY_M, SWAY_S = 0.08, 2.0
"""How far people stray to either side, and the time in which they return."""


class Activity(IntEnum):
    """What a robot or person does."""

    STANDING = 0
    """In a bay."""
    DRIVING = 1
    BACKING = 2
    HOLDING = 3
    """Standing after backing off."""
    HALTED = 4
    """A stuck robot, or a person who pauses."""


class MovingRobots(ABC):
    """n robots and people. The rows of every array are these."""

    def __init__(
        self,
        makes: Sequence[Chassis],
        fleet: Ints,
        crossing_places: Sequence[Place],
        rng: np.random.Generator,
        half_aisle_m: float = HALF_AISLE_M,
        patience_s: tuple[float, float] = PATIENCE_S,
    ) -> None:
        """All stand. `fleet` (n,) is the fleet of each, `crossing_places` are the middles of the crossings by number,
        `half_aisle_m` is how far from the middle of an aisle there is room to pass, and `patience_s` the range of the
        time that a robot stands for another before it acts by itself."""
        n, self._rng = len(makes), rng
        self._makes = tuple(makes)
        self.t_s = 0.0
        self.fleet = fleet
        """(n,) fleet of each. Robots of one fleet know of each other."""
        self.person = np.array([make.person for make in makes], np.bool_)
        self.tracks = DriveTable(n)
        self.crossings = Crossings(np.where(self.person, -1 - np.arange(n), fleet))
        self.doing = np.full(n, int(Activity.STANDING))
        self.until_s = np.zeros(n)
        """When standing, holding or halting ends."""
        self.progress_m, self.speed_mps, self.aside_m = np.zeros(n), np.zeros(n), np.zeros(n)
        self.back_to_m = np.zeros(n)
        self.halts_every_s = np.full(n, np.inf)
        """(n,) how often each stops by itself, for a while."""
        self.pace = np.ones(n)
        """(n,) preferred speed as a share of the greatest."""
        self.goes_first = np.zeros(n, np.bool_)
        """(n,) whether all others let each go first."""
        self.waits, self.instructions = MutualWaits(n, rng, patience_s), Instructions(n)
        self.lines = CrossingEntry(self.crossings, crossing_places, n)
        self.passings = Passings(np.array([make.lane_m for make in makes]), half_aisle_m)
        self.braking = Braking(makes, self.passings, rng)
        self._gain = np.array([make.gain_mps2 for make in makes])
        self._brake = np.array([make.brake_mps2 for make in makes])
        self._bodies = np.array([[_sizes(make.body), _sizes(make.loaded)] for make in makes]).reshape(-1, 2, 3)
        self._rank = np.argsort(np.lexsort((np.arange(n), self.person)))

    @property
    @abstractmethod
    def floor(self) -> Ints:
        """(n,)"""

    @property
    def loaded(self) -> Bools:
        """(n,) whether each carries a load."""
        return np.zeros(len(self), np.bool_)

    @abstractmethod
    def _leave(self, robot: int) -> None:
        """Let a robot that stands set out, by `_set_out`, or stand for longer."""

    @abstractmethod
    def _arrived(self, robot: int) -> float:
        """Note that a robot has arrived. Returns how long it stays, in seconds."""

    def __len__(self) -> int:
        return len(self._makes)

    def locations(self) -> Floats:
        """(n, 3) x, y, yaw of the location that each reports, in its floor's frame."""
        located = replace(self._traffic(), ahead_m=np.zeros(len(self)))
        return centres(located, np.arange(len(self)), self.progress_m).T

    def envelopes(self) -> Floats:
        """(n, 5) x, y, yaw of each envelope's centre, its length and its width."""
        seen = self._traffic()
        poses = centres(seen, np.arange(len(self)), self.progress_m)
        return np.column_stack([*poses, seen.length_m, seen.width_m])

    def velocities(self) -> Floats:
        """(n, 2) metres per second along the heading, and radians per second anticlockwise."""
        slope = self.tracks.slope(np.arange(len(self)), self.progress_m)
        return (slope * self.speed_mps).T

    def step(self, dt_s: float) -> None:
        """Advance the time by `dt_s`, at most 0.2 s, so that protective stops are short enough."""
        self.t_s += dt_s
        self._end_waits()
        self._halt_some(dt_s)
        self._go_aside(dt_s)
        self._move(dt_s)
        self._arrive()
        self._end_long_waits()

    def _traffic(self) -> Traffic:
        length_m, width_m, ahead_m = self._bodies[np.arange(len(self)), self.loaded.astype(np.int64)].T
        return Traffic(
            tracks=self.tracks,
            progress_m=self.progress_m,
            speed_mps=self.speed_mps,
            brake_mps2=self._brake,
            backing=self.doing == Activity.BACKING,
            going=(self.doing == Activity.DRIVING) | (self.doing == Activity.BACKING),
            aside_m=self.aside_m,
            floor=self.floor,
            length_m=length_m,
            width_m=width_m,
            ahead_m=ahead_m,
            fleet=self.fleet,
            person=self.person,
            rank=self._rank,
            first=self.goes_first,
        )

    def _place(self, robot: int, drive: Drive) -> None:
        """Let a robot stand at the start of a drive."""
        self.tracks.set_drive(robot, drive)
        self.progress_m[robot] = 0.0

    def _end_waits(self) -> None:
        going = (self.doing == Activity.DRIVING) | (self.doing == Activity.BACKING)
        for robot in np.flatnonzero(~going & (self.until_s <= self.t_s)):
            if self.doing[robot] == Activity.STANDING:
                self._leave(int(robot))
            else:
                self.doing[robot] = Activity.DRIVING

    def _set_out(self, robot: int, way: Drive, passages: list[CrossingPassage]) -> None:
        self.tracks.set_drive(robot, way)
        self.crossings.set_drive(robot, passages)
        self.lines.reset(robot)
        self.progress_m[robot], self.doing[robot] = 0.0, Activity.DRIVING
        self.waits.restart(robot)

    def _halt_some(self, dt_s: float) -> None:
        """Sometimes a robot is stuck and a person pauses."""
        struck = (self._rng.random(len(self)) < dt_s / self.halts_every_s) & (self.doing == Activity.DRIVING)
        for robot in np.flatnonzero(struck):
            self.doing[robot] = Activity.HALTED
            self.until_s[robot] = self.t_s + self._rng.uniform(*(PAUSE_S if self.person[robot] else STUCK_S))

    def _go_aside(self, dt_s: float) -> None:
        """Move robots that pass others sideways, and let people stray, if no robot is beside them."""
        seen = self._traffic()
        self.passings.update(seen, self.t_s)
        aside_m = self.passings.next_aside_m(seen, dt_s) + self._stray_m(dt_s)
        may = may_sidestep(seen, aside_m)
        self.aside_m = np.where(may, aside_m, self.aside_m)

    def _stray_m(self, dt_s: float) -> Floats:
        """(n,) how far people stray to the left. Also changes their speed."""
        pushes = self._rng.normal(size=(2, len(self))) * np.sqrt(dt_s) * self.person
        self.pace = np.clip(self.pace + PACE_DRIFT * pushes[0], SLOWEST_PACE, 1.0)
        walking = self.person & (np.abs(self.speed_mps) > MOVING_MPS) & (np.abs(self.aside_m) <= SWAY_M)
        walking &= self.passings.end_m == np.inf
        change_m = SWAY_M * pushes[1] - self.aside_m * dt_s / SWAY_S
        strayed_m: Floats = np.clip(self.aside_m + walking * change_m, -SWAY_M, SWAY_M) - self.aside_m
        return np.where(walking, strayed_m, 0.0)

    def _move(self, dt_s: float) -> None:
        seen = self._traffic()
        self.crossings.update(self.progress_m, np.flatnonzero(self.doing == Activity.DRIVING))
        line = self.lines.limits(seen, self.doing == Activity.DRIVING, self.waits.waited_s)
        planned_mps = self.tracks.speed_mps(np.arange(len(self)), self.progress_m + self.speed_mps * dt_s)
        pace_mps = np.where(
            seen.backing, BACKING_MPS, self.pace * np.minimum(planned_mps, self.braking.top_mps(self.t_s))
        )
        pace_mps = np.minimum(pace_mps, self.instructions.top_mps(self.t_s))
        order = self.crossings.stop_m - self.progress_m, self.crossings.waits_for
        course = self.braking.course(seen, pace_mps, order, line, self.t_s, dt_s)
        self._drive(np.where(seen.backing, -course.wanted_mps, course.wanted_mps), dt_s)
        self.waits.update(course.kept & (np.abs(self.speed_mps) < MOVING_MPS), course.by, dt_s)

    def _drive(self, signed_mps: Floats, dt_s: float) -> None:
        faster = np.where(self.speed_mps >= 0, self._gain, self._brake) * dt_s
        slower = np.where(self.speed_mps > 0, self._brake, self._gain) * dt_s
        self.speed_mps = self.speed_mps + np.clip(signed_mps - self.speed_mps, -slower, faster)
        self.progress_m = np.clip(self.progress_m + self.speed_mps * dt_s, 0.0, self.tracks.length_m)

    def _arrive(self) -> None:
        there = (self.doing == Activity.DRIVING) & (self.progress_m >= self.tracks.length_m - ARRIVED_M)
        for robot in np.flatnonzero(there):
            stays_s = self._arrived(int(robot))
            self.doing[robot], self.speed_mps[robot] = Activity.STANDING, 0.0
            self.until_s[robot] = self.t_s + stays_s
        back = self.doing == Activity.BACKING
        done = back & ((self.progress_m <= self.back_to_m) | (self.waits.waited_s > 0.5))
        for robot in np.flatnonzero(done):
            self.doing[robot] = Activity.HOLDING
            self.crossings.give_way(int(robot), float(self.progress_m[robot]))
            self.until_s[robot] = self.t_s + self._rng.uniform(*HOLD_S)

    def _end_long_waits(self) -> None:
        """Robots that have stood too long pass the other robot. If they wait for each other, they creep on or
        back off."""
        for robot in self.waits.look_past(self.speed_mps, self.t_s):
            self.go_around(robot, int(self.waits.blocker[robot]))
        for robot in self.waits.out_of_patience():
            if self.doing[robot] == Activity.DRIVING:
                self._end_mutual_wait(robot)

    def _end_mutual_wait(self, robot: int) -> None:
        """Let a driving robot that is out of patience creep on or back off."""
        if self._rng.random() < CREEPS_SHARE:
            self.braking.let_go(robot)
            self.braking.creep(robot, self.t_s)
            self.waits.restart(robot)
        else:
            self.back_off(robot)

    def go_around(self, robot: int, other: int, side: Side | None = None) -> bool:
        """Let a driving robot pass another one, on a side if it is named. False if it does so already, or if there is
        no room."""
        can = self.doing[robot] == Activity.DRIVING and robot not in self.passings
        begins = bool(can and self.passings.begin(self._traffic(), robot, other, self.t_s, WALKING_MPS, side))
        if begins:
            self.waits.restart(robot)
        return begins

    def back_off(self, robot: int) -> None:
        """Let a driving robot drive backwards along its path for a few metres, and then stand for a while."""
        wanted_m = self.progress_m[robot] - self._rng.uniform(*BACK_OFF_M)
        self._back_to(robot, max(self.crossings.back_to_m[robot], wanted_m))

    def back_out(self, robot: int, place: Place) -> bool:
        """Let a driving robot drive backwards along its path to a place. False if its path does not come from there, if
        that is too far, or if it would back into a crossing."""
        x, y, _, _ = self.tracks.samples(robot)
        behind = int(self.progress_m[robot] / self.tracks.step_m[robot]) + 1
        away_m = np.hypot(x[:behind] - place[0], y[:behind] - place[1])
        to_m = float(np.argmin(away_m) * self.tracks.step_m[robot])
        least_m = max(float(self.crossings.back_to_m[robot]), float(self.progress_m[robot]) - FARTHEST_BACK_M)
        can = bool(away_m.min() < NEAR_PLACE_M and to_m >= least_m)
        if can:
            self._back_to(robot, to_m)
        return can

    def _back_to(self, robot: int, to_m: float) -> None:
        self.braking.let_go(robot)
        self.doing[robot] = Activity.BACKING
        self.back_to_m[robot] = to_m
        self.waits.restart(robot)


def _sizes(body: BodySize) -> tuple[float, float, float]:
    return body.length_m, body.width_m, body.ahead_m
