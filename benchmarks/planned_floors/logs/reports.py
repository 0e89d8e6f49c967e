"""Reads a log without code of the service: the robots, and what they reported when."""

import gzip
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from datetime import datetime
from math import atan2, nan
from pathlib import Path
from typing import IO, Any

import msgspec
import numpy as np

from benchmarks.planned_floors.truth.motion import STEP_S, Motion
from ingest.batch import Floats

JOINED_S = 2.1
"""Two reports further apart than this are not joined."""


class _Plane(msgspec.Struct, frozen=True):
    x: float
    y: float


class _Angle(msgspec.Struct, frozen=True):
    z: float = 0.0
    w: float = 1.0

    @property
    def yaw_rad(self) -> float:
        return 2 * atan2(self.z, self.w)


class _Velocity(msgspec.Struct, frozen=True):
    linear: float = 0.0


class _Point(msgspec.Struct, frozen=True):
    timestamp: datetime
    x: float
    y: float
    angle: _Angle = _Angle()


class _Location(msgspec.Struct, frozen=True):
    x: float
    y: float
    angle: _Angle = _Angle()


class _Message(msgspec.Struct, frozen=True, rename="camel"):
    """The needed fields of both kinds of message."""

    uuid: str
    timestamp: datetime
    manufacturer_name: str = ""
    base_robot_envelope: _Plane | None = None
    operational_state: str = ""
    location: _Location | None = None
    velocity: _Velocity | None = None
    path: tuple[_Point, ...] = ()


class _Line(msgspec.Struct, frozen=True):
    received: datetime
    message: _Message


_LINE = msgspec.json.Decoder(_Line)


@dataclass(frozen=True, slots=True, eq=False)
class Report:
    """One status report."""

    received_s: float
    t_s: float
    """When it was made."""
    x_m: float
    y_m: float
    yaw_rad: float
    speed_mps: float
    path: Floats
    """(k, 4) t_s, x_m, y_m, yaw_rad of the points that lie ahead."""


@dataclass(slots=True, eq=False)
class Robot:
    """One robot of a log."""

    uuid: str
    vendor: str
    length_m: float
    width_m: float
    reports: list[Report] = field(default_factory=list)
    """By time received."""

    def usual_interval_s(self) -> float:
        """The median interval between its reports; nan if it sent fewer than two."""
        times_s = [report.t_s for report in self.reports]
        return float(np.median(np.diff(times_s))) if len(times_s) > 1 else nan

    def silence_limit_s(self) -> float:
        """After this time without a report it is silent: 5 s or three usual intervals; 30 s if these are unknown."""
        interval_s = self.usual_interval_s()
        return 30.0 if np.isnan(interval_s) else max(5.0, 3 * interval_s)


def robots_in_file(path: Path) -> list[Robot]:
    """The robots of a log that have reported, by identity."""
    opened: Any = gzip.open if path.suffix == ".gz" else open
    with opened(path, "rb") as lines:
        return robots_of_lines(lines)


def robots_of_lines(lines: Iterable[bytes] | IO[bytes]) -> list[Robot]:
    robots: dict[str, Robot] = {}
    for line in _parsed(lines):
        message, envelope = line.message, line.message.base_robot_envelope
        if envelope is not None:
            robots[message.uuid] = Robot(message.uuid, message.manufacturer_name, envelope.x, envelope.y)
        elif message.location is not None:
            robots[message.uuid].reports.append(_report(line, message.location))
    return [robots[uuid] for uuid in sorted(robots) if robots[uuid].reports]


def _parsed(lines: Iterable[bytes]) -> Iterator[_Line]:
    return (_LINE.decode(line) for line in lines)


def _report(line: _Line, location: _Location) -> Report:
    message, t_s = line.message, line.message.timestamp.timestamp()
    points = [(point.timestamp.timestamp(), point.x, point.y, point.angle.yaw_rad) for point in message.path]
    path = np.array([point for point in points if point[0] > t_s], np.float64).reshape(-1, 4)
    speed_mps = message.velocity.linear if message.velocity else 0.0
    return Report(line.received.timestamp(), t_s, location.x, location.y, location.angle.yaw_rad, speed_mps, path)


def reported_motion(robots: list[Robot]) -> Motion:
    """The reported motion: linear between two reports that are at most `JOINED_S` apart."""
    first_s = min(robot.reports[0].t_s for robot in robots)
    last_s = max(robot.reports[-1].t_s for robot in robots)
    t_s: Floats = first_s + np.arange(round((last_s - first_s) / STEP_S) + 1, dtype=np.float64) * STEP_S
    poses = [_joined(robot.reports, t_s) for robot in robots]
    x_m, y_m, yaw_rad = (np.stack([pose[k] for pose in poses], axis=1) for k in range(3))
    half_m = np.array([[robot.length_m / 2 for robot in robots], [robot.width_m / 2 for robot in robots]])
    return Motion(first_s, tuple(robot.uuid for robot in robots), x_m, y_m, yaw_rad, half_m)


def _joined(reports: list[Report], t_s: Floats) -> Floats:
    """(3, s) x, y, yaw at `t_s` (s,); nan between two reports that are too far apart."""
    by_time = sorted(reports, key=lambda report: report.t_s)
    reported_s = np.array([report.t_s for report in by_time])
    yaw_rad = np.unwrap([report.yaw_rad for report in by_time])
    columns = ([report.x_m for report in by_time], [report.y_m for report in by_time], yaw_rad)
    pose = np.stack([np.interp(t_s, reported_s, column, left=nan, right=nan) for column in columns])
    after = np.clip(np.searchsorted(reported_s, t_s), 1, len(reported_s) - 1)
    pose[:, reported_s[after] - reported_s[after - 1] > JOINED_S] = nan
    return pose
