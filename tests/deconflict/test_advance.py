import numpy as np
import pytest

from deconflict.advance import TOLERANCE_M, first_contacts
from deconflict.exact import Decider
from deconflict.relative import Relative
from ingest.seam import Floats
from tests.deconflict.made_motion import motions, sampled, true_distance

N = 500


def contacts(motion: Relative, target_m: float, **settings: int) -> Floats:
    return first_contacts(motion, target_m, Decider(target_m, TOLERANCE_M), **settings)


@pytest.mark.parametrize("turning", [True, False])
@pytest.mark.parametrize("target_m", [0.0, 0.3])
def test_contact_is_never_late_and_early_by_the_tolerance_at_most(turning: bool, target_m: float) -> None:
    motion = motions(np.random.default_rng(31), N, turning=turning)
    t, distance = sampled(motion, 200)
    within = distance <= target_m
    first = np.where(within.any(axis=0), np.take_along_axis(t, within.argmax(axis=0)[None], 0)[0], np.inf)
    for rounds in (0, 3, 24):
        found = contacts(motion, target_m, rounds=rounds)
        hit = np.isfinite(found)
        assert 0.1 < hit.mean() < 0.9
        assert (found <= first + 1e-9).all()
        there = true_distance(motion, np.where(hit, found, motion.begin))
        assert (there[hit] <= target_m + TOLERANCE_M + 1e-9).all()
        assert ((motion.begin <= found) & (found <= motion.end))[hit].all()


def test_what_is_within_the_target_from_the_start_is_in_contact_then() -> None:
    motion = motions(np.random.default_rng(32), N)
    close = true_distance(motion, motion.begin) <= 0.3
    assert close.any()
    np.testing.assert_array_equal(contacts(motion, 0.3)[close], motion.begin[close])


def test_robots_that_draw_apart_or_stand_apart_are_not_in_contact() -> None:
    motion = motions(np.random.default_rng(33), N, turning=False)
    apart = true_distance(motion, motion.begin) > 0.1
    zero = np.zeros(N)
    away = motion.gap_at(motion.begin)
    for vx, vy in ((away.nx, away.ny), (zero, zero)):
        leaving = Relative(
            motion.begin,
            motion.end,
            motion.dx,
            motion.dy,
            vx,
            vy,
            motion.yaw_a,
            motion.yaw_b,
            zero,
            zero,
            motion.half_a,
            motion.half_b,
        )
        assert not np.isfinite(contacts(leaving, 0.05))[apart].any()


def test_the_others_in_a_batch_make_no_difference() -> None:
    motion = motions(np.random.default_rng(34), 200)
    together = contacts(motion, 0.3)
    alone = [contacts(motion.take(np.array([row])), 0.3)[0] for row in range(200)]
    np.testing.assert_array_equal(together, alone)
