"""Lines of a log with messages of the MassRobotics standard 1.0: first identities, then statuses by arrival."""

import gzip
import uuid
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import cached_property, lru_cache
from math import cos, sin
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ingest.batch import Floats

START_S = 1_790_000_000.0
"""When every floor begins, seconds since the epoch."""
LATENCY_S = (0.03, 0.2)
"""Least and greatest time from a report to its reception."""
HEIGHT_M = 0.4
DATUM = str(uuid.uuid5(uuid.NAMESPACE_URL, "planned_floors/datum"))


@dataclass(frozen=True)
class Model:
    """The identity of one simulated robot."""

    serial: str
    vendor: str
    length_m: float
    width_m: float
    top_mps: float

    @cached_property
    def uuid(self) -> str:
        return str(uuid.uuid5(uuid.NAMESPACE_URL, f"planned_floors/{self.serial}"))


class Line(NamedTuple):
    """One message with its time of reception."""

    received_s: float
    message: str


def identity(model: Model) -> Line:
    """The identity report, sent a second before the start of the floor."""
    at_s = START_S - 1
    return Line(
        at_s,
        f'{{"uuid":"{model.uuid}","timestamp":"{stamp(at_s)}","manufacturerName":"{model.vendor}",'
        f'"robotModel":"cell robot {model.length_m:g}x{model.width_m:g}","robotSerialNumber":"{model.serial}",'
        f'"baseRobotEnvelope":{{"x":{model.length_m:g},"y":{model.width_m:g},"z":{HEIGHT_M:g}}},'
        f'"maxSpeed":{model.top_mps:g}}}',
    )


def status(
    robot: str,
    t_s: float,
    latency_s: float,
    state: str,
    pose: Sequence[float],
    speed_mps: float,
    path: Floats,
    destination: tuple[float, float, float] | None = None,
) -> Line:
    """A status report. `pose` is x, y, yaw; `path` (k, 4) t_s, x, y, yaw; `destination` t_s, x, y."""
    x_m, y_m, yaw_rad = pose
    angle = _angle(yaw_rad)
    path_text = f',"path":[{",".join(_point(*point) for point in path.tolist())}]' if len(path) else ""
    destination_text = f',"destinations":[{_point(*destination, 0.0)}]' if destination else ""
    return Line(
        t_s + latency_s,
        f'{{"uuid":"{robot}","timestamp":"{stamp(t_s)}","operationalState":"{state}",'
        f'"location":{{"x":{x_m:.3f},"y":{y_m:.3f},"angle":{angle},"planarDatum":"{DATUM}"}},'
        f'"velocity":{{"linear":{speed_mps:.3f},"angular":{angle}}}{path_text}{destination_text}}}',
    )


def _point(t_s: float, x_m: float, y_m: float, yaw_rad: float) -> str:
    return f'{{"timestamp":"{stamp(t_s)}","x":{x_m:.3f},"y":{y_m:.3f},"angle":{_angle(yaw_rad)}}}'


@lru_cache(maxsize=4096)
def _angle(yaw_rad: float) -> str:
    return f'{{"x":0,"y":0,"z":{sin(yaw_rad / 2):.5f},"w":{cos(yaw_rad / 2):.5f}}}'


def stamp(t_s: float) -> str:
    """RFC 3339, to a millisecond."""
    whole_s, after_ms = divmod(round(t_s * 1000), 1000)
    return f"{_seconds(whole_s)}.{after_ms:03d}Z"


@lru_cache(maxsize=4096)
def _seconds(whole_s: int) -> str:
    return datetime.fromtimestamp(whole_s, UTC).strftime("%Y-%m-%dT%H:%M:%S")


def report_samples(rng: np.random.Generator, samples: int, step_s: float, interval_s: float) -> list[int]:
    """The samples at which one robot reports: every `interval_s`, plus or minus a tenth, with its own phase."""
    count = int(samples * step_s / (0.9 * interval_s)) + 2
    times_s = rng.uniform(0, interval_s) + np.cumsum(rng.uniform(0.9, 1.1, count) * interval_s) - interval_s
    found = np.unique(np.rint(times_s / step_s).astype(np.int64))
    return found[(found >= 0) & (found < samples)].tolist()


def latency_s(rng: np.random.Generator) -> float:
    return float(rng.uniform(*LATENCY_S))


def ahead(t_s: Floats, path_s: int) -> Floats:
    """(n, k) the whole seconds after times (n, 1) that paths of `path_s` name."""
    return np.floor(t_s + 1e-6) + 1 + np.arange(path_s, dtype=np.float64)


def write_log(path: Path, lines: Iterable[Line]) -> None:
    """All lines by time received. The same lines give the same bytes."""
    ordered = sorted(lines, key=lambda line: line.received_s)
    with path.open("wb") as stored, gzip.GzipFile("", "wb", 6, stored, mtime=0) as file:
        for line in ordered:
            file.write(f'{{"received":"{stamp(line.received_s)}","message":{line.message}}}\n'.encode())
