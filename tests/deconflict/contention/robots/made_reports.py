"""Reports of one robot that announces when it will be where."""

from collections.abc import Sequence

import numpy as np

from deconflict.contention.robots.announced_arrivals import DatumPoint
from deconflict.contention.robots.arrival_forecast import ArrivalForecast
from ingest.batch import AMOUNTS, Batch, Destinations, Forecasts


def report(
    arrivals: ArrivalForecast,
    robot: str,
    now_s: float,
    here: DatumPoint,
    points: Sequence[DatumPoint],
    announced_s: Sequence[float],
) -> None:
    """Add the report of a robot of Alder that is at `here` and announces when it will be at each of `points`."""
    batch = report_of(robot, now_s, here, points, announced_s)
    arrivals.add_batch(batch, (batch.forecasts.floor, batch.forecasts.x_m, batch.forecasts.y_m))


def report_of(
    robot: str, now_s: float, here: DatumPoint, points: Sequence[DatumPoint], told_s: Sequence[float]
) -> Batch:
    """Of one robot."""
    floors = tuple(sorted({floor for floor, _, _ in (here, *points)} - {""}))
    numbers = {floor: number for number, floor in enumerate(floors)} | {"": -1}
    rows = np.array([(numbers[floor], x_m, y_m) for floor, x_m, y_m in (here, *points)])
    floor, x_m, y_m, zero, values = rows[:, 0].astype(np.int64), rows[:, 1], rows[:, 2], np.zeros(1), np.ones(1)
    return Batch(
        now_s=now_s,
        floors=floors,
        robots=(robot,),
        vendors=("Alder",),
        models=("",),
        names=("",),
        states=("",),
        statuses=np.array([1]),
        first_arrival_s=np.array([now_s]),
        arrival_s=np.array([now_s]),
        event_s=np.array([now_s]),
        basis=np.array([0]),
        doubt_m=zero,
        reports_within_s=zero,
        amounts=np.full(1, np.nan, AMOUNTS),
        forecasts=Forecasts(
            np.arange(2), np.array([now_s]), x_m[:1], y_m[:1], zero, floor[:1], values, values, zero, values
        ),
        destinations=Destinations(np.array([0, len(points)]), np.array(told_s, float), x_m[1:], y_m[1:], floor[1:]),
        gone=(),
    )
