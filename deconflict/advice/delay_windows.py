"""What delaying robots on their paths does to each pair: the differences of delay that bring two together.

A held robot stands where it is, then follows its forecast, late by its hold. Let u and v say how far two robots are
along their forecasts, in seconds. Both stand until the first sets off, then one goes and the other stands, then both
go: the path through (u, v) depends on the difference of the holds alone, and so does whether it meets a conflict.
Differences on the grid of holds are swept as they are, standing included, so on that grid the answer is exact.
"""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, lru_cache
from math import inf
from typing import NamedTuple

import numpy as np

from deconflict.sweep.geometry.knots import Knots, Robots, delayed
from deconflict.sweep.one_shot import first_contacts
from ingest.batch import Bools, Floats, Ints, Pair

STEP_S = 0.5
"""Holds are multiples of this."""
SHORT_S = 2.0
"""A forecast that ends no more than this before the horizon goes on as it ended; one that ends sooner stands."""


class Mover(NamedTuple):
    """One robot that others meet."""

    name: str
    vendor: str
    holdable: bool = True
    """False where it stands anyway."""
    priority: float = 1.0
    """What a second of its waiting counts."""


class Near(NamedTuple):
    """n robots that are near each other."""

    uuids: Sequence[str]
    """(n,) ascending."""
    vendors: Sequence[str]
    """(n,)"""
    robots: Robots
    """(n,) as they are swept."""
    knots: Knots
    mover: Callable[[int], Mover]
    """Who is in a row of them."""


@dataclass(frozen=True, slots=True)
class Window:
    """From when on robots may be held, and for how long; how far ahead forecasts are used."""

    start_s: float
    horizon_s: float
    clearance_m: float
    longest_hold_s: float

    @property
    def steps(self) -> int:
        """The longest hold, in `STEP_S`."""
        return int(self.longest_hold_s / STEP_S)


class Fan(NamedTuple):
    """Some pairs at each difference of holds of up to so many steps: d differences in `STEP_S`, from the least on."""

    hold_s: Floats
    """(robots * (steps + 1),) every hold of every robot."""
    a: Ints
    """(pairs * d,) which of those the first of each pair is at each difference."""
    b: Ints
    """(pairs * d,) which the second is."""
    late_s: Floats
    """(pairs * d,) how late the one that is held is."""


class Delays:
    """What holding some of the robots that are near each other does to their pairs."""

    def __init__(self, near: Near, window: Window) -> None:
        self._near, self._window = near, window
        self._row, self._rows = {uuid: row for row, uuid in enumerate(near.uuids)}, np.arange(len(near.uuids))

    def meetings(self, held_s: Mapping[str, float], of: Collection[str]) -> dict[Pair, float]:
        """Who comes within the clearance of one `of` these, and when first, where some robots are held for so long.

        Until the last that is held has had its horizon. Pairs that begin within the clearance are left out.
        """
        window, uuids = self._window, self._near.uuids
        a, b = _pairs_with(len(uuids), [self._row[uuid] for uuid in of])
        until_s = np.full(len(a), window.start_s + window.horizon_s + max(held_s.values(), default=0.0))
        hold_s = np.zeros(len(uuids))
        for uuid, seconds in held_s.items():
            hold_s[self._row[uuid]] = seconds
        met_s, begins_m = self._first_meetings(self._rows, hold_s, a, b, until_s, window.clearance_m)
        (met,) = ((met_s < inf) & (begins_m > window.clearance_m)).nonzero()
        return {
            (uuids[one], uuids[other]): at_s
            for one, other, at_s in zip(a[met].tolist(), b[met].tolist(), met_s[met].tolist(), strict=True)
        }

    def allowed(self, pairs: Sequence[Pair]) -> Bools:
        """(pairs, d) for each the differences of hold, first less second, in `STEP_S` from the least on, at which they
        keep apart.

        Two that begin within the clearance must not touch, whatever else; two that touch already may have any
        difference.
        """
        row = {robot: row for row, robot in enumerate(dict.fromkeys(robot for pair in pairs for robot in pair))}
        window, steps = self._window, self._window.steps
        fan = _fan(steps, tuple((row[one], row[other]) for one, other in pairs))
        rows = np.array([self._row[robot] for robot in row], np.int64).repeat(steps + 1)
        until_s = fan.late_s + (window.start_s + window.horizon_s)
        met_s, begins_m = self._first_meetings(rows, fan.hold_s, fan.a, fan.b, until_s, window.clearance_m)
        allowed: Bools = (met_s == inf).reshape(len(pairs), -1)
        is_near = begins_m[:: 2 * steps + 1] <= window.clearance_m
        if is_near.any():
            each = is_near.repeat(2 * steps + 1)
            met_s, begins_m = self._first_meetings(rows, fan.hold_s, fan.a[each], fan.b[each], until_s[each], 0.0)
            touch = begins_m[:: 2 * steps + 1, None] <= 0.0
            allowed[is_near] = (met_s == inf).reshape(-1, 2 * steps + 1) | touch
        return allowed

    def _first_meetings(
        self, rows: Ints, hold_s: Floats, a: Ints, b: Ints, until_s: Floats, clearance_m: float
    ) -> tuple[Floats, Floats]:
        """See `first_contacts`: the pairs `a` and `b` of the robots of `rows` (n,), each `hold_s` (n,) late."""
        near, window = self._near, self._window
        until = (window.start_s, window.horizon_s, SHORT_S, 2 * window.longest_hold_s)
        late = delayed(near.robots, near.knots, rows, hold_s, *until)
        return first_contacts(*late, a, b, now_s=window.start_s, until_s=until_s, clearance_m=clearance_m)


@lru_cache(64)
def _fan(steps: int, pairs: tuple[tuple[int, int], ...]) -> Fan:
    """Of pairs of robots by number, of which the first is 0."""
    holds, differences = np.arange(steps + 1, dtype=np.float64), np.arange(-steps, steps + 1)
    first, second = np.maximum(differences, 0), np.maximum(-differences, 0)
    a, b = np.array(pairs, np.int64).T[:, :, None] * (steps + 1)
    late_s = np.tile((first + second) * STEP_S, len(pairs))
    return Fan(np.tile(holds * STEP_S, 1 + int(np.max(pairs))), (a + first).ravel(), (b + second).ravel(), late_s)


def _pairs_with(robots: int, chosen: Sequence[int]) -> tuple[Ints, Ints]:
    """Rows of every two of so many of which one at least is chosen, the lower first."""
    (a, b), is_chosen = _pairs_of(robots), np.zeros(robots, bool)
    is_chosen[chosen] = True
    (rows,) = (is_chosen[a] | is_chosen[b]).nonzero()
    return a[rows], b[rows]


@cache
def _pairs_of(robots: int) -> tuple[Ints, Ints]:
    """Rows of every two of so many."""
    a, b = np.triu_indices(robots, 1)
    return np.ascontiguousarray(a), np.ascontiguousarray(b)
