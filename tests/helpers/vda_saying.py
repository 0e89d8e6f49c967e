"""Messages of VDA 5050 as robots and fleet managers send them, versions 2.1 and 3.0."""

import json
from typing import Any

from ingest.languages.timestamps import write
from ingest.port.connection import Connection

MAKER, SERIAL, MAP = "KIT", "0001", "hall"
STATE_2: dict[str, Any] = {
    "orderId": "",
    "orderUpdateId": 0,
    "lastNodeId": "",
    "lastNodeSequenceId": 0,
    "nodeStates": [],
    "edgeStates": [],
    "driving": False,
    "actionStates": [],
    "batteryState": {"batteryCharge": 80.0, "charging": False},
    "operatingMode": "AUTOMATIC",
    "errors": [],
    "safetyState": {"eStop": "NONE", "fieldViolation": False},
}
NOT_IN_3 = ("batteryState", "agvPosition", "safetyState")
FACTSHEET: dict[str, dict[str, Any]] = {
    "typeSpecification": {"seriesName": "Carrier", "agvKinematic": "DIFF"},
    "physicalParameters": {"length": 1.2, "width": 0.8, "heightMax": 1.5, "speedMax": 1.0},
}


def topic(kind: str, serial: str = SERIAL, maker: str = MAKER) -> str:
    return f"uagv/v2/{maker}/{serial}/{kind}"


def line(kind: str, serial: str = SERIAL, maker: str = MAKER, number: int = 1) -> Connection:
    """The connection of a robot's topic."""
    return Connection(number, "broker", language="vda5050", topic=topic(kind, serial, maker))


def without_none(document: dict[str, Any]) -> dict[str, Any]:
    return {key: value for key, value in document.items() if value is not None}


def vda(t_s: float, serial: str = SERIAL, **keys: Any) -> bytes:
    """A message with a header. A key given as None is left out."""
    header = {
        "headerId": round(t_s * 10) % 1_000_000,
        "timestamp": write(t_s),
        "version": "2.1.0",
        "manufacturer": MAKER,
        "serialNumber": serial,
    }
    return json.dumps(without_none(header | keys)).encode()


def position(x: float = 0.0, y: float = 0.0, theta: float | None = 0.0, **keys: Any) -> dict[str, Any]:
    place = {"x": x, "y": y, "theta": theta, "mapId": MAP, "positionInitialized": True}
    return without_none(place | keys)


def state(t_s: float, x: float = 0.0, y: float = 0.0, theta: float | None = 0.0, **keys: Any) -> bytes:
    return vda(t_s, **(STATE_2 | {"agvPosition": position(x, y, theta)} | keys))


def state_3(t_s: float, x: float = 0.0, y: float = 0.0, **keys: Any) -> bytes:
    """A state of version 3.0."""
    body: dict[str, Any] = {key: value for key, value in STATE_2.items() if key not in NOT_IN_3} | {
        "version": "3.0.0",
        "instantActionStates": [],
        "powerSupply": {"stateOfCharge": 80.0, "charging": False},
        "safetyState": {"activeEmergencyStop": "NONE", "fieldViolation": False},
        "mobileRobotPosition": {"x": x, "y": y, "theta": 0.0, "mapId": MAP, "localized": True},
    }
    return vda(t_s, **(body | keys))


def visualization(t_s: float, x: float, y: float, **keys: Any) -> bytes:
    return vda(t_s, **({"agvPosition": position(x, y)} | keys))


def factsheet(t_s: float, **keys: Any) -> bytes:
    return vda(t_s, **(FACTSHEET | keys))


def node(number: int, x: float | None, y: float = 0.0, *, released: bool = True, **keys: Any) -> dict[str, Any]:
    """A node of an order. The sequence id of the node `number` is twice that. `x` None leaves its place out."""
    place = None if x is None else {"x": x, "y": y, "mapId": MAP}
    parts = {"nodeId": f"n{number}", "sequenceId": 2 * number, "released": released, "actions": []}
    return without_none(parts | {"nodePosition": place} | keys)


def edge(number: int, *, released: bool = True, **keys: Any) -> dict[str, Any]:
    """The edge from the node `number` to the next."""
    ends = {"startNodeId": f"n{number}", "endNodeId": f"n{number + 1}"}
    return {"edgeId": f"e{number}", "sequenceId": 2 * number + 1, "released": released, "actions": [], **ends, **keys}


def order(t_s: float, nodes: list[dict[str, Any]], edges: list[dict[str, Any]] | None = None, **keys: Any) -> bytes:
    """An order along the nodes. By default its edges are straight and without a speed."""
    made = [edge(each["sequenceId"] // 2, released=each["released"]) for each in nodes[:-1]] if edges is None else edges
    body: dict[str, Any] = {"orderId": "o1", "orderUpdateId": 0, "nodes": nodes, "edges": made}
    return vda(t_s, **(body | keys))


def node_states(nodes: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """What a state says of nodes that remain: which, not where."""
    return [{key: each[key] for key in ("nodeId", "sequenceId", "released")} for each in nodes]


def under_way(t_s: float, x: float, y: float, nodes: list[dict[str, Any]], **keys: Any) -> bytes:
    """The state of a robot that drives to the given nodes."""
    first = nodes[0]["sequenceId"] if nodes else 2
    passed: dict[str, Any] = {"lastNodeId": f"n{first // 2 - 1}", "lastNodeSequenceId": first - 2}
    body: dict[str, Any] = {"orderId": "o1", "driving": True, "nodeStates": node_states(nodes)}
    return state(t_s, x, y, **(body | passed | keys))
