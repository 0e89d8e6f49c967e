"""The processor time of a message from its bytes to advisories, by stage: `python -m benchmarks.stages --robots 100`.

The load of `benchmarks.offer` without its sockets passes through a fleet, an engine and situations in this process,
with ten passes per second. Results are microseconds of one core per message, in the second half of the run. Here advice
is computed within the pass; in the service a thread of the engine computes it.

With `--silent 2000` it compares two such floors, on one of which so many robots have stopped reporting. Their passes
alternate. Results are the time of a pass with them and without, and their memory.
"""

import argparse
import gc
import json
import math
import tracemalloc
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass, field
from itertools import pairwise
from time import process_time
from typing import Any
from uuid import uuid5

import numpy as np

from benchmarks.endtoend import benchmark_site
from benchmarks.offer import DATUM, MARGIN_M, ROBOTS, ROBOTS_A_CONNECTION, SPACING_M, VENDORS, Circling, vendor_of
from benchmarks.replay import timed
from deconflict.advice.requests.hold_requests import HoldRequests
from deconflict.advisories.conflict_lifecycle import ConflictLifecycle
from deconflict.advisories.situations.situation_publisher import SituationPublisher
from deconflict.advisories.words.place_names import PlaceNames
from deconflict.contention.contention import Contention
from deconflict.engine.engine import Engine
from deconflict.foresight.probability.estimator import ProbabilityEstimator
from deconflict.runtime.command_parsers import GC_THRESHOLDS
from deconflict.settings.fleet_factory import fast_fleet_of
from deconflict.sweep.incremental import Sweeper
from deconflict_client.situations import AnyRevision
from ingest.batch import Batch, Floats
from ingest.fleet.fleet import Fleet
from ingest.languages import timestamps
from ingest.measures.measures import Measures
from ingest.port.connection import Connection

START_S = 1_790_000_000.0
TICK_S = 0.1
AT_A_TIME = 20
"""Robots that fall silent together."""
ARRIVING_S, SETTLING_S = 4, 40.0
"""Robots that fall silent report for so long; and the others, before they are measured."""
LONGEST_SILENCE_S, SHORTEST_SILENCE_S = 3600.0, 300.0
"""For how long robots have been silent when others are measured. A silent robot is looked at less and less often."""
STAGES: dict[str, tuple[tuple[Any, str], ...]] = {
    "read messages": ((Fleet, "receive"),),
    "batches": ((Fleet, "next_batch"), (Batch, "to_bytes")),
    "sweep": ((Sweeper, "update"), (Sweeper, "find_conflicts")),
    "probabilities": ((ProbabilityEstimator, "receive"), (ProbabilityEstimator, "estimate")),
    "life": ((ConflictLifecycle, "revise"),),
    "contention": ((Contention, "receive"), (Contention, "step")),
    "advice": ((HoldRequests, "step"),),
    "situations": ((SituationPublisher, "stamped"), (SituationPublisher, "revise")),
}


@dataclass
class Floor:
    """Robots that report once a second, with the fleet and the engine of the service."""

    robots: int
    world: Circling = field(init=False)
    messages: int = 0
    passes_s: list[float] = field(default_factory=list)
    """Processor time of each pass of the engine."""
    publish: Callable[[list[AnyRevision]], object] = lambda _: None
    """Gets what each pass publishes."""

    def __post_init__(self) -> None:
        self.world, site = Circling(self.robots), benchmark_site(0, 0)
        self.fleet, self.engine = fast_fleet_of(site, Measures()), Engine(site)
        self.situations = SituationPublisher(PlaceNames.of(site).describe)
        self.connections = [
            Connection(n + 1, f"10.0.{n // 250}.{n % 250}", "/", vendor_of(n * ROBOTS_A_CONNECTION))
            for n in range(-(-self.robots // ROBOTS_A_CONNECTION))
        ]
        for robot in range(self.robots):
            self.fleet.receive(
                self.world.identity(robot).encode(), START_S, self.connections[robot // ROBOTS_A_CONNECTION]
            )

    def fall_silent(self, robots: int) -> None:
        """Let so many robots arrive beside the circles, where they stop reporting; some arrive where others stand.

        Few arrive at a time, as on a floor on which others report, too.
        """
        rng = np.random.default_rng(2)
        x_m = MARGIN_M + rng.uniform(0, robots / 10, robots)
        y_m = SPACING_M * np.sqrt(self.robots) + 3 * MARGIN_M + rng.uniform(0, 40, robots)
        begins_s = np.linspace(-LONGEST_SILENCE_S, -SHORTEST_SILENCE_S, -(-robots // AT_A_TIME)).round()
        now_s = begins_s[0]
        for robot, begin_s in zip(range(0, robots, AT_A_TIME), begins_s.tolist(), strict=True):
            for second in range(ARRIVING_S):
                t_s, left_m = begin_s + second, float(ARRIVING_S - 1 - second)
                for each in range(robot, min(robot + AT_A_TIME, robots)):
                    connection = Connection(-1 - each, "10.1.0.1", "/", VENDORS[each % len(VENDORS)])
                    status = _arriving(f"silent {each}", x_m[each] - left_m, y_m[each], left_m, t_s)
                    self.fleet.receive(status, START_S + t_s, connection)
                self.run(np.array([now_s, t_s]), with_circles=False)
                now_s = t_s
        self.run(np.arange(now_s, 1 - SETTLING_S, 10.0), with_circles=False)

    def run(self, ticks: Floats, *, with_circles: bool = True) -> None:
        """Feed every message that is due between ticks, and make a pass at each tick."""
        for before_s, now_s in pairwise(ticks.tolist()):
            due_s = self.world.due_s
            due = np.flatnonzero(np.floor(now_s - due_s) > np.floor(before_s - due_s))[: None if with_circles else 0]
            statuses = self.world.statuses(due, START_S, START_S + now_s)
            for robot, status in zip(due.tolist(), statuses, strict=True):
                self.fleet.receive(status, START_S + now_s, self.connections[robot // ROBOTS_A_CONNECTION])
            batch = Batch.from_bytes(self.fleet.next_batch(START_S + now_s).to_bytes())
            began_s = process_time()
            self.engine.receive(batch)
            revisions = self.engine.step(START_S + now_s)
            self.passes_s.append(process_time() - began_s)
            stamped = self.situations.stamped(revisions)
            self.publish([*stamped, *self.situations.revise(START_S + now_s, revisions, self.engine.measures)])
            self.messages += len(due)


def measured(robots: int, seconds: float) -> tuple[dict[str, float], list[float]]:
    """Microseconds per message by stage, and the processor time of each pass."""
    floor, ticks = Floor(robots), np.arange(0.0, seconds, TICK_S)
    floor.run(ticks[: len(ticks) // 2 + 1])
    floor.messages, floor.passes_s = 0, []
    spent = dict.fromkeys(STAGES, 0.0)
    with ExitStack() as timers:
        for stage, calls in STAGES.items():
            for owner, name in calls:
                timers.enter_context(timed(spent, stage, owner, name))
        floor.run(ticks[len(ticks) // 2 :])
    inside = ("sweep", "probabilities", "life", "contention", "advice")
    spent["the rest of a pass"] = sum(floor.passes_s) - sum(spent[stage] for stage in inside)
    return {stage: stage_s / floor.messages * 1e6 for stage, stage_s in spent.items()}, floor.passes_s


def _arriving(name: str, x_m: float, y_m: float, left_m: float, t_s: float) -> bytes:
    """A status at `t_s` of a robot that has `left_m` to go along x, at 1 m/s."""
    angle = {"x": 0, "y": 0, "z": 0, "w": 1}
    path = [
        {"timestamp": timestamps.write(START_S + t_s + metre), "x": x_m + metre, "y": y_m, "angle": angle}
        for metre in range(1, round(left_m) + 1)
    ]
    return json.dumps(
        {
            "uuid": str(uuid5(ROBOTS, name)),
            "timestamp": timestamps.write(START_S + t_s),
            "operationalState": "navigating",
            "location": {"x": x_m, "y": y_m, "angle": angle, "planarDatum": DATUM},
            "velocity": {"linear": 1.0 if path else 0.0},
            "path": path,
        }
    ).encode()


def compare_silent(robots: int, silent: int, seconds: float) -> tuple[float, float]:
    """The processor time of a pass beside silent robots, as a ratio to one without; and bytes for each of them."""
    without, beside = Floor(robots), Floor(robots)
    tracemalloc.start()
    beside.fall_silent(silent)
    gc.collect()
    used_bytes, _ = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    for floor in (without, beside):
        floor.run(np.arange(-SETTLING_S, 0.1, 1.0))
        floor.passes_s = []
    for span in pairwise(np.arange(0.0, seconds, TICK_S)):
        for floor in (without, beside):
            floor.run(np.array(span))
    return sum(beside.passes_s) / sum(without.passes_s), used_bytes / silent


def main() -> None:
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("--robots", type=int, nargs="+", default=[100, 1000, 3000, 10000])
    arguments.add_argument("--seconds", type=float, default=10.0)
    arguments.add_argument("--silent", type=int, default=0, help="compare with a floor on which so many are silent")
    args = arguments.parse_args()
    gc.set_threshold(*GC_THRESHOLDS)
    measured(20, 2.0)
    if args.silent:
        for robots in args.robots:
            ratio, each_bytes = compare_silent(robots, args.silent, args.seconds)
            print(
                f"{robots:6} robots: a pass takes {ratio:.2f} times as long beside {args.silent} silent robots, "
                f"of {each_bytes:.0f} bytes each",
                flush=True,
            )
        return
    sums = []
    for robots in args.robots:
        spent, passes_s = measured(robots, args.seconds)
        sums.append(sum(spent.values()))
        stages_text = "  ".join(f"{stage} {us:.0f}" for stage, us in spent.items())
        slowest_ms = np.percentile(passes_s, 99) * 1000
        print(
            f"{robots:6} robots, us per message: {stages_text}, total {sums[-1]:.0f}; "
            f"p99 of a pass {slowest_ms:.0f} ms",
            flush=True,
        )
    if len(sums) > 1:
        growth = 1 + math.log(sums[-1] / sums[0]) / math.log(args.robots[-1] / args.robots[0])
        print(f"growth exponent of processor time: {growth:.2f}")


if __name__ == "__main__":
    main()
