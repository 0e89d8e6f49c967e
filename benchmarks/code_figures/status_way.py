"""The way of one status through the product, as JSON: `python status_way.py`, with the product in `PYTHONPATH`.

Two robots, one of which drives towards the other, report to a fleet, and its batches go to an engine. Only what the
product has had for long is imported, so that other checkouts can be measured.
"""

import gc
import json
import sys
import types
from collections import deque
from collections.abc import Callable, Mapping
from datetime import UTC, datetime
from numbers import Integral
from pathlib import Path
from typing import Any

import deconflict
from deconflict.engine.engine import Engine
from deconflict.settings.fleet_factory import fast_fleet_of
from deconflict.settings.site import Site
from ingest.batch import Batch
from ingest.measures.measures import Measures
from ingest.port.connection import Connection

ROOT = Path(deconflict.__file__).parent.parent
PACKAGES = tuple(f"{ROOT / package}/" for package in ("deconflict", "deconflict_client", "ingest", "metrics"))
ROBOTS = ("6b2f3f0a-54a2-4d6e-9b0e-6c1f0a7d9e11", "6b2f3f0a-54a2-4d6e-9b0e-6c1f0a7d9e12")
DATUM = "0d6f4f0e-9d0c-4a6f-8a55-0c9f5f4a1b01"
START_S, TICK_S, MOST_TICKS = 1_700_000_000.0, 0.25, 80
SPEED_M_S, DISTANCE_M = 1.0, 20.0
UPRIGHT = {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}


class FileTrace:
    """The files of the product in the order in which control is in them."""

    def __init__(self) -> None:
        self.files: list[str] = []

    def run(self, call: Callable[[], Any]) -> Any:
        sys.setprofile(self._note)
        try:
            return call()
        finally:
            sys.setprofile(None)

    def _note(self, frame: types.FrameType, event: str, _: object) -> None:
        file = frame.f_code.co_filename
        if event == "call" and file.startswith(PACKAGES) and file != (self.files[-1] if self.files else None):
            self.files.append(file)

    def figures(self) -> dict[str, int]:
        """How many files, and how often a call goes to a file that was left before."""
        return {"files": len(set(self.files)), "returns": len(self.files) - len(set(self.files))}


def _stamp(now_s: float) -> str:
    return datetime.fromtimestamp(now_s, UTC).isoformat(timespec="milliseconds")[:23] + "Z"


def _identity(robot: str) -> bytes:
    names = {"manufacturerName": "Alder", "robotModel": "A", "robotSerialNumber": robot[-4:]}
    size = {"baseRobotEnvelope": {"x": 0.9, "y": 0.6, "z": 1.2}, "maxSpeed": 2.0}
    return json.dumps({"uuid": robot, "timestamp": _stamp(START_S), **names, **size}).encode()


def _status(robot: str, x_m: float, now_s: float, speed_m_s: float) -> bytes:
    place = {"x": x_m, "y": 0.0, "angle": UPRIGHT, "planarDatum": DATUM}
    report: dict[str, Any] = {"uuid": robot, "timestamp": _stamp(now_s), "location": place}
    report["operationalState"] = "navigating" if speed_m_s else "idle"
    report["velocity"] = {"linear": speed_m_s, "angular": UPRIGHT}
    if speed_m_s:
        ahead = [(float(second), x_m + speed_m_s * second) for second in range(1, 11)]
        report["path"] = [{"timestamp": _stamp(now_s + s), "x": x, "y": 0.0, "angle": UPRIGHT} for s, x in ahead]
        goal_x_m, left_s = 2 * DISTANCE_M, (2 * DISTANCE_M - x_m) / speed_m_s
        report["destinations"] = [{"timestamp": _stamp(now_s + left_s), "x": goal_x_m, "y": 0.0, "angle": UPRIGHT}]
    return json.dumps(report).encode()


def measured() -> dict[str, int]:
    """The figures of the status that leads to the first revision. Raises `SystemExit` if none does."""
    fleet, engine, connection = fast_fleet_of(Site(), Measures()), Engine(Site()), Connection(1, "127.0.0.1", "/")
    for robot in ROBOTS:
        fleet.receive(_identity(robot), START_S, connection)

    def receive(raw: bytes, now_s: float) -> list[Any]:
        if refusal := fleet.receive(raw, now_s, connection):
            raise SystemExit(f"a status was rejected: {refusal}")
        engine.receive(Batch.from_bytes(fleet.next_batch(now_s).to_bytes()))
        return list(engine.step(now_s))

    for tick in range(MOST_TICKS):
        now_s = START_S + tick * TICK_S
        if tick % 4 == 0:
            receive(_status(ROBOTS[1], DISTANCE_M, now_s, 0.0), now_s)
        moving, trace = _status(ROBOTS[0], SPEED_M_S * tick * TICK_S, now_s, SPEED_M_S), FileTrace()
        if trace.run(lambda: receive(moving, now_s + 0.01)):  # noqa: B023 - called at once
            return trace.figures() | {"maps": slot_maps(engine)}
    raise SystemExit("no status led to a revision")


def slot_maps(root: object) -> int:
    """How many mappings from the UUID of a robot to a whole number are reached from an object."""
    waiting, seen, maps = deque([root]), {id(root)}, 0
    while waiting:
        value = waiting.popleft()
        maps += _is_slot_map(value)
        for inner in gc.get_referents(value):
            if id(inner) not in seen and not isinstance(inner, types.ModuleType | type | types.FunctionType):
                seen.add(id(inner))
                waiting.append(inner)
    return maps


def _is_slot_map(value: object) -> bool:
    if not isinstance(value, Mapping) or not any(robot in value for robot in ROBOTS):
        return False
    return all(isinstance(slot, Integral) and not isinstance(slot, bool) for slot in value.values())


if __name__ == "__main__":
    print(json.dumps(measured()))
