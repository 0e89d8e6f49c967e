"""Where robots go, as they say it in a batch: all destinations at once."""

from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from deconflict.contention.ahead import Ahead
from deconflict.contention.arrivals import Quantiles, expected
from deconflict.contention.geometry import Geometry
from deconflict.contention.promises import ARRIVED_M, Spot
from ingest.seam import Batch, Floats

QUICKEST_MPS = 2.0
"""Nobody is expected to be anywhere sooner than at this speed in a straight line."""
UNTOLD: Quantiles = (0.0, 0.0, 0.0)


class Stop(NamedTuple):
    """One destination ahead."""

    t_s: float
    """When the robot comes, corrected by how wrong its vendor has been."""
    spread_s: float
    datum: str
    x_m: float
    y_m: float
    resource: str | None


class Destinations:
    """What the n robots of a batch say, m destinations in all, by robot."""

    def __init__(
        self, batch: Batch, view: Ahead, now_s: Floats, here: Sequence[str | None], geometry: Geometry
    ) -> None:
        """`view`, `now_s` (n,) and the resource that each robot has, `here` (n), are of when it says so."""
        told, n = batch.destinations, len(batch)
        self._robot = np.repeat(np.arange(n), np.diff(told.start))
        self._t_s, self._now_s = told.t_s, now_s[self._robot]
        from_x_m, from_y_m = view.x_m[self._robot, 0], view.y_m[self._robot, 0]
        on_floor = np.maximum(told.floor, -1) == np.maximum(view.floor[self._robot, 0], -1)
        self._away_m = np.where(on_floor, np.hypot(told.x_m - from_x_m, told.y_m - from_y_m), 0.0)
        datums = batch.datums(told.floor)
        self.spots: list[Spot] = list(zip(datums, told.x_m.tolist(), told.y_m.tolist(), strict=True))
        self.told_s: list[float] = told.t_s.tolist()
        self._resources = geometry.resources_at(datums, told.x_m, told.y_m)
        there = on_floor & (self._away_m <= ARRIVED_M)
        robots = zip(self._robot.tolist(), self._resources, strict=True)
        there |= np.fromiter((place is not None and place == here[row] for row, place in robots), bool, len(there))
        start = told.start.tolist()
        self.spans = list(pairwise(start))
        """(n) of the robots' rows of `spots` and `told_s`."""
        self.first = start[:-1]
        """(n) the first that each robot is not at already."""
        for row, robot in zip(np.flatnonzero(there).tolist(), self._robot[there].tolist(), strict=True):
            self.first[robot] += self.first[robot] == row

    def stops(self, rates: Sequence[Quantiles]) -> list[Stop]:
        """All of them, each no sooner than its robot can be there; `rates` (n) are of the robots' vendors."""
        if not self.spots:
            return []
        expected_s, spread_s = expected(np.array(rates)[self._robot], self._now_s, self._t_s)
        soonest_s = self._now_s + self._away_m / QUICKEST_MPS
        times = (np.maximum(expected_s, soonest_s).tolist(), spread_s.tolist())
        each = zip(*times, self.spots, self._resources, strict=True)
        return [Stop(t_s, spread_s, *spot, resource) for t_s, spread_s, spot, resource in each]
