"""Rows of a batch out of what is known of each robot."""

from collections.abc import Iterable, Sequence
from itertools import chain

import numpy as np

from ingest.forecast import Forecast, Stop
from ingest.robots import Robot
from ingest.seam import Batch, Claim, Destinations, Floats, Forecasts


def batch(
    robots: Sequence[Robot], now_s: float, floors: tuple[str, ...], gone: tuple[str, ...], claims: tuple[Claim, ...]
) -> Batch:
    """The batch of some robots, each of which has a forecast, as they are known now."""
    return Batch(
        now_s=now_s,
        floors=floors,
        robots=tuple(robot.uuid for robot in robots),
        vendors=tuple(robot.vendor for robot in robots),
        models=tuple(robot.model for robot in robots),
        names=tuple(robot.name for robot in robots),
        states=tuple(robot.state for robot in robots),
        statuses=np.array([robot.statuses for robot in robots], np.int64),
        first_arrival_s=np.array([robot.first_arrival_s for robot in robots], np.float64),
        arrival_s=np.array([robot.arrival_s for robot in robots], np.float64),
        event_s=np.array([robot.seen.t_s for robot in robots if robot.seen], np.float64),
        basis=np.array([robot.forecast.basis for robot in robots if robot.forecast], np.int64),
        doubt_m=np.array([robot.doubt_m for robot in robots], np.float64),
        forecasts=_layout([robot.forecast for robot in robots if robot.forecast]),
        destinations=_destinations([robot.stops for robot in robots]),
        gone=gone,
        claims=claims,
    )


def _layout(forecasts: list[Forecast]) -> Forecasts:
    if not forecasts:
        return Forecasts.empty()
    t_s, x_m, y_m, yaw_rad = _columns(np.concatenate([one.knots for one in forecasts]))
    sizes = chain.from_iterable([(one.length_m, one.width_m, one.bottom_m, one.top_m) for one in forecasts])
    length_m, width_m, bottom_m, top_m = _columns(np.fromiter(sizes, np.float64).reshape(-1, 4))
    return Forecasts(
        start=np.concatenate([[0], np.cumsum([len(one.knots) for one in forecasts])]),
        t_s=t_s,
        x_m=x_m,
        y_m=y_m,
        yaw_rad=yaw_rad,
        floor=np.fromiter(chain.from_iterable(one.floors for one in forecasts), np.int64, len(t_s)),
        length_m=length_m,
        width_m=width_m,
        bottom_m=bottom_m,
        top_m=top_m,
    )


def _destinations(stops_of: list[tuple[Stop, ...]]) -> Destinations:
    stops = np.fromiter(chain.from_iterable(chain.from_iterable(stops_of)), np.float64).reshape(-1, 4)
    t_s, x_m, y_m, floor = _columns(stops)
    start = np.concatenate([[0], np.cumsum([len(each) for each in stops_of])]).astype(np.int64)
    return Destinations(start, t_s, x_m, y_m, floor.astype(np.int64))


def _columns(rows: Floats) -> Iterable[Floats]:
    """The columns (n,) of `rows` (n, c)."""
    return np.ascontiguousarray(rows.T)
