"""What can still be prevented, and how severe that is."""

import pytest

from deconflict.advice.actions.action_text import PERSON_REACTION_S
from deconflict.advisories.situations.advice.stakes import LASTS_S, stakes_of, urgency_of_stakes
from deconflict_client.advisory import Severity
from tests.deconflict.advisories.situations.made_situations import NOW_S, advice, blockage, conflict, queue


@pytest.mark.parametrize(
    ("left_s", "is_preventable"),
    [(PERSON_REACTION_S, True), (PERSON_REACTION_S - 0.1, False), (-1.0, False), (-LASTS_S, True)],
)
def test_a_conflict_can_be_prevented_in_time_or_ended_if_it_lasts(left_s: float, is_preventable: bool) -> None:
    stakes = stakes_of([conflict("ab", left_s)], NOW_S)
    assert (stakes.person_prevents_s > 0) is is_preventable
    assert (stakes.preventable_s is not None) is is_preventable


def test_a_likelier_conflict_costs_more() -> None:
    unlikely, likely = (stakes_of([conflict("ab", probability=p)], NOW_S).cost_s for p in (0.2, 0.9))
    assert unlikely < likely


def test_what_can_not_be_prevented_is_of_the_lowest_severity() -> None:
    assert urgency_of_stakes(stakes_of([conflict("ab", 1.0)], NOW_S), None) is Severity.CAUTION


def test_a_robot_in_the_way_of_several_is_critical() -> None:
    assert urgency_of_stakes(stakes_of([blockage("xabc")], NOW_S), None) is Severity.CRITICAL


def test_a_queue_in_half_an_hour_is_less_severe_than_now() -> None:
    later = queue("abc", predicted_at=conflict("ab", 1800.0).predicted_at)
    assert urgency_of_stakes(stakes_of([later], NOW_S), None) is Severity.CAUTION
    assert urgency_of_stakes(stakes_of([queue("abc")], NOW_S), None) is Severity.WARNING


def test_a_queue_is_as_severe_as_what_its_advice_saves() -> None:
    useless, useful = (
        queue("abc", recommendation=advice().model_copy(update={"expected_saving_s": saving_s}))
        for saving_s in (0.0, 60.0)
    )
    assert urgency_of_stakes(stakes_of([useless], NOW_S), None) is Severity.CAUTION
    assert urgency_of_stakes(stakes_of([useful], NOW_S), None) is Severity.CRITICAL


def test_severity_falls_only_once_the_cost_is_clearly_lower() -> None:
    slightly, clearly = (stakes_of([conflict("ab", probability=p)], NOW_S) for p in (0.4, 0.2))
    assert urgency_of_stakes(slightly, None) is Severity.CAUTION
    assert urgency_of_stakes(slightly, Severity.WARNING) is Severity.WARNING
    assert urgency_of_stakes(clearly, Severity.WARNING) is Severity.CAUTION
