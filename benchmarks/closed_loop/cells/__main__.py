"""Floors of cells without advice, with it, and under one plan, side by side."""

import argparse
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass

import numpy as np

from benchmarks.closed_loop.cells.kinds import SIZES, VENDORS, floor_of
from benchmarks.closed_loop.cells.world import CellWorld, Compliance, Figures
from benchmarks.closed_loop.halls.runs import paired_difference
from deconflict.adviser import Adviser

NONE, ONE_PLAN = "none", "one plan"


@dataclass(frozen=True)
class Run:
    kind: str
    seed: int
    adviser: str
    obey: float = 1.0
    seconds: float = 420.0
    robots: int | None = None


def driven(run: Run) -> tuple[Figures, float]:
    """The figures of one floor, and the processor time of its adviser."""
    vendors = VENDORS[:1] if run.adviser == ONE_PLAN else VENDORS
    made_of = floor_of(run.kind, run.seed, vendors, run.robots)
    world, advising_s = CellWorld(made_of, Compliance(share=run.obey)), 0.0
    adviser = Adviser() if run.adviser == "this" else None
    while world.since_s < run.seconds:
        for _ in range(10):
            world.step()
        messages, answers = world.heard(), world.answers()
        if adviser:
            began_s = time.process_time()
            for name, answer, why in answers:
                adviser.answer(name, answer, why)  # type: ignore[arg-type]
            requests = adviser.hear(world.now_s, messages)
            advising_s += time.process_time() - began_s
            for request in requests:
                world.ask(request)
    return world.figures(), advising_s


def table(
    kind: str, seeds: Sequence[int], shares: Sequence[float], jobs: int, robots: int | None = None
) -> Iterator[str]:
    """Rows of one floor: means over seeds, and the paired difference to none with its 95 % interval."""
    rows = [(NONE, 1.0), *(("this", share) for share in shares), (ONE_PLAN, 1.0)]
    runs = [Run(kind, seed, adviser, share, robots=robots) for adviser, share in rows for seed in seeds]
    with ProcessPoolExecutor(jobs) as processes:
        found = list(processes.map(driven, runs))
    none = np.array([figures.mps for figures, _ in found[: len(seeds)]])
    for number, (adviser, share) in enumerate(rows):
        figures = [each for each, _ in found[number * len(seeds) : (number + 1) * len(seeds)]]
        mps = np.array([each.mps for each in figures])
        means = [np.mean([each[k] for each in figures]) for k in (1, 2, 3)]
        name = f"{adviser}, {share:g} obey" if adviser == "this" else adviser
        interval = paired_difference(mps - none) if number else ""
        yield f"| {kind} | {name} | {mps.mean():.3f} | {interval} | {means[0]:.0f} | {means[1]:.0f} | {means[2]:.0f} |"


def main(arguments: Sequence[str] | None = None) -> None:
    options = argparse.ArgumentParser(prog="python -m benchmarks.closed_loop.cells", description=__doc__)
    options.add_argument("--floor", choices=SIZES, nargs="+", default=list(SIZES))
    options.add_argument("--seeds", type=int, nargs="+", default=[1, 2, 3])
    options.add_argument("--obey", type=float, nargs="+", default=[1.0, 0.5, 0.2], help="shares of robots that follow")
    options.add_argument("--robots", type=int, help="on each floor; by its name if absent")
    options.add_argument("--jobs", type=int, default=1)
    args = options.parse_args(arguments)
    print("| floor | advice | m/s | to none | cells/min | requests/robot-hour | encounters/robot-hour |")
    print("| --- | --- | --- | --- | --- | --- | --- |")
    for kind in args.floor:
        for row in table(kind, args.seeds, args.obey, args.jobs, args.robots):
            print(row, flush=True)


if __name__ == "__main__":
    main()
