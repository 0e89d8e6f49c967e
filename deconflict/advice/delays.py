"""What delaying robots on their paths does to each pair: the differences of delay that bring two together.

A held robot stands where it is, then follows its forecast, late by its hold. Let u and v say how far two robots are
along their forecasts, in seconds. Both stand until the first sets off, then one goes and the other stands, then both
go: the path through (u, v) depends on the difference of the holds alone, and so does whether it meets a conflict.
Differences on the grid of holds are swept as they are, standing included, so on that grid the answer is exact.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cache
from math import inf, pi

import numba
import numpy as np

from deconflict.sweep import first_meetings
from ingest.compiled import kernel, ready
from ingest.seam import Floats, Forecasts, Ints

STEP_S = 0.5
"""Holds are multiples of this."""
SHORT_S = 2.0
"""A forecast that ends no more than this before the horizon goes on as it ended; one that ends sooner stands."""

SAME_S = 1e-6
"""A knot so soon after the beginning is left out for it."""
_FLOATS, _INTS = numba.float64[::1], numba.int64[::1]
_ASKED, _ASKED_INTS = (numba.types.Array(kind, 1, "C", readonly=True) for kind in (numba.float64, numba.int64))

Pair = tuple[str, str]


@dataclass(frozen=True, slots=True)
class Mover:
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


@kernel(
    numba.types.Tuple((_INTS, *[_FLOATS] * 4, _INTS))(  # type: ignore[no-untyped-call]
        _ASKED_INTS, *[_ASKED] * 4, _ASKED_INTS, _ASKED_INTS, _ASKED, *[numba.float64] * 4
    )
)
def _delayed(
    start: Ints,
    t_s: Floats,
    x_m: Floats,
    y_m: Floats,
    yaw_rad: Floats,
    floor: Ints,
    rows: Ints,
    hold_s: Floats,
    leaves_s: float,
    horizon_s: float,
    short_s: float,
    beyond_s: float,
) -> tuple[Ints, Floats, Floats, Floats, Floats, Ints]:
    """Knots of `rows`: where each is at `leaves_s` and again when its hold ends, what it does later, and a last one in
    line with the two before it `beyond_s` after its horizon, unless it ends sooner than `short_s` before that."""
    begins, most = np.zeros(len(rows) + 1, np.int64), 0
    for row in rows:
        most += start[row + 1] - start[row] + 3
    t, x, y, yaw, on_floor = np.empty(most), np.empty(most), np.empty(most), np.empty(most), np.empty(most, np.int64)
    n = 0
    for at in range(len(rows)):
        first, end, hold, begin = start[rows[at]], start[rows[at] + 1], hold_s[at], n
        passed = np.searchsorted(t_s[first:end], leaves_s, "right")
        knot, share, turn = first + max(passed - 1, 0), 0.0, 0.0
        after = knot + 1
        if passed and after < end and floor[after] == floor[knot]:
            share = (leaves_s - t_s[knot]) / (t_s[after] - t_s[knot])
            turn = (yaw_rad[after] - yaw_rad[knot] + pi) % (2 * pi) - pi
        else:
            after = knot
        for _ in range(1 if hold == 0.0 else 2):
            t[n], on_floor[n] = leaves_s + hold * (n - begin), floor[knot]
            x[n], y[n] = x_m[knot] + share * (x_m[after] - x_m[knot]), y_m[knot] + share * (y_m[after] - y_m[knot])
            yaw[n] = yaw_rad[knot] + share * turn
            n += 1
        for k in range(first, end):
            if t_s[k] > leaves_s + SAME_S:
                t[n], x[n], y[n], yaw[n], on_floor[n] = t_s[k] + hold, x_m[k], y_m[k], yaw_rad[k], floor[k]
                n += 1
        a, b, ends = n - 2, n - 1, leaves_s + horizon_s + hold
        if a >= begin and ends - short_s <= t[b] < ends + beyond_s and on_floor[a] == on_floor[b]:
            t[n], on_floor[n], yaw[n] = ends + beyond_s, on_floor[b], yaw[b]
            share = (t[n] - t[b]) / (t[b] - t[a])
            x[n], y[n] = x[b] + share * (x[b] - x[a]), y[b] + share * (y[b] - y[a])
            n += 1
        begins[at + 1] = n
    return begins, t[:n].copy(), x[:n].copy(), y[:n].copy(), yaw[:n].copy(), on_floor[:n].copy()


def delayed(forecasts: Forecasts, rows: Ints, hold_s: Floats, window: Window) -> Forecasts:
    """The forecasts of `rows` (n,) from `window.start_s` on, each `hold_s` (n,) late, to where the last ends its."""
    f = forecasts
    t_s, x_m, y_m, yaw_rad = (ready(column) for column in (f.t_s, f.x_m, f.y_m, f.yaw_rad))
    start, floor = ready(f.start, np.int64), ready(f.floor, np.int64)
    until = (window.start_s, window.horizon_s, SHORT_S, 2 * window.longest_hold_s)
    knots = _delayed(start, t_s, x_m, y_m, yaw_rad, floor, rows, hold_s, *until)
    return Forecasts(*knots, *(column[rows] for column in (f.length_m, f.width_m, f.bottom_m, f.top_m)))


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


def meetings(movers: Sequence[Mover], holds_s: Sequence[float], window: Window) -> dict[Pair, float]:
    """Who comes within the clearance, and when first, where each robot is held for so long.

    Until the last that is held has had its horizon. Pairs that begin within the clearance are left out.
    """
    free, rows = _together(movers)
    held = delayed(free, rows, np.array(holds_s, np.float64), window)
    horizon_s = window.horizon_s + max(holds_s, default=0.0)
    a, b = _pairs_of(len(movers))
    until_s = np.full(len(a), window.start_s + horizon_s)
    met_s, begins_m = first_meetings(held, a, b, now_s=window.start_s, until_s=until_s, clearance_m=window.clearance_m)
    met = np.flatnonzero((met_s < inf) & (begins_m > window.clearance_m))
    return {
        (movers[one].robot, movers[other].robot): at_s
        for one, other, at_s in zip(a[met].tolist(), b[met].tolist(), met_s[met].tolist(), strict=True)
    }


def allowed_differences(pairs: Sequence[tuple[Mover, Mover]], window: Window) -> list[list[int]]:
    """For each pair the differences of hold, first less second, in `STEP_S`, at which they keep apart.

    Two that begin within the clearance must not touch, whatever else; two that touch already may have any difference.
    """
    steps = np.arange(-window.steps, window.steps + 1)
    allowed = np.ones((len(pairs), len(steps)), bool)
    fans, a, b = _fans(pairs, steps, window)
    ends_s = window.start_s + window.horizon_s + np.abs(steps) * STEP_S
    open_ = np.arange(len(pairs))
    for clearance_m in (window.clearance_m, 0.0):
        asked = (a[open_].ravel(), b[open_].ravel())
        until_s = np.tile(ends_s, len(open_))
        met_s, begins_m = first_meetings(fans, *asked, now_s=window.start_s, until_s=until_s, clearance_m=clearance_m)
        near = begins_m.reshape(-1, len(steps)).min(axis=1) <= clearance_m
        allowed[open_[~near]] = (met_s.reshape(-1, len(steps)) > ends_s)[~near]
        open_ = open_[near]
        if not len(open_):
            break
    return [steps[row].tolist() for row in allowed]


def _fans(pairs: Sequence[tuple[Mover, Mover]], steps: Ints, window: Window) -> tuple[Forecasts, Ints, Ints]:
    """Every robot of the pairs at every hold; and of each pair, (p, steps), the rows of both at each difference."""
    movers = {one.robot: one for pair in pairs for one in pair}
    place = {robot: row for row, robot in enumerate(movers)}
    free, rows = _together(movers.values())
    holds = np.arange(window.steps + 1)
    rows = np.repeat(rows, len(holds))
    fans = delayed(free, rows, np.tile(holds * STEP_S, len(movers)), window)
    of_pair = np.array([[place[one.robot] for one in pair] for pair in pairs], np.int64).reshape(-1, 2, 1) * len(holds)
    return fans, of_pair[:, 0] + np.maximum(steps, 0), of_pair[:, 1] + np.maximum(-steps, 0)
