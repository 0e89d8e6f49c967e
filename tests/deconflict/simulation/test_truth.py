"""True encounters and stops: every two fleets get in each other's way within ten minutes."""

from itertools import combinations

import numpy as np
import pytest

from deconflict.simulation.cast import VendorName, cast
from deconflict.simulation.driving.traffic import World
from deconflict.simulation.driving.true_stops import Stops
from deconflict.simulation.floor_layout import layout_for
from deconflict.simulation.truth import near_pairs, true_encounters

CLEARANCE_M = 0.3


@pytest.mark.parametrize("seed", [1, 2])
def test_every_two_fleets_have_stops_for_each_other(seed: int) -> None:
    world = World(layout_for(24), cast(24), np.random.default_rng(seed))
    stops = Stops(world)
    for _ in range(6000):
        world.step(0.1)
        stops.update(0.1)
    met = {
        frozenset(world.members[robot].make.vendor for robot in (one.robot, one.other))
        for one in stops.found
        if not one.ordered
    }
    assert {frozenset(pair) for pair in combinations(VendorName, 2)} <= met


def test_encounters_are_of_envelopes_within_the_clearance() -> None:
    world = World(layout_for(24), cast(24), np.random.default_rng(4))
    found = true_encounters(world, 120.0, CLEARANCE_M)
    assert found
    for one in found:
        assert 0.0 <= one.separation_m <= CLEARANCE_M
        assert one.start_s <= one.last_s <= world.t_s
    by_pair: dict[tuple[int, int], float] = {}
    for one in found:
        assert one.start_s > by_pair.get(one.robots, -1.0) + 1.0
        by_pair[one.robots] = one.last_s


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
