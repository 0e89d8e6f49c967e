"""A made-up floor on which robots fall silent for two reasons: they have left by an exit, or their radio drops out.

Lanes lead from the west to an exit each. Robots drive along them one after the other, tell their paths once a second,
and say nothing any more once they are through. Beside the lanes others are parked, so near that who passes comes within
0.15 m of some of them. Their radios drop out for 10 to 60 s, and those of some that drive for 10 to 20 s. One robot
breaks down on its lane, for good; those behind it drive around it, as near.
"""

import json
from collections.abc import Iterator
from dataclasses import dataclass, field
from math import exp
from typing import Any
from uuid import NAMESPACE_DNS, uuid5

import numpy as np
from numpy.random import Generator

from ingest.languages.massrobotics.timestamps import write

START_S = 1_790_000_000.0
HALL = "0d6f4f0e-9d0c-4a6f-8a55-0c9f5f4a1b01"
LENGTH_M, WIDTH_M = 1.0, 0.6
LANES, LANE_M, EXIT_M = 8, 4.0, 40.0
PASSES_M = WIDTH_M + 0.15
"""From the middle of a lane to that of a robot that those in the lane nearly touch."""
SPEED_MPS = 1.0
EVERY_S = 14.0
"""Between robots of one lane, on the mean; at least half of it."""
PATH_S = 10
BROKEN_LANE, BROKEN_M = 2, 22.0
GRACE_S = 5.0

Span = tuple[float, float]
"""From when to when, seconds since the beginning."""


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
    """From when on it drives around the one that has."""
    silent: list[Span] = field(default_factory=list)

    @property
    def uuid(self) -> str:
        return str(uuid5(NAMESPACE_DNS, self.name))

    @property
    def ends_s(self) -> float:
        """When it is through its exit."""
        return self.begins_s + EXIT_M / SPEED_MPS if self.drives and self.breaks_s == np.inf else np.inf

    def at(self, t_s: float) -> tuple[float, float]:
        """Where it is."""
        if not self.drives:
            return self.x_m, self.y_m
        x_m = self.x_m + SPEED_MPS * (min(t_s, self.breaks_s) - self.begins_s)
        aside_m = PASSES_M * exp(-(((x_m - BROKEN_M) / 2.0) ** 4)) if self.around_s < np.inf else 0.0
        return x_m, self.y_m + aside_m

    def is_silent(self, t_s: float) -> bool:
        return t_s >= min(self.ends_s, self.breaks_s + 1.0) or any(begin <= t_s < end for begin, end in self.silent)


@dataclass(frozen=True, slots=True)
class Meeting:
    """A robot that comes within the clearance of one that is silent, stands, and is there."""

    silent: str
    other: str
    at_s: float


class SilentFloor:
    """The floor of one seed, for so long."""

    def __init__(self, seed: int, seconds: float) -> None:
        self.seconds = seconds
        rng = np.random.default_rng(seed)
        self.robots = [*_parked(rng, seconds), *_driving(rng, seconds)]

    def log(self, *, muted: bool = True) -> Iterator[str]:
        """The lines of what is heard, by arrival; with all that was not, where not `muted`."""
        lines = []
        for robot in self.robots:
            lines.append((robot.begins_s, _identity(robot)))
            t_s = robot.begins_s + robot.phase_s
            while t_s < min(self.seconds, robot.ends_s):
                if not (muted and robot.is_silent(t_s)):
                    lines.append((t_s + 0.1, _status(robot, t_s)))
                t_s += 1.0
        for arrival_s, message in sorted(lines, key=lambda one: one[0]):
            yield json.dumps({"received": write(START_S + arrival_s), "message": message}) + "\n"

    def meetings(self) -> list[Meeting]:
        """Those after the grace, in order."""
        found = []
        for one in self.robots:
            standing = [(one.breaks_s + 1.0, self.seconds)] if one.breaks_s < np.inf else one.silent
            for begin_s, end_s in () if one.drives and one.breaks_s == np.inf else standing:
                for other in self.robots:
                    if other.lane == one.lane and other.drives and other is not one:
                        at_s = _passes_s(one, other)
                        if at_s is not None and begin_s + GRACE_S < at_s < end_s and not other.is_silent(at_s):
                            found.append(Meeting(one.uuid, other.uuid, START_S + at_s))
        return sorted(found, key=lambda one: one.at_s)

    def gone_s(self) -> dict[str, list[Span]]:
        """By robot, when it has been gone for the grace: it is through its exit."""
        return {
            one.uuid: [(START_S + one.ends_s + GRACE_S, np.inf)] for one in self.robots if one.ends_s < self.seconds
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


def _passes_s(one: Robot, other: Robot) -> float | None:
    """When a robot on a lane first comes within 0.3 m of one that stands; None where it does not."""
    for t_s in np.arange(other.begins_s, other.begins_s + EXIT_M / SPEED_MPS, 0.1):
        (x_m, y_m), (other_x_m, other_y_m) = one.at(t_s), other.at(t_s)
        beside_m = max(abs(other_x_m - x_m) - LENGTH_M, 0.0), max(abs(other_y_m - y_m) - WIDTH_M, 0.0)
        if t_s > one.begins_s and np.hypot(*beside_m) < 0.3:
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
    told: dict[str, Any] = {
        "uuid": robot.uuid,
        "timestamp": write(START_S + t_s),
        "operationalState": "navigating" if robot.drives else "idle",
        "location": {"x": round(x_m, 3), "y": round(y_m, 3), "angle": angle, "planarDatum": HALL},
        "velocity": {"linear": SPEED_MPS if drives else 0.0, "angular": angle},
    }
    if drives:
        told["path"] = [
            {
                "timestamp": write(START_S + t_s + second),
                "x": round(min(x_m + SPEED_MPS * second, EXIT_M), 3),
                "y": round(y_m, 3),
                "angle": angle,
            }
            for second in range(1, PATH_S + 1)
            if x_m + SPEED_MPS * (second - 1) < EXIT_M
        ]
    return told
