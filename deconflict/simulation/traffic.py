"""The moving world: robots and people drive from bay to bay, stop for each other, and sort out mutual waits.

A robot drives its own way and knows nothing of others' plans. Where two wait for each other, one of them backs
off along the way it came and tries again. Time goes on only by `World.step`; all chance is the given generator's.
"""

from collections.abc import Sequence
from dataclasses import replace
from enum import IntEnum

import numpy as np

from deconflict.simulation.cast import Body, Member, VendorName
from deconflict.simulation.layout import BayKind, Layout
from deconflict.simulation.protection import Traffic, centres, free_way
from deconflict.simulation.routes import drive, lane
from deconflict.simulation.tracks import Tracks
from ingest.seam import Floats, Ints

ARRIVED_M = 0.03
TRIP_M = (12.0, 70.0)
"""Shortest and longest way between two stops, as the crow flies along aisles."""
LIFT_SHARE = 0.06
"""Of trips that change floors."""
RIDE_S = 6.0
BACKING_MPS = 0.35
BACK_OFF_M = (1.2, 4.0)
HOLD_S = (1.5, 4.0)
PATIENCE_S = (2.0, 8.0)
"""How long a robot takes part in a mutual wait before it backs off."""
STUCK_EVERY_S, STUCK_S = 900.0, (8.0, 15.0)
PAUSE_EVERY_S, PAUSE_S = 25.0, (1.0, 4.0)
"""Of people: they stop for a moment."""
SWAY_M, SWAY_S = 0.1, 2.0
"""How far people stray to either side, and how soon they come back."""
LOW_BATTERY, FULL_BATTERY = 25.0, 95.0
DRAIN_PER_S, CHARGE_PER_S = 0.04, 1.5
"""Percent; faster than real ones, so that chargers are visited."""
DWELL_S = {
    BayKind.DOCK: (4.0, 12.0),
    BayKind.PARKING: (3.0, 8.0),
    BayKind.CHARGER: (15.0, 60.0),
    BayKind.LIFT: (RIDE_S, RIDE_S),
}


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
        self.layout, self.members, self._rng = layout, tuple(members), rng
        n = len(self.members)
        makes = [member.make for member in self.members]
        self.t_s = 0.0
        self.doing = np.zeros(n, np.int64)
        self.until_s = rng.uniform(0.0, 8.0, n)
        """When standing, holding or halting ends."""
        self.progress_m, self.speed_mps, self.aside_m = np.zeros(n), np.zeros(n), np.zeros(n)
        self.waited_s = np.zeros(n)
        """How long others have kept it from moving."""
        self.battery_pct = np.where(rng.random(n) < 0.15, rng.uniform(22.0, 28.0, n), rng.uniform(35.0, 98.0, n))
        self.load_pct = np.where(rng.random(n) < 0.5, np.round(rng.uniform(20.0, 90.0, n)), 0.0)
        self.person = np.array([make.person for make in makes])
        self.load_pct[self.person] = 0.0
        self.tracks = Tracks(n)
        self.bay, self.goal = self._first_bays(n), np.full(n, -1)
        """Indices into the layout's bays: where it is or was last, and where it goes; -1 for nowhere."""
        self._taken = set(self.bay.tolist())
        self.after_lift = np.full(n, -1)
        """The bay it goes to when it has changed floors."""
        self._pace, self._patience_s = np.ones(n), rng.uniform(*PATIENCE_S, n)
        self._back_to_m = np.zeros(n)
        self._blocker = np.full(n, -1)
        self._max_mps = np.array([make.max_speed_mps for make in makes])
        self._gain, self._brake = (
            np.array([getattr(make, name) for make in makes]) for name in ("gain_mps2", "brake_mps2")
        )
        self._stop_gap_m = np.array([make.stop_gap_m for make in makes])
        self._rank = np.lexsort((np.arange(n), ~self.person)).argsort()
        for index in range(n):
            self._stand(index)

    def __len__(self) -> int:
        return len(self.members)

    @property
    def floor(self) -> Ints:
        """(n,)"""
        return np.array([self.layout.bays[index].floor for index in self.bay])

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
        """Let `dt_s` pass, at most a quarter of a second at a time for stops to be short enough."""
        self.t_s += dt_s
        self._end_waits()
        self._interrupt(dt_s)
        self._sway(dt_s)
        self._move(dt_s)
        self._arrive()
        self._part_mutual_waits(dt_s)
        self._use_batteries(dt_s)

    def _traffic(self) -> Traffic:
        bodies = np.array([(b.length_m, b.width_m, b.ahead_m) for b in map(self.body, range(len(self)))])
        return Traffic(
            tracks=self.tracks,
            progress_m=self.progress_m,
            speed_mps=self.speed_mps,
            backing=self.doing == Doing.BACKING,
            aside_m=self.aside_m,
            floor=self.floor,
            length_m=bodies[:, 0],
            width_m=bodies[:, 1],
            ahead_m=bodies[:, 2],
            rank=self._rank,
        )

    def _first_bays(self, n: int) -> Ints:
        open_bays = [index for index, bay in enumerate(self.layout.bays) if bay.kind is not BayKind.LIFT]
        if n > len(open_bays):
            raise ValueError(f"{n} robots do not fit in {len(open_bays)} bays; use a larger layout")
        return self._rng.permutation(open_bays)[:n]

    def _stand(self, robot: int) -> None:
        """A drive that stays in the robot's bay, head in."""
        bay = self.layout.bays[self.bay[robot]]
        gate = self.layout.places[next(iter(self.layout.neighbours[bay.node]))]
        yaw = float(np.arctan2(bay.place[1] - gate[1], bay.place[0] - gate[0]))
        way = drive(
            [bay.place, (2 * bay.place[0] - gate[0], 2 * bay.place[1] - gate[1])], yaw, self.members[robot].make
        )
        self.tracks.put(robot, replace(way, **{name: getattr(way, name)[:2] for name in _SAMPLED}))
        self.progress_m[robot] = 0.0

    def _end_waits(self) -> None:
        ended = (self.doing != Doing.DRIVING) & (self.doing != Doing.BACKING) & (self.until_s <= self.t_s)
        for robot in np.flatnonzero(ended):
            if self.doing[robot] == Doing.STANDING:
                self._leave(robot)
            else:
                self.doing[robot] = Doing.DRIVING
                self.waited_s[robot] = 0.0

    def _leave(self, robot: int) -> None:
        """Set out from a bay; where every other is taken, stand a little longer."""
        at = self.layout.bays[self.bay[robot]]
        if at.kind is BayKind.LIFT and self.after_lift[robot] >= 0:
            goal = self._leave_lift(robot)
        else:
            goal = self._next_goal(robot)
        if goal < 0:
            self.until_s[robot] = self.t_s + 2.0
            return
        if at.kind is BayKind.DOCK and not self.person[robot]:
            self.load_pct[robot] = 0.0 if self.load_pct[robot] else round(self._rng.uniform(20.0, 90.0))
        self._taken.add(goal)
        self.goal[robot] = goal
        start, end = self.layout.bays[self.bay[robot]], self.layout.bays[goal]
        yaw = float(self.tracks.poses(np.array(robot), self.progress_m[robot])[2])
        make = self.members[robot].make
        corners = lane(self.layout, self.layout.route(start.node, end.node), make.lane_m)
        self.tracks.put(robot, drive(corners, yaw, make))
        self.progress_m[robot], self.doing[robot] = 0.0, Doing.DRIVING

    def _leave_lift(self, robot: int) -> int:
        """Come out on the other floor; the bay to go to."""
        assert self.layout.other_lift is not None
        self._taken.discard(int(self.bay[robot]))
        self.bay[robot] = self.layout.other_lift[int(self.bay[robot])]
        self._stand(robot)
        goal, self.after_lift[robot] = int(self.after_lift[robot]), -1
        return goal

    def _next_goal(self, robot: int) -> int:
        """A free bay to go to next, a charger where the battery is low, or the lift; -1 where there is none."""
        here = self.layout.bays[self.bay[robot]]
        wanted = {BayKind.DOCK, BayKind.PARKING}
        if self.battery_pct[robot] < LOW_BATTERY:
            wanted = {BayKind.CHARGER}
        elif self._rng.random() < LIFT_SHARE and not self.person[robot]:
            lift = self._free_lift(here.floor)
            beyond = self._choose(1 - here.floor, {BayKind.DOCK}, None) if lift >= 0 else -1
            if beyond >= 0:
                self.after_lift[robot] = beyond
                self._taken |= {beyond, self.layout.other_lift[lift]}
                return lift
        return self._choose(here.floor, wanted, here.place)

    def _use_batteries(self, dt_s: float) -> None:
        charging = self.charging
        change = np.where(charging, CHARGE_PER_S, np.where(self.person, 0.1, 1.0) * -DRAIN_PER_S) * dt_s
        self.battery_pct = np.clip(self.battery_pct + change, 3.0, 100.0)


_SAMPLED = ("x_m", "y_m", "yaw_rad", "speed_mps", "free_s")
