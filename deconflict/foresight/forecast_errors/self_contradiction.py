"""Robots that go elsewhere than their forecasts say, and where they go instead.

A robot is compared with its forecast whenever it has moved for about a second. Its contradiction is its distance from
the path that it stated. The time along that path does not count. So a robot that waits, hurries, or is late on its path
does not contradict itself: the bands of the ledger cover such errors. A robot contradicts itself if it takes another
path, or if it moves although it reports that it stands. After a few such reports, its forecast is replaced while it
moves: it is assumed to go straight on at the speed of its last second. Points of a forecast that are far apart in time
say little about the path between them, so such a forecast is not compared.
"""

from dataclasses import replace
from math import hypot, inf

import numba
import numpy as np
from numpy.typing import NDArray

from deconflict.sweep.robot_slots import lengthen
from ingest.batch import Basis, Batch, Bools, Floats, Forecasts, Ints
from ingest.kernels import INTS, READ_FLOATS, READ_INTS, inner, kernel

NAMED_AFTER_S = 10.0
"""A robot is named once all of its reports over this time contradicted it."""
KEPT_S = 30.0
"""It is named until this time after the last one."""
ANNOUNCED = (Basis.PATH, Basis.ORDER)
"""Bases of forecasts that a robot states itself. Who announces nothing cannot move otherwise."""


class DoubtedRobots:
    """By slot, since when and until when each robot contradicted what it announced."""

    def __init__(self) -> None:
        self._since_s = np.zeros(0)
        """inf if it did not."""
        self._last_s = np.zeros(0)

    def grow(self, slots: int) -> None:
        """Make room for this many slots."""
        before = len(self._since_s)
        if slots > before:
            lengthen(self, ("_since_s", "_last_s"), slots - before)
            self.forget(np.arange(before, slots))

    def forget(self, slots: Ints) -> None:
        """Other robots have these slots from now on."""
        self._since_s[slots], self._last_s[slots] = np.inf, -np.inf

    def note(self, slots: Ints, batch: Batch, contradict: Bools) -> None:
        """Robots of these slots have reported, in this batch as they announced it; (n,) which contradict that. Nobody
        on foot is doubted."""
        announces = np.isin(batch.basis, ANNOUNCED) & (np.array(batch.participants) != "person")
        since_s, last_s = self._since_s[slots], self._last_s[slots]
        were_named = self._are_named(slots, batch.now_s)
        since_s[batch.now_s - last_s > KEPT_S] = np.inf
        since_s = np.where(contradict, np.minimum(since_s, batch.now_s), np.where(were_named, since_s, np.inf))
        self._since_s[slots] = np.where(announces, since_s, np.inf)
        self._last_s[slots] = np.where(contradict & announces, batch.now_s, last_s)

    def named(self, now_s: float) -> Ints:
        """The slots of the robots to name."""
        return np.flatnonzero(self._are_named(slice(None), now_s))

    def _are_named(self, slots: Ints | slice, now_s: float) -> Bools:
        last_s = self._last_s[slots]
        return (last_s - self._since_s[slots] >= NAMED_AFTER_S) & (now_s - last_s <= KEPT_S)


AHEAD_S = (0.5, 1.0, 1.5, 2.0, 3.0, 4.0)
"""The stated path of a robot is kept at these times after its report."""
LEAST_S, MOST_S = 0.7, 3.0
"""Minimum and maximum time between two reports that are compared."""
DOUBTED_MPS = 0.3
"""A slower robot is believed: it may wait, or be starting."""
SLACK_M, SLACK_SHARE = 0.15, 0.5
"""A robot is still on its path within this distance plus this share of the distance that it went."""
LONGEST_LEG_S, AWAY_M = 3.0, 0.3
"""A leg that takes longer and leads further does not state the path."""
KEEPS = 0.7
"""The share of a contradiction that is left at the next comparison."""

STATED_WAY = np.dtype(
    [
        ("at_s", np.float64),  # time of the report with the stated way
        ("x_m", np.float64),  # place of the robot then
        ("y_m", np.float64),
        ("floor", np.float64),
        ("x_mps", np.float64),  # velocity between the last two compared reports
        ("y_mps", np.float64),
        (
            "contradiction",
            np.float64,
        ),  # distance from the way by what is allowed; averaged over reports
        ("way_m", np.float64, (len(AHEAD_S), 2)),  # x and y of the stated way
        ("is_vague", np.bool_),  # the forecast does not state the way
    ],
    align=True,
)
"""The stated way of a robot, and how well its reports agree with it."""

StatedWays = NDArray[np.void]
"""(slots,) of `STATED_WAY`."""

_STATED_WAYS = numba.from_dtype(STATED_WAY)[::1]


def blank_records(slots: int) -> StatedWays:
    """(slots,) records of robots that have not reported yet."""
    stated_ways = np.zeros(slots, STATED_WAY)
    stated_ways["at_s"] = -inf
    return stated_ways


@inner
def _place(t_s: Floats, at_m: Floats, first: int, end: int, at_s: float) -> float:
    """A coordinate at `at_s`, between the knots from `first` to `end`."""
    if at_s <= t_s[first]:
        return float(at_m[first])
    for knot in range(first + 1, end):
        if at_s <= t_s[knot]:
            share = (at_s - t_s[knot - 1]) / (t_s[knot] - t_s[knot - 1])
            return float(at_m[knot - 1] + share * (at_m[knot] - at_m[knot - 1]))
    return float(at_m[end - 1])


@inner
def _is_vague(t_s: Floats, x_m: Floats, y_m: Floats, first: int, end: int) -> bool:
    """Whether a leg that a robot may drive before it is compared does not state the way."""
    for knot in range(first + 1, end):
        if t_s[knot - 1] > t_s[first] + MOST_S:
            break
        leads_m = hypot(x_m[knot] - x_m[knot - 1], y_m[knot] - y_m[knot - 1])
        if t_s[knot] - t_s[knot - 1] > LONGEST_LEG_S and leads_m > AWAY_M:
            return True
    return False


@inner
def _distance_m(way_m: Floats, from_x: float, from_y: float, x: float, y: float) -> float:
    """Distance of the point (x, y) from a way that begins at (from_x, from_y)."""
    least = np.inf
    for look in range(len(way_m)):
        to_x, to_y = way_m[look, 0], way_m[look, 1]
        along_x, along_y = to_x - from_x, to_y - from_y
        square = along_x * along_x + along_y * along_y
        share = ((x - from_x) * along_x + (y - from_y) * along_y) / square if square > 0.0 else 0.0
        share = min(max(share, 0.0), 1.0)
        least = min(least, hypot(x - from_x - share * along_x, y - from_y - share * along_y))
        from_x, from_y = to_x, to_y
    return least


@kernel(READ_INTS.copy(readonly=False)(_STATED_WAYS, INTS, READ_INTS, *[READ_FLOATS] * 3, READ_INTS))
def compare_with_stated_ways(
    stated_ways: StatedWays, slots: Ints, start: Ints, t_s: Floats, x_m: Floats, y_m: Floats, floor: Ints
) -> Ints:
    """Compare robots of `slots` (n,) with the ways that they stated before, and keep the ways of their new forecasts,
    given as columns of `Forecasts`. Returns the rows (m,) of the robots that move and contradict themselves."""
    rows, n = np.empty(len(slots), np.int64), 0
    for row in range(len(slots)):
        way, first, end = stated_ways[slots[row]], start[row], start[row + 1]
        at_s, x, y = t_s[first], x_m[first], y_m[first]
        gap_s = at_s - way.at_s
        if not (0.0 <= gap_s < LEAST_S and way.floor == floor[first]):
            if LEAST_S <= gap_s <= MOST_S and way.floor == floor[first]:
                way.x_mps, way.y_mps = (x - way.x_m) / gap_s, (y - way.y_m) / gap_s
                went_m = hypot(x - way.x_m, y - way.y_m)
                if way.is_vague:
                    way.contradiction *= KEEPS
                elif went_m >= DOUBTED_MPS * gap_s:
                    off_m = _distance_m(way.way_m, way.x_m, way.y_m, x, y)
                    way.contradiction = KEEPS * way.contradiction + (1 - KEEPS) * off_m / (
                        SLACK_M + SLACK_SHARE * went_m
                    )
            else:
                way.x_mps = way.y_mps = 0.0
            way.at_s, way.x_m, way.y_m, way.floor = at_s, x, y, floor[first]
            way.is_vague = _is_vague(t_s, x_m, y_m, first, end)
            for look in range(len(AHEAD_S)):
                way.way_m[look, 0] = _place(t_s, x_m, first, end, at_s + AHEAD_S[look])
                way.way_m[look, 1] = _place(t_s, y_m, first, end, at_s + AHEAD_S[look])
        if way.contradiction > 1.0 and hypot(way.x_mps, way.y_mps) >= DOUBTED_MPS:
            rows[n] = row
            n += 1
    return rows[:n].copy()


def straight_on(batch: Batch, rows: Ints, slots: Ints, stated_ways: StatedWays, horizon_s: float) -> Batch:
    """The batch, in which the robots of `rows` (m,), of `slots` (m,), go straight on for the horizon instead."""
    forecasts = batch.forecasts
    first, m = forecasts.start[rows], len(rows)
    records = stated_ways[slots]
    t_s, x_m, y_m = forecasts.t_s[first], forecasts.x_m[first], forecasts.y_m[first]
    straight = replace(
        forecasts.take(rows),
        start=np.arange(0, 2 * m + 1, 2),
        t_s=np.stack([t_s, t_s + horizon_s], axis=1).ravel(),
        x_m=np.stack([x_m, x_m + records["x_mps"] * horizon_s], axis=1).ravel(),
        y_m=np.stack([y_m, y_m + records["y_mps"] * horizon_s], axis=1).ravel(),
        yaw_rad=forecasts.yaw_rad[first].repeat(2),
        floor=forecasts.floor[first].repeat(2),
    )
    order, basis = np.arange(len(batch)), batch.basis.copy()
    order[rows], basis[rows] = len(batch) + np.arange(m), Basis.VELOCITY
    return replace(batch, basis=basis, forecasts=Forecasts.joined([forecasts, straight]).take(order))
