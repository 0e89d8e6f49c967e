"""Situations whose outcome is known by construction, and their scores."""

from collections.abc import Sequence
from dataclasses import replace
from math import nan
from typing import Any

import pytest

from deconflict_client.advisory import ClearedCode, moment
from deconflict_client.situations import Situation
from ingest.batch import Pair
from metrics.report.quality_sections import sentence, situations
from metrics.scoring.contention_scores import AlertOutcome
from metrics.scoring.situation_scores import SituationScores, SituationTruth
from metrics.truth.advised_waits import AdvisedWaits
from metrics.truth.pair_outcomes import OutcomeSpan, PairOutcomes
from metrics.truth.resource_use import TimeSpan
from tests.deconflict.advisories.situations.made_situations import NOW_S, conflict, raised
from tests.metrics.scoring.made_situation_truth import END_S, NOBODY_LEFT

AB = ("a", "b")


def story(pair: str = "ab", raised_s: float = 10.0, cleared_s: float | None = 40.0, **fields: Any) -> list[Situation]:
    """The revisions of a situation of two robots."""
    at_s = NOW_S + raised_s
    first = raised([conflict(pair, now_s=at_s)], at_s).model_copy(update={"id": f"situation {pair}", **fields})
    return [first] if cleared_s is None else [first, first.cleared_revision(NOW_S + cleared_s, ClearedCode.PASSED, "")]


def relisted(before: Situation, at_s: float, robots: str) -> Situation:
    return before.next_revision(updated_at=moment(NOW_S + at_s), robots=tuple(robots))


def scored(revisions: Sequence[Situation], truth: SituationTruth = NOBODY_LEFT) -> dict[str, Any]:
    """The figures of a log with a pass each half second."""
    scores, left = SituationScores(), sorted(revisions, key=lambda revision: revision.updated_at)
    for half in range(round(2 * END_S)):
        now_s = NOW_S + half / 2
        due = [revision for revision in left if revision.updated_at.timestamp() <= now_s]
        left = left[len(due) :]
        scores.add(now_s, due)
    return scores.figures(truth)


def met(*spans_s: tuple[float, float], pair: Pair = AB, **outcomes: Any) -> SituationTruth:
    """The two were in each other's way at these times, and nobody left."""
    spans = [OutcomeSpan(NOW_S + onset_s, NOW_S + end_s) for onset_s, end_s in spans_s]
    return replace(NOBODY_LEFT, outcomes={pair: PairOutcomes(spans, **outcomes)})


@pytest.mark.parametrize(
    ("onset_s", "end_s", "verdict"),
    [(5, 8, "in_vain"), (5, 12, "in_progress"), (10, 12, "true"), (50, 52, "true"), (51, 52, "in_vain")],
)
def test_a_situation_came_true_if_its_robots_got_in_each_others_way(onset_s: float, end_s: float, verdict: str) -> None:
    figures = scored(story(), met((onset_s, end_s)))
    assert figures[verdict] == 1
    assert figures["came_true"] == {"true": 1.0, "in_vain": 0.0, "in_progress": None}[verdict]
    leads_s = {"median": onset_s - 10, "p10": onset_s - 10, "p90": onset_s - 10}
    assert figures["lead_time_s"] == (leads_s if verdict == "true" else None)


def test_an_outcome_of_other_robots_does_not_count() -> None:
    assert scored(story(), met((20, 25), pair=("a", "c")))["in_vain"] == 1


def test_only_robots_that_were_listed_at_the_time_count() -> None:
    first, cleared = story()
    without_b, with_c = relisted(first, 15, "a"), relisted(first, 30, "ac")
    revisions = [first, without_b, with_c, cleared]
    assert scored(revisions, met((24, 26)))["true"] == 1, "b was listed 9 s before"
    assert scored(revisions, met((26, 28)))["in_vain"] == 1
    assert scored(revisions, met((26, 28), pair=("a", "c")))["in_vain"] == 1
    assert scored(revisions, met((31, 32), pair=("a", "c")))["true"] == 1


def test_another_advisory_that_came_true_makes_its_situation_true() -> None:
    blockage = AlertOutcome(came_s=NOW_S + 4, known=True)
    figures = scored(story(advisories=("blockage",)), replace(NOBODY_LEFT, others={"blockage": blockage}))
    assert (figures["true"], figures["lead_time_s"]["median"]) == (1, -6.0)


@pytest.mark.parametrize("heeds", ["a", ("a", "b")], ids=["a wait", "what a was asked for b"])
def test_a_robot_that_did_as_advised_prevented_it(heeds: str | Pair) -> None:
    waits = AdvisedWaits()
    waits.add(NOW_S + 20, [heeds, ("a", "x"), ("c", "x")])
    figures = scored([*story(), *story("cd")], replace(NOBODY_LEFT, waits=waits))
    assert (figures["heeded"], figures["in_vain"]) == (1, 1)
    assert (figures["prevented"], figures["came_true"], figures["came_true_or_prevented"]) == (0.5, 0.0, 0.5)


@pytest.mark.parametrize(("follows", "heeded"), [("a", 0), (("a", "b"), 1)], ids=["a stands", "a was asked for b"])
def test_a_robot_that_stands_in_a_deadlock_does_not_wait_as_advised(follows: str | Pair, heeded: int) -> None:
    waits = AdvisedWaits()
    waits.add(NOW_S + 20, [follows])
    figures = scored(story(situation_kind="deadlock"), replace(NOBODY_LEFT, waits=waits))
    assert (figures["heeded"], figures["in_vain"]) == (heeded, 1 - heeded)


@pytest.mark.parametrize(
    "truth",
    [
        replace(NOBODY_LEFT, left_s=lambda *_: NOW_S + 45),
        replace(NOBODY_LEFT, others={"conflict ab": AlertOutcome(nan, known=False)}),
        met(doubted=[OutcomeSpan(NOW_S + 20, NOW_S + 25)]),
    ],
    ids=["a robot left", "the end of the log", "a wait of unknown reason"],
)
def test_what_is_not_known_is_kept_apart(truth: SituationTruth) -> None:
    figures = scored(story(), truth)
    assert (figures["unknown"], figures["came_true"], figures["intervals"]["came_true"]) == (1, None, None)


def test_how_many_are_open_at_once_is_counted_by_seconds() -> None:
    figures = scored([*story(cleared_s=80), *story("cd", 20.2, 30), *story("ef", 100.1, None)])
    assert figures["open_at_once"] == {"median": 1, "p95": 2, "most": 2}
    assert figures["open_s"] == {"median": pytest.approx(19.4), "shortest": pytest.approx(9.8), "longest": 70.0}
    assert figures["not_cleared"] == 1


def test_situations_are_counted_for_each_hour_and_fresh_stop() -> None:
    figures = scored([*story(), *story("cd"), *story("ef")], met(stops_s=[NOW_S + 12, NOW_S + 70]))
    assert (figures["per_hour"], figures["per_robot_hour"], figures["per_fresh_stop"]) == (90.0, 6.0, 1.5)
    assert [(row["kind"], row["situations"]) for row in figures["by_kind"]] == [("meeting", 3)]


@pytest.mark.parametrize(
    ("onset_s", "all_of_them", "early"),
    [(12, (1, 1.0), (0, None)), (20, (1, 1.0), (1, 1.0)), (45, (1, 0.0), (1, 0.0)), (55, (0, None), (0, None))],
)
def test_the_outcomes_that_advisories_foresaw_are_in_situations(
    onset_s: float, all_of_them: tuple[int, float | None], early: tuple[int, float | None]
) -> None:
    advised = {AB: [TimeSpan(NOW_S + 10, NOW_S + 50)]}
    figures = scored(story(), replace(NOBODY_LEFT, lasting_s={AB: [NOW_S + onset_s]}, advised=advised))
    assert tuple(figures["foreseen"].values()) == all_of_them
    assert tuple(figures["foreseen_3_s"].values()) == early


def test_the_report_and_the_sentence_show_the_figures() -> None:
    figures = scored([*story(), *story("cd")], met((20, 25)))
    assert sentence(figures).startswith("2 situations, 60.0 an hour, - for each fresh stop, share that came true 0.50")
    html = situations(figures)
    for cell in ("<td>all</td>", "<td>meeting</td>", "0.50 (0.00 to 1.00)", "10.0 (10.0 to 10.0)"):
        assert cell in html


def test_without_situations_there_are_no_shares() -> None:
    figures = scored([])
    assert (figures["situations"], figures["came_true"], figures["open_at_once"]["most"]) == (0, None, 0)
    assert sentence(SituationScores().figures(NOBODY_LEFT)).endswith("- open at once, each for - s (medians)")
