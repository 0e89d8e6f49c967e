"""Encounters of the true motion: maximal runs of one pair whose envelopes are within the clearance."""

from dataclasses import dataclass

import numpy as np

from benchmarks.planned_floors.truth.motion import STEP_S, Motion, Near, near
from ingest.batch import Ints

BRIDGED_SAMPLES = 11
"""Two runs are one encounter if their samples are at most this far apart: a gap of 1 s."""
DRAWN_APART_M = 0.1
"""Two runs are one encounter if the distance between them stays within the clearance plus this."""
FORESEEABLE_S = 2.0
"""Both robots must have been there for this long before a foreseeable encounter."""

Pair = tuple[str, str]
"""UUIDs, the lower first."""


@dataclass(frozen=True, slots=True)
class Encounter:
    """One encounter of a pair."""

    pair: Pair
    start_s: float
    end_s: float
    foreseeable: bool


def encounters(motion: Motion, clearance_m: float) -> list[Encounter]:
    """All encounters of a motion, by start."""
    found = near(motion, clearance_m + DRAWN_APART_M)
    together = _run_of(found)
    rows = np.flatnonzero(found.separation_m < clearance_m if clearance_m else found.separation_m <= 0)
    spans: list[tuple[Pair, int, int, int]] = []
    for row in rows.tolist():
        pair, sample = _pair(motion, int(found.a[row]), int(found.b[row])), int(found.sample[row])
        if spans:
            last_pair, first, last, run = spans[-1]
            if pair == last_pair and (sample - last <= BRIDGED_SAMPLES or together[row] == run):
                spans[-1] = (pair, first, sample, int(together[row]))
                continue
        spans.append((pair, sample, sample, int(together[row])))
    since = _present_since(motion)
    column = {robot: index for index, robot in enumerate(motion.robots)}
    made = []
    for pair, first, last, _ in spans:
        there = max(int(since[first, column[robot]]) for robot in pair)
        start_s, end_s = (motion.start_s + sample * STEP_S for sample in (first, last))
        made.append(Encounter(pair, start_s, end_s, (first - there) * STEP_S >= FORESEEABLE_S))
    return sorted(made, key=lambda encounter: (encounter.start_s, encounter.pair))


def _pair(motion: Motion, a: int, b: int) -> Pair:
    low, high = sorted((motion.robots[a], motion.robots[b]))
    return low, high


def _run_of(found: Near) -> Ints:
    """(m,) the run of consecutive samples to which each row belongs."""
    new = np.ones(len(found.a), bool)
    new[1:] = (np.diff(found.a) != 0) | (np.diff(found.b) != 0) | (np.diff(found.sample) != 1)
    return np.cumsum(new)


def _present_since(motion: Motion) -> Ints:
    """(s, n) the sample since which each robot has been there without a break."""
    gone = np.isnan(motion.x_m)
    samples = np.arange(1, len(gone) + 1)[:, None]
    return np.maximum.accumulate(np.where(gone, samples, 0), axis=0)
