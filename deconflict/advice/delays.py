"""What delaying robots on their paths does to each pair: the differences of delay that bring two together.

A held robot stands where it is, then follows its forecast, late by its hold. Let u and v say how far two robots are
along their forecasts, in seconds. Both stand until the first sets off, then one goes and the other stands, then both
go: the path through (u, v) depends on the difference of the holds alone, and so does whether it meets a conflict.
Differences on the grid of holds are swept as they are, standing included, so on that grid the answer is exact.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import inf
from typing import Any

import numpy as np

from deconflict.sweep import first_meetings
from ingest.seam import Floats, Forecasts, Ints

STEP_S = 0.5
"""Holds are multiples of this."""
SHORT_S = 2.0
"""A forecast that ends no more than this before the horizon goes on as it ended; one that ends sooner stands."""

Pair = tuple[str, str]


@dataclass(frozen=True, slots=True)
class Mover:
    """One robot that others meet."""

    robot: str
    name: str
    vendor: str
    forecast: Forecasts
    """Of this robot alone, envelope as it is swept."""
    holdable: bool = True
    """False where it stands anyway."""
    priority: float = 1.0
    """What a second of its waiting counts."""


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


def delayed(forecasts: Forecasts, hold_s: Floats, window: Window) -> Forecasts:
    """The forecasts of n robots from `window.start_s` on, each `hold_s` (n,) late, to where the last ends its own."""
    at = poses_from(forecasts, window.start_s)
    later = np.flatnonzero(forecasts.t_s > window.start_s + 1e-6)
    owner = np.repeat(np.arange(len(forecasts)), np.diff(forecasts.start))[later]
    stands = np.flatnonzero(hold_s != 0)
    row = np.concatenate([np.arange(len(forecasts)), stands, owner])
    order = np.argsort(row, kind="stable")
    leaves_s = np.full(len(forecasts), window.start_s)
    columns = {"t_s": np.concatenate([leaves_s, window.start_s + hold_s[stands], forecasts.t_s[later] + hold_s[owner]])}
    for name, there in at.items():
        columns[name] = np.concatenate([there, there[stands], getattr(forecasts, name)[later]])
    start = np.searchsorted(row[order], np.arange(len(forecasts) + 1))
    whole = replace(forecasts, start=start, **{name: column[order] for name, column in columns.items()})
    ends_s = window.start_s + window.horizon_s + hold_s
    return _going_on(whole, by_s=ends_s - SHORT_S, to_s=ends_s + 2 * window.longest_hold_s)


def poses_from(forecasts: Forecasts, t_s: float) -> dict[str, Any]:
    """x_m, y_m, yaw_rad and floor of each robot at `t_s`, (n,) each, as `pose_at` has them."""
    first, last = forecasts.start[:-1], forecasts.start[1:] - 1
    passed = np.concatenate([[0], np.cumsum(forecasts.t_s <= t_s)])
    knot = first + np.maximum(passed[last + 1] - passed[first] - 1, 0)
    after = np.minimum(knot + 1, last)
    moves = (after > knot) & (forecasts.t_s[knot] <= t_s) & (forecasts.floor[after] == forecasts.floor[knot])
    after = np.where(moves, after, knot)
    since_s, span_s = t_s - forecasts.t_s[knot], forecasts.t_s[after] - forecasts.t_s[knot]
    share = np.where(moves, since_s / np.where(moves, span_s, 1.0), 0.0)
    x, y, yaw = forecasts.x_m, forecasts.y_m, forecasts.yaw_rad
    turn = (yaw[after] - yaw[knot] + np.pi) % (2 * np.pi) - np.pi
    return {
        "x_m": x[knot] + share * (x[after] - x[knot]),
        "y_m": y[knot] + share * (y[after] - y[knot]),
        "yaw_rad": yaw[knot] + share * turn,
        "floor": forecasts.floor[knot],
    }


def _going_on(forecasts: Forecasts, by_s: Floats, to_s: Floats) -> Forecasts:
    """Each with a last knot at `to_s` in line with its last two, unless it ends before `by_s`: there it stands."""
    last, counts = forecasts.start[1:] - 1, np.diff(forecasts.start)
    t_s, floor = forecasts.t_s, forecasts.floor
    goes = (counts >= 2) & (by_s <= t_s[last]) & (t_s[last] < to_s) & (floor[last] == floor[last - 1])
    rows = np.flatnonzero(goes)
    a, b = last[rows] - 1, last[rows]
    share = (to_s[rows] - t_s[b]) / (t_s[b] - t_s[a])
    beyond = {
        "t_s": to_s[rows],
        "x_m": forecasts.x_m[b] + share * (forecasts.x_m[b] - forecasts.x_m[a]),
        "y_m": forecasts.y_m[b] + share * (forecasts.y_m[b] - forecasts.y_m[a]),
        "yaw_rad": forecasts.yaw_rad[b],
        "floor": floor[b],
    }
    columns = {name: np.insert(getattr(forecasts, name), b + 1, value) for name, value in beyond.items()}
    return replace(forecasts, start=np.concatenate([[0], np.cumsum(counts + goes)]), **columns)


def meetings(movers: Sequence[Mover], holds_s: Sequence[float], window: Window) -> dict[Pair, float]:
    """Who comes within the clearance, and when first, where each robot is held for so long.

    Until the last that is held has had its horizon. Pairs that begin within the clearance are left out.
    """
    held = delayed(Forecasts.joined(one.forecast for one in movers), np.array(holds_s, np.float64), window)
    horizon_s = window.horizon_s + max(holds_s, default=0.0)
    a, b = np.triu_indices(len(movers), 1)
    met_s, begins_m = first_meetings(
        held, a, b, now_s=window.start_s, horizon_s=horizon_s, clearance_m=window.clearance_m
    )
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
    reach_s = window.horizon_s + window.longest_hold_s
    open_ = np.arange(len(pairs))
    for clearance_m in (window.clearance_m, 0.0):
        asked = (a[open_].ravel(), b[open_].ravel())
        met_s, begins_m = first_meetings(fans, *asked, now_s=window.start_s, horizon_s=reach_s, clearance_m=clearance_m)
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
    free = Forecasts.joined(one.forecast for one in movers.values())
    holds = np.arange(window.steps + 1)
    fans = delayed(
        free.take(np.repeat(np.arange(len(movers)), len(holds))), np.tile(holds * STEP_S, len(movers)), window
    )
    of_pair = np.array([[place[one.robot] for one in pair] for pair in pairs], np.int64).reshape(-1, 2, 1) * len(holds)
    return fans, of_pair[:, 0] + np.maximum(steps, 0), of_pair[:, 1] + np.maximum(-steps, 0)
