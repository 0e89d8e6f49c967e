"""Builds a batch from the states of robots."""

from collections.abc import Iterable, Sequence, Sized
from itertools import chain
from operator import attrgetter
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from ingest.batch import AMOUNTS, Batch, Claim, Destinations, Floats, Forecasts, Ints
from ingest.fleet.owners.departures import Departures
from ingest.fleet.prediction.forecast_model import NO_STOPS, Forecast
from ingest.shapes import shapes_of


def batch(departures: Departures, now_s: float, floors: tuple[str, ...], claims: tuple[Claim, ...]) -> Batch:
    """The batch of the given robots, as they are known now. Each must have a forecast and a sighting."""
    robots = departures.robots
    forecasts: list[Forecast] = list(_values(robots, "forecast"))
    return Batch(
        now_s=now_s,
        floors=floors,
        robots=tuple(_values(robots, "uuid")),
        vendors=tuple(_values(robots, "vendor")),
        models=tuple(_values(robots, "model")),
        names=tuple(_values(robots, "name")),
        states=tuple(_values(robots, "state")),
        statuses=_column(robots, "statuses", np.int64),
        first_arrival_s=_column(robots, "first_arrival_s"),
        arrival_s=_column(robots, "arrival_s"),
        event_s=_column(robots, "seen.t_s"),
        basis=_column(forecasts, "basis", np.int64),
        doubt_m=_column(robots, "doubt_m"),
        reports_within_s=_column(robots, "reports_within_s"),
        amounts=np.array(list(_values(robots, "amounts")), AMOUNTS),
        forecasts=_forecasts(forecasts),
        destinations=_destinations(list(_values(robots, "stops"))),
        gone=departures.gone,
        off_floor=departures.off_floor,
        began_anew=departures.began_anew,
        claims=claims,
        participants=tuple(_values(robots, "participant")),
        sources=tuple(_values(robots, "source")),
        examined=_column(robots, "examined", np.bool_),
        came_s=_column(robots, "came_s"),
    )


def _values(items: Sequence[Any], name: str) -> Iterable[Any]:
    """The attribute `name`, which may be dotted, of each item."""
    return map(attrgetter(name), items)


def _column(items: Sequence[Any], name: str, dtype: DTypeLike = np.float64) -> NDArray[Any]:
    """(n,) the attribute `name` of n items."""
    return np.fromiter(_values(items, name), dtype, len(items))


def _forecasts(forecasts: list[Forecast]) -> Forecasts:
    if not forecasts:
        return Forecasts.empty()
    knots = list(_values(forecasts, "knots"))
    t_s, x_m, y_m, yaw_rad = _columns(np.concatenate(knots))
    return Forecasts(
        start=_starts(knots),
        t_s=t_s,
        x_m=x_m,
        y_m=y_m,
        yaw_rad=yaw_rad,
        floor=np.fromiter(chain.from_iterable(_values(forecasts, "floors")), np.int64, len(t_s)),
        length_m=_column(forecasts, "length_m"),
        width_m=_column(forecasts, "width_m"),
        bottom_m=_column(forecasts, "bottom_m"),
        top_m=_column(forecasts, "top_m"),
        shapes=shapes_of(list(_values(forecasts, "shape"))),
    )


def _destinations(stops_of: list[Floats]) -> Destinations:
    t_s, x_m, y_m, floor = _columns(np.concatenate([NO_STOPS, *stops_of]))
    return Destinations(_starts(stops_of), t_s, x_m, y_m, floor.astype(np.int64))


def _starts(parts: Sequence[Sized]) -> Ints:
    """(n + 1,) the first row of each of n parts, one after the other, and the end of the last one."""
    return np.fromiter(chain((0,), map(len, parts)), np.int64, len(parts) + 1).cumsum()


def _columns(rows: Floats) -> Iterable[Floats]:
    """The columns (n,) of `rows` (n, c)."""
    return np.ascontiguousarray(rows.T)
