import numpy as np
import pytest

from deconflict.separation import ACCURACY_M, smallest
from tests.deconflict.made_motion import motions, sampled, true_distance

N = 600


@pytest.mark.parametrize("turning", [True, False])
def test_no_sample_is_closer_and_the_time_given_is_that_close(turning: bool) -> None:
    motion = motions(np.random.default_rng(21), N, turning=turning)
    separation, when = smallest(motion, np.arange(N), N)
    _, distance = sampled(motion, 200)
    lowest = distance.min(axis=0)
    assert 0.2 < np.mean(lowest > 0) < 0.9
    assert (separation <= lowest + ACCURACY_M).all()
    assert ((motion.begin <= when) & (when <= motion.end)).all()
    np.testing.assert_allclose(true_distance(motion, when), separation, atol=1e-9)


def test_an_owner_has_the_smallest_of_its_segments() -> None:
    motion = motions(np.random.default_rng(22), N)
    owner = np.arange(N) // 3
    each, each_when = smallest(motion, np.arange(N), N)
    separation, when = smallest(motion, owner, N // 3)
    best = each.reshape(-1, 3).min(axis=1)
    assert (separation >= best - 1e-12).all()
    assert (separation <= best + ACCURACY_M).all()
    exact = separation == best
    assert exact.mean() > 0.5
    reached = np.where(each.reshape(-1, 3) == best[:, None], each_when.reshape(-1, 3), np.inf).min(axis=1)
    alone = exact & (best > 0)
    np.testing.assert_array_equal(when[alone], reached[alone])


def test_the_order_of_the_motions_makes_no_difference() -> None:
    rng = np.random.default_rng(23)
    motion, owner = motions(rng, N), np.arange(N) // 3
    order = rng.permutation(N)
    straight = smallest(motion, owner, N // 3)
    mixed = smallest(motion.take(order), owner[order], N // 3)
    np.testing.assert_array_equal(mixed[0], straight[0])
    np.testing.assert_array_equal(mixed[1], straight[1])


def test_no_motion_no_separation() -> None:
    separation, _ = smallest(motions(np.random.default_rng(24), 0), np.empty(0, np.int64), 1)
    assert separation.tolist() == [np.inf]
