import numpy as np
import pytest

from deconflict.foresight.probability.censoring import STAYED
from ingest.batch import Pair
from metrics.scoring.bootstrap import interval
from metrics.scoring.summaries import means
from metrics.scoring.warnings.calibration_scores import CalibrationSamples, CalibrationScores, CalibrationTally
from metrics.scoring.warnings.outcomes_by_moment import ContactOutcomes
from metrics.truth.advised_waits import AdvisedWaits
from tests.metrics.truth.made_motion import driven, reported

PAIR = ("a", "b")
VENDORS = {"a": "Alder", "b": "Corvid"}


def tally(*rows: tuple[float, int, int]) -> CalibrationTally:
    """So many samples of a probability, of which so many came true."""
    made = CalibrationTally()
    for probability, samples, came_true in rows:
        n = np.arange(samples)
        part = np.where(n < came_true, 0, STAYED)
        made.add(CalibrationSamples.of(n % 7, np.full(samples, probability), part, np.ones(samples, bool)), n)
    return made


def add(tally: CalibrationTally, group: int, probability: float, part: int) -> None:
    tally.add(
        CalibrationSamples.of(np.array([group]), np.array([probability]), np.array([part]), np.array([True])),
        np.array([0]),
    )


def test_correct_probabilities_have_no_calibration_error() -> None:
    figures = tally((0.2, 100, 20), (0.8, 100, 80)).figures()
    assert figures["ece"] == pytest.approx(0.0)
    assert figures["brier"] == pytest.approx(0.16)
    assert figures["brier_skill"] == pytest.approx(1 - 0.16 / 0.25)
    assert [row["came_true"] for row in figures["reliability"]] == [0.2, 0.8]


def test_probabilities_that_are_too_high_by_a_tenth_have_that_error_and_less_skill() -> None:
    figures = tally((0.3, 100, 20), (0.9, 100, 80)).figures()
    assert figures["ece"] == pytest.approx(0.1)
    assert figures["brier"] == pytest.approx(0.16 + 0.01)


def test_a_constant_base_rate_has_no_skill() -> None:
    assert tally((0.25, 400, 100)).figures()["brier_skill"] == pytest.approx(0.0)


def test_without_probabilities_or_outcomes_there_is_no_figure() -> None:
    nothing = CalibrationTally().figures()
    assert nothing["samples"] == 0
    assert nothing["ece"] is nothing["brier"] is nothing["brier_skill"] is None
    assert tally((0.1, 50, 0)).figures()["brier_skill"] is None


def test_bins_hold_the_same_number_of_samples() -> None:
    made = CalibrationTally()
    values, nothing = np.linspace(0.0, 1.0, 5000) ** 4, np.zeros(5000, np.int64)
    made.add(CalibrationSamples.of(nothing, values, np.full(5000, STAYED), np.ones(5000, bool)), np.arange(5000))
    assert made.bins()[:, 0].tolist() == pytest.approx([500] * 10, abs=60)


def test_known_samples_get_the_weight_of_censored_ones() -> None:
    # three in ten meet in the sixth second; before that, a robot of half of the pairs has left
    made = CalibrationTally()
    for n in range(200):
        if n % 2:
            made.left[2] += 1
        else:
            add(made, n % 7, 0.3, 5 if n % 20 < 6 else STAYED)
    assert made.figures()["ece"] == pytest.approx(0.0)
    # and here those that would meet in the first second do so before half of the others leave
    made = CalibrationTally()
    for n in range(100):
        if n < 30:
            add(made, n % 7, 0.3, 0)
        elif n % 2:
            add(made, n % 7, 0.3, STAYED)
        else:
            made.left[2] += 1
    assert made.figures()["ece"] == pytest.approx(0.0)
    assert made.figures()["brier_skill"] == pytest.approx(0.0)
    assert made.figures()["ece_unweighted"] == pytest.approx(30 / 65 - 0.3)


def test_censored_samples_can_count_as_not_met() -> None:
    made = tally((0.2, 100, 40), (0.8, 100, 100))
    n = np.arange(100)
    # whichever part of the horizon they left in
    made.add(CalibrationSamples.of(n % 7, np.full(100, 0.2), n % STAYED, np.zeros(100, bool)), n)
    figures = made.figures()
    assert figures["samples"] == 200
    assert figures["ece_all"] == pytest.approx(100 / 300 * 0.2)
    brier = (40 * 0.8**2 + 160 * 0.2**2 + 100 * 0.2**2) / 300
    assert figures["brier_skill_all"] == pytest.approx(1 - brier / (140 / 300 * 160 / 300))
    assert figures["ece_unweighted"] == pytest.approx(0.2)


def followed(calibration: CalibrationScores, *probabilities: float) -> CalibrationScores:
    """b comes to a at 2 m/s from 40 m, below 0.3 m from 19.35 s on, and is gone at 30 s; a probability each second."""
    truth = driven((0, 40.0, -2.0), until_s=30)
    for second, probability in enumerate(probabilities):
        calibration.sample(second + 0.05, [(PAIR, probability)])
        calibration.sample(second + 0.55, [(PAIR, 1.0 - probability)])
    calibration.resolve(ContactOutcomes(truth, 0.3), VENDORS)
    return calibration


def test_a_sample_comes_true_if_an_encounter_begins_within_ten_seconds() -> None:
    made = followed(CalibrationScores(AdvisedWaits()), *[0.25] * 15)
    (whole,) = made.by_vendors.values()
    assert made.by_vendors.keys() == {("Alder", "Corvid")}
    # of 0.05 ... 14.05 s, those after 9.35 s
    assert (whole.known().sum(), whole.fine[0, :STAYED].sum()) == (15, 5)


def test_seconds_within_an_encounter_or_before_a_robot_leaves_are_excluded() -> None:
    made = followed(CalibrationScores(AdvisedWaits()), *[0.25] * 30)
    (whole,) = made.by_vendors.values()
    # in the encounter from 19.35 to 20.65 s; after 20 s nobody knows what would have been in ten seconds
    assert (whole.known().sum(), whole.fine[0, :STAYED].sum(), whole.left.sum()) == (20, 10, 9)


@pytest.mark.parametrize("heeds", ["a", PAIR], ids=["a wait", "what a was asked for the other"])
def test_seconds_before_advice_is_followed_are_counted_separately(heeds: str | Pair) -> None:
    waits = AdvisedWaits()
    for at_s in (14.0, 15.0, 16.0):
        waits.add(at_s, [heeds])
    made = followed(CalibrationScores(waits), *[0.25] * 25)
    (whole,) = made.by_vendors.values()
    # of those of 4.05 to 15.05 s nobody knows; those of 16.05 to 19.05 s came true
    assert made.heeded == 12
    assert (whole.known().sum(), whole.fine[0, :STAYED].sum()) == (4 + 4, 4)


def test_the_first_minutes_are_counted_separately() -> None:
    truth = driven((0, 40.0, 0.0), until_s=200)
    made = CalibrationScores(AdvisedWaits())
    for second in range(180):
        made.sample(float(second), [(PAIR, 0.1)])
    made.resolve(ContactOutcomes(truth, 0.3), VENDORS)
    assert (made.whole().known().sum(), made.settled.known().sum()) == (180, 60)


def test_no_sample_is_counted_before_its_outcome_is_known() -> None:
    made = CalibrationScores(AdvisedWaits())
    truth = driven((0, 40.0, 0.0), until_s=10, finished=False)
    made.sample(5.0, [(PAIR, 0.1)])
    made.resolve(ContactOutcomes(truth, 0.3), VENDORS)
    assert made.whole().fine.sum() == 0
    for second in range(11, 25):
        reported(truth, float(second), ("a", 0, 0.0), ("b", 0, 40.0))
        truth.advance(float(second))
    made.resolve(ContactOutcomes(truth, 0.3), VENDORS)
    assert made.whole().fine[0].sum() == 1


def test_an_interval_holds_the_figure_narrows_with_cases_and_is_the_same_each_time() -> None:
    few, many = np.tile([0.0, 1.0], 20), np.tile([0.0, 1.0], 2000)
    first, other = interval(few, means), interval(many, means)
    assert first is not None
    assert other is not None
    assert first[0] < other[0] < 0.5 < other[1] < first[1]
    assert first == interval(few, means)
