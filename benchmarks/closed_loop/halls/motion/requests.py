"""What a robot does of what it is asked."""

from collections.abc import Sequence
from math import inf

import numpy as np

from benchmarks.closed_loop.halls.motion.acts import Acts
from benchmarks.closed_loop.halls.motion.driving import Driver
from benchmarks.closed_loop.halls.motion.robots import Hold, Robot
from benchmarks.planned_floors.logs.messages import START_S
from deconflict.adviser import Request

PAUSE_S = 2.0
"""For so long a robot that goes first does nothing of its own."""


class Requests:
    """Of all robots; `acts` and `drivers` are by planner."""

    def __init__(self, robots: Sequence[Robot], acts: Sequence[Acts], drivers: Sequence[Driver]) -> None:
        self._robots, self._acts, self._drivers = robots, acts, drivers
        self._row = {robot.model.uuid: robot.row for robot in robots}

    def withdraw(self, robot: Robot, name: str, now_s: float) -> None:
        robot.waits.pop(name, None)
        if robot.hold is not None and robot.hold.request == name:
            robot.hold.latest_s = now_s

    def do(self, robot: Robot, request: Request, now_s: float) -> str:
        acts = self._acts[robot.planner]
        others = [self._row[uuid] for uuid in request.until or (request.other,) if uuid in self._row]
        hold = Hold(request.id, others, np.zeros((0, 2)), request.latest_s - START_S)
        if request.verb == "go_first":
            robot.waits, robot.hit_s, robot.tries_s = {}, -inf, now_s + PAUSE_S
            return ""
        if request.verb == "wait_before":
            return self._wait_before(robot, request, hold)
        is_away = bool(robot.detour) or robot.hold is not None or robot.ended
        stands_for_itself = robot.dwells_until_s > now_s or robot.stalls_until_s > now_s
        if is_away or stands_for_itself or robot.speed_mps > 0.05:
            return "busy"
        if request.verb == "other_way":
            return self._other_way(robot, request)
        if request.verb == "go_around":
            return self._go_around(robot, request, others)
        return (acts.step_aside if request.verb == "step_aside" else acts.back_out)(robot, request.at, hold)

    def _go_around(self, robot: Robot, request: Request, others: Sequence[int]) -> str:
        why = self._acts[robot.planner].go_around(robot, others[0], request.side) if others else "past whom"
        robot.detour_for = robot.detour_for if why else request.id
        return why

    def _other_way(self, robot: Robot, request: Request) -> str:
        at = request.at
        if at is None and request.other in self._row:
            other = self._robots[self._row[request.other]]
            at = other.x_m, other.y_m
        return "no place" if at is None else self._acts[robot.planner].other_way(robot, at)

    def _wait_before(self, robot: Robot, request: Request, hold: Hold) -> str:
        if request.at is None:
            return "no place"
        wait_m = self._drivers[robot.planner].wait_m(robot, request.at)
        if wait_m == inf:
            return "not on its way"
        if robot.gone_m + robot.speed_mps**2 / 1.6 > wait_m + 0.05:
            return "too late"
        hold.watched_m = np.array([request.at])
        robot.waits[request.id] = (request.at, hold)
        return ""
