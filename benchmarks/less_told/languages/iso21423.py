"""An identity, and odometry, trajectory and plan each second, of ISO 21423."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from benchmarks.less_told.fields import Fields
from benchmarks.less_told.languages.sending import MAP_ID, Sent, is_under_way, path_of, report_times, sent
from benchmarks.less_told.scenes import Robot
from benchmarks.planned_floors.logs.messages import START_S, stamp

LANGUAGE = "iso21423"


def uuid_of(robot: Robot) -> str:
    return robot.uuid


def messages(robot: Robot, fields: Fields) -> Iterator[Sent]:
    """All messages of a robot."""
    yield _sent(robot, 0.0, "identity", _identity(robot, fields))
    was_under_way = None
    for t_s in report_times(robot):
        under_way = is_under_way(robot, t_s)
        if "states" in fields and under_way is not was_under_way:
            states = ["MODE_AUTO", "FORWARD" if under_way else "IDLE"]
            yield _sent(robot, t_s, "status", {"entityId": robot.uuid, "states": states})
        was_under_way = under_way
        if "trajectory" in fields:
            points = [_point(t_s + after_s, x_m, y_m) for after_s, _, x_m, y_m, _ in path_of(robot, t_s)]
            yield _sent(robot, t_s, "localTrajectory", {"localTrajectory": points if under_way else []})
        if "plan" in fields:
            yield _sent(robot, t_s, "globalPlan", {"globalPlan": _plan(robot, t_s) if under_way else []})
        yield _sent(robot, t_s, "odometry", _odometry(robot, t_s, fields))


def _sent(robot: Robot, t_s: float, resource: str, body: dict[str, Any]) -> Sent:
    stamped = {"timestamp": stamp(START_S + t_s)} | body
    return sent(robot, t_s, LANGUAGE, f"/ISO_21423/v1/IMR/{robot.uuid}/{resource}", stamped)


def _identity(robot: Robot, fields: Fields) -> dict[str, Any]:
    x_m, y_m = robot.length_m / 2, robot.width_m / 2
    corners = [{"x": x, "y": y} for x, y in ((x_m, y_m), (-x_m, y_m), (-x_m, -y_m), (x_m, -y_m))]
    details: dict[str, Any] = {"imrModel": robot.model, "imrSerialNumber": robot.name, "imrHeight": 0.5}
    if "footprint" in fields:
        details |= {"imrFootprint": corners, "imrWorkingArea": corners}
    if "rated_speed" in fields:
        details["ratedSpeed"] = round(robot.drive.style.limit_mps, 3)
    return {"id": robot.uuid, "entityType": "IMR", "manufacturerName": robot.vendor, "details": details}


def _odometry(robot: Robot, t_s: float, fields: Fields) -> dict[str, Any]:
    (x_m, y_m, yaw_rad), (speed_mps, turn_radps) = robot.drive.at(np.array(t_s)).tolist(), robot.drive.motion_at(t_s)
    pose: dict[str, Any] = {"locationPoint": _place(x_m, y_m)}
    if "yaw" in fields:
        pose["orientation"] = {"yaw": float(np.arctan2(np.sin(yaw_rad), np.cos(yaw_rad))), "pitch": 0.0, "roll": 0.0}
    odometry: dict[str, Any] = {"pose": pose}
    if "velocity" in fields:
        turns = {"angular": round(turn_radps, 3)} if "angular" in fields else {}
        odometry["velocity"] = {"linear": round(speed_mps, 3)} | turns
    return odometry


def _plan(robot: Robot, t_s: float) -> list[dict[str, Any]]:
    """The nodes that are ahead."""
    drive = robot.drive
    return [
        _point(
            t_s + max((node_s - max(t_s, drive.begins_s)) / robot.hurry + max(drive.begins_s - t_s, 0.0), 0.1), *place
        )
        for node_s, place in zip(drive.node_s, drive.nodes_m.tolist(), strict=True)
        if node_s > t_s
    ]


def _point(t_s: float, x_m: float, y_m: float) -> dict[str, Any]:
    return {"timestamp": stamp(START_S + t_s), "locationPoint": _place(x_m, y_m)}


def _place(x_m: float, y_m: float) -> dict[str, Any]:
    return {"ccsId": MAP_ID, "x": round(x_m, 3), "y": round(y_m, 3), "z": 0.0}
