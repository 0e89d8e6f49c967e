"""No pair of boxes that overlap is lost, whichever way they are looked for, and most pairs are."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from deconflict import motion
from deconflict.broadphase import ABSENT, FEW, LONG, MIXED, MOST_SHARE, Boxes, swept_boxes
from deconflict.sweeper import Pool
from ingest.seam import Forecasts, Ints
from tests.deconflict.made_encounters import NOW_S, wanderer

SLABS = 4


def random_boxes(seed: int, robots: int, *, floors: int = 2, longest_m: float = 5.0, spread_m: float = 40.0) -> Boxes:
    """Boxes of which some are absent, some of an old slab, some on several floors, a few very long or far away."""
    rng = np.random.default_rng(seed)
    boxes = Boxes(SLABS)
    boxes.grow(robots)
    boxes.slab[:] = np.arange(SLABS)[:, None] + SLABS * (rng.random((SLABS, robots)) < 0.9)
    boxes.floor[:] = rng.choice(
        [ABSENT, MIXED, *range(floors)], (SLABS, robots), p=[0.1, 0.05, *[0.85 / floors] * floors]
    )
    west, south = rng.uniform(-spread_m, spread_m, (2, SLABS, robots))
    long, far = rng.random((2, SLABS, robots)) < 0.02
    width, height = rng.uniform(0, longest_m, (2, SLABS, robots)) * np.where(long, 10 * LONG, 1)
    west = np.where(far, west * 1e6, west)
    boxes.sides[:] = west, west + width, south, south + height
    return boxes


def by_force(boxes: Boxes, changed: Ints) -> set[tuple[int, int, int]]:
    """All pairs of ring row, lower and higher slot, tried one by one."""
    found = set()
    for ring in range(SLABS):
        slab, floor, (west, east, south, north) = boxes.slab[ring], boxes.floor[ring], boxes.sides[:, ring]
        overlap = (west[:, None] <= east) & (west <= east[:, None])
        overlap &= (south[:, None] <= north) & (south <= north[:, None])
        overlap &= (slab[:, None] == slab) & (floor[:, None] != ABSENT) & (floor != ABSENT)
        overlap &= (floor[:, None] == floor) | (floor[:, None] == MIXED) | (floor == MIXED)
        overlap &= np.isin(np.arange(len(slab)), changed)[:, None] | np.isin(np.arange(len(slab)), changed)
        found |= {(ring, a, b) for a, b in np.argwhere(np.triu(overlap, 1)).tolist()}
    return found


def found_by(boxes: Boxes, changed: Ints) -> list[tuple[int, int, int]]:
    pairs = boxes.pairs(changed, np.arange(SLABS))
    columns = pairs.ring, np.minimum(pairs.a, pairs.b), np.maximum(pairs.a, pairs.b)
    return list(zip(*(column.tolist() for column in columns), strict=True))


def check(boxes: Boxes, changed: Ints) -> None:
    found = found_by(boxes, changed)
    assert len(set(found)) == len(found)
    assert set(found) == by_force(boxes, changed)


@pytest.mark.parametrize("share", [0.0, 0.01, 0.5 * MOST_SHARE, MOST_SHARE, 1.0])
@pytest.mark.parametrize("robots", [150, 600])
def test_finds_each_pair_that_brute_force_finds_once(robots: int, share: float) -> None:
    boxes = random_boxes(robots, robots)
    changed = np.random.default_rng(0).permutation(robots)[: int(share * robots)]
    check(boxes, changed)


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


def test_a_swept_box_holds_all_corners_of_its_segment() -> None:
    rng = np.random.default_rng(1)
    forecasts = Forecasts.joined(wanderer(rng) for _ in range(100))
    half = np.stack([forecasts.length_m, forecasts.width_m]) / 2
    cut = motion.segments(forecasts, int(NOW_S), 10)
    west, east, south, north = swept_boxes(cut, half, 0.0)
    margins = []
    for share in np.linspace(0, 1, 9):
        into = share * (cut.t1 - cut.t0)
        yaw = cut.yaw + cut.turn * into
        for along, across in ((1, 1), (1, -1), (-1, 1), (-1, -1)):
            u, w = along * half[0, cut.robot], across * half[1, cut.robot]
            x = cut.x + cut.vx * into + u * np.cos(yaw) - w * np.sin(yaw)
            y = cut.y + cut.vy * into + u * np.sin(yaw) + w * np.cos(yaw)
            margins.append(np.minimum.reduce([x - west, east - x, y - south, north - y]))
    nearest = np.min(margins, axis=0)
    assert nearest.min() > -1e-9
    assert np.median(nearest[cut.turn == 0]) < 1e-9


def test_boxes_are_put_where_their_segments_are() -> None:
    rng = np.random.default_rng(2)
    forecasts = Forecasts.joined(wanderer(rng, knots=12) for _ in range(30))
    half = np.stack([forecasts.length_m, forecasts.width_m]) / 2
    first_slab = int(NOW_S)
    cut = motion.segments(forecasts, first_slab, SLABS)
    pool, boxes = Pool(), Boxes(SLABS)
    boxes.grow(30)
    sides = swept_boxes(cut, half, 0.1)
    boxes.put(cut, sides, pool.append(cut, sides))
    for slab in range(first_slab, first_slab + SLABS):
        ring = slab % SLABS
        for slot in range(30):
            rows = boxes.first[ring, slot] + np.arange(boxes.count[ring, slot])
            held = np.flatnonzero((cut.robot == slot) & (cut.slab == slab))
            np.testing.assert_array_equal(rows, held)
            west, east, south, north = boxes.sides[:, ring, slot]
            assert (west, south) == tuple(pool.sides[[0, 2]][:, held].min(axis=1))
            assert (east, north) == tuple(pool.sides[[1, 3]][:, held].max(axis=1))
    boxes.clear(np.arange(30), np.array([first_slab % SLABS]))
    assert (boxes.floor == ABSENT).sum() == 30
