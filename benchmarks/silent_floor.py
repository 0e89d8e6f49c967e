"""A synthetic floor on which robots become silent for two reasons: they left by an exit, or their radio failed.

Each lane leads from the west to an exit. Robots drive along the lanes one after another. They report their paths once a
second, until they have left. Beside the lanes other robots are parked; some are so near that passing robots come within
0.15 m. The radios of parked robots fail for 10 to 60 s, and those of some driving robots for 10 to 20 s. One robot
breaks down on its lane permanently. The robots behind it drive around it at the same distance.
"""

import json
from collections.abc import Iterator
from dataclasses import dataclass, field
from math import exp
from typing import Any
from uuid import NAMESPACE_DNS, uuid5

import numpy as np
from numpy.random import Generator

from ingest.languages.timestamps import write

START_S = 1_790_000_000.0
HALL = "0d6f4f0e-9d0c-4a6f-8a55-0c9f5f4a1b01"
LENGTH_M, WIDTH_M = 1.0, 0.6
LANES, LANE_M, EXIT_M = 8, 4.0, 40.0
PASSES_M = WIDTH_M + 0.15
"""Distance from the middle of a lane to a robot that robots in the lane nearly touch."""
SPEED_MPS = 1.0
EVERY_S = 14.0
"""Mean time between robots of one lane. The least time is half of it."""
PATH_S = 10
BROKEN_LANE, BROKEN_M = 2, 22.0
GRACE_S = 5.0

Span = tuple[float, float]
"""Begin and end, seconds since the start."""


@dataclass(slots=True, eq=False)
class Robot:
    """One robot: parked, or on a lane from `begins_s` on."""

    name: str
    vendor: str
    lane: int
    x_m: float
    y_m: float
    phase_s: float
    begins_s: float = 0.0
    drives: bool = True
    breaks_s: float = np.inf
    """When it breaks down."""
    around_s: float = np.inf
    """From when it drives around the robot that broke down."""
    silent: list[Span] = field(default_factory=list)

    @property
    def uuid(self) -> str:
        return str(uuid5(NAMESPACE_DNS, self.name))

    @property
    def ends_s(self) -> float:
        """When it has left through its exit."""
        return self.begins_s + EXIT_M / SPEED_MPS if self.drives and self.breaks_s == np.inf else np.inf

    def at(self, t_s: float) -> tuple[float, float]:
        """Its position."""
        if not self.drives:
            return self.x_m, self.y_m
        x_m = self.x_m + SPEED_MPS * (min(t_s, self.breaks_s) - self.begins_s)
        aside_m = PASSES_M * exp(-(((x_m - BROKEN_M) / 2.0) ** 4)) if self.around_s < np.inf else 0.0
        return x_m, self.y_m + aside_m

    def is_silent(self, t_s: float) -> bool:
        return t_s >= min(self.ends_s, self.breaks_s + 1.0) or any(begin <= t_s < end for begin, end in self.silent)


@dataclass(frozen=True, slots=True)
class Meeting:
    """A robot that comes within the clearance of a silent robot that stands there."""

    silent: str
    other: str
    at_s: float


class SilentFloor:
    """The floor of one seed, for `seconds`."""

    def __init__(self, seed: int, seconds: float) -> None:
        self.seconds = seconds
        rng = np.random.default_rng(seed)
        self.robots = [*_parked(rng, seconds), *_driving(rng, seconds)]

    def log(self, *, muted: bool = True) -> Iterator[str]:
        """The lines of the log, by arrival. If not `muted`, silent robots report too."""
        lines = []
        for robot in self.robots:
            lines.append((robot.begins_s, _identity(robot)))
            t_s = robot.begins_s + robot.phase_s
            while t_s < min(self.seconds, robot.ends_s):
                if not (muted and robot.is_silent(t_s)):
                    lines.append((t_s + 0.1, _status(robot, t_s)))
                t_s += 1.0
        for arrival_s, message in sorted(lines, key=lambda line: line[0]):
            yield json.dumps({"received": write(START_S + arrival_s), "message": message}) + "\n"

    def meetings(self) -> list[Meeting]:
        """The encounters with silent robots after the grace period, in order."""
        found = []
        for robot in self.robots:
            standing = [(robot.breaks_s + 1.0, self.seconds)] if robot.breaks_s < np.inf else robot.silent
            for begin_s, end_s in () if robot.drives and robot.breaks_s == np.inf else standing:
                for other in self.robots:
                    if other.lane == robot.lane and other.drives and other is not robot:
                        at_s = _passes_s(robot, other)
                        if at_s is not None and begin_s + GRACE_S < at_s < end_s and not other.is_silent(at_s):
                            found.append(Meeting(robot.uuid, other.uuid, START_S + at_s))
        return sorted(found, key=lambda meeting: meeting.at_s)

    def gone_s(self) -> dict[str, list[Span]]:
        """By robot, the time from when it counts as gone: the grace period after it left."""
        return {
            robot.uuid: [(START_S + robot.ends_s + GRACE_S, np.inf)]
            for robot in self.robots
            if robot.ends_s < self.seconds
        }


def _parked(rng: Generator, seconds: float) -> Iterator[Robot]:
    for lane in range(LANES):
        for place in range(3):
            away_m = PASSES_M if rng.random() < 0.5 else PASSES_M + 1.0
            at_m = 8.0 + 10.0 * place + rng.uniform(-2, 2), LANE_M * lane - away_m
            robot = Robot(f"parked {lane} {place}", _vendor(rng), lane, *at_m, rng.uniform(0, 1), drives=False)
            t_s = rng.uniform(10, 120)
            while t_s < seconds:
                end_s = t_s + rng.uniform(10, 60)
                robot.silent.append((t_s, end_s))
                t_s = end_s + rng.uniform(20, 120)
            yield robot


def _driving(rng: Generator, seconds: float) -> Iterator[Robot]:
    for lane in range(LANES):
        begins_s, broken, number = rng.uniform(0, EVERY_S), False, 0
        while begins_s < seconds:
            robot = Robot(
                f"driving {lane} {number}", _vendor(rng), lane, 0.0, LANE_M * lane, rng.uniform(0, 1), begins_s
            )
            if lane == BROKEN_LANE and broken:
                robot.around_s = begins_s
            elif lane == BROKEN_LANE and begins_s > seconds / 2:
                robot.breaks_s, broken = begins_s + BROKEN_M / SPEED_MPS, True
            elif lane > LANES // 2 and rng.random() < 0.3:
                drops_s = begins_s + rng.uniform(8, 22)
                robot.silent.append((drops_s, drops_s + rng.uniform(10, 20)))
            yield robot
            begins_s, number = begins_s + EVERY_S / 2 + rng.exponential(EVERY_S / 2), number + 1


def _vendor(rng: Generator) -> str:
    return str(rng.choice(["Alder", "Corvid"]))


def _passes_s(robot: Robot, other: Robot) -> float | None:
    """When a robot on a lane first comes within 0.3 m of a standing robot. None if it does not."""
    for t_s in np.arange(other.begins_s, other.begins_s + EXIT_M / SPEED_MPS, 0.1):
        (x_m, y_m), (other_x_m, other_y_m) = robot.at(t_s), other.at(t_s)
        beside_m = max(abs(other_x_m - x_m) - LENGTH_M, 0.0), max(abs(other_y_m - y_m) - WIDTH_M, 0.0)
        if t_s > robot.begins_s and np.hypot(*beside_m) < 0.3:
            return float(t_s)
    return None


def _identity(robot: Robot) -> dict[str, Any]:
    return {
        "uuid": robot.uuid,
        "timestamp": write(START_S + robot.begins_s),
        "manufacturerName": robot.vendor,
        "robotModel": "cart",
        "robotSerialNumber": robot.name,
        "baseRobotEnvelope": {"x": LENGTH_M, "y": WIDTH_M, "z": 0.4},
    }


def _status(robot: Robot, t_s: float) -> dict[str, Any]:
    x_m, y_m = robot.at(t_s)
    angle = {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}
    drives = robot.drives and t_s < robot.breaks_s
    report: dict[str, Any] = {
        "uuid": robot.uuid,
        "timestamp": write(START_S + t_s),
        "operationalState": "navigating" if robot.drives else "idle",
        "location": {"x": round(x_m, 3), "y": round(y_m, 3), "angle": angle, "planarDatum": HALL},
        "velocity": {"linear": SPEED_MPS if drives else 0.0, "angular": angle},
    }
    if drives:
        report["path"] = [
            {
                "timestamp": write(START_S + t_s + second),
                "x": round(min(x_m + SPEED_MPS * second, EXIT_M), 3),
                "y": round(y_m, 3),
                "angle": angle,
            }
            for second in range(1, PATH_S + 1)
            if x_m + SPEED_MPS * (second - 1) < EXIT_M
        ]
    return report
