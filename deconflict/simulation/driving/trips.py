"""Who stops where and goes where: bays are taken by one robot at a time, on the way there already."""

import numpy as np
from numpy.typing import NDArray

from deconflict.simulation.floor_layout import Bay, BayKind, Layout
from ingest.batch import Ints

TRIP_M = (12.0, 70.0)
"""Shortest and longest way between two stops, along aisles."""
LIFT_SHARE = 0.06
"""Of trips that change floors."""
NOWHERE = -1


class Trips:
    """Bays are named by their index in the layout's."""

    def __init__(self, layout: Layout, robots: int, rng: np.random.Generator) -> None:
        """Everybody starts in a bay. Raises ValueError where there are more robots than bays."""
        self.layout, self._rng = layout, rng
        self._kinds = np.array([bay.kind.value for bay in layout.bays])
        self._floors = np.array([bay.floor for bay in layout.bays])
        self._places = np.array([bay.place for bay in layout.bays])
        open_bays = np.flatnonzero(self._kinds != BayKind.LIFT.value)
        if robots > len(open_bays):
            raise ValueError(f"{robots} robots do not fit in {len(open_bays)} bays; use a larger layout")
        self.bay: Ints = rng.permutation(open_bays)[:robots]
        """(n,) where each robot is or was last."""
        self.goal = np.full(robots, NOWHERE)
        """(n,) where it goes."""
        self.beyond = np.full(robots, NOWHERE)
        """(n,) where it goes when it has changed floors."""
        self._taken = np.zeros(len(layout.bays), np.bool_)
        self._taken[self.bay] = True

    @property
    def floor(self) -> Ints:
        """(n,)"""
        floors: Ints = self._floors[self.bay]
        return floors

    def at(self, robot: int) -> Bay:
        return self.layout.bays[int(self.bay[robot])]

    def standing_at(self, kind: BayKind) -> NDArray[np.bool_]:
        """(n,) whose last bay is of that kind."""
        of_kind: NDArray[np.bool_] = self._kinds[self.bay] == kind.value
        return of_kind

    def choose(self, robot: int, *, needs_charge: bool, may_ride: bool) -> Bay | None:
        """Take the bay to go to next; None where every one that would do is taken."""
        here = self.at(robot)
        if self.beyond[robot] != NOWHERE:
            goal, self.beyond[robot] = int(self.beyond[robot]), NOWHERE
        elif needs_charge:
            goal = self._free(here, here.floor, BayKind.CHARGER)
        elif may_ride and self._rng.random() < LIFT_SHARE and self._may_ride(robot, here):
            goal = self._free(here, here.floor, BayKind.LIFT)
        else:
            goal = self._free(here, here.floor, BayKind.DOCK, BayKind.PARKING)
        if goal == NOWHERE:
            return None
        self._taken[goal] = True
        self.goal[robot] = goal
        return self.layout.bays[goal]

    def arrive(self, robot: int) -> Bay:
        """The robot stands in the bay that it went to, and only now leaves the one it came from to others."""
        self._taken[self.bay[robot]] = False
        self.bay[robot], self.goal[robot] = self.goal[robot], NOWHERE
        return self.at(robot)

    def other_floor(self, robot: int) -> Bay:
        """Where the lift that the robot goes to, or rides in, will let it out."""
        lift = self.goal[robot] if self.goal[robot] != NOWHERE else self.bay[robot]
        return self.layout.bays[self.layout.other_lift[int(lift)]]

    def ride(self, robot: int) -> Bay:
        """Change floors."""
        below = int(self.bay[robot])
        self.bay[robot] = self.layout.other_lift[below]
        self._taken[below] = False
        return self.at(robot)

    def _may_ride(self, robot: int, here: Bay) -> bool:
        """Take a bay on the other floor and the far side of a lift, where the near side is free too."""
        lift = self._free(here, here.floor, BayKind.LIFT)
        if lift == NOWHERE or self._taken[self.layout.other_lift[lift]]:
            return False
        far = self.layout.other_lift[lift]
        beyond = self._free(self.layout.bays[far], 1 - here.floor, BayKind.DOCK)
        if beyond == NOWHERE:
            return False
        self._taken[[far, beyond]] = True
        self.beyond[robot] = beyond
        return True

    def _free(self, start: Bay, floor: int, *kinds: BayKind) -> int:
        """Any free bay of these kinds a trip's length from `start`; of lifts and chargers, the nearest."""
        away_m = np.abs(self._places - start.place).sum(axis=1)
        fits = ~self._taken & (self._floors == floor) & np.isin(self._kinds, [kind.value for kind in kinds])
        if BayKind.DOCK not in kinds:
            near = np.where(fits, away_m, np.inf)
            return int(near.argmin()) if fits.any() else NOWHERE
        found = np.flatnonzero(fits & (away_m >= TRIP_M[0]) & (away_m <= TRIP_M[1]))
        return int(self._rng.choice(found)) if len(found) else NOWHERE
