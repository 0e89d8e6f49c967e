import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from deconflict.sweep.geometry.envelope_distances import gap, signed_gap
from ingest.batch import Floats
from tests.helpers.oracle import polygon_distance

RNG = np.random.default_rng(11)
N = 20_000


def placed(b: Floats, yaw_a: Floats, half_a: Floats, half_b: Floats) -> tuple[Floats, Floats]:
    """The gap of rectangles with B at `b` (n, 3) from A, and the true distance."""
    a = np.stack([np.zeros(len(b)), np.zeros(len(b)), yaw_a], -1)
    found = gap(b[:, 0], b[:, 1], yaw_a, b[:, 2], half_a, half_b)
    return found, polygon_distance(a, b, 2 * half_a.T, 2 * half_b.T)


def test_the_gap_is_the_distance_of_the_polygons() -> None:
    b = RNG.uniform([-3, -3, -9], [3, 3, 9], (N, 3))
    found, true = placed(b, RNG.uniform(-9, 9, N), RNG.uniform(0.005, 1.5, (2, N)), RNG.uniform(0.005, 1.5, (2, N)))
    assert 0.2 < np.mean(true > 0) < 0.9
    np.testing.assert_allclose(found, true, atol=1e-12)


def test_parallel_rectangles_and_bars_that_cross() -> None:
    quarter = np.pi / 2
    b = np.array([[2.5, 0, 0], [0, 3.25, quarter], [2, 0, 0], [0, 0, quarter], [0, 0, 0]])
    values = np.array([[1.0, 1.0, 1.0, 2.0, 1.0], [1.0, 1.0, 1.0, 0.01, 0.5]])
    found, _ = placed(b, np.zeros(5), values, values)
    np.testing.assert_allclose(found, [0.5, 1.25, 0, 0, 0], atol=1e-12)


@given(st.integers(-6, 0), st.floats(-10, 10), st.floats(0.05, 3))
def test_a_gap_of_any_smallness_is_told_from_contact(exponent: int, yaw: float, width: float) -> None:
    apart = 10.0**exponent
    at = width / 2 + 0.5 + apart
    b = np.array([[at * np.cos(yaw), at * np.sin(yaw), yaw]])
    half = np.array([[width / 2], [1.0]]), np.array([[0.5], [1.0]])
    found, _ = placed(b, np.array([yaw]), *half)
    assert found[0] == pytest.approx(apart, abs=1e-12)


def test_where_they_overlap_the_gap_is_how_far_one_must_move() -> None:
    zero, turned = np.zeros((1, 3)), np.array([[0.0, np.pi / 2, 0.0]])
    half = np.array([[0.5], [0.25]])
    dx = np.array([[0.9, 0.0, 1.2]])
    assert signed_gap(dx, zero, zero, turned, half, half)[0] == pytest.approx([-0.1, -0.75, 0.2])


def test_constant_headings_do_not_change_the_gap() -> None:
    (dx, dy), half = RNG.uniform(-2, 2, (2, N // 4, 4)), RNG.uniform(0.005, 1.5, (2, 2, N // 4))
    yaw_a, yaw_b = RNG.choice([-1.2, 0.3, 2.0], (2, N // 4, 4))
    together = signed_gap(dx, dy, yaw_a, yaw_b, *half)
    looks = (slice(at, at + 1) for at in range(4))
    apart = [signed_gap(*(column[:, look] for column in (dx, dy, yaw_a, yaw_b)), *half) for look in looks]
    assert together.tolist() == np.concatenate(apart, axis=1).tolist()
