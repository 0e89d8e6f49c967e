"""A vendor whose fleet manager and robots speak VDA 5050: an order for each drive, and states along it.

An order has two nodes. Its edge is the way that the robot plans, as a curve. Only the order says where nodes are.
Robots speak version 2.0, 2.1 and 3.0 in turn.
"""

import json
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from deconflict.simulation.participants import BodySize
from deconflict.simulation.robot_state import RobotState
from deconflict.simulation.vendors.dialects import BASALT_MAPS, DialectMap
from ingest.languages.timestamps import write

VERSIONS = ("2.0.0", "2.1.0", "3.0.0")
CORNERS = 40
"""Most control points of an edge."""
NEW_GOAL_M = 0.5
"""A drive to a place that is further off than this from the last goal is a new order."""


class TopicMessage(NamedTuple):
    """A message for a broker."""

    topic: str
    raw: bytes
    is_retained: bool = False


class VdaRobot:
    """The messages of one robot and of its fleet manager, in turn. Keeps the order that it drives."""

    def __init__(self, maps: tuple[DialectMap, DialectMap] = BASALT_MAPS) -> None:
        self._maps = maps
        self._header_id = 0
        self._orders = 0
        self._goal: tuple[float, float, float] | None = None
        """Floor, x and y of the goal of its order."""

    def messages(self, robot: RobotState, now_s: float, *, introduce: bool = False) -> list[TopicMessage]:
        """The state, and before it an order to a new goal. With `introduce` connection and factsheet come first."""
        found = list(self._introduction(robot, now_s)) if introduce else []
        if self._has_new_goal(robot):
            found.append(self._message(robot, now_s, "order", self._order(robot)))
        return [*found, self._message(robot, now_s, "state", self._state(robot))]

    def _introduction(self, robot: RobotState, now_s: float) -> Iterator[TopicMessage]:
        yield self._message(robot, now_s, "connection", {"connectionState": "ONLINE"})._replace(is_retained=True)
        yield self._message(robot, now_s, "factsheet", _factsheet(robot))._replace(is_retained=True)

    def _message(self, robot: RobotState, now_s: float, kind: str, body: dict[str, Any]) -> TopicMessage:
        self._header_id += 1
        maker, serial, version = robot.member.make.vendor.value, robot.member.serial, version_of(robot)
        header = {
            "headerId": self._header_id,
            "timestamp": write(now_s),
            "version": version,
            "manufacturer": maker,
            "serialNumber": serial,
        }
        prefix = "vda5050/v3" if version.startswith("3") else "uagv/v2"
        raw = json.dumps(header | body, separators=(",", ":")).encode()
        return TopicMessage(f"{prefix}/{maker}/{serial}/{kind}", raw)

    def _has_new_goal(self, robot: RobotState) -> bool:
        """Whether the robot drives to another place than that of its order."""
        if robot.state != "navigating" or not robot.destinations:
            return False
        _, floor, x, y, _ = robot.destinations[0]
        if self._goal and self._goal[0] == floor and np.hypot(x - self._goal[1], y - self._goal[2]) < NEW_GOAL_M:
            return False
        self._goal = float(floor), x, y
        self._orders += 1
        return True

    def _order(self, robot: RobotState) -> dict[str, Any]:
        (x, y, _), (goal_x, goal_y, _) = self._pose(robot), self._goal_pose()
        is_3, map_id = version_of(robot).startswith("3"), self._maps[robot.floor].datum
        places = [{"x": x, "y": y, "mapId": map_id}, {"x": goal_x, "y": goal_y, "mapId": map_id}]
        nodes = [
            {"nodeId": "ab"[row], "sequenceId": 2 * row, "released": True, "nodePosition": place, "actions": []}
            for row, place in enumerate(places)
        ]
        edge = {"edgeId": "ab", "sequenceId": 1, "released": True, "actions": [], "trajectory": self._way(robot)}
        ends = {} if is_3 else {"startNodeId": "a", "endNodeId": "b"}
        speed = {"maximumSpeed" if is_3 else "maxSpeed": robot.member.make.max_speed_mps}
        return {"orderId": self._order_id, "orderUpdateId": 0, "nodes": nodes, "edges": [edge | ends | speed]}

    @property
    def _order_id(self) -> str:
        return f"order-{self._orders}" if self._orders else ""

    def _way(self, robot: RobotState) -> dict[str, Any]:
        """The planned way on this floor as a curve of degree 1."""
        plan = robot.plan
        here = plan.poses[plan.floors == robot.floor]
        rows = np.unique(np.linspace(0, len(here) - 1, min(CORNERS, len(here))).astype(int))
        points = [self._maps[robot.floor].pose(*here[row].tolist())[:2] for row in rows]
        points.append(self._goal_pose()[:2])
        inner = np.linspace(0.0, 1.0, len(points)).tolist()
        return {
            "degree": 1,
            "knotVector": [0.0, *inner, 1.0],
            "controlPoints": [{"x": round(x, 3), "y": round(y, 3)} for x, y in points],
        }

    def _pose(self, robot: RobotState) -> tuple[float, float, float]:
        x, y, yaw = self._maps[robot.floor].pose(robot.x_m, robot.y_m, robot.yaw_rad)
        return round(x, 4), round(y, 4), float(np.arctan2(np.sin(yaw), np.cos(yaw)))

    def _goal_pose(self) -> tuple[float, float, float]:
        floor, x, y = self._goal or (0.0, 0.0, 0.0)
        return self._maps[int(floor)].pose(x, y, 0.0)

    def _state(self, robot: RobotState) -> dict[str, Any]:
        x, y, yaw = self._pose(robot)
        is_3, is_driving = version_of(robot).startswith("3"), robot.state == "navigating" and bool(self._goal)
        place = {"x": x, "y": y, "theta": yaw, "mapId": self._maps[robot.floor].datum}
        charge, charging = round(robot.battery_pct, 1), robot.state == "charging"
        body: dict[str, Any] = {
            "orderId": self._order_id,
            "orderUpdateId": 0,
            "lastNodeId": ("a" if is_driving else "b") if self._goal else "",
            "lastNodeSequenceId": 0 if is_driving or not self._goal else 2,
            "nodeStates": [{"nodeId": "b", "sequenceId": 2, "released": True}] if is_driving else [],
            "edgeStates": [{"edgeId": "ab", "sequenceId": 1, "released": True}] if is_driving else [],
            "driving": is_driving and abs(robot.linear_mps) > 0.02,
            "paused": robot.state in {"waitingExternalEvent", "waitingHumanEvent"},
            "actionStates": [],
            "velocity": {"vx": round(robot.linear_mps, 3), "vy": 0.0, "omega": round(robot.turn_radps, 3)},
            "loads": _loads(robot),
            "operatingMode": "AUTOMATIC",
            "errors": [_error(code, is_3) for code in robot.errors],
            "safetyState": {"activeEmergencyStop" if is_3 else "eStop": "NONE", "fieldViolation": False},
        }
        if is_3:
            power = {"powerSupply": {"stateOfCharge": charge, "charging": charging}, "instantActionStates": []}
            return body | power | {"mobileRobotPosition": place | {"localized": True}}
        power = {"batteryState": {"batteryCharge": charge, "charging": charging}}
        return body | power | {"agvPosition": place | {"positionInitialized": True}}


def version_of(robot: RobotState) -> str:
    return VERSIONS[robot.member.number % len(VERSIONS)]


def _error(code: str, is_3: bool) -> dict[str, str]:
    is_stuck = "Stuck" in code
    level = ("CRITICAL" if is_3 else "FATAL") if is_stuck else "WARNING"
    return {"errorType": code.replace(" ", ""), "errorLevel": level}


def _loads(robot: RobotState) -> list[dict[str, Any]]:
    if not robot.load_pct:
        return []
    loaded = robot.member.make.loaded
    size = {"length": loaded.length_m, "width": loaded.width_m, "height": robot.member.make.height_m}
    return [{"boundingBoxReference": {"x": loaded.ahead_m, "y": 0.0, "z": 0.0}, "loadDimensions": size}]


def _factsheet(robot: RobotState) -> dict[str, Any]:
    """The two generations of the standard have other names for the same."""
    make, is_3 = robot.member.make, version_of(robot).startswith("3")
    speeds = 0.0, make.max_speed_mps, make.gain_mps2, make.brake_mps2
    sizes = 0.0, make.height_m, make.body.width_m, make.body.length_m
    kind = {"localizationTypes": ["NATURAL"], "navigationTypes": ["VIRTUAL_LINE_GUIDED"], "seriesName": make.model}
    kinds = (make.model, "DIFFERENTIAL" if is_3 else "DIFF", "CARRIER", 400.0)
    outline = {"envelope2dId" if is_3 else "set": "body", "vertices" if is_3 else "polygonPoints": _corners(make.body)}
    limits: tuple[dict[str, float], ...] = ({}, {}, dict.fromkeys(_TIMES[is_3], 1.0))
    return {
        "typeSpecification": kind | dict(zip(_KIND[is_3], kinds, strict=True)),
        "physicalParameters": dict(zip(_PARAMETERS[is_3], (*speeds, *sizes), strict=True)),
        "protocolLimits": dict(zip(_LIMITS[is_3], limits, strict=True)),
        "protocolFeatures": {"optionalParameters": [], "mobileRobotActions" if is_3 else "agvActions": []},
        "mobileRobotGeometry" if is_3 else "agvGeometry": {"envelopes2d": [outline]},
        "loadSpecification": {},
    }


_KIND = (
    ("seriesName", "agvKinematic", "agvClass", "maxLoadMass"),
    ("seriesName", "mobileRobotKinematics", "mobileRobotClass", "maximumLoadMass"),
)
"""By whether the version is 3.0, as the others."""
_PARAMETERS = (
    ("speedMin", "speedMax", "accelerationMax", "decelerationMax", "heightMin", "heightMax", "width", "length"),
    (
        "minimumSpeed",
        "maximumSpeed",
        "maximumAcceleration",
        "maximumDeceleration",
        "minimumHeight",
        "maximumHeight",
        "width",
        "length",
    ),
)
_LIMITS = (
    ("maxStringLens", "maxArrayLens", "timing"),
    ("maximumStringLengths", "maximumArrayLengths", "timing"),
)
_TIMES = ("minOrderInterval", "minStateInterval"), ("minimumOrderInterval", "minimumStateInterval")


def _corners(body: BodySize) -> list[dict[str, float]]:
    half_m, side_m = body.length_m / 2, body.width_m / 2
    signs = ((1, 1), (-1, 1), (-1, -1), (1, -1))
    return [{"x": round(body.ahead_m + a * half_m, 3), "y": round(b * side_m, 3)} for a, b in signs]
