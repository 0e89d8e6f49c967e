"""The broad phase leaves out no pair that meets: boxes against brute force, crowds against the oracle."""

from collections import Counter
from itertools import combinations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.random import Generator

from deconflict.sweep.broadphase import (
    ABSENT,
    FEW,
    MIXED,
    MOST_CROWDED,
    MOST_FOUND,
    PAIR,
    ROOMY,
    SweptBoxes,
    sorted_pairs,
)
from deconflict.sweep.contact_intervals import PairConflicts
from deconflict.sweep.geometry.knots import ROBOT
from deconflict.sweep.incremental import Sweeper
from deconflict.sweep.robot_slots import RobotSlots
from deconflict.sweep.slot_table import SlotTable
from ingest.batch import Bools, Floats, Forecasts, Ints
from tests.helpers.made_encounters import HORIZON_S, NOW_S, moved, robot, wanderer
from tests.helpers.oracle import Track, truth

CLEARANCE_M = 0.25
SLABS = 4


def swept(crowd: Forecasts, *, batch: int | None = None) -> PairConflicts:
    """Sweep all at once, or in steps of `batch` robots, each against the robots already on the floor."""
    sweeper = Sweeper(clearance_m=CLEARANCE_M)
    keys = [f"{row:04d}" for row in range(len(crowd))]
    for begin in range(0, len(crowd), batch or len(crowd)):
        rows = range(begin, min(begin + (batch or len(crowd)), len(crowd)))
        sweeper.update([keys[row] for row in rows], crowd.take(rows))
        found = sweeper.find_conflicts(NOW_S)
    return found


def spread(rng: Generator, robots: int, side_m: float) -> list[Forecasts]:
    return [wanderer(rng, spread_m=side_m / 2) for _ in range(robots)]


def mixed_sizes(rng: Generator) -> list[Forecasts]:
    """Tow trains, fast robots and many small ones, some of which turn."""
    trains = [
        robot([0, 11], rng.uniform(-20, 20, 2), rng.uniform(-20, 20, 2), rng.uniform(-3, 3), (14, 1)) for _ in range(4)
    ]
    fast = [wanderer(rng, speed_mps=16, spread_m=20) for _ in range(6)]
    return [*trains, *fast, *spread(rng, 28, 40)]


def in_a_row(rng: Generator) -> list[Forecasts]:
    """All robots in one aisle, far from the origin, with equal edges."""
    return [moved(robot([0], [1.3 * i], [0], 0, (1, 1)), -9_000.0, 9_000.0) for i in range(40)] + [
        moved(wanderer(rng, spread_m=3), -8_980.0, 9_000.0) for _ in range(10)
    ]


def on_many_floors(rng: Generator) -> list[Forecasts]:
    """Some change floor within the horizon, even within a second."""
    found = []
    for forecasts in spread(rng, 36, 12):
        t = forecasts.t_s - NOW_S
        floor = rng.integers(-1, 3, len(t)) if rng.random() < 0.5 else np.full(len(t), rng.integers(0, 3))
        found.append(
            robot(
                t,
                forecasts.x_m,
                forecasts.y_m,
                forecasts.yaw_rad,
                (forecasts.length_m[0], forecasts.width_m[0]),
                floor=floor,
            )
        )
    return found


CROWDS = {
    "dense": lambda rng: spread(rng, 30, 8),
    "sparse": lambda rng: spread(rng, 40, 48),
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


def test_nearly_all_pairs_of_a_wide_floor_are_left_out() -> None:
    crowd = Forecasts.joined(spread(np.random.default_rng(52), 300, 120))
    all_pairs = len(crowd) * (len(crowd) - 1) / 2
    assert swept(crowd).segment_pairs < all_pairs * HORIZON_S / 50


def test_robots_of_other_floors_are_not_compared() -> None:
    crowd = Forecasts.joined(robot([0], [0], [0], 0, (1, 1), floor=floor) for floor in range(50))
    assert swept(crowd).segment_pairs == 0


def test_one_changed_robot_does_not_compare_all_others_again() -> None:
    rng = np.random.default_rng(53)
    crowd = Forecasts.joined(spread(rng, 300, 120))
    sweeper = Sweeper(clearance_m=CLEARANCE_M)
    sweeper.update([str(row) for row in range(300)], crowd)
    first = sweeper.find_conflicts(NOW_S)
    sweeper.update(["7"], crowd.single(7))
    assert sweeper.find_conflicts(NOW_S).segment_pairs < first.segment_pairs / 10


def random_boxes(
    seed: int, robots: int, *, floors: int = 2, longest_m: float = 5.0, spread_m: float = 40.0
) -> SweptBoxes:
    """Boxes of which some are absent, some of an old slab, some on several floors, a few very long or far away."""
    rng = np.random.default_rng(seed)
    boxes = SweptBoxes(SLABS)
    boxes.grow(robots)
    made = boxes.by_ring
    made["slab"] = np.arange(SLABS)[:, None] + SLABS * (rng.random((SLABS, robots)) < 0.9)
    made["floor"] = rng.choice(
        [ABSENT, MIXED, *range(floors)], (SLABS, robots), p=[0.1, 0.05, *[0.85 / floors] * floors]
    )
    west, south = rng.uniform(-spread_m, spread_m, (2, SLABS, robots))
    long, far = rng.random((2, SLABS, robots)) < 0.02
    width, height = rng.uniform(0, longest_m, (2, SLABS, robots)) * np.where(long, 40 * ROOMY, 1)
    west = np.where(far, west * 1e6, west)
    made["west"], made["east"], made["south"], made["north"] = west, west + width, south, south + height
    sides(boxes)[:] = reaches_of(boxes)
    return boxes


def sides(boxes: SweptBoxes) -> Floats:
    """(slots, 4) of the reaches that are kept."""
    return boxes.reaches.view(np.float64).reshape(-1, 4)


def reaches_of(boxes: SweptBoxes) -> Floats:
    """(slots, 4) the extent of all boxes that are not absent."""
    there = boxes.by_ring["floor"] != ABSENT
    low, high = (
        [np.where(there, boxes.by_ring[side], none) for side in sides]
        for none, sides in ((np.inf, ("west", "south")), (-np.inf, ("east", "north")))
    )
    (west, south), (east, north) = (side.min(axis=0) for side in low), (side.max(axis=0) for side in high)
    return np.stack([west, east, south, north], axis=1)


def by_force(boxes: SweptBoxes, changed: Ints) -> set[tuple[int, int, int]]:
    """All pairs (ring row, lower slot, higher slot) that overlap, tried one by one."""
    found = set()
    for ring in range(SLABS):
        row = boxes.by_ring[ring]
        slab, floor, west, east, south, north = (row[n] for n in ("slab", "floor", "west", "east", "south", "north"))
        overlap = (west[:, None] <= east) & (west <= east[:, None])
        overlap &= (south[:, None] <= north) & (south <= north[:, None])
        overlap &= (slab[:, None] == slab) & (floor[:, None] != ABSENT) & (floor != ABSENT)
        overlap &= (floor[:, None] == floor) | (floor[:, None] == MIXED) | (floor == MIXED)
        overlap &= np.isin(np.arange(len(slab)), changed)[:, None] | np.isin(np.arange(len(slab)), changed)
        found |= {(ring, a, b) for a, b in np.argwhere(np.triu(overlap, 1)).tolist()}
    return found


def found_by(boxes: SweptBoxes, changed: Ints, is_crowded: Bools | None = None) -> list[tuple[int, int, int]]:
    none = np.zeros(len(boxes.reaches), bool)
    pairs = boxes.overlapping_pairs(changed, np.arange(SLABS), none if is_crowded is None else is_crowded, none.copy())
    columns = pairs["ring"], np.minimum(pairs["a"], pairs["b"]), np.maximum(pairs["a"], pairs["b"])
    return list(zip(*(column.tolist() for column in columns), strict=True))


def check(boxes: SweptBoxes, changed: Ints) -> None:
    found = found_by(boxes, changed)
    assert len(set(found)) == len(found)
    assert set(found) == by_force(boxes, changed)


@pytest.mark.parametrize("share", [0.0, 0.01, 0.2, 0.5, 1.0])
@pytest.mark.parametrize("robots", [150, 1500])
def test_finds_each_pair_that_brute_force_finds_once(robots: int, share: float) -> None:
    boxes = random_boxes(robots, robots, longest_m=1.0, spread_m=3.0 * np.sqrt(robots))
    changed = np.random.default_rng(0).permutation(robots)[: int(share * robots)]
    check(boxes, changed)


@pytest.mark.parametrize("share", [0.04, 0.1, 0.5, 1.0])
def test_a_box_is_paired_with_some_of_a_crowd_once_and_with_all_others(share: float) -> None:
    robots, rng = 500, np.random.default_rng(7)
    boxes, is_crowded = random_boxes(6, robots, longest_m=2.0, spread_m=35.0), rng.random(robots) < 0.4
    changed = rng.permutation(robots)[: int(share * robots)]
    found, every = found_by(boxes, changed, is_crowded), by_force(boxes, changed)
    assert len(set(found)) == len(found)
    assert set(found) <= every
    alone = {(ring, a, b) for ring, a, b in every if not (is_crowded[a] or is_crowded[b])}
    assert {(ring, a, b) for ring, a, b in found if not (is_crowded[a] or is_crowded[b])} == alone
    assert not any(is_crowded[a] and is_crowded[b] for _, a, b in found)
    for slot in np.intersect1d(changed, np.flatnonzero(~is_crowded)).tolist():
        of_crowd, paired = (
            Counter(ring for ring, a, b in pairs if slot in (a, b) and is_crowded[a] != is_crowded[b])
            for pairs in (every, found)
        )
        if len(changed) > FEW:
            assert all(paired[ring] >= min(of_crowd[ring], MOST_CROWDED) for ring in of_crowd)
        assert bool(paired) is bool(of_crowd)


@pytest.mark.parametrize("changed", [FEW, 600])
def test_of_too_many_boxes_above_each_other_some_are_paired_and_the_others_marked(changed: int) -> None:
    robots = MOST_FOUND + 400
    boxes = random_boxes(5, robots, spread_m=0.0)
    is_crowded, is_cut = np.arange(robots) >= robots - 50, np.zeros(robots, bool)
    pairs = boxes.overlapping_pairs(np.arange(changed), np.arange(SLABS), is_crowded, is_cut)
    assert is_cut[:changed].any()
    assert not is_cut[changed:].any()
    in_ring, count = np.unique(np.column_stack([pairs["ring"], pairs["a"]]), axis=0, return_counts=True)
    assert count.max() <= MOST_FOUND + MOST_CROWDED
    assert len(in_ring) > SLABS * FEW / 2
    assert not (is_crowded[pairs["a"]] & is_crowded[pairs["b"]]).any()
    assert (is_crowded[pairs["a"]] | is_crowded[pairs["b"]]).any()


@settings(max_examples=60)
@given(
    seed=st.integers(0, 2**32),
    robots=st.integers(1, 80),
    changed=st.integers(0, 80),
    longest_m=st.sampled_from([0.0, 0.5, 5.0, 500.0]),
    floors=st.integers(1, 5),
)
def test_finds_each_pair_wherever_hypothesis_looks(
    seed: int, robots: int, changed: int, longest_m: float, floors: int
) -> None:
    boxes = random_boxes(seed, robots, floors=floors, longest_m=longest_m)
    check(boxes, np.random.default_rng(seed).permutation(robots)[:changed])


def test_discards_almost_all_pairs_of_a_large_floor() -> None:
    boxes = random_boxes(9, 1000, floors=1, longest_m=3.0, spread_m=60.0)
    for changed in (np.arange(1000), np.arange(FEW + 1), np.arange(FEW)):
        possible = SLABS * len(changed) * 1000
        assert 0 < len(found_by(boxes, changed)) < possible / 20


def covered(robots: int, seed: int, grow_m: float) -> tuple[Forecasts, SlotTable, SweptBoxes]:
    rng = np.random.default_rng(seed)
    forecasts = Forecasts.joined(wanderer(rng, knots=12) for _ in range(robots))
    table, boxes = SlotTable(RobotSlots()), SweptBoxes(SLABS)
    slots = table.replace_forecasts([str(row) for row in range(robots)], forecasts)
    assert slots is not None
    boxes.grow(robots)
    boxes.cover(slots, table.robots, table.knots, int(NOW_S), SLABS, grow_m)
    return forecasts, table, boxes


def test_a_swept_box_holds_all_corners_of_its_robot_and_is_no_larger_than_it_must_be() -> None:
    forecasts, _, boxes = covered(60, 1, 0.1)
    nearest = []
    for slot in range(60):
        courses, track = forecasts.single(slot), Track(forecasts, slot)
        half_l, half_w = courses.length_m[0] / 2, courses.width_m[0] / 2
        for ring, slab in enumerate(range(int(NOW_S), int(NOW_S) + SLABS), int(NOW_S) % SLABS):
            box = boxes.by_ring[ring % SLABS, slot]
            t = np.linspace(slab, slab + 1, 33)
            on_floor, pose, _ = track.between(t[:-1], t[1:])
            x, y, yaw = pose[on_floor >= 0].T
            if box["floor"] == ABSENT:
                assert not len(x)
                continue
            corners = np.array([(half_l, half_w), (half_l, -half_w), (-half_l, half_w), (-half_l, -half_w)])[:, :, None]
            px = x + corners[:, 0] * np.cos(yaw) - corners[:, 1] * np.sin(yaw)
            py = y + corners[:, 0] * np.sin(yaw) + corners[:, 1] * np.cos(yaw)
            margins = [px - box["west"], box["east"] - px, py - box["south"], box["north"] - py]
            nearest.append(float(np.min(margins, initial=np.inf)))
    assert len(nearest) > 60
    assert min(nearest) > 0.1 - 1e-6
    assert min(nearest) < 0.1 + 1e-3
    assert np.median(nearest) < 0.2


def test_a_box_has_the_knot_that_holds_when_it_begins() -> None:
    forecasts, table, boxes = covered(30, 2, 0.1)
    for ring, slot in np.argwhere(boxes.by_ring["floor"] != ABSENT).tolist():
        box, t_s = boxes.by_ring[ring, slot], forecasts.single(slot).t_s
        assert box["knot"] == max(np.searchsorted(t_s, box["slab"], "right") - 1, 0)
    boxes.clear(np.arange(30))
    assert (boxes.by_ring["floor"] == ABSENT).all()
    assert len(table.slots) == 30


def test_a_reach_holds_all_boxes_of_its_robot_and_no_more_until_old_ones_are_replaced() -> None:
    _, table, boxes = covered(30, 3, 0.1)
    np.testing.assert_array_equal(sides(boxes), reaches_of(boxes))
    for first_slab in range(int(NOW_S) + SLABS, int(NOW_S) + 3 * SLABS):
        boxes.cover(np.arange(30), table.robots, table.knots, first_slab, 1, 0.1)
        now = reaches_of(boxes)
        assert (np.isinf(now) | (sides(boxes) * (1, -1, 1, -1) <= now * (1, -1, 1, -1))).all()
    boxes.grow(40)
    boxes.clear(np.arange(10))
    assert (sides(boxes)[[*range(10), *range(30, 40)]] == (np.inf, -np.inf, np.inf, -np.inf)).all()
    assert np.isfinite(sides(boxes)[10:30]).all()


def test_pairs_are_put_in_order_without_those_above_one_another() -> None:
    rng, robots = np.random.default_rng(71), np.zeros(40, ROBOT)
    robots["bottom"] = rng.choice([0.0, 1.0, 2.0], 40)
    robots["top"] = robots["bottom"] + rng.choice([0.5, 1.0], 40)
    ranks, pairs = rng.permutation(40), np.zeros(3000, PAIR)
    pairs["ring"], pairs["a"] = np.sort(rng.integers(0, 12, 3000)), rng.integers(0, 40, 3000)
    pairs["b"] = (pairs["a"] + rng.integers(1, 40, 3000)) % 40
    rank = dict(enumerate(ranks.tolist()))
    expected = []
    for ring, *both in pairs.tolist():
        a, b = sorted(both, key=rank.__getitem__)
        if max(robots["bottom"][[a, b]]) <= min(robots["top"][[a, b]]):
            expected.append((ring, a, b))
    expected.sort(key=lambda pair: (rank[pair[1]], rank[pair[2]]))
    none = np.zeros(len(robots), bool)
    assert sorted_pairs(pairs, ranks, robots, none, none).tolist() == expected
    assert 1000 < len(expected) < 2500
