"""The path believer, a baseline: it alerts if the reported paths of two robots come within the clearance.

It has no memory and no probability. A robot without a path goes straight on at the speed that it reports. A robot that
has been silent for longer than its silence limit is forgotten.
"""

from bisect import bisect_right
from math import ceil, cos, floor, sin

import numpy as np

from benchmarks.planned_floors.logs.reports import Report, Robot
from benchmarks.planned_floors.scoring.alerts import Alert, alerts_of_seconds
from benchmarks.planned_floors.truth.encounters import Pair
from deconflict.sweep.sweep_once import sweep
from ingest.batch import Floats, Forecasts

HORIZON_S = 10.0
STRAIGHT_S = 120.0
"""A robot without a path is extrapolated for this time, which is beyond every horizon and silence limit."""


def believed_alerts(robots: list[Robot], clearance_m: float) -> list[Alert]:
    """The believer's alerts over a log, computed at whole seconds."""
    first_s = ceil(min(robot.reports[0].received_s for robot in robots))
    last_s = floor(max(robot.reports[-1].received_s for robot in robots))
    received_s = [[report.received_s for report in robot.reports] for robot in robots]
    limits_s = [robot.silence_limit_s() for robot in robots]
    seconds: dict[Pair, list[int]] = {}
    for now_s in range(first_s, last_s + 1):
        newest = [bisect_right(times_s, now_s) - 1 for times_s in received_s]
        heard = [
            (robot, robot.reports[index])
            for robot, index, limit_s in zip(robots, newest, limits_s, strict=True)
            if index >= 0 and now_s - robot.reports[index].t_s <= limit_s
        ]
        for pair in _pairs(heard, float(now_s), clearance_m):
            seconds.setdefault(pair, []).append(now_s)
    return alerts_of_seconds(seconds)


def _pairs(heard: list[tuple[Robot, Report]], now_s: float, clearance_m: float) -> list[Pair]:
    """Pairs that come within the clearance by their newest reports, without those that are already within it."""
    if len(heard) < 2:
        return []
    found = sweep(_forecasts(heard), now_s=now_s, horizon_s=HORIZON_S, clearance_m=clearance_m)
    ahead = found.pairs[found.start_separation_m > clearance_m]
    return [(heard[a][0].uuid, heard[b][0].uuid) for a, b in ahead.tolist()]


def _forecasts(heard: list[tuple[Robot, Report]]) -> Forecasts:
    knots = [_knots(report) for _, report in heard]
    joined = np.concatenate(knots)
    n = len(heard)
    return Forecasts(
        start=np.concatenate([[0], np.cumsum([len(rows) for rows in knots])]),
        t_s=joined[:, 0],
        x_m=joined[:, 1],
        y_m=joined[:, 2],
        yaw_rad=joined[:, 3],
        floor=np.zeros(len(joined), np.int64),
        length_m=np.array([robot.length_m for robot, _ in heard]),
        width_m=np.array([robot.width_m for robot, _ in heard]),
        bottom_m=np.full(n, -np.inf),
        top_m=np.full(n, np.inf),
    )


def _knots(report: Report) -> Floats:
    """(k, 4) t_s, x_m, y_m, yaw_rad: its pose, and its path."""
    here = np.array([[report.t_s, report.x_m, report.y_m, report.yaw_rad]])
    if len(report.path):
        return np.concatenate([here, report.path])
    way_m = report.speed_mps * STRAIGHT_S
    on = np.array([[STRAIGHT_S, way_m * cos(report.yaw_rad), way_m * sin(report.yaw_rad), 0.0]])
    return np.concatenate([here, here + on])
