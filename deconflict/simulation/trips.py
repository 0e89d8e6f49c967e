"""The bays where robots stop and where they go. A bay belongs to one robot at a time, from when it sets out for it."""

import numpy as np
from numpy.typing import NDArray

from deconflict.simulation.floor_layout import GROUND, Bay, BayKind, Layout
from ingest.batch import Ints

TRIP_M = (8.0, 90.0)
"""Shortest and longest path between two stops, along aisles."""
LIFT_SHARE = 0.06
"""Share of trips that change floors."""
TO_DOCK_SHARE = 0.4
"""Share of trips from a rack that lead to a dock."""
LEAVES_PICK_ZONE_SHARE = 0.15
"""Share of people's trips that lead out of the pick zone."""
STOPS = (BayKind.RACK, BayKind.PICK, BayKind.PARKING)
NEAREST = (BayKind.LIFT, BayKind.CHARGER)
"""Robots go to the nearest free bay of these kinds."""
NOWHERE = -1


class Trips:
    """The trips of n robots. Bays are given by their index in the layout."""

    def __init__(self, layout: Layout, person: NDArray[np.bool_], rng: np.random.Generator) -> None:
        """Every robot starts in a bay, and people in the pick zone. `person` (n,) is whether each is a person.

        Raises ValueError if there are more robots than bays.
        """
        self.layout, self._rng, self._person, robots = layout, rng, person, len(person)
        self._kinds = np.array([bay.kind.value for bay in layout.bays])
        self._floors = np.array([bay.floor for bay in layout.bays])
        self._places = np.array([bay.place for bay in layout.bays])
        open_bays = np.flatnonzero(self._kinds != BayKind.LIFT.value)
        if robots > len(open_bays):
            raise ValueError(f"{robots} robots do not fit in {len(open_bays)} bays; use a larger layout")
        self.bay: Ints = np.empty(robots, np.int64)
        """(n,) present or last bay of each robot."""
        self.bay[person], self.bay[~person] = self._starts(rng.permutation(open_bays))
        self.goal = np.full(robots, NOWHERE)
        """(n,) bay to which it drives."""
        self.beyond = np.full(robots, NOWHERE)
        """(n,) bay to which it drives after it has changed floors."""
        self._taken = np.zeros(len(layout.bays), np.bool_)
        self._taken[self.bay] = True

    def _starts(self, bays: Ints) -> tuple[Ints, Ints]:
        """The bays of the people, in the pick zone as long as it has room, and those of the robots."""
        in_pick_zone, people = self._kinds[bays] == BayKind.PICK.value, int(self._person.sum())
        of_people = np.concatenate([bays[in_pick_zone], bays[~in_pick_zone]])[:people]
        others = bays[~np.isin(bays, of_people)]
        return of_people, others[: len(self._person) - people]

    @property
    def floor(self) -> Ints:
        """(n,)"""
        return self._floors[self.bay]

    def at(self, robot: int) -> Bay:
        return self.layout.bays[int(self.bay[robot])]

    def standing_at(self, kind: BayKind) -> NDArray[np.bool_]:
        """(n,) whether the last bay of each robot is of this kind."""
        return self._kinds[self.bay] == kind.value

    def choose(self, robot: int, *, needs_charge: bool) -> Bay | None:
        """Reserve the bay to go to next. None if every suitable bay is taken."""
        here = self.at(robot)
        if self.beyond[robot] != NOWHERE:
            goal, self.beyond[robot] = int(self.beyond[robot]), NOWHERE
        elif needs_charge:
            goal = self._free(here, here.floor, BayKind.CHARGER)
        elif self._rng.random() < LIFT_SHARE and not self._person[robot] and self._may_ride(robot, here):
            goal = self._free(here, here.floor, BayKind.LIFT)
        else:
            goal = self._free(here, here.floor, *self._next_kinds(robot, here))
        if goal == NOWHERE:
            return None
        self._taken[goal] = True
        self.goal[robot] = goal
        return self.layout.bays[goal]

    def _next_kinds(self, robot: int, here: Bay) -> tuple[BayKind, ...]:
        if self._person[robot]:
            return STOPS if self._rng.random() < LEAVES_PICK_ZONE_SHARE else (BayKind.PICK,)
        at_rack = here.kind in (BayKind.RACK, BayKind.PICK) and here.floor == GROUND
        return (BayKind.DOCK,) if at_rack and self._rng.random() < TO_DOCK_SHARE else STOPS

    def arrive(self, robot: int) -> Bay:
        """The robot has arrived at its goal. Only now the bay that it came from becomes free."""
        self._taken[self.bay[robot]] = False
        self.bay[robot], self.goal[robot] = self.goal[robot], NOWHERE
        return self.at(robot)

    def other_floor(self, robot: int) -> Bay:
        """The bay on the other floor of the lift that the robot drives to or rides in."""
        lift = self.goal[robot] if self.goal[robot] != NOWHERE else self.bay[robot]
        return self.layout.bays[self.layout.other_lift[int(lift)]]

    def ride(self, robot: int) -> Bay:
        """Move the robot to the other floor of its lift."""
        below = int(self.bay[robot])
        self.bay[robot] = self.layout.other_lift[below]
        self._taken[below] = False
        return self.at(robot)

    def _may_ride(self, robot: int, here: Bay) -> bool:
        """Reserve a bay on the other floor and both sides of a lift, if they are free. Returns whether they were."""
        lift = self._free(here, here.floor, BayKind.LIFT)
        if lift == NOWHERE or self._taken[self.layout.other_lift[lift]]:
            return False
        far = self.layout.other_lift[lift]
        beyond = self._free(self.layout.bays[far], 1 - here.floor, BayKind.RACK, BayKind.DOCK)
        if beyond == NOWHERE:
            return False
        self._taken[[far, beyond]] = True
        self.beyond[robot] = beyond
        return True

    def _free(self, start: Bay, floor: int, *kinds: BayKind) -> int:
        """A random free bay of these kinds at a trip's length from `start`. For lifts and chargers, the nearest."""
        away_m = np.abs(self._places - start.place).sum(axis=1)
        fits = ~self._taken & (self._floors == floor) & np.isin(self._kinds, [kind.value for kind in kinds])
        if kinds[0] in NEAREST:
            near = np.where(fits, away_m, np.inf)
            return int(near.argmin()) if fits.any() else NOWHERE
        found = np.flatnonzero(fits & (away_m >= TRIP_M[0]) & (away_m <= TRIP_M[1]))
        return int(self._rng.choice(found)) if len(found) else NOWHERE
