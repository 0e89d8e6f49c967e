"""What delaying robots on their paths does to each pair: the differences of delay that bring two together.

A held robot stands where it is, then follows its forecast, late by its hold. Let u and v say how far two robots are
along their forecasts, in seconds. Both stand until the first sets off, then one goes and the other stands, then both
go: the path through (u, v) depends on the difference of the holds alone, and so does whether it meets a conflict.
Differences on the grid of holds are swept as they are, standing included, so on that grid the answer is exact.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from math import inf
from typing import NamedTuple

import numpy as np

from deconflict.motion import Knots, Robots, delayed, faults, robots_of
from deconflict.sweep import first_meetings
from ingest.compiled import ready
from ingest.seam import Floats, Forecasts, Ints

STEP_S = 0.5
"""Holds are multiples of this."""
SHORT_S = 2.0
"""A forecast that ends no more than this before the horizon goes on as it ended; one that ends sooner stands."""

Pair = tuple[str, str]
Late = tuple[Robots, Knots]
"""Robots, each late by its hold, and their knots."""


class Mover(NamedTuple):
    """One robot that others meet."""

    robot: str
    name: str
    vendor: str
    told: Forecasts
    """Of all that are asked of together, envelopes as they are swept."""
    row: int = 0
    """Which of them is its own."""
    holdable: bool = True
    """False where it stands anyway."""
    priority: float = 1.0
    """What a second of its waiting counts."""

    @property
    def forecast(self) -> Forecasts:
        """Of this robot alone."""
        return self.told.one(self.row)


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
    """Holds of up to so many steps, and their differences (d,), in `STEP_S`."""

    hold_s: Floats
    """(steps + 1,)"""
    differences: Ints
    first: Ints
    """(d,) what the first of two is held for at each difference."""
    second: Ints
    """(d,) what the second is."""
    late_s: Floats
    """(d,) how late the one that is held is."""


class Delays:
    """What holding some of the robots that are near each other does to their pairs."""

    def __init__(self, movers: Sequence[Mover], window: Window) -> None:
        self._movers, self._window = movers, window
        self._told, self._rows = _together(movers)
        self._place = {one.robot: place for place, one in enumerate(movers)}
        self._robots = robots_of(self._told, self._told.start[:-1], self._told.start[1:] - self._told.start[:-1])
        if wrong := faults(self._told):
            self._robots["count"][list(wrong)] = 0

    def meetings(self, held_s: Mapping[str, float]) -> dict[Pair, float]:
        """Who comes within the clearance, and when first, where some robots are held for so long.

        Until the last that is held has had its horizon. Pairs that begin within the clearance are left out.
        """
        window, movers, (a, b) = self._window, self._movers, _pairs_of(len(self._movers))
        until_s = np.full(len(a), window.start_s + window.horizon_s + max(held_s.values(), default=0.0))
        hold_s = np.zeros(len(movers))
        for robot, seconds in held_s.items():
            hold_s[self._place[robot]] = seconds
        late = self._delayed(self._rows, hold_s)
        met_s, begins_m = self._first_meetings(late, a, b, until_s, window.clearance_m)
        (met,) = ((met_s < inf) & (begins_m > window.clearance_m)).nonzero()
        return {
            (movers[one].robot, movers[other].robot): at_s
            for one, other, at_s in zip(a[met].tolist(), b[met].tolist(), met_s[met].tolist(), strict=True)
        }

    def allowed(self, pairs: Sequence[Pair]) -> list[list[int]]:
        """For each pair the differences of hold, first less second, in `STEP_S`, at which they keep apart.

        Two that begin within the clearance must not touch, whatever else; two that touch already may have any
        difference.
        """
        steps, from_s = _fan(self._window.steps), self._window.start_s + self._window.horizon_s
        fans, a, b = self._fans(pairs, steps)
        allowed, open_ = np.ones(a.shape, bool), np.arange(len(pairs))
        for clearance_m in (self._window.clearance_m, 0.0):
            until_s = np.concatenate([from_s + steps.late_s] * len(open_))
            told = self._first_meetings(fans, a[open_].ravel(), b[open_].ravel(), until_s, clearance_m)
            met_s, begins_m = (one.reshape(-1, len(steps.late_s)) for one in told)
            near = begins_m[:, 0] <= clearance_m
            allowed[open_[~near]] = met_s[~near] == inf
            open_ = open_[near]
            if not len(open_):
                break
        return [steps.differences[row].tolist() for row in allowed]

    def _fans(self, pairs: Sequence[Pair], steps: Fan) -> tuple[Late, Ints, Ints]:
        """Every robot of the pairs at every hold; and of each pair, (p, differences), the rows of both at each."""
        robots, holds = dict.fromkeys(robot for pair in pairs for robot in pair), len(steps.hold_s)
        rows = self._rows[[self._place[robot] for robot in robots]]
        fans = self._delayed(rows.repeat(holds), np.concatenate([steps.hold_s] * len(rows)))
        begins = dict(zip(robots, range(0, len(rows) * holds, holds), strict=True))
        a, b = np.array([[begins[one], begins[other]] for one, other in pairs], np.int64).T[:, :, None]
        return fans, a + steps.first, b + steps.second

    def _delayed(self, rows: Ints, hold_s: Floats) -> Late:
        """The robots of `rows` (n,), each `hold_s` (n,) late, and their knots to where the last ends its."""
        f, window = self._told, self._window
        t_s, x_m, y_m, yaw_rad = (ready(column) for column in (f.t_s, f.x_m, f.y_m, f.yaw_rad))
        until = (window.start_s, window.horizon_s, SHORT_S, 2 * window.longest_hold_s)
        return delayed(self._robots, t_s, x_m, y_m, yaw_rad, ready(f.floor, np.int64), rows, hold_s, *until)

    def _first_meetings(
        self, late: Late, a: Ints, b: Ints, until_s: Floats, clearance_m: float
    ) -> tuple[Floats, Floats]:
        return first_meetings(*late, a, b, now_s=self._window.start_s, until_s=until_s, clearance_m=clearance_m)


@cache
def _fan(steps: int) -> Fan:
    holds, differences = np.arange(steps + 1, dtype=np.float64), np.arange(-steps, steps + 1)
    first, second = np.maximum(differences, 0), np.maximum(-differences, 0)
    return Fan(holds * STEP_S, differences, first, second, (first + second) * STEP_S)


def _together(movers: Iterable[Mover]) -> tuple[Forecasts, Ints]:
    """Their forecasts, and the row of each."""
    movers, begins, robots = list(movers), {}, 0
    parts = {id(one.told): one.told for one in movers}
    for part, told in parts.items():
        begins[part], robots = robots, robots + len(told)
    return Forecasts.joined(parts.values()), np.array([begins[id(one.told)] + one.row for one in movers], np.int64)


@cache
def _pairs_of(robots: int) -> tuple[Ints, Ints]:
    """Rows of every two of so many."""
    a, b = np.triu_indices(robots, 1)
    return np.ascontiguousarray(a), np.ascontiguousarray(b)
