"""Which differences of delay bring two robots together, if robots wait before they follow their paths.

A held robot stands where it is, then follows its forecast, late by its hold. Let u and v be how far two robots are
along their forecasts, in seconds. Both stand until the first departs, then one moves and the other stands, then both
move. The path through (u, v) depends only on the difference of the holds, and so does whether it meets a conflict. The
sweep is run for each difference on the grid of holds, standing included, so on that grid the answer is exact.
"""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, lru_cache
from math import inf
from typing import NamedTuple

import numpy as np

from deconflict.sweep.geometry.knots import Knots, Robots, delayed
from deconflict.sweep.shapes.trains import with_trailers
from deconflict.sweep.sweep_once import first_contacts
from ingest.batch import Bools, Floats, Ints, Pair

STEP_S = 0.5
"""Holds are multiples of this."""
SHORTEST_HOLD_S = 1.0
"""Nobody is held for a shorter time."""
SHORTEST_STEPS = round(SHORTEST_HOLD_S / STEP_S)
SHORT_S = 2.0
"""A forecast that ends no more than this before the horizon is extrapolated; after one that ends sooner, it stands."""


class PlannedRobot(NamedTuple):
    """What a plan has to know of one robot."""

    name: str
    vendor: str
    holdable: bool = True
    """False if it stands anyway, or is a person on foot."""
    priority: float = 1.0
    """Weight of a second of its waiting."""
    waited_s: float = -inf
    """When it was last seen to wait as advised, seconds since the epoch."""
    on_foot: bool = False
    """Whether it is a person on foot: vehicles yield."""


class NearbyRobots(NamedTuple):
    """n robots that are near each other."""

    uuids: Sequence[str]
    """(n,) in ascending order."""
    vendors: Sequence[str]
    """(n,)"""
    robots: Robots
    """(n + m,) as they are swept, and their m trailers."""
    knots: Knots
    """Their forecasts."""
    planned: Callable[[int], PlannedRobot]
    """The robot of a row."""


@dataclass(frozen=True, slots=True)
class HoldWindow:
    """The limits within which holds are planned."""

    start_s: float
    """When holds begin, seconds since the epoch."""
    horizon_s: float
    """How far ahead forecasts are used, from `start_s` plus the hold of a robot on."""
    clearance_m: float
    """Envelopes nearer than this are in conflict."""
    longest_hold_s: float

    @property
    def steps(self) -> int:
        """The longest hold, in units of `STEP_S`."""
        return int(self.longest_hold_s / STEP_S)


class DifferenceGrid(NamedTuple):
    """Pairs at each difference of their holds: d differences in units of `STEP_S`, in ascending order."""

    hold_s: Floats
    """(robots * (steps + 1),) every hold of every robot."""
    a: Ints
    """(pairs * d,) index in `hold_s` of the first robot of each pair at each difference."""
    b: Ints
    """(pairs * d,) index in `hold_s` of the second robot."""
    late_s: Floats
    """(pairs * d,) how late the held robot of the two is."""


class DelayWindows:
    """What holding some of the robots that are near each other does to their pairs."""

    def __init__(self, near: NearbyRobots, window: HoldWindow) -> None:
        self._near, self._window = near, window
        self._row_of, self._rows = {uuid: row for row, uuid in enumerate(near.uuids)}, np.arange(len(near.uuids))

    def contacts_s(self, held_s: Mapping[str, float], of: Collection[str]) -> dict[Pair, float]:
        """The pairs of robots in `of` that come within the clearance, and when first, if robots are held for `held_s`.

        Until the last held robot has had its horizon. Pairs that begin within the clearance are left out.
        """
        window, uuids = self._window, self._near.uuids
        a, b = _pairs_with(len(uuids), [self._row_of[uuid] for uuid in of])
        until_s = np.full(len(a), window.start_s + window.horizon_s + max(held_s.values(), default=0.0))
        hold_s = np.zeros(len(uuids))
        for uuid, seconds in held_s.items():
            hold_s[self._row_of[uuid]] = seconds
        contact_s, start_m = self._first_contacts(self._rows, hold_s, a, b, until_s, window.clearance_m)
        (found,) = ((contact_s < inf) & (start_m > window.clearance_m)).nonzero()
        columns = a[found].tolist(), b[found].tolist(), contact_s[found].tolist()
        return {(uuids[first], uuids[second]): at_s for first, second, at_s in zip(*columns, strict=True)}

    def allowed(self, pairs: Sequence[Pair]) -> Bools:
        """(pairs, d) whether each pair keeps apart at each difference of holds, first less second, in ascending order.

        Two that begin within the clearance only must not touch. Two that touch already may have any difference.
        """
        row_of = {robot: row for row, robot in enumerate(dict.fromkeys(robot for pair in pairs for robot in pair))}
        window, steps = self._window, self._window.steps
        grid = _difference_grid(steps, tuple((row_of[a], row_of[b]) for a, b in pairs))
        rows = np.array([self._row_of[robot] for robot in row_of], np.int64).repeat(steps + 1)
        until_s = grid.late_s + (window.start_s + window.horizon_s)
        contact_s, start_m = self._first_contacts(rows, grid.hold_s, grid.a, grid.b, until_s, window.clearance_m)
        allowed: Bools = (contact_s == inf).reshape(len(pairs), -1)
        is_near = start_m[:: 2 * steps + 1] <= window.clearance_m
        if is_near.any():
            some = is_near.repeat(2 * steps + 1)
            contact_s, start_m = self._first_contacts(rows, grid.hold_s, grid.a[some], grid.b[some], until_s[some], 0.0)
            touch = start_m[:: 2 * steps + 1, None] <= 0.0
            allowed[is_near] = (contact_s == inf).reshape(-1, 2 * steps + 1) | touch
        return allowed

    def _first_contacts(
        self, rows: Ints, hold_s: Floats, a: Ints, b: Ints, until_s: Floats, clearance_m: float
    ) -> tuple[Floats, Floats]:
        """See `first_contacts`: the pairs `a` and `b` of the robots of `rows` (n,), each `hold_s` (n,) late."""
        near, window = self._near, self._window
        until = (window.start_s, window.horizon_s, SHORT_S, 2 * window.longest_hold_s)
        rows, hold_s, trailers = with_trailers(near.robots, len(near.uuids), rows, hold_s)
        late = delayed(near.robots, near.knots, rows, hold_s, *until)
        start_s = window.start_s
        return first_contacts(*late, a, b, now_s=start_s, until_s=until_s, clearance_m=clearance_m, trailers=trailers)


@lru_cache(64)
def _difference_grid(steps: int, pairs: tuple[tuple[int, int], ...]) -> DifferenceGrid:
    """The grid of pairs of robots, which are numbered from 0."""
    holds, differences = np.arange(steps + 1, dtype=np.float64), np.arange(-steps, steps + 1)
    first, second = np.maximum(differences, 0), np.maximum(-differences, 0)
    a, b = np.array(pairs, np.int64).T[:, :, None] * (steps + 1)
    late_s = np.tile((first + second) * STEP_S, len(pairs))
    hold_s = np.tile(holds * STEP_S, 1 + int(np.max(pairs)))
    return DifferenceGrid(hold_s, (a + first).ravel(), (b + second).ravel(), late_s)


def _pairs_with(robots: int, chosen: Sequence[int]) -> tuple[Ints, Ints]:
    """Rows of all pairs of so many robots that have at least one of `chosen`, the lower row first."""
    (a, b), is_chosen = _all_pairs(robots), np.zeros(robots, bool)
    is_chosen[chosen] = True
    (rows,) = (is_chosen[a] | is_chosen[b]).nonzero()
    return a[rows], b[rows]


@cache
def _all_pairs(robots: int) -> tuple[Ints, Ints]:
    """Rows of all pairs of this many robots."""
    a, b = np.triu_indices(robots, 1)
    return np.ascontiguousarray(a), np.ascontiguousarray(b)
