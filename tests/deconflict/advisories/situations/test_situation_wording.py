"""What situations say: about what, in which tense, and where."""

from typing import Any

import pytest

from deconflict.advisories.situations.situation_lifecycle import OVER_S, UPDATE_GAP_S
from deconflict_client.advisory import AnyAdvisory, ClearedCode, EncounterClass, moment
from tests.deconflict.advisories.situations.made_situations import (
    NOW_S,
    action,
    advice,
    blockage,
    conflict,
    deadlock,
    head_on,
    lifecycle,
    queue,
    raised,
)


def test_a_situation_is_about_what_people_are_asked_to_end() -> None:
    """The blockage costs more; without the order of the deadlock it is the title."""
    blocked, robots = blockage("acdefghijkl"), "ab"
    assert raised([blocked, deadlock(robots)]).situation_kind == "blocked_aisle"
    locked = deadlock(robots, recommendation=advice(action("a", "look")))
    situation = raised([blocked, locked])
    assert situation.situation_kind == "deadlock"
    assert situation.summary.startswith("Robot a and Robot b lock each other")


def test_the_sentence_stays_as_long_as_its_order() -> None:
    situations = lifecycle()
    met = head_on("ab", 20.0, recommendation=advice(action("a", "back_out", where="of Aisle 3")))
    (before,) = situations.revise(NOW_S, [met])
    later_s = NOW_S + UPDATE_GAP_S
    situations.revise(later_s, [deadlock("ab"), met.cleared_revision(later_s, ClearedCode.PASSED, "they drive")])
    (after,) = situations.open()
    assert after.advice == before.advice
    assert (after.situation_kind, after.summary) == (before.situation_kind, before.summary)
    situations.revise(NOW_S + 3 * UPDATE_GAP_S, [])
    assert [each.situation_kind for each in situations.open()] == ["deadlock"]


def test_the_time_of_a_situation_is_that_of_its_sentence() -> None:
    """A conflict that has begun is no reason to say that the deadlock is now."""
    locked = deadlock("ab", predicted_at=moment(NOW_S + 9), recommendation=advice(action("a", "look")))
    situation = raised([conflict("bc", left_s=0.0), locked])
    assert situation.summary.startswith("Robot a and Robot b lock each other in 9 s")
    assert situation.time_to_conflict_s == 9.0


def test_how_long_a_robot_has_stood_stays_true() -> None:
    assert "Robot x has stood for over 30 s, in Aisle 3, in the way of" in raised([blockage("xab")]).summary


def test_a_queue_for_one_of_several_places_is_likely_and_names_them() -> None:
    chargers: dict[str, Any] = {
        "resource_name": "one of Charger 1, Charger 2, Charger 3 and 5 others",
        "resources": ("charger-1", "charger-2"),
        "probability": 0.8,
    }
    summary = raised([queue("abc", **chargers)]).summary
    assert summary.startswith(
        "2 robots will probably have to wait for one of Charger 1, Charger 2, Charger 3 and 5 others in"
    )
    assert summary.endswith("; 3 robots need one")


@pytest.mark.parametrize(
    ("advisory", "past"),
    [
        (conflict("ab"), "Robot a and Robot b got in each other's way, or were about to, in Aisle 3"),
        (blockage("xabc"), "Robot x stood in the way of others, in Aisle 3"),
        (deadlock("ab"), "Robot a and Robot b waited for each other, or were about to, in Aisle 3"),
        (queue("abc"), "robots needed the same place, in Aisle 3"),
    ],
)
def test_what_has_ended_is_in_the_past_and_says_how_it_ended(advisory: AnyAdvisory, past: str) -> None:
    situations = lifecycle()
    situations.revise(NOW_S, [advisory])
    situations.revise(NOW_S + 5.5, [])
    (over,) = situations.revise(NOW_S + 6, [advisory.cleared_revision(NOW_S + 6, ClearedCode.PASSED, "they drive on")])
    assert over.summary == past
    assert over.time_to_conflict_s == 0.0
    (cleared,) = situations.revise(NOW_S + 6 + OVER_S, [])
    assert (cleared.summary, cleared.cleared_because) == (past, "they drive on")


def test_a_knot_tells_people_from_robots() -> None:
    """Who reads "3 robots" looks for no person."""
    met = conflict("ab", participants=("person", "robot"))
    chased = conflict("bc", participants=("robot", "person"))
    situations = lifecycle()
    (knot,) = situations.revise(NOW_S, [met, chased])
    assert knot.headline == "1 robot and 2 people get in each other's way, in Aisle 3"
    situations.revise(NOW_S + 5.5, [])
    (over,) = situations.revise(
        NOW_S + 6, [each.cleared_revision(NOW_S + 6, ClearedCode.GAVE_WAY) for each in (met, chased)]
    )
    assert over.summary == "1 robot and 2 people got in each other's way, in Aisle 3"


def test_a_robot_stood_in_nobodys_way_who_met_others() -> None:
    """Robot b, for which the robot stood in the way, meets a third: it names nobody rather than the third, too."""
    stood = EncounterClass.STATIONARY_OBSTACLE
    still = conflict("ax", encounter_class=stood, basis=("path", "stationary"))
    situations, after = lifecycle(), conflict("ab", probability=0.1)
    (alone,) = situations.revise(NOW_S, [still])
    situations.revise(NOW_S + 1, [after])
    situations.revise(NOW_S + 5.5, [])
    (over,) = situations.revise(
        NOW_S + 6, [each.cleared_revision(NOW_S + 6, ClearedCode.PASSED) for each in (still, after)]
    )
    assert (alone.headline, len(over.robots)) == ("Robot x stands in the way of Robot a, in Aisle 3", 3)
    assert over.summary == "Robot x stood in the way of others, in Aisle 3"
