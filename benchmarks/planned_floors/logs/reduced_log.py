"""Logs of the same motion in which robots report less: shorter paths, a destination or a position alone, fewer reports.

A log is read without code of the service and written again, so that any log of the MassRobotics standard can be
reduced.
"""

import gzip
import json
from collections.abc import Iterable, Iterator, Mapping
from datetime import datetime
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple
from zlib import crc32

Message = dict[str, Any]

MANUAL = "manualOverride"


class Tells(NamedTuple):
    """What robots report beside their position."""

    path_points: int = 0
    """Most points of a path."""
    destination: bool = False
    destination_time: bool = True
    """Whether a destination has the time of arrival."""
    invents_destination: bool = False
    """Whether the last point of the path is the destination where the log has none."""
    velocity: bool = True
    every_s: float | None = None
    """Time between two reports of a robot. None for that of the log."""
    state: str | None = None
    """The operational state of all reports. None for those of the log."""


TELLS: Mapping[str, Tells] = MappingProxyType(
    {
        **{str(points): Tells(points, destination=True) for points in (10, 5, 3, 2, 1)},
        "none": Tells(),
        "destination": Tells(destination=True, destination_time=False, invents_destination=True),
        "timed_destination": Tells(destination=True, invents_destination=True),
        "manual": Tells(state=MANUAL),
        "position": Tells(velocity=False),
        "position_5s": Tells(velocity=False, every_s=5.0),
        "position_10s": Tells(velocity=False, every_s=10.0),
        "position_30s": Tells(velocity=False, every_s=30.0),
    }
)
"""By name, from the most to the least. The first is what the floors of this benchmark report by themselves."""
TIME_TOLERANCE_S = 0.05
"""A report that is due within this time is due."""


def reduce_log(log: Path, tells: Tells, out: Path) -> None:
    """Write a log with what robots tell of `tells`. The same log gives the same bytes."""
    opened: Any = gzip.open if log.suffix == ".gz" else open
    with opened(log, "rb") as lines, out.open("wb") as stored, gzip.GzipFile("", "wb", 3, stored, mtime=0) as file:
        for line in reduced_lines(map(json.loads, lines), tells):
            file.write(json.dumps(line, separators=(",", ":")).encode() + b"\n")


def reduced_lines(lines: Iterable[dict[str, Any]], tells: Tells) -> Iterator[dict[str, Any]]:
    """The lines of a log without what is not told, and without the reports that are not sent."""
    due_s: dict[str, float] = {}
    for line in lines:
        message = line["message"]
        if "location" not in message:
            yield line
        elif _is_due(message, tells.every_s, due_s):
            yield line | {"message": reduced(message, tells)}


def reduced(message: Message, tells: Tells) -> Message:
    """A status report without what is not told."""
    path, destinations = message.get("path", []), message.get("destinations", [])
    kept = {key: value for key, value in message.items() if key not in {"path", "destinations", "velocity"}}
    if tells.state:
        kept["operationalState"] = tells.state
    if tells.velocity and "velocity" in message:
        kept["velocity"] = message["velocity"]
    if path[: tells.path_points]:
        kept["path"] = path[: tells.path_points]
    if tells.destination and not destinations and tells.invents_destination:
        destinations = path[-1:]
    if tells.destination and destinations:
        left_out = set() if tells.destination_time else {"timestamp"}
        kept["destinations"] = [{key: point[key] for key in point if key not in left_out} for point in destinations]
    return kept


def _is_due(message: Message, every_s: float | None, due_s: dict[str, float]) -> bool:
    """Whether a robot sends this report. Each robot has its own phase."""
    if every_s is None:
        return True
    robot, t_s = message["uuid"], datetime.fromisoformat(message["timestamp"]).timestamp()
    if robot not in due_s:
        due_s[robot] = t_s + every_s * (crc32(robot.encode()) % 1000) / 1000
    if t_s < due_s[robot] - TIME_TOLERANCE_S:
        return False
    due_s[robot] += every_s
    return True
