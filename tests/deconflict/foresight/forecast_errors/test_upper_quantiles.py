import numpy as np
import pytest
from numpy.random import default_rng

from deconflict.foresight.forecast_errors.upper_quantiles import BINS, EDGES_M, STEP, bins, upper_quantiles


def test_quantiles_are_those_of_the_distances_to_a_step() -> None:
    distances_m = default_rng(1).lognormal(-1, 1.5, 5000)
    counts = np.bincount(bins(distances_m), minlength=BINS).astype(np.float64)
    shares = np.array([0.1, 0.5, 0.9, 0.99])
    true_m = np.quantile(distances_m, shares, method="inverted_cdf")
    found_m = upper_quantiles(counts, shares)
    assert np.all(found_m >= true_m * (1 - 1e-9))
    assert np.all(found_m <= true_m * STEP * (1 + 1e-9))


def test_distances_beyond_either_end_count_in_the_last_bin_there() -> None:
    assert bins(np.array([0.0, 1e-9, 1e9])).tolist() == [0, 0, BINS - 1]


def test_a_distance_on_an_edge_belongs_below_it() -> None:
    assert bins(EDGES_M).tolist() == list(range(BINS))


def test_no_counts_have_no_quantile() -> None:
    assert upper_quantiles(np.zeros((2, BINS)), np.array([0.5])).tolist() == [[0.0], [0.0]]


def test_each_row_may_have_its_own_shares() -> None:
    counts = np.zeros((2, BINS))
    counts[:, [10, 20]] = 1.0
    assert upper_quantiles(counts, np.array([[0.5], [0.9]]))[:, 0] == pytest.approx(EDGES_M[[10, 20]])
