"""The speed of replaying and scoring a recorded log, and the time of each stage: `python -m benchmarks.replay`.

The log comes from the demo's simulated vendors, each in its own dialect, most with one status per second. With
`--circles` it comes from the robots of `benchmarks.endtoend`, each with one status per second. Or give another log.
It uses one clearance and one core, and the garbage collection settings of the command. Times are processor times, so
that other load on the machine has little effect. The log is replayed twice: the total time is from the run without
timers, the shares are from the run with timers.

`--side-by-side` runs the command itself instead, on several logs, clearances and variants: in one process, in two, and
on a Dask cluster of this machine. The ways take turns, so that other load meets all of them.
"""

import argparse
import gc
import json
import os
import resource
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from typing import Any, TextIO

import numpy as np

from benchmarks.offer import Circling
from deconflict.advice.requests.hold_requests import HoldRequests
from deconflict.advisories.conflict_lifecycle import ConflictLifecycle
from deconflict.contention.contention import Contention
from deconflict.foresight.presence.live_robots import LiveRobots
from deconflict.foresight.presence.presence import Presence
from deconflict.foresight.probability.estimator import ProbabilityEstimator
from deconflict.runtime.command_parsers import GC_THRESHOLDS
from deconflict.settings.site import Site
from deconflict.settings.site_file import load
from deconflict.simulation.demo.demo_site import demo_site
from deconflict.simulation.driving.traffic import World
from deconflict.simulation.floor_layout import layout_for
from deconflict.simulation.participants import participants
from deconflict.simulation.robot_state import robot_states
from deconflict.simulation.vendors.dialects import DIALECTS
from deconflict.sweep.incremental import Sweeper
from ingest.fleet.fleet import Fleet
from ingest.languages import timestamps
from ingest.recording.log_reader import LogReader
from metrics.replay.log_scores import ClearanceScores
from metrics.replay.replay import replay
from metrics.scoring.arrival_scores import ArrivalScores
from metrics.scoring.forecast_scores import ForecastScores
from metrics.scoring.warnings.calibration_scores import CalibrationScores
from metrics.truth.encounters import EncounterFinder

START_S = 1_790_000_000.0
STEP_S = 0.1
STAGES: dict[str, tuple[tuple[Any, str], ...]] = {
    "read messages": ((Fleet, "receive"),),
    "cut batches": ((Fleet, "next_batch"), (LiveRobots, "update")),
    "sweep": ((Sweeper, "update"), (Sweeper, "find_conflicts")),
    "presence": ((Presence, "receive"), (Presence, "advance")),
    "probabilities": ((ProbabilityEstimator, "receive"), (ProbabilityEstimator, "estimate")),
    "lifecycle of advisories": ((ConflictLifecycle, "revise"),),
    "advice on conflicts": ((HoldRequests, "step"),),
    "contention": ((Contention, "receive"), (Contention, "step")),
    "truth, arrivals": (
        (ArrivalScores, "add_batch"),
        (EncounterFinder, "report"),
        (EncounterFinder, "advance"),
        (EncounterFinder, "finish"),
    ),
    "forecast errors": ((ForecastScores, "add"), (ForecastScores, "advance"), (ForecastScores, "finish")),
    "scoring": ((CalibrationScores, "sample"), (CalibrationScores, "resolve"), (ClearanceScores, "figures")),
}

WAYS: dict[str, tuple[str, ...]] = {
    "--jobs 1": ("--jobs", "1"),
    "--jobs 2": ("--jobs", "2"),
    "--scheduler": ("--scheduler",),
}
CASES = (1, 1, 1), (1, 3, 1), (1, 1, 2), (4, 1, 1), (4, 3, 1)
"""Logs, clearances and variants."""

_within: list[str] = []
"""The stage in progress, if any. Advice also sweeps, so a stage may call another."""


def write_log(path: Path, robots: int, seconds: float, seed: int = 1) -> int:
    """Write what simulated robots of four vendors send in `seconds`. Returns the number of messages."""
    rng, messages = np.random.default_rng(seed), 0
    world = World(layout_for(robots), participants(robots), rng)
    every_s = np.array([member.make.report_every_s for member in world.members])
    phase_s = every_s * (np.arange(len(world)) * 0.618 % 1.0)
    introduced: set[int] = set()
    with path.open("w") as out:
        while world.t_s < seconds:
            before = np.floor((world.t_s + phase_s) / every_s)
            world.step(STEP_S)
            due = np.flatnonzero(np.floor((world.t_s + phase_s) / every_s) > before)
            now_s = START_S + world.t_s
            for row, robot in zip(due.tolist(), robot_states(world, due), strict=True):
                messages_of_robot = DIALECTS[robot.member.make.vendor].messages(
                    robot, now_s, introduce=row not in introduced
                )
                introduced.add(row)
                for raw in messages_of_robot:
                    _write(out, now_s + 0.05, raw.decode())
                    messages += 1
    return messages


def write_circles(path: Path, robots: int, seconds: float) -> None:
    """Write what robots on circles send in `seconds`."""
    circling = Circling(robots)
    with path.open("w") as out:
        for robot in range(robots):
            _write(out, START_S, circling.identity(robot))
        for step in range(round(seconds / STEP_S)):
            before_s, now_s = step * STEP_S, (step + 1) * STEP_S
            due = np.flatnonzero(np.floor(now_s - circling.due_s) > np.floor(before_s - circling.due_s))
            for raw in circling.statuses(due, START_S, START_S + now_s):
                _write(out, START_S + now_s + 0.01, raw.decode())


def _write(out: TextIO, received_s: float, message: str) -> None:
    out.write(f'{{"received":"{timestamps.write(received_s)}","message":{message}}}\n')


@contextmanager
def timed(spent: dict[str, float], stage: str, owner: Any, name: str) -> Iterator[None]:
    """Add the time of every call of `owner.name` to the stage, except calls within another stage."""
    call = getattr(owner, name)

    def timed_call(*args: Any, **named: Any) -> Any:
        if _within:
            return call(*args, **named)
        _within.append(stage)
        began = time.process_time()
        try:
            return call(*args, **named)
        finally:
            _within.pop()
            spent[stage] += time.process_time() - began

    setattr(owner, name, timed_call)
    try:
        yield
    finally:
        setattr(owner, name, call)


def replayed(log: Path, site: Site) -> tuple[dict[str, Any], float]:
    """The result, and the seconds that the replay took."""
    began = time.process_time()
    reader = LogReader()
    result = replay(reader, reader.read([log]), site, [site.conflict.clearance_m])
    return result, time.process_time() - began


def stages(log: Path, site: Site) -> tuple[dict[str, float], float]:
    """Seconds by stage, and in total."""
    spent = dict.fromkeys(STAGES, 0.0)
    with ExitStack() as timers:
        for stage, calls in STAGES.items():
            for owner, name in calls:
                timers.enter_context(timed(spent, stage, owner, name))
        _, took_s = replayed(log, site)
    spent["read the log"] = read_alone(log)
    return spent | {"the rest": took_s - sum(spent.values())}, took_s


def read_alone(log: Path) -> float:
    began = time.process_time()
    for _ in LogReader().read([log]):
        pass
    return time.process_time() - began


def peak_mb() -> float:
    """Peak memory of this process in megabytes. Linux reports kilobytes."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def command_of(logs: Sequence[Path], clearances: int, variants: int, folder: Path) -> list[str]:
    """The command that replays the logs, without the options that say in how many processes."""
    clearances_m = [f"{0.3 + 0.1 * number:g}" for number in range(clearances)]
    command = [sys.executable, "-m", "deconflict", "replay", *map(str, logs), "--each", "--site", str(demo_site())]
    command += ["--json", str(folder / "scores.json"), "--clearance", *clearances_m]
    for number in range(variants if variants > 1 else 0):
        command += ["--variant", str(number), f"confirm=[{number + 2},3]"]
    return command


def ran(command: Sequence[str]) -> tuple[float, float]:
    """The wall seconds and the processor seconds that a command and its processes took."""
    before = os.times()
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    after = os.times()
    return after.elapsed - before.elapsed, sum(after[2:4]) - sum(before[2:4])


def side_by_side(robots: int, seconds: float, turns: int) -> Iterator[str]:
    """A table: for each case and way, the fastest of the turns, and the median of its ratios to one process."""
    yield "| logs, clearances, variants | way | wall, s | processor, s | wall to `--jobs 1` | load |\n|" + " --- |" * 6
    with TemporaryDirectory() as name:
        logs = [Path(name) / f"log{seed}.jsonl" for seed in range(1, 5)]
        for seed, log in enumerate(logs, 1):
            write_log(log, robots, seconds, seed)
        for count, clearances, variants in CASES:
            command = command_of(logs[:count], clearances, variants, Path(name))
            took = [{way: ran([*command, *options]) for way, options in WAYS.items()} for _ in range(turns)]
            case, load = f"{count}, {clearances}, {variants}", os.getloadavg()[0]
            for way in WAYS:
                wall_s, core_s = min(turn[way] for turn in took)
                ratio = median(turn[way][0] / turn["--jobs 1"][0] for turn in took)
                yield f"| {case} | `{way}` | {wall_s:.1f} | {core_s:.1f} | {ratio:.2f} | {load:.1f} |"


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("log", nargs="?", type=Path)
    options.add_argument("--site", type=Path)
    options.add_argument("--circles", action="store_true", help="robots on circles instead of the demo's vendors")
    options.add_argument("--robots", type=int, default=100)
    options.add_argument("--seconds", type=float, default=300.0)
    options.add_argument("--side-by-side", action="store_true", help="the command, with several processes and with one")
    options.add_argument("--turns", type=int, default=3, help="how often each way runs side by side")
    args = options.parse_args()
    if args.side_by_side:
        for row in side_by_side(args.robots, args.seconds, args.turns):
            print(row, flush=True)
        return
    gc.set_threshold(*GC_THRESHOLDS)
    site = load(args.site or demo_site()) if args.site or not (args.log or args.circles) else Site()
    with TemporaryDirectory() as folder:
        log, short = args.log or Path(folder) / "log.jsonl", Path(folder) / "short.jsonl"
        write_log(short, 40, 12.0)
        _, loading_s = replayed(short, site)
        if not args.log:
            (write_circles if args.circles else write_log)(log, args.robots, args.seconds)
        (result, took_s), most_mb = replayed(log, site), peak_mb()
        spent, watched_s = stages(log, site)
    span_s, messages = result["span_s"], result["messages"]
    print(f"{result['robots']} robots, {messages} messages in {span_s:.0f} s: {took_s:.1f} s")
    print(f"{span_s / took_s:.0f} times real time, {messages / took_s:.0f} messages a second")
    for stage, stage_s in spent.items():
        print(f"{stage:<20}{stage_s / watched_s:>6.0%}{stage_s / messages * 1e6:>9.1f} us a message")
    print(f"before that, {loading_s:.1f} s to load compiled code; peak memory {most_mb:.0f} MB")
    json.dump({name: result["scores"][0][name] for name in ("encounters", "alerts")}, sys.stdout)
    print()


if __name__ == "__main__":
    main()
