"""The time of a sweep, compared with other engines: `python -m benchmarks.sweep [--json FILE] [--repeats N]`.

Times are processor times of one core. The two times of a ratio are from the same run. `--compare A.json B.json`
compares two saved runs.
"""

import argparse
import json
import os
import platform
import subprocess
import sys
from collections.abc import Callable, Sequence
from importlib.metadata import version
from math import log10
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from time import process_time
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from benchmarks import shapes
from benchmarks.floors import NOW_S, World, crowd, lanes
from benchmarks.peers import HORIZON_S, PEERS, Peer
from deconflict.sweep.contact_intervals import PairConflicts
from deconflict.sweep.incremental import Sweeper
from deconflict.sweep.sweep_once import sweep
from ingest.batch import Ints
from tests.helpers.oracle import truth

CLEARANCE_M = 0.3
FLOORS = [(robots, area_m2) for area_m2 in (25.0, 8.0) for robots in (1_000, 3_000, 10_000)]
PEER_FLOOR = (3_000, 25.0)
PEER_GOALS = {"commonroad-drivability-checker": 1 / 8, "bluesky-simulator": 1 / 25}
"""A full pass should take at most this share of theirs."""
FLOOR_KINDS = {"crowd": crowd, "lanes": lanes}
OWN = "this sweep"
CHANGED = (0, 1, 10, 100, 1_000)
Row = dict[str, Any]


def keys_of(world: World) -> list[str]:
    return [f"robot-{row:05d}" for row in range(len(world.x))]


class Running:
    """A floor that is swept while the time advances."""

    def __init__(self, world: World, clearance_m: float = CLEARANCE_M) -> None:
        self.world, self.keys = world, keys_of(world)
        self.sweeper = Sweeper(clearance_m=clearance_m, horizon_s=HORIZON_S)
        self.last: PairConflicts | None = None

    def pass_ms(self, at_s: float, rows: Ints | None = None) -> float:
        """Milliseconds of one core to add the reports of `rows` (by default all) at `at_s`, and to sweep."""
        forecasts = self.world.forecasts(at_s)
        keys = self.keys if rows is None else [self.keys[row] for row in rows.tolist()]
        part = forecasts if rows is None else forecasts.take(rows)
        begin = process_time()
        if keys:
            self.sweeper.update(keys, part)
        self.last = self.sweeper.find_conflicts(NOW_S + at_s)
        return 1e3 * (process_time() - begin)


def timed(call: Callable[[], float], times: int) -> Row:
    return summary([call() for _ in range(times)])


def summary(taken: Sequence[float]) -> Row:
    return {"min_ms": min(taken), "median_ms": median(taken), "max_ms": max(taken)}


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
    """Passes in which a few of many robots change, while the time advances. Full passes in between for comparison."""
    rows = []
    for name, made in FLOOR_KINDS.items():
        world = made(robots, 25.0)
        running, at_s = Running(world), 0.05
        running.pass_ms(0.0)
        took: dict[int, list[float]] = {changed: [] for changed in CHANGED}
        full_ms, listed = [], 0
        turns = 3 * repeats
        moved_on_s = 0.9 / (turns * len(CHANGED))
        for turn in range(turns):
            full_ms.append(Running(world).pass_ms(at_s))
            for changed in CHANGED:
                chosen = np.random.default_rng([turn, changed]).choice(robots, changed, replace=False)
                at_s += moved_on_s
                took[changed].append(running.pass_ms(at_s, chosen))
            listed = len(running.last.pairs) if running.last else 0
        for changed in CHANGED:
            row = {"floor": name, "robots": robots, "changed": changed, "conflicts": listed}
            rows.append(row | summary(took[changed]) | {"full_ms": median(full_ms)})
            print(_partial_line(rows[-1]), flush=True)
    return rows


def _partial_line(row: Row) -> str:
    share = row["median_ms"] / row["full_ms"]
    return (
        f"{row['floor']:<8}{row['robots']:>7}{row['changed']:>9}{row['min_ms']:>10.2f}{row['median_ms']:>10.2f}"
        f"{share:>10.1%} of a full pass{row['conflicts']:>10} conflicts"
    )


def growth(area_m2: float, repeats: int) -> float:
    """The growth exponent of a full pass: the median over ten floors of 1,000 robots and one of 10,000 in turn.

    The ten floors differ, because caches and branch predictors would adapt to one floor that is swept repeatedly, but
    a floor ten times as large does not fit into them.
    """
    small, large = [crowd(1_000, area_m2, seed=seed) for seed in range(1, 11)], crowd(10_000, area_m2)
    ratios = []
    for _ in range(repeats):
        ten_ms = sum(Running(world).pass_ms(0.0) for world in small)
        ratios.append(Running(large).pass_ms(0.0) / ten_ms)
    return 1 + log10(median(ratios))


def footprint(robots: int) -> Row:
    """Peak memory of a process that sweeps `robots` robots, and import times with and without compiled kernels
    on disk."""
    footprint_of(0)
    kept = footprint_of(robots)
    with TemporaryDirectory() as empty:
        anew = footprint_of(0, NUMBA_CACHE_DIR=empty)
    return kept | {"compile_s": anew["import_s"]}


def footprint_of(robots: int, **environment: str) -> Row:
    command = [sys.executable, "-m", "benchmarks.footprint", str(robots)]
    done = subprocess.run(command, check=True, capture_output=True, text=True, env=os.environ | environment)
    return json.loads(done.stdout)


def beside_peers(repeats: int, pairs: int) -> list[Row]:
    """The same floor and question, with clearance 0, for every installed engine."""
    world = crowd(*PEER_FLOOR)
    own_ms = timed(lambda: Running(world, 0.0).pass_ms(0.0), 2 * repeats)["min_ms"]
    forecasts = world.forecasts(0.0)
    candidates = near_pairs(world, pairs)
    true = truth(forecasts, candidates, now_s=NOW_S, horizon_s=HORIZON_S, clearance_m=0.0).closest_m
    found = sweep(forecasts, now_s=NOW_S, horizon_s=HORIZON_S, clearance_m=0.0)
    own = {tuple(pair) for pair in found.pairs.tolist()}
    rows = [{"engine": OWN, "pass_ms": own_ms} | _wrong_answers([pair in own for pair in candidates], true)]
    print(_peer_line(rows[0], own_ms), flush=True)
    for peer in PEERS:
        rows.append(_measured(peer, world, candidates, true, repeats))
        print(_peer_line(rows[-1], own_ms), flush=True)
    return rows


def near_pairs(world: World, count: int) -> list[tuple[int, int]]:
    """The first `count` pairs in random order whose paths within the horizon overlap, each enclosed in a circle."""
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
    begin = process_time()
    answers = list(peer.touches(world, pairs))
    return row | {"us_a_pair": 1e6 * (process_time() - begin) / len(pairs)} | _wrong_answers(answers, true)


def _wrong_answers(answers: list[bool], closest_m: Any) -> Row:
    """Counts of wrong answers. Only pairs that overlap, or stay apart by more than a millimetre, count."""
    touch, apart, touches = closest_m <= 0, closest_m > 1e-3, np.array(answers)
    return {"pairs": len(answers), "touching": int(touch.sum()), "missed": int((touch & ~touches).sum())} | {
        "false": int((apart & touches).sum())
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
        "numba": version("numba"),
    }


def compare(paths: Sequence[Path]) -> None:
    """Print the minimum times of two saved runs, and the second as a share of the first."""
    runs = [json.loads(path.read_text()) for path in paths]
    for before, after in zip(*(run["full"] for run in runs), strict=False):
        for kind in ("cold", "steady"):
            old, new = before[kind]["min_ms"], after[kind]["min_ms"]
            print(f"{before['robots']:>7}{before['area_m2']:>5.0f} m2 {kind:<8}{old:>9.1f}{new:>9.1f}{new / old:>8.0%}")
    for before, after in zip(*(run["partial"] for run in runs), strict=False):
        old, new = before["min_ms"], after["min_ms"]
        print(f"{before['floor']:<8}{before['changed']:>6} changed  {old:>9.2f}{new:>9.2f}{new / old:>8.0%}")


def goals(found: Row) -> list[Row]:
    """The goals, and what this run reached. `share` is at most 1 if the goal is met."""
    full = {(row["robots"], row["area_m2"]): row for row in found["full"]}
    changed = {(row["floor"], row["changed"]): row["median_ms"] / row["full_ms"] for row in found["partial"]}
    peers = {row["engine"]: row["pass_ms"] for row in found["peers"] if "pass_ms" in row}
    own_ms = peers.pop(OWN)
    reached = [
        (f"full pass of 3,000 robots, of {name}'s", own_ms / ms, PEER_GOALS[name])
        for name, ms in peers.items()
        if name in PEER_GOALS
    ]
    reached += [
        ("steady pass of 10,000 robots on 25 m2 each, s", full[10_000, 25.0]["steady"]["median_ms"] / 1e3, 0.2),
        ("the same on 8 m2 each, s", full[10_000, 8.0]["steady"]["median_ms"] / 1e3, 0.5),
        *((f"growth exponent at {area} m2", value, 1.1) for area, value in found["growth"].items()),
        ("peak memory at 10,000 robots, MB", found["footprint"]["peak_mb"], 200.0),
        *((f"1,000 of 10,000 changed, {floor}, of a full pass", changed[floor, 1_000], 0.25) for floor in FLOOR_KINDS),
    ]
    return [{"goal": name, "reached": value, "most": most, "share": value / most} for name, value, most in reached]


def run(repeats: int, pairs: int) -> Row:
    found: Row = {"machine": (here := machine())}
    print(
        f"{here['cpu']}, {here['cores']} cores, Python {here['python']}, numpy {here['numpy']}, numba {here['numba']}"
    )
    print(f"\nclearance {CLEARANCE_M} m, horizon {HORIZON_S:.0f} s; ms of one core, min/median/max\n{FULL_HEAD}")
    found["full"] = full_passes(repeats)
    found["growth"] = {f"{area_m2:.0f}": growth(area_m2, repeats) for area_m2 in (25.0, 8.0)}
    grown = ", ".join(f"{power:.2f} at {area} m2" for area, power in found["growth"].items())
    print(f"\ngrowth exponent, ten floors of 1,000 robots to one of 10,000: {grown}")
    found["footprint"] = taken = footprint(10_000)
    print(
        f"a process that sweeps 10,000 robots: {taken['peak_mb']:.0f} MB at most, "
        f"{taken['idle_mb']:.0f} before it sweeps, "
        f"{taken['numpy_mb']:.0f} with numpy alone\n"
        f"import: {taken['import_s']:.1f} s with kernels from disk, {taken['compile_s']:.1f} s to compile them anew\n"
        "\nof 10,000 robots, so many changed"
    )
    found["partial"] = partial_passes(repeats, 10_000)
    print(f"\n{PEER_FLOOR[0]:,} robots on {PEER_FLOOR[1]:.0f} m2 each, clearance 0")
    found["peers"] = beside_peers(repeats, pairs)
    found["shapes"] = shapes.run(repeats, pairs)
    found["goals"] = goals(found)
    print("\ngoals, and what this run reached")
    for goal in found["goals"]:
        verdict = "met" if goal["share"] <= 1 else "not met"
        print(
            f"{goal['goal']:<66}{goal['reached']:>9.3f} of at most {goal['most']:<8.3f}{goal['share']:>6.0%} {verdict}"
        )
    return found


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.sweep", description=__doc__)
    parser.add_argument("--json", type=Path, default=Path("build/sweep.json"), help="where to save the run")
    parser.add_argument("--compare", type=Path, nargs=2, metavar="RUN", help="compare two saved runs")
    parser.add_argument("--repeats", type=int, default=7, help="passes of each kind")
    parser.add_argument("--pairs", type=int, default=5_000, help="pairs that are compared with the oracle")
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
