"""Draws floors and drives each with and without its other robots: `python -m benchmarks.drawn_floors [--floors 200]`.

Every floor has `--robots` robots, a fifth to a half of them honest, at one per 25 m2, crossing each other's way. The
others are of one to three kinds (`benchmarks/drawn_floors/others.py`): large bodies, heaps, crowds that fall silent,
very fast, converging, jumping and more, of one or many makers and addresses. The fleet and the engine of the service
get the messages of each floor in simulated time, once of the honest robots alone and once of all.

The figures of a pass are the greatest median of 20 passes in a row, compared with the median pass of as many honest
robots at one per 25 m2 in the same run. The warnings of honest pairs beside others are compared with those without, but
for robots that meet one of the others. A drive is given up if a pass takes more than 5 s of processor time. All drives
begin with what was learned of other honest robots before, as in a service that has run for a while: what an engine
learns first, it learns from whoever is there.
"""

import argparse
import gc
import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np

from benchmarks.drawn_floors.driving import Drive, drive
from benchmarks.drawn_floors.figures import MOST_MORE_S, line, table
from benchmarks.drawn_floors.floor import Floor, drawn_floor, honest_floor
from benchmarks.drawn_floors.judging import compared
from benchmarks.drawn_floors.motion import Robot, sent_by
from benchmarks.drawn_floors.others import KINDS
from deconflict.runtime.command_parsers import GC_THRESHOLDS
from deconflict.runtime.learned_state import Part
from ingest.batch import Floats

PASSES = 20
REFERENCE_EVERY = 10
LEARNING_S = 80.0
"""For how long honest robots are heard before."""


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
    half = len(alone.work) // 4
    return {name: median(alone.column(name)[half:].tolist()) for name in ("pass_s", "pairs")}


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
        "work": {name: _most(beside, name) for name in ("box_pairs", "segment_pairs", "advanced_pairs", "fcl_calls")},
        "foreseen_pairs": _most(beside, "foreseen_pairs"),
        "open_conflicts": _most(beside, "open_conflicts"),
        "not_examined": beside.not_examined,
        "warnings": None if verdict is None else asdict(verdict) | {"differ": verdict.differ},
    }


def _most(driven: Drive, name: str) -> int:
    return int(driven.column(name).max())


def main() -> None:
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("--floors", type=int, default=200)
    arguments.add_argument("--first", type=int, default=0, help="number of the first floor")
    arguments.add_argument("--robots", type=int, default=300)
    arguments.add_argument("--seed", type=int, default=0)
    arguments.add_argument("--seconds", type=float, default=40.0, help="simulated seconds")
    arguments.add_argument("--passes", type=int, default=5, help="passes a simulated second")
    arguments.add_argument("--kinds", nargs="+", choices=list(KINDS), help="all floors have these others")
    arguments.add_argument("--unlearned", action="store_true", help="begin without what was learned of honest robots")
    arguments.add_argument("--json", type=Path)
    args = arguments.parse_args()
    gc.set_threshold(*GC_THRESHOLDS)
    terms, usual, results = Terms(LEARNING_S, args.passes), dict[str, float](), list[dict[str, Any]]()
    learned = {} if args.unlearned else terms.drive(honest_floor(args.robots, LEARNING_S, args.seed)).learned
    terms = Terms(args.seconds, args.passes, learned)
    for number in range(args.first, args.first + args.floors):
        if number % REFERENCE_EVERY == 0 or not usual:
            usual = reference(args.robots, args.seed + number, terms)
        floor = drawn_floor(number, args.robots, args.seconds, args.seed, tuple(args.kinds or ()))
        results.append(measured(floor, terms, usual))
        print(line(results[-1]), flush=True)
        if args.json:
            args.json.write_text(json.dumps(results, indent=1) + "\n")
    print("\n".join(["", *table(results)]))


if __name__ == "__main__":
    main()
