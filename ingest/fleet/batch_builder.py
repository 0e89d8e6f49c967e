"""Rows of a batch out of what is known of each robot."""

from collections.abc import Iterable, Sequence, Sized
from itertools import chain
from operator import attrgetter
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from ingest.batch import Batch, Claim, Destinations, Floats, Forecasts, Ints
from ingest.fleet.forecast import NO_STOPS, Forecast
from ingest.fleet.robot import Robot


def batch(
    robots: Sequence[Robot], now_s: float, floors: tuple[str, ...], gone: tuple[str, ...], claims: tuple[Claim, ...]
) -> Batch:
    """The batch of some robots, each of which has a forecast, as they are known now."""
    forecasts: list[Forecast] = list(_each(robots, "forecast"))
    return Batch(
        now_s=now_s,
        floors=floors,
        robots=tuple(_each(robots, "uuid")),
        vendors=tuple(_each(robots, "vendor")),
        models=tuple(_each(robots, "model")),
        names=tuple(_each(robots, "name")),
        states=tuple(_each(robots, "state")),
        statuses=_column(robots, "statuses", np.int64),
        first_arrival_s=_column(robots, "first_arrival_s"),
        arrival_s=_column(robots, "arrival_s"),
        event_s=_column(robots, "seen.t_s"),
        basis=_column(forecasts, "basis", np.int64),
        doubt_m=_column(robots, "doubt_m"),
        battery_pct=_column(robots, "battery_pct"),
        run_time_left_s=_column(robots, "run_time_left_s"),
        forecasts=_layout(forecasts),
        destinations=_destinations(list(_each(robots, "stops"))),
        gone=gone,
        claims=claims,
    )


def _each(of: Sequence[Any], name: str) -> Iterable[Any]:
    return map(attrgetter(name), of)


def _column(of: Sequence[Any], name: str, kind: DTypeLike = np.float64) -> NDArray[Any]:
    return np.fromiter(_each(of, name), kind, len(of))


def _layout(forecasts: list[Forecast]) -> Forecasts:
    if not forecasts:
        return Forecasts.empty()
    knots = list(_each(forecasts, "knots"))
    t_s, x_m, y_m, yaw_rad = _columns(np.concatenate(knots))
    return Forecasts(
        start=_starts(knots),
        t_s=t_s,
        x_m=x_m,
        y_m=y_m,
        yaw_rad=yaw_rad,
        floor=np.fromiter(chain.from_iterable(_each(forecasts, "floors")), np.int64, len(t_s)),
        length_m=_column(forecasts, "length_m"),
        width_m=_column(forecasts, "width_m"),
        bottom_m=_column(forecasts, "bottom_m"),
        top_m=_column(forecasts, "top_m"),
    )


def _destinations(stops_of: list[Floats]) -> Destinations:
    t_s, x_m, y_m, floor = _columns(np.concatenate([NO_STOPS, *stops_of]))
    return Destinations(_starts(stops_of), t_s, x_m, y_m, floor.astype(np.int64))


def _starts(parts: Sequence[Sized]) -> Ints:
    """(n + 1,) where each of n parts begins, one after the other, and where the last one ends."""
    return np.fromiter(chain((0,), map(len, parts)), np.int64, len(parts) + 1).cumsum()


def _columns(rows: Floats) -> Iterable[Floats]:
    """The columns (n,) of `rows` (n, c)."""
    return np.ascontiguousarray(rows.T)
