import numpy as np
import pytest
from numpy.random import default_rng

from deconflict.foresight.calibration import OUTCOME_WEIGHT, PRIOR, PRIOR_INFORMATION, Calibration, log_odds
from deconflict.foresight.leaving import STAYED, weights
from deconflict.foresight.pairs import FEATURES, Fates
from deconflict.motion import Bools
from ingest.seam import Floats

NOW_S = 1_790_000_000.0


def pairs_of(n: int, seed: int) -> tuple[Floats, Floats]:
    """Features of n pairs and the share of the errors within the clearance that they rest on."""
    likely = default_rng(seed).uniform(0, 1, n)
    return np.column_stack([np.ones(n), log_odds(likely), log_odds(likely / 2), np.full(n, 0.5), np.zeros(n)]), likely


def fates(met: Bools) -> Fates:
    """Some met at once, the others stayed apart; nobody left."""
    return Fates(np.where(met, 0, STAYED), met, np.zeros(len(met), bool))


def test_on_day_one_a_likelier_overlap_is_a_likelier_meeting() -> None:
    seen, likely = pairs_of(50, 1)
    told = Calibration().probability(seen)
    assert np.all(np.diff(told[np.argsort(likely)]) > 0)
    assert np.all((told > 0) & (told < 1))


@pytest.mark.parametrize("share", [0.1, 0.6])
def test_it_comes_to_say_how_often_what_looks_so_does_happen(share: float) -> None:
    calibration, rng = Calibration(), default_rng(2)
    for second in range(600):
        seen, likely = pairs_of(5, 100 + second)
        calibration.learn(seen, fates(rng.uniform(size=5) < share * likely), NOW_S + second)
    seen, likely = pairs_of(4000, 3)
    told = calibration.probability(seen)
    for low in (0.0, 0.25, 0.5, 0.75):
        those = (likely >= low) & (likely < low + 0.25)
        assert told[those].mean() == pytest.approx(share * likely[those].mean(), abs=0.06)


def test_outcomes_are_learned_as_one_step_of_newton_takes_them() -> None:
    rng, seen = default_rng(7), pairs_of(60, 8)[0]
    part, met = rng.integers(0, STAYED, 60), rng.uniform(size=60) < 0.4
    left = ~met & (rng.uniform(size=60) < 0.4)
    told = Fates(np.where(met | left, part, STAYED), met, left)
    calibration, before = Calibration(), Calibration()
    calibration.learn(seen, told, NOW_S)
    known_of, left_of = (
        np.bincount(told.part[which], minlength=STAYED + 1).astype(np.float64) for which in (~left, left)
    )
    assert calibration.ended.tolist() == [known_of.tolist(), left_of.tolist()]
    weight = OUTCOME_WEIGHT * np.where(left, 0.0, weights(known_of, left_of)[told.part])
    expected = 1 / (1 + np.exp(-seen @ PRIOR))
    assert before.probability(seen) == pytest.approx(expected)
    information = PRIOR_INFORMATION + (seen * (weight * expected * (1 - expected))[:, None]).T @ seen
    assert calibration.information == pytest.approx(information)
    step = np.linalg.solve(information, seen.T @ (weight * (met - expected)))
    assert calibration.weights == pytest.approx(PRIOR + step)


def test_what_was_learned_fades_to_the_prior() -> None:
    calibration = Calibration()
    seen, _ = pairs_of(200, 4)
    calibration.learn(seen, fates(np.ones(200, bool)), NOW_S)
    sure = np.linalg.det(calibration.information)
    calibration.learn(seen[:1], fates(np.ones(1, bool)), NOW_S + 86_400)
    assert np.linalg.det(calibration.information) < sure / 10


def test_nothing_known_changes_nothing() -> None:
    calibration = Calibration()
    calibration.learn(np.empty((0, FEATURES)), fates(np.empty(0, bool)), NOW_S)
    assert calibration.weights.tolist() == PRIOR.tolist()


def test_robots_that_leave_do_not_make_meetings_look_frequent() -> None:
    # three in ten meet, evenly over the horizon, and half of all robots leave, evenly too
    calibration, rng = Calibration(), default_rng(5)
    for second in range(1200):
        seen, _ = pairs_of(10, 300 + second)
        meets_s = np.where(rng.uniform(size=10) < 0.3, rng.uniform(0, 10, 10), np.inf)
        leaves_s = np.where(rng.uniform(size=10) < 0.5, rng.uniform(0, 10, 10), np.inf)
        met = meets_s < leaves_s
        part = np.minimum(np.minimum(meets_s, leaves_s), STAYED).astype(int)
        calibration.learn(seen, Fates(part, met, ~met & (leaves_s < np.inf)), NOW_S + second)
    assert calibration.probability(pairs_of(4000, 6)[0]).mean() == pytest.approx(0.3, abs=0.03)
