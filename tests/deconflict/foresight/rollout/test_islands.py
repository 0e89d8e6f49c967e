"""Tests of islands, against SciPy's connected components."""

import numpy as np
import pytest
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from deconflict.foresight.rollout.rollout_schedule import islands_of

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
