"""The protective stop: what is in whose way."""

import numpy as np
import pytest
import shapely

from deconflict.contention.robots.lookahead import corners
from deconflict.simulation.driving.protection import NOBODY, free_ways, gaps, may_sidestep
from deconflict.simulation.participants import ALDER
from tests.deconflict.simulation.driving.made_traffic import Way, traffic


def test_gaps_are_negative_for_overlaps_and_at_most_the_distance() -> None:
    rng = np.random.default_rng(5)
    n = 2000
    a, b = (np.stack([*rng.uniform(-2, 2, (2, n)), rng.uniform(-4, 4, n)]) for _ in range(2))
    size_a, size_b = (tuple(rng.uniform(0.3, 2.0, (2, n))) for _ in range(2))
    found = gaps(a, b, (size_a[0], size_a[1]), (size_b[0], size_b[1]))
    shapes_a, shapes_b = (shapely.polygons(corners(*pose, *size)) for pose, size in ((a, size_a), (b, size_b)))
    distance_m = shapely.distance(shapes_a, shapes_b)
    assert np.array_equal(found > 0, distance_m > 0)
    assert np.all(found <= distance_m + 1e-9)
    assert 100 < np.sum(found > 0) < n - 100


AHEAD: list[Way] = [((0.0, 0.0), (20.0, 0.0)), ((2.5, 0.0), (2.5, 9.0))]
CROSSING: list[Way] = [((0.0, 0.0), (20.0, 0.0)), ((10.0, -10.0), (10.0, 10.0))]


def test_a_robot_senses_another_that_stands_on_its_path() -> None:
    free = free_ways(traffic(AHEAD, [0.0, 0.0], [1.0, 0.0], [0, 1]))
    gap_m = 2.5 - ALDER.body.length_m / 2 - ALDER.body.width_m / 2
    assert free.sensed.tolist() == [1, NOBODY]
    assert gap_m - 0.3 <= free.sensed_m[0] <= gap_m
    assert free.sensed_m[1] == np.inf
    assert free.known.tolist() == [NOBODY, NOBODY]


def test_a_robot_of_the_own_fleet_is_known_and_not_sensed() -> None:
    free = free_ways(traffic(AHEAD, [0.0, 0.0], [1.0, 0.0], [0, 0]))
    assert free.known.tolist() == [1, NOBODY]
    assert free.sensed.tolist() == [NOBODY, NOBODY]


def test_robots_that_pass_in_their_lanes_do_not_block_each_other() -> None:
    passing: list[Way] = [((0.0, -0.7), (20.0, -0.7)), ((20.0, 0.7), (0.0, 0.7))]
    free = free_ways(traffic(passing, [9.0, 10.5], [1.4, 1.4], [0, 1]))
    assert free.sensed_m.tolist() == [np.inf, np.inf]


def test_the_higher_rank_of_two_crossing_robots_of_a_fleet_keeps_clear() -> None:
    free = free_ways(traffic(CROSSING, [7.8, 8.2], [1.4, 1.2], [0, 0]))
    assert free.known.tolist() == [NOBODY, 0]
    assert free.known_m[1] < 1.5


def test_crossing_robots_of_two_fleets_do_not_know_each_others_paths() -> None:
    free = free_ways(traffic(CROSSING, [7.0, 6.0], [1.4, 1.2], [0, 1]))
    assert free.sensed.tolist() == [NOBODY, NOBODY]


def test_a_field_keeps_clear_of_the_other_robots_braking_path() -> None:
    """The other is 2 m from the robot's way, and needs 0.7 m to stop."""
    coming, standing = (traffic(CROSSING, [8.6, 7.8], [1.4, mps], [0, 1]) for mps in (1.4, 0.0))
    coming.speed_mps[1] = 2.2
    assert free_ways(coming).sensed[0] == 1
    assert free_ways(standing).sensed[0] == NOBODY


def test_a_robot_may_move_away_from_one_that_is_too_near() -> None:
    near: list[Way] = [((0.0, 0.0), (20.0, 0.0)), ((-1.01, 0.0), (-9.0, 0.0))]
    free = free_ways(traffic(near, [0.0, 0.0], [0.0, 0.0], [0, 1]))
    assert free.sensed_m.tolist() == [np.inf, np.inf]


@pytest.mark.parametrize(("aside_m", "may"), [(0.3, True), (0.45, False)])
def test_no_robot_moves_sideways_into_another(aside_m: float, may: bool) -> None:
    beside: list[Way] = [((0.0, 0.0), (20.0, 0.0)), ((0.0, 1.2), (20.0, 1.2))]
    seen = traffic(beside, [5.0, 5.0], [0.5, 0.0], [0, 1])
    assert may_sidestep(seen, np.array([aside_m, 0.0])).tolist() == [may, True]


@pytest.mark.parametrize("floors", [[0, 0], [0, 1]])
def test_robots_on_different_floors_do_not_affect_each_other(floors: list[int]) -> None:
    seen = traffic(AHEAD, [0.0, 0.0], [1.0, 0.0], [0, 1])
    seen.floor[:] = floors
    assert np.isfinite(free_ways(seen).sensed_m[0]) == (floors == [0, 0])
