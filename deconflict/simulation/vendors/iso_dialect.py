"""A vendor whose robots speak ISO 21423, in the coordinates of the datums."""

import json
from typing import Any

import numpy as np

from deconflict.simulation.robot_state import RobotState
from deconflict.simulation.vendors.dialects import EVERY_SECOND_S, SITE_MAPS
from deconflict.simulation.vendors.vda_dialect import TopicMessage
from ingest.languages.timestamps import write

STATES = {
    "navigating": "FORWARD",
    "idle": "IDLE",
    "charging": "CHARGING",
    "waitingExternalEvent": "WAIT_FOR_EVENT",
    "waitingHumanEvent": "BLOCKED",
}


class IsoRobot:
    """The messages of one robot."""

    def __init__(self) -> None:
        self._states: list[str] = []
        """Those that were published last."""

    def messages(self, robot: RobotState, now_s: float, *, introduce: bool = False) -> list[TopicMessage]:
        """Odometry, trajectory and plan; changed states before them; with `introduce` the identity first."""
        found = []
        if introduce:
            found.append(self._message(robot, now_s, "identity", _identity(robot))._replace(is_retained=True))
        states = ["MODE_AUTO", STATES[robot.state], *(["LOW_BATTERY"] if robot.battery_pct < 20 else [])]
        if introduce or states != self._states:
            self._states = states
            found.append(self._message(robot, now_s, "status", {"entityId": robot.member.uuid, "states": states}))
        battery = {"batterySoc": round(robot.battery_pct / 100, 3), "batteryHealth": "HEALTHY"}
        velocity = {"linear": round(robot.linear_mps, 3), "angular": round(robot.turn_radps, 3)}
        orientation = {"yaw": robot.yaw_rad, "pitch": 0.0, "roll": 0.0}
        pose = {"locationPoint": _point(robot.floor, robot.x_m, robot.y_m), "orientation": orientation}
        return [
            *found,
            self._message(robot, now_s, "batteryStatus", battery),
            self._message(robot, now_s, "localTrajectory", {"localTrajectory": _trajectory(robot, now_s)}),
            self._message(robot, now_s, "globalPlan", {"globalPlan": _plan(robot, now_s)}),
            self._message(robot, now_s, "odometry", {"pose": pose, "velocity": velocity}),
        ]

    def _message(self, robot: RobotState, now_s: float, resource: str, body: dict[str, Any]) -> TopicMessage:
        raw = json.dumps({"timestamp": write(now_s)} | body, separators=(",", ":")).encode()
        return TopicMessage(f"/ISO_21423/v1/IMR/{robot.member.uuid}/{resource}", raw)


def _identity(robot: RobotState) -> dict[str, Any]:
    make = robot.member.make
    x_m, y_m = make.body.length_m / 2, make.body.width_m / 2
    corners = [{"x": x, "y": y} for x, y in ((x_m, y_m), (-x_m, y_m), (-x_m, -y_m), (x_m, -y_m))]
    details = {
        "imrModel": make.model,
        "imrSerialNumber": f"{make.model}-{robot.member.number:04}",
        "imrFootprint": corners,
        "imrWorkingArea": corners,
        "imrHeight": make.height_m,
        "softwareVersions": [],
        "ratedSpeed": make.max_speed_mps,
    }
    return {
        "id": robot.member.uuid,
        "entityType": "IMR",
        "manufacturerName": make.vendor.value,
        "iso21423Version": "1.0",
        "capabilities": {
            "provides": ["status", "odometry", "localTrajectory", "globalPlan"],
            "accepts": {"requests": []},
        },
        "details": details,
    }


def _point(floor: int, x_m: float, y_m: float) -> dict[str, Any]:
    return {"ccsId": SITE_MAPS[floor].datum, "x": round(x_m, 4), "y": round(y_m, 4), "z": 0.0}


def _trajectory(robot: RobotState, now_s: float) -> list[dict[str, Any]]:
    if robot.state != "navigating":
        return []
    poses, floors = robot.plan.at(np.array(EVERY_SECOND_S))
    rows = zip(EVERY_SECOND_S, floors.tolist(), poses.tolist(), strict=True)
    return [
        {"timestamp": write(now_s + after_s), "locationPoint": _point(floor, *pose[:2])}
        for after_s, floor, pose in rows
    ]


def _plan(robot: RobotState, now_s: float) -> list[dict[str, Any]]:
    return [
        {"timestamp": write(now_s + after_s), "locationPoint": _point(floor, x, y)}
        for after_s, floor, x, y, _ in robot.destinations
    ]
