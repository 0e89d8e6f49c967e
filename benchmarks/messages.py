"""The processor time to read one message: `python -m benchmarks.messages`.

It measures three things: reading alone; everything from bytes to a row of a batch, including forecast, counters and
four batches per second; and the document for people. Each is the best of many short runs, so that other load on the
machine has little effect. The ratios compare with pydantic's validation of a conforming message in the same run. Of
"late" robots each reports every ten seconds.
"""

import json
from collections.abc import Callable, Iterator
from datetime import UTC, datetime
from functools import partial
from time import process_time
from timeit import repeat
from typing import Any

from deconflict.settings.fleet_factory import fast_fleet_of
from deconflict.settings.site import Site
from ingest.fleet.fleet import Fleet
from ingest.languages.massrobotics.message_document import message_document
from ingest.languages.massrobotics.parser import read
from ingest.languages.massrobotics.report_models import StatusReport
from ingest.measures.measures import Measures
from ingest.port.connection import Connection
from ingest.settings import Datum, ReferencePoint, Vendor, VendorMap

T = "2023-11-14T22:13:{:02d}.250Z"
DATUM = "0d6f4f0e-9d0c-4a6f-8a55-0c9f5f4a1b01"
ANGLE = {"x": 0.0, "y": 0.0, "z": 0.49999, "w": 0.86603}
NO_TURN = {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}
Lines = Callable[[int], Iterator[tuple[bytes, Connection]]]
"""Messages and their connections, by second."""
RUNS, CALLS = 60, 200
WRONG_TYPE = {"batteryPercentage": "81.5"}
ROBOTS, SECONDS, TICKS = 200, 12, 4
START_S = 1_700_000_000.25
MARKS = {"north": (0.0, 50.0), "south": (0.0, 0.0), "east": (40.0, 0.0)}
SITE = Site(
    name="Benchmark",
    datums=(
        Datum(
            id=DATUM,
            name="Hall",
            reference_points=tuple(ReferencePoint(id=mark, x=x, y=y) for mark, (x, y) in MARKS.items()),
        ),
    ),
    vendors=(
        Vendor(
            name="Mapped",
            maps=(
                VendorMap(
                    datum=DATUM, site_datum=DATUM, readings={mark: (y + 3, 9 - x) for mark, (x, y) in MARKS.items()}
                ),
            ),
        ),
    ),
)


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


def official() -> dict[str, Any]:
    """The same status as the official sample sender writes it: upper case, no colon, the other datum key."""
    report = conforming()
    report["uuid"] = report["uuid"].upper()
    report["location"]["planarDatum"] = DATUM.upper()
    report["timestamp"] = _no_colon(report["timestamp"])
    for point in report["path"]:
        point["timestamp"] = _no_colon(point["timestamp"])
        point["planarDatum"] = DATUM.upper()
    return report


def _no_colon(timestamp: str) -> str:
    return timestamp[:19] + "+0000"


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


def batch_us(report: dict[str, Any], vendor: str | None = None, every_s: int = 1) -> float:
    """See `row_us`, of a status through the compiled shortcut, if each robot reports every so many seconds."""
    connection = Connection(1, vendor=vendor)
    robots = [{**report, "uuid": f"6b2f3f0a-54a2-4d6e-9b0e-{robot:012x}"} for robot in range(ROBOTS)]

    def of_second(second: int) -> Iterator[tuple[bytes, Connection]]:
        for robot in robots:
            message = identity(robot["uuid"]) if second < 0 else later(robot, second * every_s)
            yield json.dumps(message).encode(), connection

    return row_us(fast_fleet_of(SITE, Measures()), of_second, every_s)


def row_us(fleet: Fleet, of_second: Lines, every_s: int = 1) -> float:
    """Processor time of one message from bytes to a row of a batch, in the best second of many robots' messages.

    `of_second` returns the messages of one second and their connections, and for second -1 those that introduce robots.
    Only one second of every so many has messages.
    """
    best_s, messages = float("inf"), 1
    for raw, connection in of_second(-1):
        fleet.receive(raw, START_S - 1, connection)
    for second in range(SECONDS):
        lines = list(of_second(second))
        began_s, messages = process_time(), len(lines)
        for number, (raw, connection) in enumerate(lines):
            now_s = START_S + second * every_s + number / messages
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


def main() -> None:
    cases = {
        "conforming": (conforming(), None, 1),
        "conforming, late": (conforming(), None, 10),
        "conforming, a map of its own": (conforming(), "Mapped", 1),
        "no path": (conforming() | {"path": []}, None, 1),
        "no path, late": (conforming() | {"path": []}, None, 10),
        "a number as text": (conforming() | WRONG_TYPE, None, 1),
        "a key of its own": (conforming() | {"fleet": "Alder"}, None, 1),
        "official dialect": (official(), None, 1),
        "both": (official() | WRONG_TYPE, None, 1),
    }
    plain = json.dumps(conforming()).encode()
    alone_us = us(partial(StatusReport.model_validate_json, plain))
    columns = f"{'read us':>10}{'ratio':>7}{'batch us':>10}{'ratio':>7}"
    print(f"{'status, ten points':<30}{'bytes':>8}{columns}{'document us':>13}")
    for name, (report, vendor, every_s) in cases.items():
        raw = json.dumps(report).encode()
        read_us, document_us, row_us = (
            us(partial(read, raw)),
            us(partial(message_document, raw)),
            batch_us(report, vendor, every_s),
        )
        columns = f"{read_us:>10.1f}{read_us / alone_us:>7.1f}{row_us:>10.1f}{row_us / alone_us:>7.1f}"
        print(f"{name:<30}{len(raw):>8}{columns}{document_us:>13.1f}")


if __name__ == "__main__":
    main()
