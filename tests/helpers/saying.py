"""Messages of robots for tests: conforming reports in the standard's JSON, with any key replaced."""

import json
from datetime import UTC, datetime
from math import cos, sin
from typing import Any
from uuid import NAMESPACE_DNS, uuid5

HALL = "0d6f4f0e-9d0c-4a6f-8a55-0c9f5f4a1b01"
LOFT = "0d6f4f0e-9d0c-4a6f-8a55-0c9f5f4a1b02"

Point = tuple[float, float, float, float]
"""t_s, x, y, yaw_rad."""


def robot(name: str) -> str:
    return str(uuid5(NAMESPACE_DNS, name))


def stamp(t_s: float) -> str:
    return datetime.fromtimestamp(t_s, UTC).isoformat(timespec="milliseconds").replace("+00:00", "Z")


def angle(yaw_rad: float) -> dict[str, float]:
    return {"x": 0.0, "y": 0.0, "z": sin(yaw_rad / 2), "w": cos(yaw_rad / 2)}


def points(*given: Point) -> list[dict[str, Any]]:
    return [{"timestamp": stamp(t), "x": x, "y": y, "angle": angle(yaw)} for t, x, y, yaw in given]


def identity(name: str, t_s: float, **replaced: Any) -> bytes:
    report = {
        "uuid": robot(name),
        "timestamp": stamp(t_s),
        "manufacturerName": "Alder",
        "robotModel": "A1",
        "robotSerialNumber": name,
        "baseRobotEnvelope": {"x": 1.0, "y": 0.5, "z": 0.4},
    }
    return _bytes(report | replaced)


def status(name: str, t_s: float, x: float = 0.0, y: float = 0.0, yaw_rad: float = 0.0, **replaced: Any) -> bytes:
    report = {
        "uuid": robot(name),
        "timestamp": stamp(t_s),
        "operationalState": "navigating",
        "location": {"x": x, "y": y, "angle": angle(yaw_rad), "planarDatum": HALL},
    }
    return _bytes(report | replaced)


def _bytes(report: dict[str, Any]) -> bytes:
    """The report as JSON. Keys with the value None are left out."""
    return json.dumps({key: value for key, value in report.items() if value is not None}).encode()
