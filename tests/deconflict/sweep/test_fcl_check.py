import numpy as np
import pytest

from deconflict.sweep.fcl_check import FclCheck
from tests.helpers.made_motion import motions, sampled, true_distance

TOLERANCE_M = 1e-3


@pytest.mark.parametrize("target_m", [0.0, 0.3])
def test_halving_finds_the_first_contact_and_no_other(target_m: float) -> None:
    motion = motions(np.random.default_rng(41), 600)
    check = FclCheck(target_m, TOLERANCE_M)
    apart = np.flatnonzero(true_distance(motion, motion["begin"]) > target_m)
    t, distance = sampled(motion, 100)
    found = 0
    for row in apart.tolist():
        contact = check.first_contact(motion[row : row + 1], float(motion["begin"][row]))
        within = np.flatnonzero(distance[:, row] <= target_m)
        if len(within):
            assert contact <= t[within[0], row]
        if np.isfinite(contact):
            found += 1
            values = motion[row : row + 1]
            assert true_distance(values, np.array([contact]))[0] <= target_m + TOLERANCE_M
    assert 30 < found < len(apart) - 30
    assert check.calls >= len(apart)


def test_contacts_before_the_begin_do_not_count() -> None:
    motion = motions(np.random.default_rng(42), 300)
    _, distance = sampled(motion, 200)
    passed = np.flatnonzero((distance[:75] == 0).any(axis=0) & (distance[75:] > 0.1).all(axis=0))
    assert len(passed)
    check = FclCheck(0.0, TOLERANCE_M)
    for row in passed.tolist():
        middle = float((motion["begin"][row] + motion["end"][row]) / 2)
        assert check.first_contact(motion[row : row + 1], middle) == np.inf


def test_results_do_not_depend_on_earlier_calls() -> None:
    motion = motions(np.random.default_rng(43), 60)
    begins = motion["begin"].tolist()
    once = [FclCheck(0.2, TOLERANCE_M).first_contact(motion[row : row + 1], begins[row]) for row in range(60)]
    check = FclCheck(0.2, TOLERANCE_M)
    again = [check.first_contact(motion[row : row + 1], begins[row]) for row in reversed(range(60))]
    assert again[::-1] == once
