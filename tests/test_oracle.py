"""The oracle where the answer is known without it."""

from math import hypot, inf, pi, sqrt

import numpy as np
import pytest

from ingest.batch import Forecasts
from tests.helpers.made_encounters import HORIZON_S, NOW_S, encounters, robot, rows_of_pairs
from tests.helpers.oracle import (
    RESOLUTION_M,
    Truth,
    distance_at,
    distances_at,
    polygon_distance,
    rectangle_distance,
    truth,
)


def of(*robots: Forecasts, clearance_m: float) -> Truth:
    return truth(Forecasts.joined(robots), [(0, 1)], now_s=NOW_S, horizon_s=HORIZON_S, clearance_m=clearance_m)


@pytest.mark.parametrize(
    ("pose", "size", "distance_m"),
    [
        ((3.0, 0.0, 0.0), (2.0, 1.0), 1.0),
        ((3.0, 0.0, pi / 2), (2.0, 1.0), 1.5),
        ((3.0, 3.0, 0.0), (2.0, 2.0), hypot(1.0, 1.0)),
        ((3.0, 0.0, pi / 4), (2.0, 2.0), 2.0 - sqrt(2.0)),
        ((0.0, 0.0, pi / 2), (4.0, 0.01), 0.0),
    ],
)
def test_distance_of_two_rectangles(
    pose: tuple[float, float, float], size: tuple[float, float], distance_m: float
) -> None:
    far = np.array([[10_000.0, -10_000.0, 0.0]])
    b = far + np.array([pose])
    for measured in (rectangle_distance, polygon_distance):
        assert measured(far, b, np.array([[2.0, 2.0]]), np.array([size]))[0] == pytest.approx(distance_m)


def test_rectangles_are_as_far_apart_as_their_polygons() -> None:
    """Of any size, some thin; a fifth side by side in parallel, overlapping or apart by 1e-1 to 1e-12 m."""
    n, beside, rng = 100_000, 20_000, np.random.default_rng(5)
    size_a, size_b = (rng.uniform(0.3, 4.0, (n, 2)) * np.where(rng.random((n, 2)) < 0.05, 0.01, 1.0) for _ in "ab")
    a, b = (rng.uniform([-2.0, -2.0, -9.0], [2.0, 2.0, 9.0], (n, 3)) for _ in "ab")
    gap = rng.choice([-1, 1], beside) * 10.0 ** -rng.uniform(1, 12, beside)
    across = (size_a[:beside, 1] + size_b[:beside, 1]) / 2 + gap
    yaw = a[:beside, 2]
    b[:beside] = a[:beside] + np.stack([-np.sin(yaw) * across, np.cos(yaw) * across, 0 * yaw], -1)
    true = polygon_distance(a, b, size_a, size_b)
    assert 0.3 < np.mean(true > 0) < 0.7
    np.testing.assert_allclose(rectangle_distance(a, b, size_a, size_b), true, atol=1e-12)


def test_one_passes_another_side_by_side() -> None:
    passing = robot([0, 8], [-4, 4], [1.5, 1.5], 0, (1, 1))
    true = of(robot([0], [0], [0], 0, (1, 1)), passing, clearance_m=0.5 + 1e-6)
    assert true.closest_m[0] == pytest.approx(0.5)
    assert true.touch_s[0] == pytest.approx(3.0, abs=2e-3)


def test_one_drives_into_another() -> None:
    true = of(robot([0], [0], [0], 0, (1, 1)), robot([0, 10], [5, -5], [0, 0], 0, (1, 1)), clearance_m=0.0)
    assert (true.closest_m[0], true.touch_s[0]) == (0.0, pytest.approx(4.0, abs=1e-5))


def test_a_corner_that_turns_by_touches_for_an_instant() -> None:
    t = np.arange(0.0, 11.0)
    spins = robot(t, 0 * t, 0 * t, 0.3 * t, (2, 2))
    wall = robot([0], [sqrt(2.0) + 0.5 - 1e-7], [0], 0, (1, 4))
    true = of(spins, wall, clearance_m=0.0)
    assert (true.closest_m[0], true.touch_s[0]) == (0.0, pytest.approx(pi / 4 / 0.3, abs=1e-2))


def test_robots_that_share_no_floor_never_meet() -> None:
    true = of(robot([0], [0], [0], 0, (1, 1)), robot([0], [0], [0], 0, (1, 1), floor=1), clearance_m=1.0)
    assert (true.closest_m[0], true.touch_s[0]) == (inf, inf)


@pytest.mark.parametrize("family", ["random", "spinning", "floor_changes", "late_or_early"])
def test_dense_samples_find_nothing_closer_or_sooner(family: str) -> None:
    count, clearance_m = 12, 0.25
    forecasts = encounters(family, count, 4, clearance_m)
    true = truth(forecasts, rows_of_pairs(count), now_s=NOW_S, horizon_s=HORIZON_S, clearance_m=clearance_m)
    times = np.arange(0, HORIZON_S, 0.01)
    for number, pair in enumerate(rows_of_pairs(count)):
        sampled = distances_at(forecasts, [pair], NOW_S + times[None])[0]
        deep = np.flatnonzero(sampled <= clearance_m - RESOLUTION_M)
        if sampled.min() <= clearance_m:
            assert true.closest_m[number] <= sampled.min() + RESOLUTION_M
        if len(deep):
            assert true.touch_s[number] <= times[deep[0]] + 1e-6
        if np.isfinite(true.touch_s[number]):
            assert distance_at(forecasts, pair, NOW_S + true.touch_s[number]) <= clearance_m + 1e-5
