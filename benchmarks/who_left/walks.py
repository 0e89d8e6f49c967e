"""The true motion of robots and people on a scene, what they report, and whom they meet."""

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from math import atan2, cos, hypot, inf, sin
from typing import Any
from uuid import NAMESPACE_DNS, uuid5

import numpy as np
from numpy.random import Generator

from benchmarks.silent_floor import Meeting
from ingest.batch import Bools, Floats
from ingest.languages.timestamps import write

START_S = 1_790_000_000.0
STEP_S = 0.1
SIDE_M = 0.5
"""Side of each envelope, a square."""
CLEARANCE_M = 0.3
PASSES_M = 0.65
"""Between the centres of a body that stands and one that goes around it."""
SILENT_S = 5.0
SWERVES_M = 1.5
"""So far before and behind a body one swerves."""
PATH_S = 10

Span = tuple[float, float]
Point = tuple[float, float]


@dataclass(slots=True, eq=False)
class Walk:
    """One robot or person, from when it is there until it has left."""

    name: str
    begins_s: float
    at_m: Floats
    """(n, 2) its places, `STEP_S` apart."""
    tells_goal: bool
    """Whether its path is its own plan, which ends where it leaves. Otherwise its path goes straight on."""
    stays: bool = False
    """Whether it is still there at its last place when the log ends."""
    silent: list[Span] = field(default_factory=list)

    @property
    def uuid(self) -> str:
        return str(uuid5(NAMESPACE_DNS, self.name))

    @property
    def vendor(self) -> str:
        return ("Alder", "Birch", "Corvid")[int(self.uuid[:4], 16) % 3]

    @property
    def ends_s(self) -> float:
        return inf if self.stays else self.begins_s + (len(self.at_m) - 1) * STEP_S

    def is_silent(self, t_s: float) -> bool:
        return any(begin_s <= t_s < end_s for begin_s, end_s in self.silent)

    def at(self, t_s: float) -> Point:
        row = min(max(round((t_s - self.begins_s) / STEP_S), 0), len(self.at_m) - 1)
        return float(self.at_m[row, 0]), float(self.at_m[row, 1])


def walked(points: Sequence[tuple[Point, float]], mps: float, around: Sequence[Point] = ()) -> Floats:
    """(n, 2) places along points, at each of which it waits for some seconds. It goes around bodies that stand."""
    (last, wait_s), *others = points
    places = [np.tile(last, (max(round(wait_s / STEP_S), 1), 1))]
    for point, wait_s in others:
        long_m = hypot(point[0] - last[0], point[1] - last[1])
        steps = max(round(long_m / (mps * STEP_S)), 1)
        places.append(_leg(np.array(last), np.array(point), long_m, steps, around))
        places.append(np.tile(point, (round(wait_s / STEP_S), 1)))
        last = point
    return np.concatenate(places)


def _leg(begin: Floats, end: Floats, long_m: float, steps: int, around: Sequence[Point]) -> Floats:
    """(steps, 2) places on a leg, which swerves before each body in its way."""
    along_m = long_m * np.arange(1, steps + 1) / steps
    ahead = (end - begin) / max(long_m, 1e-6)
    aside, shift_m = np.array([-ahead[1], ahead[0]]), np.zeros(steps)
    for body in around:
        body_m, aside_m = float((body - begin) @ ahead), float((body - begin) @ aside)
        if abs(aside_m) < PASSES_M and 0.0 < body_m < long_m:
            away_m = aside_m - PASSES_M if aside_m > 0.0 else aside_m + PASSES_M
            shift_m += away_m * np.exp(-(((along_m - body_m) / SWERVES_M) ** 4))
    shifted: Floats = begin + np.outer(along_m, ahead) + np.outer(shift_m, aside)
    return shifted


def meetings(walks: Sequence[Walk], seconds: float) -> Iterator[Meeting]:
    """Encounters in which one is silent for `SILENT_S`, and there, and the other one is heard."""
    rows, t_s = len(walks), np.arange(0.0, seconds, STEP_S)
    at_m = np.full((rows, len(t_s), 2), np.nan)
    silent_since_s, is_heard = np.full((rows, len(t_s)), np.inf), np.zeros((rows, len(t_s)), np.bool_)
    for row, walk in enumerate(walks):
        there = (t_s >= walk.begins_s) & (t_s < walk.ends_s)
        at_m[row, there] = [walk.at(at_s) for at_s in t_s[there]]
        is_heard[row] = there
        for begin_s, end_s in walk.silent:
            within = there & (t_s >= begin_s) & (t_s < end_s)
            silent_since_s[row, within], is_heard[row, within] = begin_s, False
    is_silent = t_s - silent_since_s > SILENT_S
    for row in np.flatnonzero(is_silent.any(axis=1)).tolist():
        gap_m = np.hypot(*np.maximum(np.abs(at_m - at_m[row]) - SIDE_M, 0.0).transpose(2, 0, 1))
        is_near = gap_m < CLEARANCE_M
        begins: Bools = is_near[:, 1:] & ~is_near[:, :-1] & is_silent[row, 1:] & is_heard[:, 1:]
        begins[row] = False
        for other, step in np.argwhere(begins).tolist():
            yield Meeting(walks[row].uuid, walks[other].uuid, START_S + float(t_s[step + 1]))


def log_of(walks: Sequence[Walk], seconds: float, rng: Generator, datum: str) -> Iterator[str]:
    """The lines of the log, by arrival: each reports once a second while it is there and not silent."""
    lines: list[tuple[float, dict[str, Any]]] = []
    for walk in walks:
        lines.append((walk.begins_s, _identity(walk)))
        times_s = np.arange(walk.begins_s + rng.uniform(0, 1), min(walk.ends_s, seconds), 1.0).tolist()
        said_s = [t_s for t_s in times_s if not walk.is_silent(t_s)]
        lines += [(t_s + rng.uniform(0.03, 0.2), _status(walk, t_s, datum)) for t_s in said_s]
    for arrival_s, message in sorted(lines, key=lambda line: line[0]):
        yield json.dumps({"received": write(START_S + arrival_s), "message": message}) + "\n"


def _identity(walk: Walk) -> dict[str, Any]:
    return {
        "uuid": walk.uuid,
        "timestamp": write(START_S + walk.begins_s),
        "manufacturerName": walk.vendor,
        "robotModel": "cart",
        "robotSerialNumber": walk.name,
        "baseRobotEnvelope": {"x": SIDE_M, "y": SIDE_M, "z": 0.4},
    }


def _status(walk: Walk, t_s: float, datum: str) -> dict[str, Any]:
    (x_m, y_m), before_m = walk.at(t_s), walk.at(t_s - 1.0)
    step_m = x_m - before_m[0], y_m - before_m[1]
    mps = hypot(*step_m)
    stands = mps < 0.05
    if walk.tells_goal:
        ahead = [walk.at(t_s + second) for second in range(1, PATH_S + 1)]
        stands = stands and hypot(ahead[-1][0] - x_m, ahead[-1][1] - y_m) < 0.05
    else:
        ahead = [(x_m + step_m[0] * second, y_m + step_m[1] * second) for second in range(1, PATH_S + 1)]
    yaw_rad = atan2(step_m[1], step_m[0]) if mps > 0.01 else 0.0
    angle = {"x": 0.0, "y": 0.0, "z": round(sin(yaw_rad / 2), 5), "w": round(cos(yaw_rad / 2), 5)}
    report: dict[str, Any] = {
        "uuid": walk.uuid,
        "timestamp": write(START_S + t_s),
        "operationalState": "idle" if stands else "navigating",
        "location": {"x": round(x_m, 3), "y": round(y_m, 3), "angle": angle, "planarDatum": datum},
        "velocity": {"linear": round(mps, 3)},
    }
    if not stands:
        report["path"] = [
            {"timestamp": write(START_S + t_s + second), "x": round(x, 3), "y": round(y, 3), "angle": angle}
            for second, (x, y) in enumerate(ahead, 1)
        ]
    return report
