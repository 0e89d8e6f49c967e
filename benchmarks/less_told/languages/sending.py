"""What the languages share: when robots report, what they know of their way, and the messages as they arrive."""

import json
from collections.abc import Iterator
from typing import Any, NamedTuple
from zlib import crc32

import numpy as np

from benchmarks.less_told.scenes import SECONDS, Robot
from benchmarks.planned_floors.logs.messages import DATUM, LATENCY_S, START_S
from ingest.port.connection import Connection
from ingest.recording.log_reader import Received

MAP_ID = DATUM
AHEAD_S = np.arange(1.0, 11.0)
"""The seconds ahead of the points of a path."""
KNOWN_S = 3.0
"""So long before it sets out, a robot knows its way."""
Point = tuple[float, float, float, float, float]
"""Seconds ahead, the time of the report, x, y, yaw."""


class Sent(NamedTuple):
    """A message as it arrives."""

    arrival_s: float
    """Seconds since the epoch."""
    message: Received


def sent(robot: Robot, t_s: float, language: str, topic: str, body: dict[str, Any]) -> Sent:
    """A message that a robot makes at a time since the start. Each arrives a little later."""
    raw = json.dumps(body, separators=(",", ":")).encode()
    least_s, most_s = LATENCY_S
    arrival_s = START_S + t_s + least_s + (most_s - least_s) * (crc32(f"{robot.name} {t_s:.3f}".encode()) % 997) / 997
    connection = Connection(0, "floor", vendor=robot.vendor, language=language, topic=topic, proven=True)
    return Sent(arrival_s, Received(raw, arrival_s, connection))


def report_times(robot: Robot) -> Iterator[float]:
    """When a robot reports, seconds since the start."""
    for second in range(int(SECONDS)):
        yield second + robot.phase_s


def is_under_way(robot: Robot, t_s: float) -> bool:
    """Whether a robot drives, or is about to."""
    return robot.drive.begins_s - KNOWN_S <= t_s < robot.drive.ends_s


def path_of(robot: Robot, t_s: float) -> list[Point]:
    """Where a robot means to be in each of the next ten seconds. At the end of its way it stands."""
    poses = robot.drive.hurried(t_s, AHEAD_S, robot.hurry).tolist()
    return [(after_s, t_s, *pose) for after_s, pose in zip(AHEAD_S.tolist(), poses, strict=True)]
