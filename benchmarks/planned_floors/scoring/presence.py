"""Which robots were truly there, which stood, and which had been silent for long."""

from bisect import bisect_right
from math import inf

import numpy as np

from benchmarks.planned_floors.logs.reports import Robot
from benchmarks.planned_floors.truth.floor_truth import FloorTruth
from benchmarks.planned_floors.truth.motion import STEP_S

STOOD_M = 0.3
"""A robot that moved at most this far stood."""


class Presence:
    """The times at which the robots of a floor were truly there."""

    def __init__(self, truth: FloorTruth) -> None:
        self._motion = truth.motion
        self._column = {robot: column for column, robot in enumerate(truth.motion.robots)}
        there = ~np.isnan(truth.motion.x_m)
        self._absent = [np.flatnonzero(~there[:, column]) for column in range(there.shape[1])]

    def there(self, robot: str, t_s: float) -> bool:
        x_m = self._motion.x_m[self._motion.sample(t_s), self._column[robot]]
        return t_s <= self._motion.end_s + STEP_S and not np.isnan(x_m)

    def until(self, robot: str, t_s: float) -> float:
        """Until when it was there from a time on. The end of the log if it stayed."""
        absent = self._absent[self._column[robot]]
        index = int(np.searchsorted(absent, self._motion.sample(t_s)))
        return self._motion.start_s + absent[index] * STEP_S if index < len(absent) else self._motion.end_s

    def stands(self, robot: str, since_s: float, t_s: float) -> bool:
        """Whether it was there at a time, and had stood there since another time."""
        column, motion = self._column[robot], self._motion
        since, now = motion.sample(since_s), motion.sample(t_s) + 1
        x_m, y_m = motion.x_m[since:now, column], motion.y_m[since:now, column]
        moved_m = np.hypot(x_m - x_m[0], y_m - y_m[0])
        return bool((moved_m <= STOOD_M).all())  # nan, where it was not there, is not


class Silences:
    """Which robots had been silent for longer than their limit."""

    def __init__(self, robots: list[Robot]) -> None:
        self._received_s = {robot.uuid: [report.received_s for report in robot.reports] for robot in robots}
        self._heard_s = {robot.uuid: [report.t_s for report in robot.reports] for robot in robots}
        self.robots = sorted(self._received_s)
        self._limit_s = {robot.uuid: robot.silence_limit_s() for robot in robots}

    def silent(self, robot: str, t_s: float) -> bool:
        return self.heard_s(robot, t_s) < inf

    def heard_s(self, robot: str, t_s: float) -> float:
        """The last report of a robot that was silent at a time; inf if it was not silent."""
        received_s = self._received_s[robot]
        index = bisect_right(received_s, t_s) - 1
        is_silent = index >= 0 and t_s - received_s[index] > self._limit_s[robot]
        return self._heard_s[robot][index] if is_silent else inf
