"""What the pace of the passes costs: `python -m benchmarks.pace [--robots 100 1000 10000] [--ticks 0.02 0.08]`.

The robots of `benchmarks.stages` report to a fleet and an engine in this process, in simulated time: a pass takes the
processor time that it needs, and the next one follows a tick later, or when it is over. So the figures do not depend on
what else the machine does, but for its speed. Latency is the wait for the tick and the pass, without sockets and
publishing. All ticks take turns on floors of their own.
"""

import argparse
import gc
from collections.abc import Sequence

import numpy as np

from benchmarks.stages import Floor, measured
from deconflict.runtime.command_parsers import GC_THRESHOLDS
from deconflict.settings.site import DEFAULT
from ingest.batch import Floats

SETTLING_S, TURN_S = 3.0, 1.0


class PacedFloor:
    """A floor whose passes are at least `tick_s` apart."""

    def __init__(self, robots: int, tick_s: float) -> None:
        self.floor, self.tick_s, self.now_s = Floor(robots), tick_s, 0.0
        self.latencies_s: list[Floats] = []

    def run(self, until_s: float) -> None:
        """Make the passes until `until_s`."""
        floor = self.floor
        while self.now_s < until_s:
            passes_s = floor.passes_s[-1] if floor.passes_s else 0.0
            before_s, self.now_s = self.now_s, self.now_s + max(self.tick_s, passes_s)
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


def compare(robots: int, ticks_s: Sequence[float], seconds: float) -> None:
    floors = [PacedFloor(robots, tick_s) for tick_s in ticks_s]
    for floor in floors:
        floor.run(SETTLING_S)
        floor.floor.passes_s, floor.latencies_s = floor.floor.passes_s[-1:], []
    for turn in range(1, round(seconds / TURN_S) + 1):
        for floor in floors:
            floor.run(SETTLING_S + turn * TURN_S)
    for floor in floors:
        print(f"{robots:6} robots, each {floor.tick_s:g} s: {floor.text(seconds)}", flush=True)


def main() -> None:
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("--robots", type=int, nargs="+", default=[100, 1000, 10000])
    arguments.add_argument("--ticks", type=float, nargs="+", default=[0.02, DEFAULT.engine.tick_s], metavar="S")
    arguments.add_argument("--seconds", type=float, default=10.0)
    args = arguments.parse_args()
    gc.set_threshold(*GC_THRESHOLDS)
    measured(20, 2.0)
    for robots in args.robots:
        compare(robots, args.ticks, args.seconds)


if __name__ == "__main__":
    main()
