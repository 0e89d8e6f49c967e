"""What the broad phase leaves out could not have met: crowds against the oracle, which looks at every pair."""

from itertools import combinations

import numpy as np
import pytest
from numpy.random import Generator

from deconflict.sweeper import PairConflicts, Sweeper
from ingest.seam import Forecasts
from tests.deconflict.made_encounters import HORIZON_S, NOW_S, moved, robot, wanderer
from tests.oracle import truth

CLEARANCE_M = 0.25


def swept(crowd: Forecasts, *, batch: int | None = None) -> PairConflicts:
    """All at once, or in steps of `batch` robots, each held against those that are there already."""
    sweeper = Sweeper(clearance_m=CLEARANCE_M)
    keys = [f"{row:04d}" for row in range(len(crowd))]
    for begin in range(0, len(crowd), batch or len(crowd)):
        rows = range(begin, min(begin + (batch or len(crowd)), len(crowd)))
        sweeper.update([keys[row] for row in rows], crowd.take(rows))
        found = sweeper.step(NOW_S)
    return found


def spread(rng: Generator, robots: int, side_m: float) -> list[Forecasts]:
    return [wanderer(rng, spread_m=side_m / 2) for _ in range(robots)]


def mixed_sizes(rng: Generator) -> list[Forecasts]:
    """Tow trains, fast ones and many small robots, some of which turn."""
    trains = [
        robot([0, 11], rng.uniform(-20, 20, 2), rng.uniform(-20, 20, 2), rng.uniform(-3, 3), (14, 1)) for _ in range(4)
    ]
    fast = [wanderer(rng, speed_mps=16, spread_m=20) for _ in range(6)]
    return [*trains, *fast, *spread(rng, 45, 40)]


def in_a_row(rng: Generator) -> list[Forecasts]:
    """All in one aisle, far from the origin, all edges alike."""
    return [moved(robot([0], [1.3 * i], [0], 0, (1, 1)), -9_000.0, 9_000.0) for i in range(40)] + [
        moved(wanderer(rng, spread_m=3), -8_980.0, 9_000.0) for _ in range(10)
    ]


def on_many_floors(rng: Generator) -> list[Forecasts]:
    """Some change floor within the horizon, even within a second."""
    found = []
    for one in spread(rng, 55, 12):
        t = one.t_s - NOW_S
        floor = rng.integers(-1, 3, len(t)) if rng.random() < 0.5 else np.full(len(t), rng.integers(0, 3))
        found.append(robot(t, one.x_m, one.y_m, one.yaw_rad, (one.length_m[0], one.width_m[0]), floor=floor))
    return found


CROWDS = {
    "dense": lambda rng: spread(rng, 45, 8),
    "sparse": lambda rng: spread(rng, 60, 60),
    "mixed_sizes": mixed_sizes,
    "in_a_row": in_a_row,
    "on_many_floors": on_many_floors,
}


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("kind", CROWDS)
def test_no_pair_that_meets_is_left_out(kind: str, seed: int) -> None:
    crowd = Forecasts.joined(CROWDS[kind](np.random.default_rng([seed, 51])))
    pairs = list(combinations(range(len(crowd)), 2))
    closest = truth(crowd, pairs, now_s=NOW_S, horizon_s=HORIZON_S, clearance_m=CLEARANCE_M).closest_m
    meet = {pair for pair, apart in zip(pairs, closest.tolist(), strict=True) if apart <= CLEARANCE_M}
    nearly = {pair for pair, apart in zip(pairs, closest.tolist(), strict=True) if apart <= CLEARANCE_M + 1e-3}
    assert 3 < len(meet) < 0.9 * len(pairs)
    for batch in (None, 1, 17):
        found = {(int(a), int(b)) for a, b in swept(crowd, batch=batch).pairs}
        assert meet <= found <= nearly


def test_it_does_leave_out_nearly_everything_on_a_wide_floor() -> None:
    crowd = Forecasts.joined(spread(np.random.default_rng(52), 300, 120))
    all_pairs = len(crowd) * (len(crowd) - 1) / 2
    assert swept(crowd).segment_pairs < all_pairs * HORIZON_S / 50


def test_robots_of_other_floors_are_not_looked_at() -> None:
    crowd = Forecasts.joined(robot([0], [0], [0], 0, (1, 1), floor=floor) for floor in range(50))
    assert swept(crowd).segment_pairs == 0


def test_one_that_changed_is_not_held_against_all_over_again() -> None:
    rng = np.random.default_rng(53)
    crowd = Forecasts.joined(spread(rng, 300, 120))
    sweeper = Sweeper(clearance_m=CLEARANCE_M)
    sweeper.update([str(row) for row in range(300)], crowd)
    first = sweeper.step(NOW_S)
    sweeper.update(["7"], crowd.one(7))
    assert sweeper.step(NOW_S).segment_pairs < first.segment_pairs / 10
