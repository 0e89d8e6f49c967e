from math import nan
from typing import Any

import numpy as np

from deconflict.foresight.probability.censoring import STAYED
from metrics.scoring.compare import CONTACT_ALONE, FigureChange, changes, headline_changes, page, situation_changes
from metrics.scoring.situation_scores import SituationScores
from metrics.scoring.warnings.calibration_scores import CalibrationSamples, CalibrationTally
from metrics.scoring.warnings.judged_alerts import JudgedAlert, JudgedCases, JudgedOnset
from metrics.scoring.warnings.precision_by_encounters import Alert, RobotPresence, score
from metrics.scoring.warnings.precision_by_outcomes import figures
from metrics.scoring.warnings.warning_quality import WarningQuality
from metrics.truth.encounters import RecordedEncounter
from metrics.truth.pair_outcomes import Verdict
from tests.metrics.scoring.made_situation_truth import NOBODY_LEFT


def result(recalled: int, of: int = 60, shift_s: float = 0.0) -> dict[str, Any]:
    """So many encounters, the first of which were foreseen by an alert 5 s before."""
    pairs = [(f"a{n}", f"b{n}") for n in range(of)]
    encounters = [RecordedEncounter(pair, 100.0 * n + 20, 100.0 * n + 22, True) for n, pair in enumerate(pairs)]
    alerts = [
        Alert(
            pair, ("A", "B"), encounter.start_s - 5 - shift_s, encounter.end_s, encounter.start_s, encounter.end_s + 60
        )
        for pair, encounter in list(zip(pairs, encounters, strict=True))[:recalled]
    ]
    onsets = [
        JudgedOnset(
            each.pair, ("A", "B"), each.start_s, False, (n < recalled,) * 4, 5 + shift_s if n < recalled else nan, None
        )
        for n, each in enumerate(encounters)
    ]
    judged_alerts = [JudgedAlert(each, ("A", "B"), 7.0, Verdict.TRUE, (5, 0, 0, 0, 0, 0, 2)) for each in alerts]
    warnings = figures(JudgedCases(judged_alerts, onsets), RobotPresence(), {})
    scores, situations = (
        [score(encounters, alerts, 0.3) | {"warnings": warnings}],
        SituationScores().figures(NOBODY_LEFT),
    )
    return {"messages": 9, "robots": 2 * of, "span_s": 100.0 * of, "scores": scores, "situations": situations}


def change(name: str, a: dict[str, Any], b: dict[str, Any]) -> FigureChange:
    return next(change for change in changes(a["scores"][0], b["scores"][0], same_log=True) if change.figure == name)


def test_a_result_compared_with_itself_shows_no_change() -> None:
    figure_change = change("recall", result(30), result(30))
    assert (figure_change.before, figure_change.after, figure_change.interval, figure_change.meaning) == (
        0.5,
        0.5,
        (0.0, 0.0),
        "no significant change",
    )


def test_fewer_predicted_encounters_show_as_lower_recall() -> None:
    figure_change = change("recall", result(50), result(25))
    assert figure_change.interval is not None
    assert figure_change.interval[0] < 25 / 60 - 50 / 60 < figure_change.interval[1] < 0
    assert figure_change.meaning == "worse"


def test_a_longer_lead_shows_as_higher() -> None:
    figure_change = change("lead_time_s", result(30), result(30, shift_s=2.0))
    assert (figure_change.before, figure_change.after, figure_change.meaning) == (5.0, 7.0, "better")


def test_without_predictions_there_is_no_interval() -> None:
    assert change("lead_time_s", result(0), result(30)).interval is None
    assert change("brier", result(30), result(30)).interval is None


def test_the_comparison_says_if_the_logs_differ() -> None:
    assert "The logs differ" in page(result(30), result(30, of=50))
    assert "The logs differ" not in page(result(30), result(20))
    assert "60 and 60 foreseeable encounters" in page(result(30), result(20))


def test_the_comparison_begins_with_the_figures_of_the_report_and_says_what_is_better() -> None:
    a, b = result(25), result(50, shift_s=2.0)
    warnings = [document["scores"][0]["warnings"] for document in (a, b)]
    found = {change.figure: change for change in headline_changes(warnings[0], warnings[1], same_log=True)}
    qualities = [WarningQuality.of(part) for part in warnings]
    assert [found["warned of"].before, found["warned of"].after] == [each.share_warned_of for each in qualities]
    assert [found["came true"].before, found["came true"].after] == [each.share_came_true for each in qualities]
    assert (found["ahead by, s"].before, found["ahead by, s"].after) == (5.0, 7.0)
    assert (found["warned of"].meaning, found["ahead by, s"].meaning) == ("better", "better")
    lines = page(a, b).splitlines()
    assert lines[0] == "clearance 0.3 m: 60 and 60 times in each other's way"
    assert lines.index(CONTACT_ALONE) < next(n for n, line in enumerate(lines) if line.startswith("precision"))


def test_situations_are_compared_after_the_clearances() -> None:
    a, b = result(30), result(30)
    a["situations"]["cases"]["came_true"], b["situations"]["cases"]["came_true"] = "y" * 40, "n" * 20 + "y" * 20 + "-"
    came_true = next(situation_changes(a["situations"], b["situations"]))
    assert (came_true.before, came_true.after, came_true.meaning) == (1.0, 0.5, "worse")
    assert "\n0 and 0 situations\n" in page(a, b)


def published(seed: int, off: float = 0.0) -> dict[str, Any]:
    """A result with probabilities of ten of the groups of pairs, `off` further from what came of them."""
    rng, calibration_tally, n = np.random.default_rng(seed), CalibrationTally(), np.arange(500)
    came_true = rng.random(500) < 0.3
    values = np.where(came_true, 0.6, 0.2 + rng.random(500) / 2) + np.where(came_true, -off, off)
    calibration_tally.add(CalibrationSamples.of(n % 10, values, np.where(came_true, 0, STAYED), np.ones(500, bool)), n)
    return result(30) | {"scores": [score([], [], 0.3, tallies={("A", "B"): calibration_tally})]}


def test_the_same_probabilities_show_no_change() -> None:
    for name in ("brier", "brier_skill"):
        figure_change = change(name, published(1), published(1))
        assert (figure_change.before, figure_change.interval) == (figure_change.after, (0.0, 0.0))


def test_probabilities_that_are_a_little_worse_show() -> None:
    figure_change = change("brier", published(1), published(1, off=0.01))
    assert figure_change.interval is not None
    assert figure_change.before is not None
    assert figure_change.after is not None
    assert 0 < figure_change.interval[0] < figure_change.after - figure_change.before < figure_change.interval[1]
    assert figure_change.meaning == "worse"


def test_results_without_every_group_are_not_paired() -> None:
    a, b = published(1), published(1)
    for document in (a, b):
        cases = document["scores"][0]["cases"]
        cases["probabilities"] = [row for row in cases["probabilities"] if row[0]]
    assert change("brier", a, b).meaning == "no significant change"
