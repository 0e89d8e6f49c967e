import numpy as np
import pytest
from numpy.random import default_rng

from deconflict.foresight.probability.calibration import (
    CONTACT,
    INTERACTION,
    OUTCOME_WEIGHT,
    OWN_SD,
    Calibration,
    log_odds,
)
from deconflict.foresight.probability.censoring import STAYED, CensoredOutcomes, weights
from deconflict.foresight.probability.pair_table import CONTACT_FEATURES, FEATURES
from ingest.batch import Bools, Floats, Ints

NOW_S = 1_790_000_000.0


def pairs_of(n: int, seed: int) -> tuple[Floats, Floats]:
    """Features of n pairs, and the shares of the errors within the clearance from which they are made."""
    likely = default_rng(seed).uniform(0, 1, n)
    return np.column_stack([np.ones(n), log_odds(likely), log_odds(likely / 2), np.full(n, 0.5), np.zeros(n)]), likely


def alike(features: Floats) -> Ints:
    """Vendors of pairs that are all of the same two vendors."""
    return np.zeros(len(features), np.int64)


def probability(calibration: Calibration, features: Floats) -> Floats:
    return calibration.estimate(features, alike(features)).probability


def outcomes_of(met: Bools) -> CensoredOutcomes:
    """Outcomes of pairs of which some met at once and the others stayed apart; no robot left."""
    return CensoredOutcomes(np.where(met, 0, STAYED), met, np.zeros(len(met), bool))


def learn(
    calibration: Calibration,
    features: Floats,
    vendors: Ints,
    outcomes: CensoredOutcomes,
    now_s: float,
    *,
    for_all: bool = True,
) -> None:
    calibration.learn(features, vendors, outcomes, np.full(len(features), for_all), now_s)


def test_the_prior_gives_a_larger_overlap_a_higher_probability() -> None:
    features, likely = pairs_of(50, 1)
    estimated = probability(Calibration(CONTACT), features)
    assert np.all(np.diff(estimated[np.argsort(likely)]) > 0)
    assert np.all((estimated > 0) & (estimated < 1))


@pytest.mark.parametrize("share", [0.1, 0.6])
def test_probabilities_converge_to_observed_frequencies(share: float) -> None:
    calibration, rng = Calibration(CONTACT), default_rng(2)
    for second in range(600):
        features, likely = pairs_of(5, 100 + second)
        learn(calibration, features, alike(features), outcomes_of(rng.uniform(size=5) < share * likely), NOW_S + second)
    features, likely = pairs_of(4000, 3)
    estimated = probability(calibration, features)
    for low in (0.0, 0.25, 0.5, 0.75):
        those = (likely >= low) & (likely < low + 0.25)
        assert estimated[those].mean() == pytest.approx(share * likely[those].mean(), abs=0.06)


def test_learning_is_one_newton_step() -> None:
    rng, features = default_rng(7), pairs_of(60, 8)[0]
    part, met = rng.integers(0, STAYED, 60), rng.uniform(size=60) < 0.4
    left = ~met & (rng.uniform(size=60) < 0.4)
    estimated = CensoredOutcomes(np.where(met | left, part, STAYED), met, left)
    calibration, before = Calibration(CONTACT), Calibration(CONTACT)
    learn(calibration, features, alike(features), estimated, NOW_S)
    known_of, left_of = (
        np.bincount(estimated.part[which], minlength=STAYED + 1).astype(np.float64) for which in (~left, left)
    )
    assert calibration.ended.tolist() == [known_of.tolist(), left_of.tolist()]
    weight = OUTCOME_WEIGHT * np.where(left, 0.0, weights(known_of, left_of)[estimated.part])
    expected = 1 / (1 + np.exp(-features @ CONTACT.mean))
    assert probability(before, features) == pytest.approx(expected)
    information = np.diag(CONTACT.sd**-2.0) + (features * (weight * expected * (1 - expected))[:, None]).T @ features
    assert calibration.of_all.information == pytest.approx(information)
    step = np.linalg.solve(information, features.T @ (weight * (met - expected)))
    assert calibration.of_all.weights == pytest.approx(CONTACT.mean + step)


def test_what_was_learned_fades_to_the_prior() -> None:
    calibration = Calibration(CONTACT)
    features, _ = pairs_of(200, 4)
    learn(calibration, features, alike(features), outcomes_of(np.ones(200, bool)), NOW_S)
    unlearned = np.linalg.det(Calibration(CONTACT).of_all.information)
    assert np.linalg.det(calibration.of_all.information) > 3 * unlearned
    learn(calibration, features[:1], alike(features[:1]), outcomes_of(np.ones(1, bool)), NOW_S + 86_400)
    assert np.linalg.det(calibration.of_all.information) == pytest.approx(unlearned, rel=0.1)


def test_nothing_known_changes_nothing() -> None:
    calibration = Calibration(CONTACT)
    learn(calibration, np.empty((0, CONTACT_FEATURES)), np.empty(0, np.int64), outcomes_of(np.empty(0, bool)), NOW_S)
    assert calibration.of_all.weights.tolist() == CONTACT.mean.tolist()


def test_robots_that_leave_do_not_make_meetings_look_frequent() -> None:
    # three in ten meet, evenly over the horizon, and half of all robots leave, evenly too
    calibration, rng = Calibration(CONTACT), default_rng(5)
    for second in range(1200):
        features, _ = pairs_of(10, 300 + second)
        meets_s = np.where(rng.uniform(size=10) < 0.3, rng.uniform(0, 10, 10), np.inf)
        leaves_s = np.where(rng.uniform(size=10) < 0.5, rng.uniform(0, 10, 10), np.inf)
        met = meets_s < leaves_s
        part = np.minimum(np.minimum(meets_s, leaves_s), STAYED).astype(int)
        learn(
            calibration,
            features,
            alike(features),
            CensoredOutcomes(part, met, ~met & (leaves_s < np.inf)),
            NOW_S + second,
        )
    assert probability(calibration, pairs_of(4000, 6)[0]).mean() == pytest.approx(0.3, abs=0.03)


def test_a_pair_of_vendors_learns_weights_of_its_own() -> None:
    calibration, rng = Calibration(CONTACT), default_rng(9)
    for second in range(900):
        features, likely = pairs_of(6, 2000 + second)
        vendors = np.array([0, 1] * 3)
        learn(
            calibration, features, vendors, outcomes_of((rng.uniform(size=6) < likely) & (vendors == 1)), NOW_S + second
        )
    features, likely = pairs_of(2000, 6)
    ordered, blind, unknown = (calibration.estimate(features, np.full(2000, vendors)) for vendors in (0, 1, 2))
    assert ordered.probability.mean() < 0.1
    assert blind.probability.mean() == pytest.approx(likely.mean(), abs=0.12)
    assert ordered.probability.mean() < unknown.probability.mean() < blind.probability.mean()


def test_what_counts_for_its_vendors_alone_changes_nothing_for_others() -> None:
    calibration, features = Calibration(CONTACT), pairs_of(200, 4)[0]
    before = calibration.estimate(features, alike(features) + 7)
    learn(calibration, features, alike(features), outcomes_of(np.ones(200, bool)), NOW_S, for_all=False)
    after = calibration.estimate(features, alike(features) + 7)
    assert all(np.array_equal(*columns) for columns in zip(before, after, strict=True))
    assert (probability(calibration, features) > before.probability).all()


def test_thin_evidence_gives_a_wide_interval_and_errs_to_warning() -> None:
    calibration = Calibration(CONTACT)
    features, _ = pairs_of(200, 4)
    before = calibration.estimate(features, alike(features))
    for second in range(300):
        learn(calibration, features, alike(features), outcomes_of(np.arange(200) % 2 == 0), NOW_S + second)
    after = calibration.estimate(features, alike(features))
    elsewhere = calibration.estimate(features, alike(features) + 7)
    assert (before.lower < before.probability).all()
    assert (before.probability < before.deciding).all()
    assert (before.deciding < before.upper).all()
    assert (after.upper - after.lower).mean() < (before.upper - before.lower).mean() / 3
    assert (elsewhere.upper - elsewhere.lower).mean() > 2 * (after.upper - after.lower).mean()
    assert OWN_SD[0] > 0.5


def test_robots_of_one_vendor_need_no_caution_once_they_were_seen_to_keep_out_of_each_others_way() -> None:
    calibration, features = Calibration(INTERACTION), np.zeros((1, FEATURES))
    features[:, 0] = 1.0
    of_one_vendor, of_two = np.array([0]), np.array([1])
    for has_learned in (False, True):
        for vendors, is_cautious in ((of_one_vendor, not has_learned), (of_two, True)):
            estimate = calibration.estimate(features, vendors)
            assert (estimate.deciding > estimate.probability).all() == is_cautious
        for _ in range(300):
            for vendors in (of_one_vendor, of_two):
                learn(calibration, features, vendors, outcomes_of(np.array([False])), NOW_S)
