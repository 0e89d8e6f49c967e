"""What vendors report: status messages with the ten-second paths of their own plans."""

import json
from math import hypot
from typing import Any

import numpy as np

from benchmarks.closed_loop.halls.ground.roadmap import Roadmap
from benchmarks.closed_loop.halls.motion.driving import CREEP_MPS, REVERSE_MPS, TURNS_RADPS, Driver
from benchmarks.closed_loop.halls.motion.robots import Robot, way_of, wrapped
from benchmarks.planned_floors.logs.messages import START_S, ahead, status
from ingest.batch import Floats

PATH_S = 10
DWELL_S = (3.0, 8.0)
"""How long a robot works at a station."""


def report(robot: Robot, driver: Driver, roadmap: Roadmap, now_s: float) -> dict[str, Any]:
    """The status of a robot at a time, seconds since the begin of the floor."""
    times_s, points_m, yaw_rad, arrives_s = _plan(robot, driver, roadmap, now_s)
    at_s = ahead(np.array([[now_s]]), PATH_S)[0]
    x_m, y_m = (np.interp(at_s - now_s, times_s, points_m[:, k]) for k in (0, 1))
    yaw = yaw_rad[np.minimum(np.searchsorted(times_s, at_s - now_s), len(yaw_rad) - 1)]
    path = np.stack([START_S + at_s, x_m, y_m, yaw], axis=1)
    destination = (START_S + now_s + arrives_s, *roadmap.xy[robot.goal])
    pose = robot.x_m, robot.y_m, robot.yaw
    line = status(robot.model.uuid, START_S + now_s, 0.0, "navigating", pose, robot.speed_mps, path, destination)
    return json.loads(line.message)


def _plan(robot: Robot, driver: Driver, roadmap: Roadmap, now_s: float) -> tuple[Floats, Floats, Floats, float]:
    """Times from now (n,), points (n, 2) and headings (n,) of its plan, and when it arrives.

    Stalls and stops end at once. Nothing of other vendors is known.
    """
    rows: list[tuple[float, float, float, float]] = [(0.0, robot.x_m, robot.y_m, robot.yaw)]
    _wait(rows, max(0.0, robot.dwells_until_s - now_s))
    for point in robot.detour:
        _drive(rows, point.x_m, point.y_m, REVERSE_MPS if point.backward else CREEP_MPS, point.backward)
    gone_m = robot.rejoins_m if robot.detour else robot.gone_m
    if robot.hold is not None and robot.aside < 0:
        _wait(rows, 60.0)
    waits_m = min((driver.wait_m(robot, point) for point, _ in robot.waits.values()), default=np.inf)
    for k in range(robot.way.leg(gone_m) + 1, len(robot.way.nodes)):
        if robot.way.gone_m[k] > waits_m:
            _drive(rows, *robot.way.at(waits_m), robot.model.top_mps)
            _wait(rows, 60.0)
        _drive(rows, float(robot.way.points_m[k, 0]), float(robot.way.points_m[k, 1]), robot.model.top_mps)
        if rows[-1][0] > PATH_S + 2.0:
            break
    arrives_s = rows[-1][0] + float(roadmap.distance_m[robot.way.nodes[k], robot.goal]) / robot.model.top_mps
    if rows[-1][0] < PATH_S:
        _wait(rows, 60.0 if robot.aside >= 0 else sum(DWELL_S) / 2)
        for point in way_of(roadmap, robot.next_nodes).points_m[1:].tolist():
            _drive(rows, point[0], point[1], robot.model.top_mps)
    plan = np.array(rows)
    return plan[:, 0], plan[:, 1:3], plan[:, 3], arrives_s


def _wait(rows: list[tuple[float, float, float, float]], seconds: float) -> None:
    t_s, x_m, y_m, yaw = rows[-1]
    if seconds > 0:
        rows.append((t_s + seconds, x_m, y_m, yaw))


def _drive(
    rows: list[tuple[float, float, float, float]], x_m: float, y_m: float, speed_mps: float, backward: bool = False
) -> None:
    t_s, x, y, yaw = rows[-1]
    away_m = hypot(x_m - x, y_m - y)
    if away_m < 1e-6:
        return
    to = float(np.arctan2(y_m - y, x_m - x)) + np.pi * backward
    turns_s = abs(wrapped(to - yaw)) / TURNS_RADPS
    if turns_s > 0.05:
        rows.append((t_s + turns_s, x, y, to))
    rows.append((t_s + turns_s + away_m / speed_mps, x_m, y_m, wrapped(to)))
