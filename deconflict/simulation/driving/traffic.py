"""The simulated world: robots and people move from bay to bay on both floors, load, charge and pause.

Time advances only by `World.step`. All randomness comes from the given generator.
"""

from collections.abc import Mapping, Sequence
from types import MappingProxyType

import numpy as np

from deconflict.simulation.driving.crossings import passages
from deconflict.simulation.driving.motion import Activity, MovingRobots
from deconflict.simulation.driving.mutual_waits import PATIENCE_S
from deconflict.simulation.driving.passing import HALF_AISLE_M
from deconflict.simulation.driving.routes import Drive, SpeedShare, drive, lane, standing
from deconflict.simulation.floor_layout import Bay, BayKind, Layout
from deconflict.simulation.participants import BodySize, Participant, VendorName
from deconflict.simulation.trips import NOWHERE, Trips
from ingest.batch import Bools, Ints

RIDE_S = 6.0
"""Time in a lift."""
DWELL_S = {
    BayKind.RACK: (15.0, 50.0),
    BayKind.PICK: (10.0, 40.0),
    BayKind.DOCK: (20.0, 60.0),
    BayKind.PARKING: (15.0, 90.0),
    BayKind.CHARGER: (15.0, 60.0),
    BayKind.LIFT: (RIDE_S, RIDE_S),
}
LOADING = (BayKind.RACK, BayKind.PICK, BayKind.DOCK)
"""Bays where robots load and unload."""
SET_OUT_S = 12.0
"""All members set out within this time."""
FEW, SPREAD_S, SPREAD_POWER = 24, 100.0, 1.5
"""More members than these set out within this time, most of them early."""
FULL_BAYS_S = 2.0
"""If all bays are taken, a robot waits this long before it looks again."""
DETOUR = 0.6
"""Robots do not all take the shortest path: for each trip, aisles count as up to this share longer."""
STUCK_EVERY_S, PAUSE_EVERY_S = 900.0, 25.0
"""How often a robot is stuck and a person pauses."""
UNLOAD_SHARE = 0.4
"""Share of loaded robots that unload at a rack or dock."""
LOW_BATTERY = 25.0
DRAIN_PER_S, CHARGE_PER_S = 0.04, 1.5
"""Percent per second. Faster than in reality, so that chargers are used."""
NO_LIMITS: Mapping[int, SpeedShare] = MappingProxyType({})


class World(MovingRobots):
    """All members on both floors. The rows of every array are the members, in order."""

    def __init__(
        self,
        layout: Layout,
        members: Sequence[Participant],
        rng: np.random.Generator,
        speed_shares: Mapping[int, SpeedShare] = NO_LIMITS,
        *,
        trips: type[Trips] = Trips,
        half_aisle_m: float = HALF_AISLE_M,
        patience_s: tuple[float, float] = PATIENCE_S,
    ) -> None:
        """Every member starts in a bay. `speed_shares` are speed limits by floor, `trips` says where members go,
        `half_aisle_m` and `patience_s` are as in `MovingRobots`. Raises ValueError if there are more members than
        bays."""
        self._speed_shares = speed_shares
        self.members = tuple(members)
        n, makes, vendors = len(self.members), [member.make for member in members], list(VendorName)
        person = np.array([make.person for make in makes], np.bool_)
        self.trips = trips(layout, person, rng)
        until_s = rng.uniform(0.0, SET_OUT_S, n)
        self.load_pct = np.where(rng.random(n) < 0.75, rng.integers(20, 90, n), 0) * ~person
        self.battery_pct = np.where(rng.random(n) < 0.15, rng.uniform(22.0, 28.0, n), rng.uniform(35.0, 98.0, n))
        fleet: Ints = np.array([vendors.index(make.vendor) for make in makes])
        super().__init__(makes, fleet, layout.places, rng, half_aisle_m, patience_s)
        self.until_s = until_s
        self.halts_every_s = np.where(person, PAUSE_EVERY_S, STUCK_EVERY_S)
        for robot in range(n):
            self._place(robot, self._standing_in(self.trips.at(robot)))

    def spread_start(self) -> None:
        """Let no more members drive at first than later: if many set out at once, twice as many are in each other's
        way."""
        if len(self) > FEW:
            self.until_s = SPREAD_S * (self.until_s / SET_OUT_S) ** SPREAD_POWER

    @property
    def floor(self) -> Ints:
        return self.trips.floor

    @property
    def loaded(self) -> Bools:
        has_load: Bools = self.load_pct > 0
        return has_load

    @property
    def charging(self) -> Bools:
        """(n,)"""
        standing_now: Bools = self.doing == Activity.STANDING
        return standing_now & self.trips.standing_at(BayKind.CHARGER)

    def rows(self) -> dict[str, int]:
        """By UUID, the row of each member."""
        return {member.uuid: row for row, member in enumerate(self.members)}

    def body(self, robot: int) -> BodySize:
        """Its present envelope."""
        make = self.members[robot].make
        return make.loaded if self.load_pct[robot] else make.body

    def step(self, dt_s: float) -> None:
        super().step(dt_s)
        self._use_batteries(dt_s)

    def _standing_in(self, bay: Bay) -> Drive:
        return standing(bay.place, self.trips.layout.heading_rad(bay))

    def _arrived(self, robot: int) -> float:
        return float(self._rng.uniform(*DWELL_S[self.trips.arrive(robot).kind]))

    def _leave(self, robot: int) -> None:
        """Set out from a bay. If every other is taken, stand a little longer."""
        if self.trips.beyond[robot] != NOWHERE:
            self._place(robot, self._standing_in(self.trips.ride(robot)))
        start, make = self.trips.at(robot), self.members[robot].make
        low = bool(self.battery_pct[robot] < LOW_BATTERY)
        goal = self.trips.choose(robot, needs_charge=low)
        if goal is None:
            self.until_s[robot] = self.t_s + FULL_BAYS_S
            return
        if start.kind in LOADING and not make.person:
            unloads = self.load_pct[robot] and self._rng.random() < UNLOAD_SHARE
            self.load_pct[robot] = 0 if unloads else self._rng.integers(20, 90)
        layout = self.trips.layout
        detours = 1.0 + DETOUR * self._rng.random(len(layout.places))
        nodes = layout.route(start.node, goal.node, detours)
        corners, limits = lane(layout, nodes, make.lane_m), self._speed_shares.get(start.floor)
        way = drive(corners, layout.heading_rad(start), make, limits)
        self._set_out(robot, way, passages(layout, nodes, way))

    def _use_batteries(self, dt_s: float) -> None:
        drain = np.where(self.person, 0.1, 1.0) * DRAIN_PER_S
        change = np.where(self.charging, CHARGE_PER_S, -drain) * dt_s
        self.battery_pct = np.clip(self.battery_pct + change, 3.0, 100.0)
