"""What shapes cost and save: the floor of `benchmarks.sweep` with rectangles, with mixed shapes and with trains.

Part of `python -m benchmarks.sweep`. Alone: `python -m benchmarks.shapes [--repeats N] [--pairs N]`.
"""

import argparse
from collections.abc import Callable, Sequence
from dataclasses import replace
from math import cos, pi
from statistics import median
from time import process_time
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from benchmarks.floors import NOW_S, World, crowd
from deconflict.sweep.contact_intervals import PairConflicts
from deconflict.sweep.incremental import Sweeper
from deconflict.sweep.shapes.shape_table import SHAPES
from deconflict.sweep.sweep_once import sweep
from ingest.batch import Floats, Forecasts
from ingest.shapes import Shape, Trailer, shapes_of
from tests.helpers.shape_oracle import approach

ROBOTS, AREA_M2, CLEARANCE_M, HORIZON_S = 3_000, 25.0, 0.3, 10.0
TRAILERS = 4
TRAILER = Trailer(1.0, 0.7, 1.4)
SURE_M = 1e-3
Row = dict[str, Any]


def mixed_shapes(world: World) -> list[Shape | None]:
    """One third each of rectangles, circles and polygons of eight corners, about as large as the rectangles."""
    sizes = np.column_stack([world.length, world.width]).tolist()
    return [_shape(row, length, width) for row, (length, width) in enumerate(sizes)]


def _shape(row: int, length: float, width: float) -> Shape | None:
    if row % 3 == 0:
        return None
    if row % 3 == 1:
        return Shape.circle((length + width) / 2)
    angle = np.arange(8) * pi / 4 + pi / 8
    return Shape.polygon(
        zip(length / 2 * np.cos(angle) / cos(pi / 8), width / 2 * np.sin(angle) / cos(pi / 8), strict=True)
    )


def with_trains(shapes: Sequence[Shape | None], yaw_rad: Floats) -> list[Shape | None]:
    """A tenth of the robots pull trailers, which are straight behind them."""
    trains = list(shapes)
    for row in range(0, len(trains), 10):
        own = trains[row] or Shape(())
        trains[row] = own._replace(trailers=(TRAILER._replace(yaw_rad=float(yaw_rad[row])),) * TRAILERS)
    return trains


class ShapedFloor:
    """A floor of shapes that is swept while the time advances."""

    def __init__(self, world: World, kind: str) -> None:
        self.world, self.kind = world, kind
        self._keys = [f"robot-{row:05d}" for row in range(len(world.x))]
        self._shapes = mixed_shapes(world)
        self.bodies = len(world.x) + (len(world.x) // 10 * TRAILERS if kind == "trains" else 0)
        self.sweeper = self._new_sweeper()
        self.found: PairConflicts | None = None

    def _new_sweeper(self) -> Sweeper:
        return Sweeper(clearance_m=CLEARANCE_M, horizon_s=HORIZON_S)

    def forecasts(self, at_s: float) -> Forecasts:
        made = self.world.forecasts(at_s)
        if self.kind == "rectangles":
            return made
        yaw_rad = made.yaw_rad[made.start[:-1]]
        shapes = self._shapes if self.kind == "mixed" else with_trains(self._shapes, yaw_rad)
        return replace(made, shapes=shapes_of(shapes))

    def pass_ms(self, at_s: float, *, anew: bool = False) -> float:
        """Milliseconds of one core to add all reports at `at_s`, and to sweep; `anew` without what is known."""
        forecasts = self.forecasts(at_s)
        if anew:
            self.sweeper = self._new_sweeper()
        begin = process_time()
        self.sweeper.update(self._keys, forecasts)
        self.found = self.sweeper.find_conflicts(NOW_S + at_s)
        return 1e3 * (process_time() - begin)


def costs(repeats: int) -> list[Row]:
    """Full and steady passes of each floor in turns."""
    world, bodies = crowd(ROBOTS, AREA_M2), ROBOTS + ROBOTS // 10 * TRAILERS
    floors = [ShapedFloor(world, "rectangles"), ShapedFloor(world, "mixed")]
    floors += [ShapedFloor(crowd(bodies, ROBOTS * AREA_M2 / bodies), "rectangles"), ShapedFloor(world, "trains")]
    for floor in floors:
        floor.pass_ms(0.0)
    full: list[list[float]] = [[] for _ in floors]
    for _ in range(repeats):
        for times, floor in zip(full, floors, strict=True):
            times.append(floor.pass_ms(0.0, anew=True))
    rows = [_cost(floor, times) for floor, times in zip(floors, full, strict=True)]
    for second in range(1, repeats + 1):
        for row, floor in zip(rows, floors, strict=True):
            row.setdefault("steady", []).append(floor.pass_ms(float(second)))
    for row in rows:
        row["steady_ms"] = median(row.pop("steady"))
    for row in rows:
        (alike,) = (each for each in rows if each["floor"] == "rectangles" and each["bodies"] == row["bodies"])
        row["times"] = row["full_ms"] / alike["full_ms"]
        print(_cost_line(row), flush=True)
    return rows


def _cost(floor: ShapedFloor, full_ms: list[float]) -> Row:
    found = floor.found
    assert found is not None  # noqa: S101
    numbers = np.zeros(len(floor.world.x), np.int64) + SHAPES.numbers(floor.forecasts(0.0))
    is_plain = SHAPES.is_plain[numbers]
    rows = [(int(a[-5:]), int(b[-5:])) for a, b in found.pairs]
    by_fcl = sum(not (is_plain[a] and is_plain[b]) for a, b in rows)
    counts = {"conflicts": len(rows), "by_fcl": by_fcl / max(len(rows), 1), "fcl_calls": found.fcl_calls}
    return {"floor": floor.kind, "bodies": floor.bodies, "full_ms": median(full_ms)} | counts


COST_HEAD = (
    f"{'floor':<12}{'bodies':>7}{'full, ms':>10}{'steady, ms':>11}{'times':>10}"
    f"{'conflicts':>10}{'by FCL':>8}{'calls':>7}"
)


def _cost_line(row: Row) -> str:
    return (
        f"{row['floor']:<12}{row['bodies']:>7}{row['full_ms']:>10.1f}{row['steady_ms']:>11.1f}{row['times']:>9.1f}x"
        f"{row['conflicts']:>10}{row['by_fcl']:>8.0%}{row['fcl_calls']:>7}"
    )


def answers(pairs: int) -> Row:
    """The sweep and the sweep of bounding rectangles against the oracle, on near pairs of mixed floors."""
    row: Row = {"pairs": 0, "touching": 0, "missed": 0, "false": 0, "false_of_rectangles": 0}
    seed = 1
    while row["pairs"] < pairs:
        floor = ShapedFloor(crowd(ROBOTS, AREA_M2, seed=seed), "mixed")
        for name, count in _checked(floor.forecasts(0.0), pairs - row["pairs"], seed).items():
            row[name] += count
        seed += 1
    print(
        f"{row['pairs']} pairs, {row['touching']} come within the clearance: {row['missed']} missed, {row['false']} "
        f"false; bounding rectangles: {row['false_of_rectangles']} false"
    )
    return row


def _checked(forecasts: Forecasts, pairs: int, seed: int) -> Row:
    limits = {"now_s": NOW_S, "horizon_s": HORIZON_S, "clearance_m": CLEARANCE_M}
    look: Callable[[Forecasts], set[tuple[int, ...]]] = lambda robots: {  # noqa: E731
        tuple(pair) for pair in sweep(robots, **limits).pairs.tolist()
    }
    found, of_rectangles = look(forecasts), look(_bounding(forecasts))
    near = _near(forecasts, pairs, seed)
    row: Row = {"pairs": len(near), "touching": 0, "missed": 0, "false": 0, "false_of_rectangles": 0}
    for pair in near:
        closest_m = approach(forecasts, pair, **limits).closest_m
        row["touching"] += closest_m <= CLEARANCE_M
        row["missed"] += closest_m <= CLEARANCE_M and pair not in found
        row["false"] += closest_m > CLEARANCE_M + SURE_M and pair in found
        row["false_of_rectangles"] += closest_m > CLEARANCE_M + SURE_M and pair in of_rectangles
    return row


def _bounding(forecasts: Forecasts) -> Forecasts:
    sizes = [forecasts.shape(row) for row in range(len(forecasts))]
    length_m, width_m = (
        np.array([shape.size_m[side] if shape else own for shape, own in zip(sizes, column.tolist(), strict=True)])
        for side, column in enumerate((forecasts.length_m, forecasts.width_m))
    )
    return replace(forecasts, length_m=length_m, width_m=width_m, shapes=shapes_of([None] * len(forecasts)))


def _near(forecasts: Forecasts, count: int, seed: int) -> list[tuple[int, int]]:
    """Pairs whose robots are within 2 m of each other at some second."""
    knots = np.diff(forecasts.start)[0]
    places = np.stack([forecasts.x_m, forecasts.y_m], -1).reshape(-1, knots, 2)
    near = {tuple(sorted(pair)) for at in range(knots) for pair in cKDTree(places[:, at]).query_pairs(2.0)}
    chosen = np.random.default_rng(seed).permutation(np.array(sorted(near)))[:count]
    return [(int(a), int(b)) for a, b in chosen]


def run(repeats: int, pairs: int) -> Row:
    print(f"\n{ROBOTS:,} robots on {AREA_M2:.0f} m2 each, clearance {CLEARANCE_M} m; times: of as many rectangles")
    print(COST_HEAD)
    return {"costs": costs(repeats), "answers": answers(pairs)}


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.shapes", description=__doc__)
    parser.add_argument("--repeats", type=int, default=7, help="passes of each kind")
    parser.add_argument("--pairs", type=int, default=5_000, help="pairs that are compared with the oracle")
    chosen = parser.parse_args()
    run(chosen.repeats, chosen.pairs)


if __name__ == "__main__":
    main()
