"""The truth of a floor, and the files that keep it.

The list of stops has the form of the recordings that others made: robot, by, start, end, v0, standing_s, around. What a
list leaves out is worked out from these.
"""

import gzip
import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Self

from benchmarks.planned_floors.truth.encounters import Pair
from benchmarks.planned_floors.truth.motion import Motion

BRAKING_MPS2 = 1.0
LEAST_LOST_S = 1.0
AROUND_S = 15.0
"""Longest time to drive around another robot, if a list does not give it."""
STOPS, SILENCES, MOTION, LOG = "stops.json.gz", "silences.json", "motion.npz", "log.jsonl.gz"


@dataclass(frozen=True, slots=True)
class Stop:
    """One robot yielded to another: it braked, and may have stood, or it left its path."""

    robot: str
    by: str
    """The robot to which it yielded."""
    start_s: float
    """When braking began, seconds since the epoch."""
    end_s: float
    v0_mps: float
    """Speed when braking began."""
    standing_s: float
    same_vendor: bool
    around: bool
    """Whether it then drove around the other, where bodies may overlap."""
    around_until_s: float
    """When it was back on its path; `end_s` if it did not drive around."""
    kind: str = "stop"
    """`stop`, `slow` or `swerve`: what the robot's protective stop did."""
    lost_s: float = 0.0
    """Progress lost, seconds."""
    aside_m: float = 0.0
    """How far it left its path."""

    @property
    def pair(self) -> Pair:
        low, high = sorted((self.robot, self.by))
        return low, high

    def gives_way(self, half_width_m: float) -> bool:
        """Whether it lost at least a second, or left its path by more than half its width."""
        return self.lost_s >= LEAST_LOST_S or self.aside_m > half_width_m

    @classmethod
    def of(cls, entry: Mapping[str, Any]) -> Self:
        """The stop of one entry of a list."""
        end_s, around = float(entry["end"]), bool(entry["around"])
        v0_mps, standing_s = float(entry["v0"]), float(entry["standing_s"])
        lasted_s = end_s - float(entry["start"])
        return cls(
            robot=entry["robot"],
            by=entry["by"],
            start_s=float(entry["start"]),
            end_s=end_s,
            v0_mps=v0_mps,
            standing_s=standing_s,
            same_vendor=bool(entry["same_vendor"]),
            around=around,
            around_until_s=float(entry.get("around_until", end_s + AROUND_S if around else end_s)),
            kind=entry.get("kind", "stop"),
            lost_s=float(entry.get("lost_s", lost_s(v0_mps, lasted_s, standing_s))),
            aside_m=float(entry.get("aside_m", 0.0)),
        )

    def entry(self) -> dict[str, Any]:
        """The stop as an entry of a list."""
        return {
            "robot": self.robot,
            "by": self.by,
            "start": round(self.start_s, 1),
            "end": round(self.end_s, 1),
            "v0": round(self.v0_mps, 3),
            "standing_s": round(self.standing_s, 1),
            "same_vendor": self.same_vendor,
            "around": self.around,
            "around_until": round(self.around_until_s, 1),
            "kind": self.kind,
            "lost_s": round(self.lost_s, 2),
            "aside_m": round(self.aside_m, 2),
        }


def lost_s(v0_mps: float, lasted_s: float, standing_s: float) -> float:
    """Progress lost by a robot that brakes from `v0_mps`, stands, and accelerates again at the same rate."""
    if v0_mps <= 0:
        return standing_s
    slowed_mps = v0_mps if standing_s > 0 else min(v0_mps, BRAKING_MPS2 * lasted_s)
    return standing_s + slowed_mps**2 / (BRAKING_MPS2 * v0_mps)


@dataclass(frozen=True, slots=True)
class Silence:
    """A time in which a robot sent nothing."""

    robot: str
    start_s: float
    end_s: float
    """When it reports again, or the end of the log."""
    gone_s: float | None
    """When it was carried away. None if it was there all the time."""
    x_m: float
    """Its last position, or that before it was carried away."""
    y_m: float


@dataclass(frozen=True, slots=True, eq=False)
class FloorTruth:
    """The truth of one log."""

    motion: Motion
    stops: list[Stop]
    silences: list[Silence]

    def save(self, directory: Path) -> None:
        with gzip.GzipFile(directory / STOPS, "wb", mtime=0) as file:
            file.write(json.dumps([stop.entry() for stop in self.stops]).encode())
        (directory / SILENCES).write_text(json.dumps([asdict(silence) for silence in self.silences], indent=1) + "\n")
        self.motion.save(directory / MOTION)


def load(path: Path, reported: Motion) -> FloorTruth:
    """The truth in a directory. For a list of stops alone, the true positions are the `reported` ones."""
    if not path.is_dir():
        return FloorTruth(reported, stops_of(path), [])
    silences = [Silence(**entry) for entry in json.loads((path / SILENCES).read_text())]
    return FloorTruth(Motion.load(path / MOTION), stops_of(path / STOPS), silences)


def stops_of(path: Path) -> list[Stop]:
    """The stops of a list, by start."""
    raw = path.read_bytes()
    entries = json.loads(gzip.decompress(raw) if path.suffix == ".gz" else raw)
    return sorted(map(Stop.of, entries), key=lambda stop: (stop.start_s, stop.robot))
