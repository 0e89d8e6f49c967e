"""Draws floors and drives each with and without its other robots: `python -m benchmarks.drawn_floors [--floors 200]`.

Every floor has `--robots` robots, a fifth to a half of them honest, at one per 25 m2, crossing each other's way. The
others are of one to three kinds (`benchmarks/drawn_floors/others.py`): large bodies, heaps, crowds that fall silent,
very fast, converging, jumping and more, of one or many makers and addresses. The fleet and the engine of the service
get the messages of each floor in simulated time, once of the honest robots alone and once of all.

The figures of a pass are the greatest median of 20 passes in a row, compared with the median pass of as many honest
robots at one per 25 m2 in the same run. The warnings of honest pairs beside others are compared with those without, but
for robots that meet one of the others. A drive is given up if a pass takes more than 5 s of processor time.
"""

import argparse
import gc
import json
from dataclasses import asdict
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np

from benchmarks.drawn_floors.driving import Drive, drive
from benchmarks.drawn_floors.figures import MOST_MORE_S, line, table
from benchmarks.drawn_floors.floor import Floor, drawn_floor, honest_floor
from benchmarks.drawn_floors.judging import compared
from benchmarks.drawn_floors.motion import sent_by
from benchmarks.drawn_floors.others import KINDS
from deconflict.runtime.command_parsers import GC_THRESHOLDS
from ingest.batch import Floats

PASSES = 20
REFERENCE_EVERY = 10


def windowed(values: Floats) -> float:
    """The greatest median of `PASSES` in a row."""
    width = min(PASSES, len(values))
    return float(np.median(np.lib.stride_tricks.sliding_window_view(values, width), axis=1).max())


def reference(robots: int, seconds: float, seed: int, passes: int) -> dict[str, float]:
    """The median pass of honest robots."""
    honest = honest_floor(robots, seconds, seed)
    alone = drive(honest, sent_by(honest, seconds), seconds, passes)
    half = len(alone.work) // 4
    return {name: median(alone.column(name)[half:].tolist()) for name in ("pass_s", "pairs")}


def measured(floor: Floor, seconds: float, passes: int, usual: dict[str, float]) -> dict[str, Any]:
    """The figures of one floor, as a line of the JSON file."""
    alone = drive(floor.honest, sent_by(floor.honest, seconds), seconds, passes)
    robots = (*floor.honest, *floor.others)
    beside = drive(robots, sent_by(robots, seconds), seconds, passes)
    verdict = None if beside.failed else compared(floor, alone, beside, seconds)
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
    arguments.add_argument("--json", type=Path)
    args = arguments.parse_args()
    gc.set_threshold(*GC_THRESHOLDS)
    warm_up, usual, results = honest_floor(20, 5.0, 0), dict[str, float](), list[dict[str, Any]]()
    drive(warm_up, sent_by(warm_up, 5.0), 5.0, args.passes)
    for number in range(args.first, args.first + args.floors):
        if number % REFERENCE_EVERY == 0 or not usual:
            usual = reference(args.robots, args.seconds, args.seed + number, args.passes)
        floor = drawn_floor(number, args.robots, args.seconds, args.seed, tuple(args.kinds or ()))
        results.append(measured(floor, args.seconds, args.passes, usual))
        print(line(results[-1]), flush=True)
        if args.json:
            args.json.write_text(json.dumps(results, indent=1) + "\n")
    print("\n".join(["", *table(results)]))


if __name__ == "__main__":
    main()
