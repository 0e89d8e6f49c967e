import numpy as np
import pytest
from numpy.random import default_rng

from deconflict.foresight.calibration import PRIOR, Calibration, features
from ingest.seam import Floats

NOW_S = 1_790_000_000.0


def pairs_of(n: int, seed: int) -> tuple[Floats, Floats]:
    """Features of n pairs and the share of the errors within the clearance that they rest on."""
    likely = default_rng(seed).uniform(0, 1, n)
    return features(likely, np.full(n, 0.5)), likely


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
        calibration.learn(seen, rng.uniform(size=5) < share * likely, NOW_S + second)
    seen, likely = pairs_of(4000, 3)
    told = calibration.probability(seen)
    for low in (0.0, 0.25, 0.5, 0.75):
        those = (likely >= low) & (likely < low + 0.25)
        assert told[those].mean() == pytest.approx(share * likely[those].mean(), abs=0.06)


def test_what_was_learned_fades_to_the_prior() -> None:
    calibration = Calibration()
    seen, _ = pairs_of(200, 4)
    calibration.learn(seen, np.ones(200, bool), NOW_S)
    sure = np.linalg.det(calibration.information)
    calibration.learn(seen[:1], np.ones(1, bool), NOW_S + 86_400)
    assert np.linalg.det(calibration.information) < sure / 10


def test_nothing_known_changes_nothing() -> None:
    calibration = Calibration()
    calibration.learn(np.empty((0, 4)), np.empty(0, bool), NOW_S)
    assert calibration.weights.tolist() == PRIOR.tolist()
