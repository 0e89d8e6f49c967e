"""True encounters of the simulated world."""

import numpy as np
import pytest

from benchmarks.watch_demo.true_encounters import near_pairs, true_encounters
from deconflict.simulation.driving.traffic import World
from deconflict.simulation.floor_layout import layout_for
from deconflict.simulation.participants import participants

CLEARANCE_M = 0.3


def test_encounters_are_of_envelopes_within_the_clearance() -> None:
    world = World(layout_for(24), participants(24), np.random.default_rng(4))
    found = true_encounters(world, 120.0, CLEARANCE_M)
    assert found
    for encounter in found:
        assert 0.0 <= encounter.separation_m <= CLEARANCE_M
        assert encounter.start_s <= encounter.last_s <= world.t_s
    by_pair: dict[tuple[int, int], float] = {}
    for encounter in found:
        assert encounter.start_s > by_pair.get(encounter.robots, -1.0) + 1.0
        by_pair[encounter.robots] = encounter.last_s


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
