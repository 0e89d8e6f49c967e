"""A factsheet, an order that grows with the drive, and a state each second, of VDA 5050."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from benchmarks.less_told.fields import Fields
from benchmarks.less_told.languages.sending import KNOWN_S, MAP_ID, Sent, is_under_way, path_of, report_times, sent
from benchmarks.less_told.scenes import Robot
from benchmarks.planned_floors.logs.messages import START_S, stamp
from ingest.languages.front_ends import FRONT_ENDS

LANGUAGE = "vda5050"
RELEASED = 2
"""So many nodes ahead of a robot are released."""


def uuid_of(robot: Robot) -> str:
    """The identity that the service derives."""
    sender = FRONT_ENDS[LANGUAGE].sender(_topic(robot, "state"))
    if sender is None:
        raise ValueError(f"{_topic(robot, 'state')} is no topic of {LANGUAGE}")
    return sender.uuid


def messages(robot: Robot, fields: Fields) -> Iterator[Sent]:
    """All messages of a robot and of its fleet manager."""
    yield _sent(robot, 0.0, "connection", {"connectionState": "ONLINE"})
    if "factsheet" in fields:
        yield _sent(robot, 0.0, "factsheet", _factsheet(robot, fields))
    update = -1
    for t_s in report_times(robot):
        passed = _passed(robot, t_s)
        if "order" in fields and t_s >= robot.drive.begins_s - KNOWN_S and passed > update:
            update = passed
            yield _sent(robot, t_s, "order", _order(robot, update, fields))
        yield _sent(robot, t_s, "state", _state(robot, t_s, update, fields))


def _passed(robot: Robot, t_s: float) -> int:
    """The last node that a robot has left, or at which it stands in the end."""
    return max(sum(node_s <= t_s for node_s in robot.drive.node_s) - 1, 0)


def _topic(robot: Robot, kind: str) -> str:
    return f"uagv/v2/{robot.vendor}/{robot.name}/{kind}"


def _sent(robot: Robot, t_s: float, kind: str, body: dict[str, Any]) -> Sent:
    header = {
        "headerId": round(t_s * 10),
        "timestamp": stamp(START_S + t_s),
        "version": "2.1.0",
        "manufacturer": robot.vendor,
        "serialNumber": robot.name,
    }
    return sent(robot, t_s, LANGUAGE, _topic(robot, kind), header | body)


def _factsheet(robot: Robot, fields: Fields) -> dict[str, Any]:
    stated = {"speedMax": round(robot.drive.style.limit_mps, 3)} if "speed_max" in fields else {}
    return {
        "typeSpecification": {"seriesName": robot.model, "agvKinematic": "DIFF"},
        "physicalParameters": {"length": robot.length_m, "width": robot.width_m, "heightMax": 0.5} | stated,
    }


def _order(robot: Robot, passed: int, fields: Fields) -> dict[str, Any]:
    """From the last node that the robot has passed. Beyond the released nodes is the horizon."""
    count, base_end = len(robot.drive.nodes_m), passed + RELEASED
    last = count - 1 if "horizon" in fields else min(base_end, count - 1)
    return {
        "orderId": "o1",
        "orderUpdateId": passed,
        "nodes": [_node(robot, number, fields) | _release(number <= base_end) for number in range(passed, last + 1)],
        "edges": [_edge(robot, number, fields) | _release(number < base_end) for number in range(passed, last)],
    }


def _release(is_released: bool) -> dict[str, Any]:
    return {"released": is_released, "actions": []}


def _node(robot: Robot, number: int, fields: Fields) -> dict[str, Any]:
    x_m, y_m = robot.drive.nodes_m[number].tolist()
    place: dict[str, Any] = {"x": round(x_m, 3), "y": round(y_m, 3), "mapId": MAP_ID}
    yaw_rad = robot.drive.node_yaw_rad[number]
    if "node_theta" in fields and yaw_rad is not None:
        place["theta"] = _theta(yaw_rad)
    return {"nodeId": f"n{number}", "sequenceId": 2 * number, "nodePosition": place}


def _edge(robot: Robot, number: int, fields: Fields) -> dict[str, Any]:
    edge: dict[str, Any] = {"edgeId": f"e{number}", "sequenceId": 2 * number + 1}
    edge |= {"startNodeId": f"n{number}", "endNodeId": f"n{number + 1}"}
    if "edge_max_speed" in fields:
        edge["maxSpeed"] = round(robot.drive.style.limit_mps, 3)
    if "edge_max_rotation" in fields:
        edge["maxRotationSpeed"] = round(robot.drive.style.turn_radps, 3)
    return edge


def _state(robot: Robot, t_s: float, update: int, fields: Fields) -> dict[str, Any]:
    (x_m, y_m, yaw_rad), (speed_mps, turn_radps) = robot.drive.at(np.array(t_s)).tolist(), robot.drive.motion_at(t_s)
    place: dict[str, Any] = {"x": round(x_m, 3), "y": round(y_m, 3), "mapId": MAP_ID, "positionInitialized": True}
    if "theta" in fields:
        place["theta"] = _theta(yaw_rad)
    state: dict[str, Any] = {
        "agvPosition": place,
        "driving": abs(speed_mps) > 0.02 or abs(turn_radps) > 0.02,
        "actionStates": [],
        "batteryState": {"batteryCharge": 80.0, "charging": False},
        "operatingMode": "AUTOMATIC",
        "errors": [],
        "safetyState": {"eStop": "NONE", "fieldViolation": False},
    }
    if "velocity" in fields:
        turns = {"omega": round(turn_radps, 3)} if "omega" in fields else {}
        state["velocity"] = {"vx": round(speed_mps, 3), "vy": 0.0} | turns
    if "intermediate_path" in fields and is_under_way(robot, t_s):
        state["intermediatePath"] = {"polyline": _polyline(robot, t_s)}
    return state | _progress(robot, t_s, update, fields)


def _progress(robot: Robot, t_s: float, update: int, fields: Fields) -> dict[str, Any]:
    """The order, its last node and what remains of it. `update` is -1 before there is an order."""
    if update < 0:
        nothing: dict[str, Any] = {"nodeStates": [], "edgeStates": []}
        return {"orderId": "", "orderUpdateId": 0, "lastNodeId": "", "lastNodeSequenceId": 0} | nothing
    passed, base_end, last = _passed(robot, t_s), update + RELEASED, len(robot.drive.nodes_m) - 1
    if "horizon" not in fields:
        last = min(base_end, last)
    nodes, edges = range(passed + 1, last + 1), range(passed, last)
    return {
        "orderId": "o1",
        "orderUpdateId": update,
        "lastNodeId": f"n{passed}",
        "lastNodeSequenceId": 2 * passed,
        "nodeStates": [{"nodeId": f"n{k}", "sequenceId": 2 * k, "released": k <= base_end} for k in nodes],
        "edgeStates": [{"edgeId": f"e{k}", "sequenceId": 2 * k + 1, "released": k < base_end} for k in edges],
    }


def _polyline(robot: Robot, t_s: float) -> list[dict[str, Any]]:
    return [
        {"x": round(x_m, 3), "y": round(y_m, 3), "theta": _theta(yaw_rad), "eta": stamp(START_S + t_s + after_s)}
        for after_s, _, x_m, y_m, yaw_rad in path_of(robot, t_s)
    ]


def _theta(yaw_rad: float) -> float:
    return round(float(np.arctan2(np.sin(yaw_rad), np.cos(yaw_rad))), 4)
