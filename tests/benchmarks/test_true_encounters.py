"""True encounters of the simulated world."""

import numpy as np
import pytest

from benchmarks.watch_demo.true_encounters import near_pairs


def test_near_pairs_by_hand() -> None:
    envelopes = np.array(
        [
            (0.0, 0.0, 0.0, 1.0, 0.6),
            (1.25, 0.0, 0.0, 1.0, 0.6),
            (1.25, 5.0, 0.0, 1.0, 0.6),
            (0.0, 0.9, np.pi / 2, 1.0, 0.6),
        ]
    )
    on_one_floor = dict(near_pairs(envelopes, np.zeros(4, np.int64), 0.3))
    assert on_one_floor == pytest.approx({(0, 1): 0.25, (0, 3): 0.1})
    assert dict(near_pairs(envelopes, np.array([0, 1, 0, 0]), 0.3)) == pytest.approx({(0, 3): 0.1})
