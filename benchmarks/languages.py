"""The processor time of one message of each language, from bytes to a row of a batch: `python -m benchmarks.languages`.

Robots with ten points, or ten nodes, ahead of them. Beside it stands the time of `json.loads` and a validation by the
JSON Schema of the standard alone (ISO 21423: none that is free). Each is the best of many short runs.
"""

import json
from collections.abc import Callable, Iterator
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from time import process_time
from timeit import repeat
from typing import Any

from jsonschema import Draft202012Validator

from deconflict.settings.fleet_factory import fast_fleet_of, fleet_of
from deconflict.settings.site import Site
from ingest.fleet.fleet import Fleet
from ingest.languages.massrobotics.report_models import StatusReport
from ingest.measures.measures import Measures
from ingest.port.connection import Connection
from ingest.settings import Datum
from tests.helpers import iso_saying, vda_saying

T = "2023-11-14T22:13:{:02d}.250Z"
DATUM = "0d6f4f0e-9d0c-4a6f-8a55-0c9f5f4a1b01"
ANGLE = {"x": 0.0, "y": 0.0, "z": 0.49999, "w": 0.86603}
NO_TURN = {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}
Lines = Callable[[int], Iterator[tuple[bytes, Connection]]]
"""Messages and their connections, by second."""
RUNS, CALLS = 60, 200
ROBOTS, SECONDS, TICKS = 200, 12, 4
START_S = 1_700_000_000.25
SITE = Site(name="Benchmark", datums=(Datum(id=DATUM, name="Hall"),))
AHEAD = 10
SPEED_MPS = 1.0
SCHEMA = Path(__file__).parents[1] / "tests/helpers/vda5050_schemas/2.1.0/state.schema.json"
SOCKET = Connection(1)


def conforming() -> dict[str, Any]:
    """A conforming status with ten path points."""
    path = [{"timestamp": T.format(20 + i), "x": 12.345 + i, "y": 6.789, "angle": dict(ANGLE)} for i in range(10)]
    return {
        "uuid": "6b2f3f0a-54a2-4d6e-9b0e-6c1f0a7d9e11",
        "timestamp": T.format(20),
        "operationalState": "navigating",
        "location": {"x": 12.345, "y": 6.789, "angle": ANGLE, "planarDatum": DATUM},
        "velocity": {"linear": 1.25, "angular": NO_TURN},
        "batteryPercentage": 81.5,
        "remainingRunTime": 4.5,
        "loadPercentageStillAvailable": 60.0,
        "path": path,
    }


def identity(uuid: str) -> dict[str, Any]:
    """The identity report of a robot."""
    return {
        "uuid": uuid,
        "timestamp": T.format(20),
        "manufacturerName": "Alder",
        "robotModel": "A",
        "robotSerialNumber": uuid[-4:],
        "baseRobotEnvelope": {"x": 0.9, "y": 0.6, "z": 1.2},
        "maxSpeed": 2.0,
    }


def us(call: Callable[[], object]) -> float:
    return min(repeat(call, number=CALLS, repeat=RUNS)) / CALLS * 1e6


def row_us(fleet: Fleet, of_second: Lines) -> float:
    """Processor time of one message from bytes to a row of a batch, in the best second of many robots' messages.

    `of_second` returns the messages of one second and their connections, and for second -1 those that introduce robots.
    """
    best_s, messages = float("inf"), 1
    for raw, connection in of_second(-1):
        fleet.receive(raw, START_S - 1, connection)
    for second in range(SECONDS):
        lines = list(of_second(second))
        began_s, messages = process_time(), len(lines)
        for number, (raw, connection) in enumerate(lines):
            now_s = START_S + second + number / messages
            if fleet.receive(raw, now_s, connection):
                raise SystemExit("a message was rejected")
            if (number + 1) % (messages // TICKS) == 0:
                fleet.next_batch(now_s)
        best_s = min(best_s, process_time() - began_s)
    return best_s / messages * 1e6


def later(report: dict[str, Any], by_s: int) -> dict[str, Any]:
    """The same report with all timestamps moved."""
    path = [point | {"timestamp": _moved(point["timestamp"], by_s)} for point in report["path"]]
    return report | {"timestamp": _moved(report["timestamp"], by_s), "path": path}


def _moved(stamp: str, by_s: int) -> str:
    moved = datetime.fromtimestamp(datetime.fromisoformat(stamp).timestamp() + by_s, UTC)
    return moved.isoformat(timespec="milliseconds")[:23] + stamp[23:]


def massrobotics(second: int) -> Iterator[tuple[bytes, Connection]]:
    """The statuses of all robots; before the first second their identities."""
    for robot in range(ROBOTS):
        uuid = f"6b2f3f0a-54a2-4d6e-9b0e-{robot:012x}"
        report = identity(uuid) if second < 0 else later(conforming() | {"uuid": uuid}, second)
        yield json.dumps(report).encode(), SOCKET


def vda5050(second: int) -> Iterator[tuple[bytes, Connection]]:
    """The states of all robots; before the first second their factsheets and orders."""
    nodes = [vda_saying.node(number, 10.0 * number) for number in range(AHEAD + 1)]
    t_s = START_S + second
    for robot in range(ROBOTS):
        serial = f"{robot:05}"
        keys: dict[str, Any] = {"serialNumber": serial}
        if second < 0:
            yield vda_saying.factsheet(t_s, **keys), vda_saying.line("factsheet", serial)
            yield vda_saying.order(t_s, nodes, **keys), vda_saying.line("order", serial)
        else:
            velocity = {"vx": SPEED_MPS, "vy": 0.0, "omega": 0.0}
            raw = vda_saying.under_way(t_s, SPEED_MPS * second / 2, 0.0, nodes[1:], velocity=velocity, **keys)
            yield raw, vda_saying.line("state", serial)


def iso21423(second: int) -> Iterator[tuple[bytes, Connection]]:
    """A trajectory and an odometry of each robot; before the first second their identities and states."""
    t_s = START_S + second
    for robot in range(ROBOTS):
        uuid = f"91403a21-7534-4467-99a6-{robot:012d}"
        ahead = [(t_s + i, SPEED_MPS * (second + i), 0.0) for i in range(1, AHEAD + 1)]
        first = iso_saying.identity(t_s), iso_saying.states(t_s, "MODE_AUTO", "FORWARD")
        then = iso_saying.trajectory(t_s, *ahead), iso_saying.odometry(t_s, SPEED_MPS * second, 0.0, 0.0, SPEED_MPS)
        raws, kinds = (first, ("identity", "status")) if second < 0 else (then, ("localTrajectory", "odometry"))
        for raw, kind in zip(raws, kinds, strict=True):
            yield raw, iso_saying.line(kind, uuid)


def validation_us(raw: bytes, schema: dict[str, Any]) -> float:
    """Of `json.loads` and a validation by a schema."""
    validator = Draft202012Validator(schema)
    if not validator.is_valid(json.loads(raw)):
        raise SystemExit("a message is not valid by its schema")
    return us(lambda: validator.validate(json.loads(raw)))


def main() -> None:
    lines: dict[str, Lines] = {"massrobotics": massrobotics, "vda5050": vda5050, "iso21423": iso21423}
    schemas = {"massrobotics": StatusReport.model_json_schema(by_alias=True), "vda5050": json.loads(SCHEMA.read_text())}
    slow_us = row_us(fleet_of(SITE, Measures()), massrobotics)
    print(f"{'language':<26}{'bytes':>7}{'loads us':>10}{'+ schema us':>13}{'to a batch us':>15}{'ratio':>7}")
    for name, of_second in lines.items():
        raw, _ = next(iter(of_second(0)))
        alone_us, schema = us(partial(json.loads, raw)), schemas.get(name)
        checked = f"{validation_us(raw, schema):>13.0f}" if schema else f"{'-':>13}"
        whole_us = slow_us if name == "massrobotics" else row_us(fleet_of(SITE, Measures()), of_second)
        print(f"{name:<26}{len(raw):>7}{alone_us:>10.1f}{checked}{whole_us:>15.1f}{whole_us / slow_us:>7.2f}")
    fast_us = row_us(fast_fleet_of(SITE, Measures()), massrobotics)
    print(f"{'massrobotics, compiled':<26}{'':>30}{fast_us:>15.1f}{fast_us / slow_us:>7.2f}")


if __name__ == "__main__":
    main()
