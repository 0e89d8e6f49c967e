"""Messages of ISO 21423 as robots send them."""

import json
from typing import Any

from ingest.languages.timestamps import write
from ingest.port.connection import Connection

ROBOT = "91403a21-7534-4467-99a6-79c46a130fe8"
CCS = "hall"
SQUARE = [{"x": 0.6, "y": 0.4}, {"x": -0.6, "y": 0.4}, {"x": -0.6, "y": -0.4}, {"x": 0.6, "y": -0.4}]
DETAILS: dict[str, Any] = {
    "imrModel": "TUG",
    "imrSerialNumber": "42",
    "imrFootprint": SQUARE,
    "imrWorkingArea": SQUARE,
    "imrHeight": 1.9,
    "ratedSpeed": 1.8,
}


def topic(resource: str, uuid: str = ROBOT) -> str:
    return f"/ISO_21423/v1/IMR/{uuid}/{resource}"


def line(resource: str, uuid: str = ROBOT) -> Connection:
    """The connection of a robot's topic."""
    return Connection(1, "broker", language="iso21423", topic=topic(resource, uuid))


def iso(t_s: float, **keys: Any) -> bytes:
    return json.dumps({"timestamp": write(t_s)} | keys).encode()


def identity(t_s: float, maker: str = "Acme", **details: Any) -> bytes:
    return iso(t_s, id=ROBOT, entityType="IMR", manufacturerName=maker, details=DETAILS | details)


def at(x: float, y: float, **keys: Any) -> dict[str, Any]:
    return {"ccsId": CCS, "x": x, "y": y, "z": 0.0} | keys


def odometry(t_s: float, x: float = 0.0, y: float = 0.0, yaw: float | None = 0.0, speed: float = 0.0) -> bytes:
    pose = {"locationPoint": at(x, y), "orientation": {"yaw": yaw, "pitch": 0.0, "roll": 0.0}}
    return iso(t_s, pose=pose, velocity={"linear": speed, "angular": 0.0})


def points(*rows: tuple[float, float, float]) -> list[dict[str, Any]]:
    """Time, x and y of each point."""
    return [{"timestamp": write(t_s), "locationPoint": at(x, y)} for t_s, x, y in rows]


def trajectory(t_s: float, *rows: tuple[float, float, float]) -> bytes:
    return iso(t_s, localTrajectory=points(*rows))


def states(t_s: float, *names: str) -> bytes:
    return iso(t_s, entityId=ROBOT, states=list(names))
