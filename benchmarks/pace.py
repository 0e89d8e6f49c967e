"""What the pace of the passes costs and saves: `python -m benchmarks.pace [--robots 100 1000 10000]`.

The robots of `benchmarks.stages` report to a fleet and an engine in this process, in simulated time: a pass takes the
processor time that it needs, and the next one follows at the service's pace, or 0.1 s later. So the figures do not
depend on what else the machine does, but for its speed. Latency is the wait for the tick and the pass, without sockets
and publishing. Both paces take turns on floors of their own.
"""

import argparse
import gc

import numpy as np

from benchmarks.stages import Floor, measured
from deconflict.engine.load_shedding import LONGEST_TICK_S, PassPace
from deconflict.runtime.command_parsers import GC_THRESHOLDS
from ingest.batch import Floats

SETTLING_S, TURN_S = 3.0, 1.0


class PacedFloor:
    """A floor whose passes are at least `shortest_s` apart."""

    def __init__(self, robots: int, shortest_s: float) -> None:
        self.floor, self._pace, self.now_s = Floor(robots), PassPace(shortest_s), 0.0
        self.latencies_s: list[Floats] = []

    def run(self, until_s: float) -> None:
        """Make the passes until `until_s`."""
        floor = self.floor
        while self.now_s < until_s:
            passes_s = floor.passes_s[-1] if floor.passes_s else 0.0
            self._pace.add_pass(passes_s)
            before_s, self.now_s = self.now_s, self.now_s + max(self._pace.tick_s, passes_s)
            floor.run(np.array([before_s, self.now_s]))
            waited_s = (self.now_s - floor.world.due_s) % 1.0
            self.latencies_s.append(waited_s[waited_s < self.now_s - before_s] + floor.passes_s[-1])

    def text(self, seconds: float) -> str:
        p50_ms, p99_ms = np.percentile(np.concatenate(self.latencies_s), [50, 99]) * 1000
        passes_s = self.floor.passes_s
        return (
            f"p50 {p50_ms:.0f} ms, p99 {p99_ms:.0f} ms, {len(passes_s) / seconds:.0f} passes a second of "
            f"{np.mean(passes_s) * 1000:.1f} ms, engine {sum(passes_s) / seconds:.2f} cores"
        )


def compare(robots: int, seconds: float) -> None:
    fixed, paced = (PacedFloor(robots, shortest_s) for shortest_s in (LONGEST_TICK_S, 0.02))
    for floor in (fixed, paced):
        floor.run(SETTLING_S)
        floor.floor.passes_s, floor.latencies_s = floor.floor.passes_s[-1:], []
    for turn in range(1, round(seconds / TURN_S) + 1):
        for floor in (fixed, paced):
            floor.run(SETTLING_S + turn * TURN_S)
    for name, floor in (("each 0.1 s", fixed), ("paced", paced)):
        print(f"{robots:6} robots, {name:10}: {floor.text(seconds)}", flush=True)


def main() -> None:
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("--robots", type=int, nargs="+", default=[100, 1000, 10000])
    arguments.add_argument("--seconds", type=float, default=10.0)
    args = arguments.parse_args()
    gc.set_threshold(*GC_THRESHOLDS)
    measured(20, 2.0)
    for robots in args.robots:
        compare(robots, args.seconds)


if __name__ == "__main__":
    main()
