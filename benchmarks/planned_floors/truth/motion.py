"""The true motion: poses of all robots at 10 Hz, and the distances of their envelopes."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Self

import numpy as np
from numpy.typing import NDArray

from deconflict.sweep.geometry.envelope_distances import signed_gap
from ingest.batch import Floats, Ints

Bools = NDArray[np.bool_]

STEP_S = 0.1
CHUNK = 600
"""Samples whose pairs are processed together. Bounds the memory."""


@dataclass(frozen=True, slots=True, eq=False)
class Motion:
    """Poses of n robots at s samples, `STEP_S` apart; nan while a robot is absent."""

    start_s: float
    """Time of the first sample, seconds since the epoch."""
    robots: tuple[str, ...]
    x_m: Floats
    """(s, n) envelope centre."""
    y_m: Floats
    """(s, n)"""
    yaw_rad: Floats
    """(s, n)"""
    half_m: Floats
    """(2, n) half length and half width."""

    @property
    def end_s(self) -> float:
        return self.start_s + (len(self.x_m) - 1) * STEP_S

    def sample(self, t_s: float) -> int:
        """The sample nearest to a time."""
        return min(max(round((t_s - self.start_s) / STEP_S), 0), len(self.x_m) - 1)

    def present_s(self) -> float:
        """Total presence of all robots."""
        return float(np.count_nonzero(~np.isnan(self.x_m))) * STEP_S

    def save(self, path: Path) -> None:
        np.savez_compressed(
            path,
            start_s=np.float64(self.start_s),
            robots=np.array(self.robots),
            x_m=self.x_m.astype(np.float32),
            y_m=self.y_m.astype(np.float32),
            yaw_rad=self.yaw_rad.astype(np.float32),
            half_m=self.half_m,
        )

    @classmethod
    def load(cls, path: Path) -> Self:
        with np.load(path) as kept:
            x_m, y_m, yaw_rad = (kept[name].astype(np.float64) for name in ("x_m", "y_m", "yaw_rad"))
            return cls(float(kept["start_s"]), tuple(kept["robots"].tolist()), x_m, y_m, yaw_rad, kept["half_m"])


@dataclass(frozen=True, slots=True, eq=False)
class Near:
    """Pairs of robots that are near at a sample, ascending by pair and sample. Arrays are (m,)."""

    a: Ints
    """The lower index of the two robots."""
    b: Ints
    sample: Ints
    separation_m: Floats
    """Distance of the envelopes; negative if they overlap."""


def near(motion: Motion, within_m: float) -> Near:
    """All pairs at all samples at which their envelopes are at most `within_m` apart."""
    parts = list(_near_parts(motion, within_m))
    a, b, sample = (np.concatenate([part[k] for part in parts]).astype(np.int64) for k in range(3))
    separation_m = np.concatenate([part[3] for part in parts])
    order = np.lexsort((sample, b, a))
    return Near(a[order], b[order], sample[order], separation_m[order])


def _near_parts(motion: Motion, within_m: float) -> Iterator[tuple[Ints, Ints, Ints, Floats]]:
    rows, columns = np.triu_indices(len(motion.robots), 1)
    radius_m = np.hypot(*motion.half_m)
    reach_m = radius_m[rows] + radius_m[columns] + within_m
    for first in range(0, len(motion.x_m), CHUNK):
        x_m, y_m = motion.x_m[first : first + CHUNK], motion.y_m[first : first + CHUNK]
        candidates = _candidates(x_m, y_m, rows, columns, reach_m)
        a, b, reach = rows[candidates], columns[candidates], reach_m[candidates]
        at, pair = np.nonzero(np.hypot(x_m[:, a] - x_m[:, b], y_m[:, a] - y_m[:, b]) <= reach)
        a, b = a[pair], b[pair]
        separation_m = _separation(motion, a, b, first + at)
        close = separation_m <= within_m
        yield a[close], b[close], (first + at)[close], separation_m[close]


def _candidates(x_m: Floats, y_m: Floats, rows: Ints, columns: Ints, reach_m: Floats) -> Ints:
    """Pairs whose bounding boxes over a range of samples are near enough."""
    present: Bools = np.any(~np.isnan(x_m), axis=0)
    apart = np.zeros(len(rows), bool)
    for values in (x_m, y_m):
        low = np.min(values, axis=0, initial=np.inf, where=~np.isnan(values))
        high = np.max(values, axis=0, initial=-np.inf, where=~np.isnan(values))
        apart |= (low[rows] - high[columns] > reach_m) | (low[columns] - high[rows] > reach_m)
    return np.flatnonzero(~apart & present[rows] & present[columns])


def _separation(motion: Motion, a: Ints, b: Ints, sample: Ints) -> Floats:
    dx_m = motion.x_m[sample, b] - motion.x_m[sample, a]
    dy_m = motion.y_m[sample, b] - motion.y_m[sample, a]
    yaw_a, yaw_b = motion.yaw_rad[sample, a], motion.yaw_rad[sample, b]
    columns = (dx_m[:, None], dy_m[:, None], yaw_a[:, None], yaw_b[:, None])
    return signed_gap(*columns, motion.half_m[:, a], motion.half_m[:, b])[:, 0]
