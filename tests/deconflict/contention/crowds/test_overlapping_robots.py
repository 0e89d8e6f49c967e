"""Which robots can't all be where they report from: by construction, and against a slow and simple computation."""

from math import hypot, inf, pi

import numpy as np
import pytest

from deconflict.contention.crowds.crowds import COVERED, MOST_COMPARED, overlapping
from deconflict.sweep.pair_choice import LATER_S
from ingest.batch import Bools, Floats, Ints

ONE_VENDOR, AT_ONCE_S = np.zeros(400, np.int64), np.zeros(400)


def at(x_m: Floats, y_m: Floats) -> Floats:
    """Robots on floor 0 whose heights are not known."""
    n = len(x_m)
    return np.column_stack([x_m, y_m, np.zeros(n), np.full(n, -inf), np.full(n, inf)])


def found(places: Floats, length_m: float = 1.0, width_m: float = 0.5, vendor: Ints = ONE_VENDOR) -> Bools:
    sizes_m = np.tile([length_m, width_m], (len(places), 1))
    return overlapping(np.arange(len(places)), places, sizes_m, vendor[: len(places)], AT_ONCE_S[: len(places)])


@pytest.mark.parametrize("there", [(0.0, 0.0), (-7.99, 2.01), (1e6, -1e6)])
def test_robots_that_report_from_one_spot_overlap(there: tuple[float, float]) -> None:
    spot = at(np.full(20, there[0]), np.full(20, there[1]))
    assert found(spot).all()
    assert not found(spot[:3]).any()


@pytest.mark.parametrize("length_m", [0.4, 1.0, 1.3, 1.75, 3.0, 9.0])
@pytest.mark.parametrize("width_m", [0.3, 0.8])
def test_robots_parked_side_by_side_without_a_gap_do_not_overlap(length_m: float, width_m: float) -> None:
    x, y = np.meshgrid(np.arange(10) * length_m, np.arange(40) * width_m)
    parked = at(x.ravel(), y.ravel())
    assert not found(parked, length_m, width_m).any()
    noisy = parked + np.random.default_rng(1).normal(0, 0.05, parked.shape) * [1, 1, 0, 0, 0]
    assert not found(noisy, length_m, width_m).any()


def test_robots_of_other_vendors_floors_and_heights_are_not_compared() -> None:
    spot, vendors = at(np.zeros(20), np.zeros(20)), np.arange(20)
    assert not found(spot, vendor=vendors).any()
    floors = spot.copy()
    floors[:, 2] = vendors
    assert not found(floors).any()
    racked = spot.copy()
    racked[:, 3], racked[:, 4] = vendors, vendors + 0.9
    assert not found(racked).any()
    nowhere = spot.copy()
    nowhere[:10, 2], nowhere[10:, :3] = -1, np.nan
    assert not found(nowhere).any()


def test_a_large_robot_does_not_count_as_many() -> None:
    sizes_m = np.array([[0.4, 0.4], [8.0, 8.0]])
    assert not overlapping(np.arange(2), at(np.zeros(2), np.zeros(2)), sizes_m, ONE_VENDOR[:2], AT_ONCE_S[:2]).any()


def test_large_robots_overlap_by_the_same_rule() -> None:
    """Cells far around them are looked at, and those that happen to share a place in memory do not count."""
    large = at(*np.random.default_rng(3).uniform(0, 47, (2, 300)))
    assert found(large, 30.0, 30.0).all()
    x, y = np.meshgrid(np.arange(10) * 30.0, np.arange(10) * 30.0)
    assert not found(at(x.ravel(), y.ravel()), 30.0, 30.0).any()


def test_those_that_come_later_make_nobody_overlap_who_was_there() -> None:
    spot, sizes_m = at(np.zeros(20), np.zeros(20)), np.tile([1.0, 0.5], (20, 1))
    came_s = np.where(np.arange(20) < 2, 0.0, LATER_S + 1)
    overlaps = overlapping(np.arange(20), spot, sizes_m, ONE_VENDOR[:20], came_s)
    assert not overlaps[:2].any()
    assert overlaps[2:].all()


def test_many_that_came_later_hide_no_crowd() -> None:
    n = MOST_COMPARED + 50
    came_s = np.where(np.arange(n) >= n - 20, 0.0, LATER_S + 1)
    overlaps = overlapping(
        np.arange(n), at(np.zeros(n), np.zeros(n)), np.tile([1.0, 0.5], (n, 1)), ONE_VENDOR[:n], came_s
    )
    assert overlaps.all()


def test_bodies_smaller_than_any_robot_overlap_where_robots_have_no_room() -> None:
    x, y = np.meshgrid(np.arange(10) * 0.1, np.arange(10) * 0.1)
    assert found(at(x.ravel(), y.ravel()), 0.05, 0.05).all()


def brute_force(places: Floats, sizes_m: Floats, vendor: Ints) -> list[bool]:
    overlaps = []
    for i, (x, y, floor, bottom, top) in enumerate(places.tolist()):
        radius, area = hypot(*sizes_m[i]) / 2, 0.0
        for j, (other_x, other_y, other_floor, other_bottom, other_top) in enumerate(places.tolist()):
            is_level = floor == other_floor and bottom <= other_top and other_bottom <= top
            if is_level and vendor[i] == vendor[j] and hypot(other_x - x, other_y - y) <= radius:
                area += min(sizes_m[j, 0] * sizes_m[j, 1], pi * radius**2)
        overlaps.append(area > COVERED * pi * radius**2)
    return overlaps


@pytest.mark.parametrize("seed", range(6))
def test_the_cells_find_what_a_look_at_all_pairs_finds(seed: int) -> None:
    rng, n = np.random.default_rng(seed), 300
    places = at(*rng.normal(0, 1.5, (2, n)))
    places[:, 2] = rng.integers(-1, 2, n)
    places[:, 3] = rng.integers(0, 3, n)
    places[:, 4] = places[:, 3] + rng.choice([0.5, 5.0], n)
    sizes_m, vendor = rng.uniform(0.3, rng.choice([1.0, 5.0]), (n, 2)), rng.integers(0, 3, n)
    expected = np.array(brute_force(places, sizes_m, vendor)) & (places[:, 2] >= 0)
    result = overlapping(np.arange(n), places, sizes_m, vendor, AT_ONCE_S[:n])
    assert result.tolist() == expected.tolist()
    some = rng.permutation(n)[:50]
    assert overlapping(some, places, sizes_m, vendor, AT_ONCE_S[:n]).tolist() == expected[some].tolist()
    assert 0 < result.sum() < n
