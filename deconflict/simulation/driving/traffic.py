"""The moving world: robots and people drive from bay to bay, stop for each other, and sort out mutual waits.

A robot drives its own way and knows nothing of others' plans. Where two wait for each other, one of them backs
off along the way it came and tries again. Time goes on only by `World.step`; all chance is the given generator's.
"""

from collections.abc import Sequence
from dataclasses import replace
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from deconflict.simulation.cast import Body, Member
from deconflict.simulation.driving.crossings import Crossings, passages
from deconflict.simulation.driving.protection import Traffic, centres, free_way
from deconflict.simulation.driving.routes import drive, lane, standing
from deconflict.simulation.driving.tracks import Tracks
from deconflict.simulation.driving.trips import NOWHERE, Trips
from deconflict.simulation.layout import Bay, BayKind, Layout
from ingest.seam import Floats, Ints

ARRIVED_M = 0.03
RIDE_S = 6.0
"""In a lift."""
DWELL_S = {
    BayKind.DOCK: (4.0, 12.0),
    BayKind.PARKING: (3.0, 8.0),
    BayKind.CHARGER: (15.0, 60.0),
    BayKind.LIFT: (RIDE_S, RIDE_S),
}
FULL_BAYS_S = 2.0
"""How long a robot waits before it looks again for a bay to go to."""
DETOUR = 0.6
"""Not everybody takes the shortest way: aisles seem up to this share longer to each."""
BACKING_MPS = 0.35
BACK_OFF_M = (1.2, 4.0)
HOLD_S = (1.5, 4.0)
PATIENCE_S = (2.0, 8.0)
"""How long a robot takes part in a mutual wait before it backs off."""
LONG_WAIT_S = 30.0
"""And in any other."""
MOVING_MPS, NEARLY_M = 0.03, 0.02
STUCK_EVERY_S, STUCK_S = 900.0, (8.0, 15.0)
PAUSE_EVERY_S, PAUSE_S = 25.0, (1.0, 4.0)
"""Of people: they stop for a moment."""
PACE_DRIFT, SLOWEST_PACE = 0.15, 0.5
"""How fast people change their pace."""
SWAY_M, SWAY_S = 0.08, 2.0
"""How far people stray to either side, and how soon they come back."""
UNLOAD_SHARE = 0.4
"""Of robots that come to a dock with a load, those that leave without."""
LOW_BATTERY = 25.0
DRAIN_PER_S, CHARGE_PER_S = 0.04, 1.5
"""Percent; faster than real ones, so that chargers are visited."""


class Doing(IntEnum):
    STANDING = 0
    """In a bay."""
    DRIVING = 1
    BACKING = 2
    HOLDING = 3
    """After backing off."""
    HALTED = 4
    """Stuck, or a person who pauses."""


class World:
    """Everybody on both floors. Rows of every array are the members, in order."""

    def __init__(self, layout: Layout, members: Sequence[Member], rng: np.random.Generator) -> None:
        """Everybody starts in a bay. Raises ValueError where there are more members than bays."""
        self.members, self._rng = tuple(members), rng
        n, makes = len(self.members), [member.make for member in self.members]
        self.t_s = 0.0
        self.trips, self.tracks, self._crossings = Trips(layout, n, rng), Tracks(n), Crossings(n)
        self.doing = np.full(n, int(Doing.STANDING))
        self.until_s = rng.uniform(0.0, 6.0, n)
        """When standing, holding or halting ends."""
        self.progress_m, self.speed_mps, self.aside_m = np.zeros(n), np.zeros(n), np.zeros(n)
        self.waited_s = np.zeros(n)
        """How long others have kept it from moving."""
        self.back_to_m = np.zeros(n)
        self.pace = np.ones(n)
        """Share of its greatest speed that it likes to go at."""
        self.person = np.array([make.person for make in makes], np.bool_)
        self.load_pct = np.where(rng.random(n) < 0.75, rng.integers(20, 90, n), 0) * ~self.person
        self.battery_pct = np.where(rng.random(n) < 0.15, rng.uniform(22.0, 28.0, n), rng.uniform(35.0, 98.0, n))
        self._patience_s, self._blocker = rng.uniform(*PATIENCE_S, n), np.full(n, NOWHERE)
        self._gain = np.array([make.gain_mps2 for make in makes])
        self._brake = np.array([make.brake_mps2 for make in makes])
        self._stop_gap_m = np.array([make.stop_gap_m for make in makes])
        self._bodies = np.array([[_sizes(make.body), _sizes(make.loaded)] for make in makes])
        self._rank = np.argsort(np.lexsort((np.arange(n), ~self.person)))
        for robot in range(n):
            self._put_in(self.trips.at(robot), robot)

    def __len__(self) -> int:
        return len(self.members)

    @property
    def floor(self) -> Ints:
        """(n,)"""
        return self.trips.floor

    @property
    def charging(self) -> NDArray[np.bool_]:
        """(n,)"""
        standing: NDArray[np.bool_] = self.doing == Doing.STANDING
        return standing & self.trips.standing_at(BayKind.CHARGER)

    def body(self, robot: int) -> Body:
        """The envelope that holds now."""
        make = self.members[robot].make
        return make.loaded if self.load_pct[robot] else make.body

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
        """(n, 2) metres a second along the heading, and radians a second anticlockwise."""
        slope = self.tracks.slope(np.arange(len(self)), self.progress_m)
        return (slope * self.speed_mps).T

    def step(self, dt_s: float) -> None:
        """Let `dt_s` pass: at most 0.2 s, for protective stops to be short enough."""
        self.t_s += dt_s
        self._end_waits()
        self._interrupt(dt_s)
        self._stray(dt_s)
        self._move(dt_s)
        self._arrive()
        self._part_mutual_waits()
        self._use_batteries(dt_s)

    def _traffic(self) -> Traffic:
        length_m, width_m, ahead_m = self._bodies[np.arange(len(self)), (self.load_pct > 0).astype(np.int64)].T
        return Traffic(
            tracks=self.tracks,
            progress_m=self.progress_m,
            speed_mps=self.speed_mps,
            backing=self.doing == Doing.BACKING,
            aside_m=self.aside_m,
            floor=self.floor,
            length_m=length_m,
            width_m=width_m,
            ahead_m=ahead_m,
            rank=self._rank,
        )

    def _put_in(self, bay: Bay, robot: int) -> None:
        self.tracks.put(robot, standing(bay.place, self.trips.layout.heading_rad(bay)))
        self.progress_m[robot] = 0.0

    def _end_waits(self) -> None:
        going = (self.doing == Doing.DRIVING) | (self.doing == Doing.BACKING)
        for robot in np.flatnonzero(~going & (self.until_s <= self.t_s)):
            if self.doing[robot] == Doing.STANDING:
                self._leave(int(robot))
            else:
                self.doing[robot] = Doing.DRIVING

    def _leave(self, robot: int) -> None:
        """Set out from a bay; where every other is taken, stand a little longer."""
        if self.trips.beyond[robot] != NOWHERE:
            self._put_in(self.trips.ride(robot), robot)
        start, make = self.trips.at(robot), self.members[robot].make
        low = bool(self.battery_pct[robot] < LOW_BATTERY)
        goal = self.trips.choose(robot, needs_charge=low, may_ride=not make.person)
        if goal is None:
            self.until_s[robot] = self.t_s + FULL_BAYS_S
            return
        if start.kind is BayKind.DOCK and not make.person:
            unloads = self.load_pct[robot] and self._rng.random() < UNLOAD_SHARE
            self.load_pct[robot] = 0 if unloads else self._rng.integers(20, 90)
        layout = self.trips.layout
        detours = 1.0 + DETOUR * self._rng.random(len(layout.places))
        nodes = layout.route(start.node, goal.node, detours)
        way = drive(lane(layout, nodes, make.lane_m), layout.heading_rad(start), make)
        self.tracks.put(robot, way)
        self._crossings.put(robot, passages(layout, nodes, way))
        self.progress_m[robot], self.doing[robot], self.waited_s[robot] = 0.0, Doing.DRIVING, 0.0

    def _interrupt(self, dt_s: float) -> None:
        """Now and then a robot is stuck and a person pauses."""
        every_s = np.where(self.person, PAUSE_EVERY_S, STUCK_EVERY_S)
        struck = (self._rng.random(len(self)) < dt_s / every_s) & (self.doing == Doing.DRIVING)
        for robot in np.flatnonzero(struck):
            self.doing[robot] = Doing.HALTED
            self.until_s[robot] = self.t_s + self._rng.uniform(*(PAUSE_S if self.person[robot] else STUCK_S))

    def _stray(self, dt_s: float) -> None:
        """People change their pace, and do not walk in a straight line."""
        pushes = self._rng.normal(size=(2, len(self))) * np.sqrt(dt_s) * self.person
        self.pace = np.clip(self.pace + PACE_DRIFT * pushes[0], SLOWEST_PACE, 1.0)
        walking = np.abs(self.speed_mps) > MOVING_MPS
        change = SWAY_M * pushes[1] - self.aside_m * dt_s / SWAY_S
        self.aside_m = np.clip(self.aside_m + walking * change, -SWAY_M, SWAY_M)

    def _move(self, dt_s: float) -> None:
        everyone, backing = np.arange(len(self)), self.doing == Doing.BACKING
        going = backing | (self.doing == Doing.DRIVING)
        self._crossings.update(self.progress_m, np.flatnonzero(self.doing == Doing.DRIVING))
        free_m, by = free_way(self._traffic())
        to_crossing_m = np.where(backing, np.inf, self._crossings.stop_m - self.progress_m)
        open_m = np.maximum(np.minimum(free_m - self._stop_gap_m, to_crossing_m), 0.0)
        by = np.where(to_crossing_m < free_m - self._stop_gap_m, self._crossings.waits_for, by)
        planned = self.pace * self.tracks.speed_mps(everyone, self.progress_m + self.speed_mps * dt_s)
        wanted = np.minimum(np.where(backing, BACKING_MPS, planned), np.sqrt(2 * self._brake * open_m)) * going
        signed = np.where(backing, -wanted, wanted)
        faster = np.where(self.speed_mps >= 0, self._gain, self._brake) * dt_s
        slower = np.where(self.speed_mps > 0, self._brake, self._gain) * dt_s
        self.speed_mps = self.speed_mps + np.clip(signed - self.speed_mps, -slower, faster)
        self.progress_m = np.clip(self.progress_m + self.speed_mps * dt_s, 0.0, self.tracks.length_m)
        kept = going & (open_m < NEARLY_M) & (np.abs(self.speed_mps) < MOVING_MPS)
        self._blocker = np.where(kept, by, NOWHERE)
        self.waited_s = np.where(kept, self.waited_s + dt_s, 0.0)

    def _arrive(self) -> None:
        there = (self.doing == Doing.DRIVING) & (self.progress_m >= self.tracks.length_m - ARRIVED_M)
        for robot in np.flatnonzero(there):
            bay = self.trips.arrive(int(robot))
            self.doing[robot], self.speed_mps[robot] = Doing.STANDING, 0.0
            self.until_s[robot] = self.t_s + self._rng.uniform(*DWELL_S[bay.kind])
        back = self.doing == Doing.BACKING
        done = back & ((self.progress_m <= self.back_to_m) | (self.waited_s > 0.5))
        for robot in np.flatnonzero(done):
            self.doing[robot] = Doing.HOLDING
            self._crossings.give_way(int(robot), float(self.progress_m[robot]))
            self.until_s[robot] = self.t_s + self._rng.uniform(*HOLD_S)

    def _part_mutual_waits(self) -> None:
        """Robots that wait, directly or through others, for one that waits for them back off one by one."""
        nobody = len(self)
        waits_for = np.append(np.where(self._blocker == NOWHERE, nobody, self._blocker), nobody)
        for _ in range(6):
            waits_for = waits_for[waits_for]
        mutual = waits_for[:-1] != nobody
        tired = (mutual & (self.waited_s > self._patience_s)) | (self.waited_s > LONG_WAIT_S)
        for robot in np.flatnonzero(tired & (self.doing == Doing.DRIVING)):
            self.doing[robot], self.waited_s[robot] = Doing.BACKING, 0.0
            wanted_m = self.progress_m[robot] - self._rng.uniform(*BACK_OFF_M)
            self.back_to_m[robot] = max(self._crossings.back_to_m[robot], wanted_m)
            self._patience_s[robot] = self._rng.uniform(*PATIENCE_S)

    def _use_batteries(self, dt_s: float) -> None:
        drain = np.where(self.person, 0.1, 1.0) * DRAIN_PER_S
        change = np.where(self.charging, CHARGE_PER_S, -drain) * dt_s
        self.battery_pct = np.clip(self.battery_pct + change, 3.0, 100.0)


def _sizes(body: Body) -> tuple[float, float, float]:
    return body.length_m, body.width_m, body.ahead_m
