import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ingest.batch import Floats
from ingest.frames.fitting import Fit, FitError, Method, fit
from ingest.frames.transforms import Affine
from tests.ingest.frames.made_maps import HALL, affines, jolts, seeds, similarities, similarity

NAMES = ("door", "dock", "pillar", "gate", "lift", "desk")


def fitted(readings: Floats, reference: Floats, *, mirrored: bool = False) -> Fit:
    return fit(readings, reference, NAMES[: len(readings)], mirrored=mirrored)


def inverse(affine: Affine) -> Affine:
    back = np.asarray(np.linalg.inv(affine.matrix), np.float64)
    return Affine(back, -back @ affine.shift)


@given(similarities, st.integers(2, 6))
def test_exact_readings_give_the_transform_back(truth: Affine, count: int) -> None:
    readings = inverse(truth)(HALL[:count])
    found = fitted(readings, HALL[:count], mirrored=truth.mirrored)
    elsewhere = np.array([[-30.0, 4.0], [60.0, 50.0], [20.0, 10.0]])
    np.testing.assert_allclose(found.transform(inverse(truth)(elsewhere)), elsewhere, atol=1e-7)
    np.testing.assert_allclose(found.affine.matrix, truth.matrix, rtol=1e-9, atol=1e-9 * np.abs(truth.matrix).max())
    assert found.affine.mirrored is truth.mirrored
    assert found.residuals_m.max() < 1e-7


@given(affines, st.integers(3, 6))
def test_three_points_and_more_recover_an_affine_map_to_a_nanometre(truth: Affine, count: int) -> None:
    found = fitted(HALL[:count], truth(HALL[:count]))
    np.testing.assert_allclose(found.affine.matrix, truth.matrix, atol=1e-9)
    np.testing.assert_allclose(found.transform(HALL), truth(HALL), atol=1e-9)


@pytest.mark.parametrize(
    ("count", "method"), [(2, Method.SIMILARITY), (3, Method.AFFINE), (4, Method.ADJUST), (6, Method.ADJUST)]
)
def test_the_number_of_points_chooses_the_method(count: int, method: Method) -> None:
    assert fitted(HALL[:count], HALL[:count]).method is method


@given(seeds)
def test_residuals_are_those_of_the_global_fit_though_adjust_hides_them(seed: int) -> None:
    reference = HALL + jolts(6, 0.2, seed)
    found = fitted(HALL, reference)
    np.testing.assert_allclose(found.transform(HALL), reference, atol=1e-9)
    missed = np.hypot(*(found.affine(HALL) - reference).T)
    np.testing.assert_allclose(found.residuals_m, missed, atol=1e-12)
    others = fitted(HALL, reference + jolts(6, 1e-3, seed + 1))
    assert np.sum(missed**2) <= np.sum(np.hypot(*(others.affine(HALL) - reference).T) ** 2)


def test_a_point_left_out_shows_a_wrong_reading_that_the_fit_takes_in() -> None:
    readings = HALL[:3].copy()
    readings[1] += (0.0, 1.0)
    found = fitted(readings, HALL[:3])
    assert found.residuals_m.max() < 1e-9
    assert found.left_out_m[1] == pytest.approx(1.0, abs=0.1)
    more = HALL.copy()
    more[4] += (0.6, 0.0)
    left_out = fitted(more, HALL).left_out_m
    assert left_out.argmax() == 4
    assert left_out[4] == pytest.approx(0.6)
    assert np.isnan(fitted(HALL[:2], HALL[:2]).left_out_m).all()


def test_a_far_origin_loses_no_digits() -> None:
    truth = similarity(1.0, 1.0, (0.0, 0.0))
    far = HALL + np.array([4_500_000.0, 6_200_000.0])
    found = fitted(far, truth(HALL))
    np.testing.assert_allclose(found.transform(far), truth(HALL), atol=1e-7)
    np.testing.assert_allclose(found.affine.matrix, truth.matrix, atol=1e-9)


LINE = np.array([[0.0, 0.0], [10.0, 0.01], [25.0, 0.0], [31.0, -0.01]])


@pytest.mark.parametrize(
    ("readings", "reference", "says"),
    [
        (HALL[:0], HALL[:0], r"at least two reference points are needed, found 0"),
        (HALL[:1], HALL[:1], r"at least two reference points are needed, found 1"),
        (HALL[[1, 1]], HALL[:2], r"the readings of door and dock are at the same place"),
        (HALL[[0, 1, 2, 1]], HALL[:4], r"the readings of dock and gate are at the same place"),
        (HALL[:2], HALL[[1, 1]], r"the reference points door and dock are at the same place"),
        (LINE[:3], HALL[:3], r"the readings of door, dock, pillar lie on one line"),
        (LINE, HALL[:4], r"the readings of door, dock, pillar, gate lie on one line"),
        (HALL[:4], LINE, r"the reference points of door, dock, pillar, gate lie on one line"),
        (np.array([[0, 0], [9, 0], [9, 9], [0, 9.0]]), np.array([[0, 0], [9, 0], [0, 9], [9, 9.0]]), r"exchanged"),
        (np.array([[0.0, 5e-324], [0.0, 0.0]]), HALL[:2], "are at the same place"),
        (np.array([[0.0, 0.0], [0.0, 1e308], [1e308, 1e308]]), HALL[:3], "readings of door, .* are too far away"),
        (HALL[:2], np.array([[1e308, 0.0], [-1e308, 0.0]]), "reference points door, dock are too far away"),
    ],
)
def test_readings_that_fit_nothing_are_refused_with_their_names(readings: Floats, reference: Floats, says: str) -> None:
    with pytest.raises(FitError, match=says):
        fitted(readings, reference)
