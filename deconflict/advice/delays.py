"""What delaying robots on their paths does to each pair: the differences of delay that bring two together.

A held robot stands where it is, then follows its forecast, late by its hold. Let u and v say how far two robots are
along their forecasts, in seconds. Both stand until the first sets off, then one goes and the other stands, then both
go: the path through (u, v) depends on the difference of the holds alone, and so does whether it meets a conflict.
Differences on the grid of holds are swept as they are, standing included, so on that grid the answer is exact.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from math import inf

import numpy as np

from deconflict.pose import pose_at
from deconflict.sweep import sweep
from ingest.seam import Forecasts

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


def delayed(forecast: Forecasts, hold_s: float, window: Window) -> Forecasts:
    """One robot's forecast from `window.start_s` on, `hold_s` late, to where the last robot ends its own."""
    start_s = window.start_s
    pose = pose_at(forecast, start_s)
    later = forecast.t_s > start_s + 1e-6
    leaves_s = [start_s] if hold_s == 0 else [start_s, start_s + hold_s]
    head = {"x_m": pose.x_m, "y_m": pose.y_m, "yaw_rad": pose.yaw_rad, "floor": pose.floor}
    columns = {
        name: np.concatenate([np.repeat(value, len(leaves_s)), getattr(forecast, name)[later]]).astype(
            getattr(forecast, name).dtype
        )
        for name, value in head.items()
    }
    t_s = np.concatenate([leaves_s, forecast.t_s[later] + hold_s])
    whole = replace(forecast, start=np.array([0, len(t_s)]), t_s=t_s, **columns)
    ends_s = start_s + window.horizon_s + hold_s
    return _goes_on(whole, by_s=ends_s - SHORT_S, to_s=ends_s + 2 * window.longest_hold_s)


def _goes_on(forecast: Forecasts, by_s: float, to_s: float) -> Forecasts:
    """With a last knot at `to_s` in line with its last two, unless it ends before `by_s`: there it stands."""
    if len(forecast.t_s) < 2 or not by_s <= forecast.t_s[-1] < to_s or forecast.floor[-1] != forecast.floor[-2]:
        return forecast
    share = (to_s - forecast.t_s[-1]) / (forecast.t_s[-1] - forecast.t_s[-2])
    beyond = {
        "t_s": to_s,
        "x_m": forecast.x_m[-1] + share * (forecast.x_m[-1] - forecast.x_m[-2]),
        "y_m": forecast.y_m[-1] + share * (forecast.y_m[-1] - forecast.y_m[-2]),
        "yaw_rad": forecast.yaw_rad[-1],
        "floor": forecast.floor[-1],
    }
    columns = {name: np.append(getattr(forecast, name), value) for name, value in beyond.items()}
    return replace(forecast, start=np.array([0, len(columns["t_s"])]), **columns)


def meetings(movers: Sequence[Mover], holds_s: Sequence[float], window: Window) -> dict[Pair, float]:
    """Who comes within the clearance, and when first, where each robot is held for so long.

    Until the last that is held has had its horizon. Pairs that begin within the clearance are left out.
    """
    held = Forecasts.joined(delayed(one.forecast, hold_s, window) for one, hold_s in zip(movers, holds_s, strict=True))
    horizon_s = window.horizon_s + max(holds_s, default=0.0)
    found = sweep(held, now_s=window.start_s, horizon_s=horizon_s, clearance_m=window.clearance_m)
    return {
        (movers[a].robot, movers[b].robot): contact_s
        for (a, b), contact_s, start_m in zip(
            found.pairs.tolist(), found.contact_s.tolist(), found.start_separation_m.tolist(), strict=True
        )
        if start_m > window.clearance_m
    }


def allowed_differences(pairs: Sequence[tuple[Mover, Mover]], window: Window) -> list[list[int]]:
    """For each pair the differences of hold, first less second, in `STEP_S`, at which they keep apart.

    Two that begin within the clearance must not touch, whatever else; two that touch already may have any difference.
    """
    steps = range(-window.steps, window.steps + 1)
    allowed = [list(steps) for _ in pairs]
    open_ = list(range(len(pairs)))
    for clearance_m in (window.clearance_m, 0.0):
        contacts, begins = _contacts([pairs[row] for row in open_], window, clearance_m)
        near = []
        for row, by_step, begins_m in zip(open_, contacts, begins, strict=True):
            if begins_m <= clearance_m:
                near.append(row)
                continue
            ends_s = (window.start_s + window.horizon_s + abs(step) * STEP_S for step in steps)
            allowed[row] = [step for step, met_s, end_s in zip(steps, by_step, ends_s, strict=True) if met_s > end_s]
        open_ = near
    return allowed


def _contacts(
    pairs: Sequence[tuple[Mover, Mover]], window: Window, clearance_m: float
) -> tuple[list[list[float]], list[float]]:
    """When each pair meets at each difference, inf where it does not; and its distance at the start, inf if unknown.

    All are swept at once, each pair and difference on a floor of its own.
    """
    steps = range(-window.steps, window.steps + 1)
    contacts, begins = [[inf] * len(steps) for _ in pairs], [inf] * len(pairs)
    if not pairs:
        return contacts, begins
    movers = {one.robot: one for pair in pairs for one in pair}
    fans = {
        robot: [delayed(one.forecast, k * STEP_S, window) for k in range(window.steps + 1)]
        for robot, one in movers.items()
    }
    floors = 1 + max(int(one.forecast.floor.max()) for one in movers.values())
    rows = []
    for number, (a, b) in enumerate(pairs):
        for column, step in enumerate(steps):
            case = number * len(steps) + column
            rows += _on_floor([fans[a.robot][max(step, 0)], fans[b.robot][max(-step, 0)]], case * floors)
    found = sweep(
        Forecasts.joined(rows),
        now_s=window.start_s,
        horizon_s=window.horizon_s + window.longest_hold_s,
        clearance_m=clearance_m,
    )
    for (row, _), contact_s, start_m in zip(
        found.pairs.tolist(), found.contact_s.tolist(), found.start_separation_m.tolist(), strict=True
    ):
        number, column = divmod(row // 2, len(steps))
        contacts[number][column] = contact_s
        begins[number] = min(begins[number], start_m)
    return contacts, begins


def _on_floor(forecasts: Iterable[Forecasts], base: int) -> list[Forecasts]:
    return [replace(one, floor=np.where(one.floor < 0, -1, one.floor + base)) for one in forecasts]
