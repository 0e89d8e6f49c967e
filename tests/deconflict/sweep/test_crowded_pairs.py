"""Of the pairs of a robot with those of a crowd, the soonest few are kept."""

import numpy as np

from deconflict.sweep.incremental import Sweeper
from deconflict.sweep.pair_choice import MOST_OF_CROWD, CrowdedPairs
from ingest.batch import Forecasts

CROWDS = np.array([0, 0, *[1] * 8, *[2] * 8])
"""Slots 0 and 1 are in no crowd."""


def kept(pairs: CrowdedPairs, contact_s: dict[tuple[int, int], float]) -> set[tuple[int, int]]:
    a, b = np.array(list(contact_s), np.int64).reshape(-1, 2).T
    rows = pairs.kept_rows(a, b, np.array([*contact_s.values()]), CROWDS)
    assert np.all(np.diff(rows) > 0)
    return {(int(a[row]), int(b[row])) for row in rows}


def test_each_robot_keeps_its_soonest_pairs_with_each_crowd_and_all_others() -> None:
    contact_s = {(0, slot): 20.0 - slot for slot in range(2, 18)} | {(slot, 1): slot for slot in range(2, 6)}
    others = {(0, 1): 30.0}
    soonest = {(0, 9), (0, 8), (0, 7), (0, 17), (0, 16), (0, 15), (2, 1), (3, 1), (4, 1)}
    assert kept(CrowdedPairs(), contact_s | others) == soonest | set(others)
    assert kept(CrowdedPairs(), others) == set(others)
    assert kept(CrowdedPairs(), {}) == set()


def test_pairs_that_were_kept_stay_before_sooner_ones() -> None:
    pairs = CrowdedPairs()
    assert kept(pairs, {(0, 4): 4.0, (0, 5): 5.0}) == {(0, 4), (0, 5)}
    assert kept(pairs, {(0, 4): 4.0, (0, 5): 5.0, (0, 6): 1.0, (0, 7): 2.0}) == {(0, 4), (0, 5), (0, 6)}
    assert kept(pairs, {(0, 5): 5.0, (0, 7): 2.0, (0, 8): 3.0, (0, 9): 4.0}) == {(0, 5), (0, 7), (0, 8)}


def standing(x_m: list[float]) -> Forecasts:
    n = len(x_m)
    zero, size = np.zeros(n), np.full(n, 0.5)
    unknown = np.full(n, np.inf)
    return Forecasts(
        np.arange(n + 1), zero + 100.0, np.array(x_m), zero, zero, np.zeros(n, np.int64), size, size, -unknown, unknown
    )


def test_a_sweep_leaves_out_pairs_within_crowds_as_long_as_they_last() -> None:
    crowds: dict[str, int] = {}
    sweeper = Sweeper(clearance_m=0.3, crowds=crowds)
    names = [f"m{i}" for i in range(6)]
    sweeper.update([*names, "a", "b"], standing([0.1 * i for i in range(6)] + [0.7, 9.0]))
    everything = sweeper.find_conflicts(100.0).pairs
    assert len(everything) == 6 * 5 / 2 + 6
    crowds |= dict.fromkeys(names, 1)
    sweeper.touch([*names, "nobody"])
    few = sweeper.find_conflicts(100.1).pairs
    assert len(few) == MOST_OF_CROWD
    assert all(pair[0] == "a" for pair in few)
    crowds.clear()
    sweeper.touch(names)
    assert sweeper.find_conflicts(100.2).pairs == everything
