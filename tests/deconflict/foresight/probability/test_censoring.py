import numpy as np
import pytest

from deconflict.foresight.probability.censoring import PARTS, STAYED, part_of, weights


def test_every_outcome_counts_one_if_no_robot_leaves() -> None:
    known = np.arange(PARTS + 1, dtype=np.float64)
    assert weights(known, np.zeros(PARTS + 1)).tolist() == [1.0] * (PARTS + 1)
    assert weights(np.zeros(PARTS + 1), np.zeros(PARTS + 1)).tolist() == [1.0] * (PARTS + 1)


def test_a_meeting_counts_as_the_share_of_the_present_pairs_that_stay() -> None:
    # of 100 pairs 20 meet at once; half of the other 80 leave in the third part, the rest stays
    known, left = np.zeros(PARTS + 1), np.zeros(PARTS + 1)
    known[0], left[2], known[STAYED] = 20, 40, 40
    counted = weights(known, left)
    assert counted[:3].tolist() == [0.5] * 3
    assert counted[3:].tolist() == [1.0] * (PARTS - 2)
    share = counted[0] * known[0] / (counted[0] * known[0] + known[STAYED])
    assert share == pytest.approx(0.2)


def test_moments_are_assigned_to_tenths_of_the_horizon() -> None:
    assert part_of(np.array([-1.0, 0.0, 0.49, 2.5, 4.99, 5.0, np.inf]), 5.0).tolist() == [0, 0, 0, 5, 9, STAYED, STAYED]
