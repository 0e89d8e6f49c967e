"""An identity, and a status each second, of the MassRobotics standard."""

from collections.abc import Iterator
from math import cos, sin
from typing import Any

import numpy as np

from benchmarks.less_told.fields import Fields
from benchmarks.less_told.languages.sending import AHEAD_S, MAP_ID, Sent, is_under_way, path_of, report_times, sent
from benchmarks.less_told.scenes import Robot
from benchmarks.planned_floors.logs.messages import START_S, stamp


def uuid_of(robot: Robot) -> str:
    return robot.uuid


def messages(robot: Robot, fields: Fields) -> Iterator[Sent]:
    """All messages of a robot."""
    if "identity" in fields:
        yield sent(robot, 0.0, "massrobotics", "", _identity(robot, fields))
    for t_s in report_times(robot):
        yield sent(robot, t_s, "massrobotics", "", _status(robot, t_s, fields))


def _identity(robot: Robot, fields: Fields) -> dict[str, Any]:
    stated = {"maxSpeed": round(robot.drive.style.limit_mps, 3)} if "max_speed" in fields else {}
    return {
        "uuid": robot.uuid,
        "timestamp": stamp(START_S),
        "manufacturerName": robot.vendor,
        "robotModel": robot.model,
        "robotSerialNumber": robot.name,
        "baseRobotEnvelope": {"x": robot.length_m, "y": robot.width_m, "z": 0.5},
    } | stated


def _status(robot: Robot, t_s: float, fields: Fields) -> dict[str, Any]:
    drive, under_way = robot.drive, is_under_way(robot, t_s)
    (x_m, y_m, yaw_rad), (speed_mps, turn_radps) = drive.at(np.array(t_s)).tolist(), drive.motion_at(t_s)
    location: dict[str, Any] = {"x": round(x_m, 3), "y": round(y_m, 3), "planarDatum": MAP_ID}
    if "angle" in fields:
        location["angle"] = _angle(yaw_rad)
    status: dict[str, Any] = {
        "uuid": robot.uuid,
        "timestamp": stamp(START_S + t_s),
        "operationalState": "navigating" if under_way else "idle",
        "location": location,
    }
    if "velocity" in fields:
        turns = {"angular": _angle(turn_radps)} if "angular" in fields else {}
        status["velocity"] = {"linear": round(speed_mps, 3)} | turns
    if "path" in fields and under_way:
        status["path"] = [_point(*row, fields) for row in path_of(robot, t_s)]
    if "destination" in fields and under_way:
        status["destinations"] = [_destination(robot, t_s, fields)]
    return status


def _point(after_s: float, t_s: float, x_m: float, y_m: float, yaw_rad: float, fields: Fields) -> dict[str, Any]:
    point = {"timestamp": stamp(START_S + t_s + after_s), "x": round(x_m, 3), "y": round(y_m, 3)}
    turned = {"angle": _angle(yaw_rad)} if "path_angle" in fields else {}
    return point | turned


def _destination(robot: Robot, t_s: float, fields: Fields) -> dict[str, Any]:
    x_m, y_m, yaw_rad = robot.drive.poses[-1].tolist()
    left_s = max((robot.drive.ends_s - max(t_s, robot.drive.begins_s)) / robot.hurry, AHEAD_S[0])
    timed = {"timestamp": stamp(START_S + t_s + left_s)} if "destination_time" in fields else {}
    return timed | {"x": round(x_m, 3), "y": round(y_m, 3), "angle": _angle(yaw_rad)}


def _angle(yaw_rad: float) -> dict[str, float]:
    return {"x": 0.0, "y": 0.0, "z": round(sin(yaw_rad / 2), 5), "w": round(cos(yaw_rad / 2), 5)}
