"""The figures of one floor: its passes beside those of honest robots, and its warnings with and without the others."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from statistics import median
from typing import Any

import numpy as np

from benchmarks.drawn_floors.driving import Drive, drive
from benchmarks.drawn_floors.figures import MOST_MORE_S
from benchmarks.drawn_floors.floor import Floor, honest_floor
from benchmarks.drawn_floors.judging import compared
from benchmarks.drawn_floors.motion import Robot, sent_by
from deconflict.runtime.learned_state import Part
from ingest.batch import Floats

SWEEP_WORK = "swept_pairs", "box_pairs", "segment_pairs", "advanced_pairs", "fcl_calls"
PASSES = 20
"""As many in a row make a figure."""


def windowed(values: Floats) -> float:
    """The greatest median of `PASSES` in a row."""
    width = min(PASSES, len(values))
    return float(np.median(np.lib.stride_tricks.sliding_window_view(values, width), axis=1).max())


@dataclass(frozen=True, slots=True)
class Terms:
    """For how many simulated seconds each floor is driven, with how many passes in each, and what is learned before."""

    seconds: float
    passes: int
    learned: dict[str, Part] = field(default_factory=dict)

    def drive(self, robots: Sequence[Robot]) -> Drive:
        return drive(robots, sent_by(robots, self.seconds), self.seconds, self.passes, self.learned)


def reference(robots: int, seed: int, terms: Terms) -> dict[str, float]:
    """The median pass of honest robots."""
    alone = terms.drive(honest_floor(robots, terms.seconds, seed))
    settled = len(alone.work) // 4
    return {name: median(alone.column(name)[settled:].tolist()) for name in ("pass_s", "pairs", "box_pairs")}


def measured(floor: Floor, terms: Terms, usual: dict[str, float]) -> dict[str, Any]:
    """The figures of one floor, as they are in the JSON file."""
    alone, beside = terms.drive(floor.honest), terms.drive((*floor.honest, *floor.others))
    verdict = None if beside.failed else compared(floor, alone, beside, terms.seconds)
    pass_s, pairs = windowed(beside.column("pass_s")), windowed(beside.column("pairs"))
    return {
        "floor": floor.number,
        "kinds": floor.kinds,
        "place": floor.place,
        "makers": floor.makers,
        "sources": floor.sources,
        "honest": len(floor.honest),
        "others": len(floor.others),
        "failed": beside.failed,
        "pass_ms": round(pass_s * 1e3, 2),
        "worst_pass_ms": round(beside.column("pass_s").max() * 1e3, 1),
        "worst_alone_ms": round(alone.column("pass_s").max() * 1e3, 1),
        "usual_pass_ms": round(usual["pass_s"] * 1e3, 2),
        "pass_ratio": round(max(pass_s - MOST_MORE_S, 0.0) / usual["pass_s"], 2),
        "pairs": round(pairs),
        "worst_pairs": round(beside.column("pairs").max()),
        "usual_pairs": round(usual["pairs"]),
        "pairs_ratio": round(pairs / usual["pairs"], 2),
        "boxes_ratio": round(windowed(beside.column("box_pairs")) / usual["box_pairs"], 2),
        "work": {name: _most(beside, name) for name in SWEEP_WORK},
        "foreseen_pairs": _most(beside, "foreseen_pairs"),
        "open_conflicts": _most(beside, "open_conflicts"),
        "not_examined": beside.not_examined,
        "warnings": None if verdict is None else asdict(verdict) | {"differ": verdict.differ},
    }


def _most(driven: Drive, name: str) -> int:
    return int(driven.column(name).max())
