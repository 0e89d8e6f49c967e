"""Who was near whom, against every two robots at every sample by themselves."""

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest

from deconflict.sweep.geometry.envelope_distances import gap
from ingest.batch import Forecasts
from ingest.shapes import Shape, shapes_of
from metrics.truth.recorded_motion import BODIES, RecordedMotion, SampledMotion
from metrics.truth.separations import TooManyPairsError, separations

SAMPLES = 50


def wandering(robots: int, size_m: float) -> SampledMotion:
    """Robots that go about a square on two floors, each away for some time."""
    rng = np.random.default_rng(robots)
    x_m, y_m = rng.uniform(0, size_m, (2, robots, 1)) + np.cumsum(rng.normal(scale=0.1, size=(2, robots, SAMPLES)), 2)
    floor = np.repeat(rng.integers(0, 2, (robots, 1)).astype(float), SAMPLES, 1)
    floor[:, 40:] = np.nan
    half_m, since_s = rng.uniform(0.2, 0.8, (2, robots, SAMPLES)), rng.uniform(0, 9, (robots, SAMPLES))
    for row in range(robots):
        for column in (x_m, y_m, floor, since_s, *half_m):
            column[row, row % 30 : row % 30 + 10] = np.nan
    bottom_m = np.repeat(rng.choice([-np.inf, 0.0, 1.0, 5.0], (robots, 1)), SAMPLES, 1)
    height_m = np.stack([bottom_m, np.where(bottom_m == -np.inf, np.inf, bottom_m + 2)])
    yaw_rad = rng.normal(size=(robots, SAMPLES))
    return SampledMotion(700, np.arange(robots) * 2 * BODIES, x_m, y_m, yaw_rad, half_m, height_m, floor, since_s)


@pytest.mark.parametrize(("robots", "size_m", "fewest"), [(0, 1.0, 0), (1, 1.0, 0), (40, 6.0, 1000), (25, 60.0, 1)])
def test_separations_equal_those_of_every_pair_alone(robots: int, size_m: float, fewest: int) -> None:
    there, expected = wandering(robots, size_m), []
    radius_m = np.hypot(*there.half_m)
    for a, b in combinations(range(robots), 2):
        for at in range(SAMPLES):
            dx, dy = there.x_m[b, at] - there.x_m[a, at], there.y_m[b, at] - there.y_m[a, at]
            apart_m, reach_m = np.hypot(dx, dy), radius_m[a, at] + radius_m[b, at]
            (bottom_a, bottom_b), (top_a, top_b) = there.height_m[:, [a, b], at]
            beside = bottom_a <= top_b and bottom_b <= top_a
            if beside and apart_m <= reach_m + 0.6 and there.floor[a, at] == there.floor[b, at]:
                yaw_rad = there.yaw_rad[a, at, None], there.yaw_rad[b, at, None]
                half_m = there.half_m[:, a, at, None], there.half_m[:, b, at, None]
                gap_m = gap(dx[None], dy[None], *yaw_rad, *half_m)[0]
                since_s = max(there.since_s[a, at], there.since_s[b, at])
                expected.append((2 * a, 2 * b, 700 + at, gap_m, since_s, apart_m / reach_m))
    found = separations(there, 0.6)
    assert len(expected) >= fewest
    np.testing.assert_allclose(np.array(found).T, np.reshape(expected, (-1, 6)))


def test_more_pairs_than_may_be_looked_at_are_an_error() -> None:
    there = wandering(40, 6.0)
    near = len(separations(there, 0.6).a)
    assert len(separations(there, 0.6, most=near).a) == near
    with pytest.raises(TooManyPairsError):
        separations(there, 0.6, most=near - 1)


def test_round_robots_are_as_far_apart_as_their_circles() -> None:
    reported = [Shape.circle(1.0), Shape.circle(1.0), None]
    motion = RecordedMotion()
    for t_s in (700.0, 701.0):
        ones, place_m, floor = np.ones(3), np.array([0.0, 1.0, -1.0]), np.zeros(3, np.int64)
        sizes = ones, ones, -np.inf * ones, np.inf * ones
        report = Forecasts(np.arange(4), t_s * ones, place_m, place_m, 0 * ones, floor, *sizes)
        motion.report(["a", "b", "c"], replace(report, shapes=shapes_of(reported)))
    found = separations(motion.sampled(7000, 10, 0.1), 1.0)
    pairs = zip(found.a.tolist(), found.b.tolist(), strict=True)
    apart_m = dict(zip(pairs, found.separation_m.tolist(), strict=True))
    assert apart_m[0, 1] == pytest.approx(2**0.5 - 1.0)
    assert apart_m[0, 2] == pytest.approx(0.5**0.5 - 0.5)
