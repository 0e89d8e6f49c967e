from math import degrees, radians

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from ingest.batch import Floats
from ingest.frames.transforms import Adjusted, Affine
from tests.ingest.frames.made_maps import HALL, affines, jolts, seeds, similarity

TURNED = similarity(radians(30), 1.0, (100.0, 50.0))
steps = st.tuples(st.floats(-15, 55), st.floats(-15, 40))


def adjusted(seed: int, size_m: float = 0.2, base: Affine = TURNED) -> tuple[Adjusted, Floats]:
    jolted = jolts(len(HALL), size_m, seed)
    return Adjusted(base, HALL, jolted), jolted


def differences(transform: Adjusted | Affine, point: Floats) -> Floats:
    """The linear part at a point by central differences, (2, 2)."""
    h = 1e-5
    ends = transform(np.vstack([point + h * np.eye(2), point - h * np.eye(2)]))
    return (ends[:2] - ends[2:]).T / (2 * h)


def linear_at(transform: Adjusted, point: Floats) -> Floats:
    """The linear part at a point as the map states it, (2, 2)."""
    return np.array(transform.at(*point.tolist())[2:]).reshape(2, 2)


def smooth_at(transform: Adjusted, point: Floats) -> bool:
    """Whether the linear part is the same all round a point, so that no edge passes through."""
    round_it = point + 1e-4 * np.array([[1, 0], [-1, 0], [0, 1], [0, -1], [0, 0]])
    linear = np.array([linear_at(transform, each) for each in round_it])
    return bool(np.ptp(linear, axis=0).max() < 1e-4)


@given(seeds, affines)
def test_adjust_passes_exactly_through_its_points(seed: int, base: Affine) -> None:
    transform, jolted = adjusted(seed, base=base)
    np.testing.assert_allclose(transform(HALL), base(HALL) + jolted, rtol=0, atol=1e-9)


@given(seeds)
def test_adjust_is_continuous_across_the_edges_of_its_triangles_and_its_hull(seed: int) -> None:
    transform, _ = adjusted(seed)
    walk = np.linspace([-20.0, -9.0], [57.0, 33.0], 4001)
    leaps = np.diff(transform(walk), axis=0) - np.diff(TURNED(walk), axis=0)
    longest = float(np.hypot(*(walk[1] - walk[0])))
    assert np.abs(leaps).max() < 0.2 * longest


@given(seeds, steps)
def test_the_linear_part_is_the_derivative_of_the_map(seed: int, place: tuple[float, float]) -> None:
    transform, _ = adjusted(seed)
    point = np.array(place)
    assume(smooth_at(transform, point))
    local = linear_at(transform, point)
    np.testing.assert_allclose(local, differences(transform, point), atol=1e-7)


def test_beyond_the_hull_the_correction_is_that_of_its_nearest_point() -> None:
    transform, jolted = adjusted(3)
    beyond_corner = HALL[0] - 30.0
    beyond_side = (HALL[0] + HALL[1]) / 2 + 7.0 * np.array([1.0, -40.0]) / np.hypot(1, 40)
    placed = transform(np.array([beyond_corner, beyond_side])) - TURNED(np.array([beyond_corner, beyond_side]))
    np.testing.assert_allclose(placed, [jolted[0], (jolted[0] + jolted[1]) / 2], atol=1e-9)


def test_three_points_along_a_wall_do_not_give_wrong_headings() -> None:
    wall = np.array([[0.0, 0.0], [10.0, 0.002], [20.0, 0.0], [10.0, 15.0]])
    jolted = np.array([[0.03, -0.02], [-0.03, 0.03], [0.02, 0.01], [0.0, 0.0]])
    transform = Adjusted(TURNED, wall, jolted)
    share, _ = transform.bend()
    assert share < 0.02
    np.testing.assert_allclose(transform(wall), TURNED(wall) + jolted, atol=1e-9)
    beside_the_wall = linear_at(transform, np.array([9.0, 0.001]))
    assert np.abs(beside_the_wall - TURNED.matrix).max() < 0.02


def test_the_bend_names_the_points_that_are_too_near_for_their_residuals() -> None:
    near = np.vstack([HALL, HALL[4] + 0.5])
    jolted = np.zeros((7, 2))
    jolted[6] = 0.2, -0.2
    share, rows = Adjusted(TURNED, near, jolted).bend()
    assert share > 0.3
    assert {4, 6} <= set(rows)


@pytest.mark.parametrize("mirrored", [False, True])
def test_an_affine_map_has_its_scales_rotation_and_shear(mirrored: bool) -> None:
    affine = similarity(radians(-50), 3.0, (1.0, 2.0), mirrored=mirrored)
    assert affine.mirrored is mirrored
    assert degrees(affine.rotation_rad) == pytest.approx(-50)
    assert affine.scales == pytest.approx((3.0, 3.0))
    assert affine.distortion == pytest.approx(0.0, abs=1e-12)
    assert affine.shear_rad == pytest.approx(0.0, abs=1e-12)


def test_shear_and_unequal_scales_are_told_apart() -> None:
    leaning = Affine(np.array([[1.0, 0.5], [0.0, np.sqrt(0.75)]]), np.zeros(2))
    assert leaning.scales == pytest.approx((1.0, 1.0))
    assert degrees(leaning.shear_rad) == pytest.approx(30)
    stretched = Affine(np.diag([1.0, 1.1]), np.zeros(2))
    assert stretched.distortion == pytest.approx(0.1)
    assert stretched.shear_rad == pytest.approx(0.0)
