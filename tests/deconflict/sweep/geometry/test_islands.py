"""Tests of islands, against SciPy's connected components."""

import numpy as np
import pytest
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from deconflict.sweep.geometry.islands import islands_of, spots_of

SLOTS = 60


@pytest.mark.parametrize("seed", range(20))
def test_islands_are_the_connected_components(seed: int) -> None:
    rng = np.random.default_rng(seed)
    a, b = rng.integers(0, SLOTS, (2, rng.integers(0, 50)))
    slots, places = np.unique(np.concatenate([a, b]), return_inverse=True)
    graph = coo_array((np.ones(len(a)), (places[: len(a)], places[len(a) :])), (len(slots), len(slots)))
    _, island = connected_components(graph, directed=False)
    found, of_found = islands_of(a, b, SLOTS)
    assert found.tolist() == slots.tolist()
    assert of_found.tolist() == island.tolist()


@pytest.mark.parametrize("seed", range(20))
def test_spots_are_places_that_are_near_each_other_or_through_others(seed: int) -> None:
    rng = np.random.default_rng(seed)
    x_m, y_m = rng.uniform(0, 60, (2, rng.integers(0, 40)))
    is_near = np.hypot(x_m[:, None] - x_m, y_m[:, None] - y_m) <= 5.0
    _, island = connected_components(is_near, directed=False) if len(x_m) else (0, np.zeros(0, int))
    assert spots_of(x_m, y_m, 5.0).tolist() == island.tolist()
