"""What a sweep costs, beside other engines: `python -m benchmarks.sweep [--json FILE] [--repeats N]`.

Every ratio is of two times measured in the same run. `--compare A.json B.json` sets two saved runs side by side.
"""

import argparse
import json
import platform
import subprocess
import sys
from collections.abc import Callable, Sequence
from math import log
from pathlib import Path
from statistics import median
from time import perf_counter
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from benchmarks.floors import NOW_S, World, crowd, lanes
from benchmarks.peers import HORIZON_S, PEERS, Peer
from deconflict.sweep import sweep
from deconflict.sweeper import PairConflicts, Sweeper
from ingest.seam import Ints
from tests.oracle import truth

CLEARANCE_M = 0.3
FLOORS = [(robots, area_m2) for area_m2 in (25.0, 8.0) for robots in (1_000, 3_000, 10_000)]
PEER_FLOOR = (3_000, 25.0)
Row = dict[str, Any]


def keys_of(world: World) -> list[str]:
    return [f"robot-{row:05d}" for row in range(len(world.x))]


class Running:
    """A floor that is swept as time goes on."""

    def __init__(self, world: World, clearance_m: float = CLEARANCE_M) -> None:
        self.world, self.keys = world, keys_of(world)
        self.sweeper = Sweeper(clearance_m=clearance_m, horizon_s=HORIZON_S)
        self.last: PairConflicts | None = None

    def pass_ms(self, at_s: float, rows: Ints | None = None) -> float:
        """Milliseconds to take in what `rows` (everybody, by default) report by `at_s`, and to sweep."""
        forecasts = self.world.forecasts(at_s)
        keys = self.keys if rows is None else [self.keys[row] for row in rows.tolist()]
        part = forecasts if rows is None else forecasts.take(rows)
        begin = perf_counter()
        if keys:
            self.sweeper.update(keys, part)
        self.last = self.sweeper.step(NOW_S + at_s)
        return 1e3 * (perf_counter() - begin)


def timed(call: Callable[[], float], times: int) -> Row:
    taken = sorted(call() for _ in range(times))
    return {"min_ms": taken[0], "median_ms": median(taken), "max_ms": taken[-1]}


def full_passes(repeats: int) -> list[Row]:
    rows = []
    for robots, area_m2 in FLOORS:
        world = crowd(robots, area_m2)
        cold = timed(lambda world=world: Running(world).pass_ms(0.0), repeats)  # type: ignore[misc]
        running = Running(world)
        running.pass_ms(0.0)
        found = running.last
        assert found is not None  # noqa: S101
        seconds = iter(range(1, repeats + 1))
        steady = timed(lambda running=running, seconds=seconds: running.pass_ms(float(next(seconds))), repeats)  # type: ignore[misc]
        moving = float(np.mean(world.speed > 0))
        counts = {
            "conflicts": len(found.pairs),
            "box_pairs": found.box_pairs,
            "segment_pairs": found.segment_pairs,
            "advanced_pairs": found.advanced_pairs,
            "fcl_calls": found.fcl_calls,
        }
        rows.append(
            {"robots": robots, "area_m2": area_m2, "moving": moving} | counts | {"cold": cold, "steady": steady}
        )
        print(_full_line(rows[-1]), flush=True)
    return rows


FULL_HEAD = (
    f"{'robots':>7}{'m2 each':>8}{'moving':>7}{'full pass, ms':>22}{'steady pass, ms':>22}"
    f"{'box pairs':>11}{'segments':>10}{'advanced':>10}{'FCL':>7}{'conflicts':>10}"
)


def _full_line(row: Row) -> str:
    times = "".join(
        f"{'/'.join(f'{row[kind][name]:.0f}' for name in ('min_ms', 'median_ms', 'max_ms')):>22}"
        for kind in ("cold", "steady")
    )
    return (
        f"{row['robots']:>7}{row['area_m2']:>8.0f}{row['moving']:>7.0%}{times}"
        f"{row['box_pairs']:>11}{row['segment_pairs']:>10}{row['advanced_pairs']:>10}{row['fcl_calls']:>7}"
        f"{row['conflicts']:>10}"
    )


def partial_passes(repeats: int, robots: int) -> list[Row]:
    """A few robots changed among many, and the full pass of the same run."""
    rows = []
    for name, world in (("crowd", crowd(robots, 25.0)), ("lanes", lanes(robots, 25.0))):
        full_ms = timed(lambda world=world: Running(world).pass_ms(0.0), repeats)["min_ms"]  # type: ignore[misc]
        running = Running(world)
        running.pass_ms(0.0)
        running.pass_ms(0.05, np.arange(0))
        for changed in (0, 1, 10, 100, robots // 10):
            chosen = np.random.default_rng(changed).choice(robots, changed, replace=False)
            took = timed(lambda chosen=chosen, running=running: running.pass_ms(0.05, chosen), 3 * repeats)  # type: ignore[misc]
            listed = len(running.last.pairs) if running.last else 0
            rows.append(
                {"floor": name, "robots": robots, "changed": changed, "conflicts": listed, "full_ms": full_ms} | took
            )
            print(
                f"{name:<8}{robots:>7}{changed:>9}{took['min_ms']:>10.2f}{took['median_ms']:>10.2f}"
                f"{took['min_ms'] / full_ms:>10.1%} of a full pass{listed:>10} conflicts",
                flush=True,
            )
    return rows


def exponent(rows: Sequence[Row], area_m2: float, kind: str) -> float:
    """Of robots from 1,000 to 10,000: how many times the cost grows for ten times the robots, as a power."""
    cost = {row["robots"]: row[kind]["min_ms"] for row in rows if row["area_m2"] == area_m2}
    return log(cost[10_000] / cost[1_000]) / log(10)


def peak_mb(robots: int) -> float:
    """Peak memory of a process of its own that sweeps so many robots for some seconds."""
    code = (
        "import resource; from benchmarks.floors import crowd; from benchmarks.sweep import swept_for\n"
        f"swept_for(crowd({robots}, 25.0), 5); print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)"
    )
    done = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
    return int(done.stdout.split()[-1]) / 1024


def swept_for(world: World, seconds: int) -> None:
    sweeper, keys = Sweeper(clearance_m=CLEARANCE_M, horizon_s=HORIZON_S), keys_of(world)
    for second in range(seconds):
        sweeper.update(keys, world.forecasts(float(second)))
        sweeper.step(NOW_S + second)


def beside_peers(repeats: int, pairs: int) -> list[Row]:
    """The same floor and question, clearance 0, for every engine that is installed."""
    world = crowd(*PEER_FLOOR)
    own_ms = timed(lambda: Running(world, 0.0).pass_ms(0.0), 2 * repeats)["min_ms"]
    forecasts = world.forecasts(0.0)
    candidates = near_pairs(world, pairs)
    true = truth(forecasts, candidates, now_s=NOW_S, horizon_s=HORIZON_S, clearance_m=0.0).closest_m
    found = sweep(forecasts, now_s=NOW_S, horizon_s=HORIZON_S, clearance_m=0.0)
    own = {tuple(pair) for pair in found.pairs.tolist()}
    rows = [{"engine": "this sweep", "pass_ms": own_ms} | _held([pair in own for pair in candidates], true)]
    print(_peer_line(rows[0], own_ms), flush=True)
    for peer in PEERS:
        rows.append(_measured(peer, world, candidates, true, repeats))
        print(_peer_line(rows[-1], own_ms), flush=True)
    return rows


def near_pairs(world: World, count: int) -> list[tuple[int, int]]:
    """Pairs whose ways of the horizon, one circle each, overlap; the first so many in a shuffled order."""
    middle_x, middle_y, _ = world.pose(np.full((len(world.x), 1), HORIZON_S / 2))
    reach = world.speed * HORIZON_S / 2 + np.hypot(world.length, world.width) / 2
    places = np.column_stack([middle_x[:, 0], middle_y[:, 0]])
    near = cKDTree(places).query_pairs(2 * float(reach.max()), output_type="ndarray")
    apart = np.hypot(*(places[near[:, 0]] - places[near[:, 1]]).T)
    near = near[apart <= reach[near[:, 0]] + reach[near[:, 1]]]
    order = np.random.default_rng(1).permutation(len(near))[:count]
    return [(int(a), int(b)) for a, b in np.sort(near[order], axis=1)]


def _measured(peer: Peer, world: World, pairs: list[tuple[int, int]], true: Any, repeats: int) -> Row:
    row: Row = {"engine": peer.name, "how": peer.how, "installed": peer.installed}
    if not peer.installed:
        return row
    if peer.look is not None:
        row["pass_ms"] = timed(lambda: peer.look(world), repeats)["min_ms"]  # type: ignore[misc]
    begin = perf_counter()
    said = list(peer.touches(world, pairs))
    return row | {"us_a_pair": 1e6 * (perf_counter() - begin) / len(pairs)} | _held(said, true)


def _held(said: list[bool], closest_m: Any) -> Row:
    """Wrong answers, of pairs that overlap or stay apart by more than a millimetre."""
    touch, apart, told = closest_m <= 0, closest_m > 1e-3, np.array(said)
    return {"pairs": len(said), "touching": int(touch.sum()), "missed": int((touch & ~told).sum())} | {
        "false": int((apart & told).sum())
    }


def _peer_line(row: Row, own_ms: float) -> str:
    name = f"{row['engine']:<32}"
    if not row.get("installed", True):
        return f"{name}not installed"
    took = f"{row['pass_ms']:>9.0f} ms{row['pass_ms'] / own_ms:>8.1f}x" if "pass_ms" in row else " " * 21
    return f"{name}{took}{row['missed']:>8} missed{row['false']:>8} false, of {row['pairs']} ({row['touching']} touch)"


def machine() -> Row:
    cpuinfo = Path("/proc/cpuinfo")
    lines = cpuinfo.read_text().splitlines() if cpuinfo.exists() else []
    models = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    return {
        "cpu": models[0] if models else platform.processor(),
        "cores": len(models) or None,
        "python": platform.python_version(),
        "numpy": np.__version__,
    }


def compare(paths: Sequence[Path]) -> None:
    """Minimum times of two saved runs, and the second as a share of the first."""
    runs = [json.loads(path.read_text()) for path in paths]
    for before, after in zip(*(run["full"] for run in runs), strict=False):
        for kind in ("cold", "steady"):
            old, new = before[kind]["min_ms"], after[kind]["min_ms"]
            print(f"{before['robots']:>7}{before['area_m2']:>5.0f} m2 {kind:<8}{old:>9.1f}{new:>9.1f}{new / old:>8.0%}")
    for before, after in zip(*(run["partial"] for run in runs), strict=False):
        old, new = before["min_ms"], after["min_ms"]
        print(f"{before['floor']:<8}{before['changed']:>6} changed  {old:>9.2f}{new:>9.2f}{new / old:>8.0%}")


def run(repeats: int, pairs: int) -> Row:
    here = machine()
    print(f"{here['cpu']}, {here['cores']} cores, Python {here['python']}, numpy {here['numpy']}; one core is used")
    print(f"\nclearance {CLEARANCE_M} m, horizon {HORIZON_S:.0f} s; times are min/median/max\n{FULL_HEAD}")
    full = full_passes(repeats)
    growth = {f"{area_m2:.0f}": exponent(full, area_m2, "cold") for area_m2 in (25.0, 8.0)}
    print("\ngrowth exponent, 1,000 to 10,000 robots: " + ", ".join(f"{v:.2f} at {k} m2" for k, v in growth.items()))
    memory = peak_mb(10_000)
    print(f"peak memory of a process that sweeps 10,000 robots: {memory:.0f} MB\n\nof 10,000 robots, so many changed")
    partial = partial_passes(repeats, 10_000)
    print(f"\n{PEER_FLOOR[0]:,} robots on {PEER_FLOOR[1]:.0f} m2 each, clearance 0")
    peers = beside_peers(repeats, pairs)
    return {"machine": here, "full": full, "growth": growth, "peak_mb": memory, "partial": partial, "peers": peers}


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.sweep", description=__doc__)
    parser.add_argument("--json", type=Path, default=Path("build/sweep.json"), help="where to save the run")
    parser.add_argument("--compare", type=Path, nargs=2, metavar="RUN", help="two saved runs, side by side")
    parser.add_argument("--repeats", type=int, default=7, help="passes of each kind")
    parser.add_argument("--pairs", type=int, default=5_000, help="pairs held against the oracle")
    chosen = parser.parse_args(arguments)
    if chosen.compare:
        compare(chosen.compare)
        return
    found = run(chosen.repeats, chosen.pairs)
    chosen.json.parent.mkdir(parents=True, exist_ok=True)
    chosen.json.write_text(json.dumps(found, indent=1))
    print(f"\nsaved to {chosen.json}")


if __name__ == "__main__":
    main()
