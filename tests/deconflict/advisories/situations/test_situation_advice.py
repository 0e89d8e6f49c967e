"""Which advice a situation gives, how long it stands, and why it changes."""

from deconflict.advisories.situations.situation import SituationAdvice
from deconflict.advisories.situations.situation_advice import STANDS_S, proposals_of, revised_advice
from deconflict.advisory import AnyAdvisory
from tests.deconflict.advisories.situations.made_situations import NOW_S, action, advice, blockage, conflict


def revised(before: SituationAdvice | None, now_s: float, *advisories: AnyAdvisory) -> SituationAdvice | None:
    robots = {robot for advisory in advisories for robot in advisory.robots}
    return revised_advice(before, proposals_of(advisories, robots, now_s), robots, now_s)


def test_the_first_to_do_comes_first() -> None:
    soon = conflict("ab", 5.0, recommendation=advice(action("b")))
    later = conflict("bc", 9.0, recommendation=advice(action("c"), action("b", "slow_down", speed_mps=0.5)))
    found = revised(None, NOW_S, later, soon)
    assert found is not None
    assert found.text == "Robot b should wait 5 s; Robot c should wait 5 s"


def test_nobody_has_to_wait_for_less_than_a_person_can_do() -> None:
    short = conflict("ab", recommendation=advice(action("a", seconds=2.0)))
    assert revised(None, NOW_S, short) is None


def test_at_most_three_actions_are_advised() -> None:
    many = conflict("ab", recommendation=advice(*map(action, "ab")))
    more = conflict("cd", recommendation=advice(*map(action, "cd")))
    found = revised(None, NOW_S, many, more)
    assert found is not None
    assert len(found.actions) == 3


def test_advice_stands_while_it_is_proposed_anywhere() -> None:
    first = conflict("ab", recommendation=advice(action("a", seconds=20.0)))
    before = revised(None, NOW_S, first)
    other = conflict("bc", 4.0, recommendation=advice(action("c")))
    assert revised(before, NOW_S + 2 * STANDS_S, other, first) == before


def test_a_change_says_why() -> None:
    before = revised(None, NOW_S, conflict("ab", recommendation=advice(action("a", seconds=20.0))))
    other = conflict("ab", 30.0, recommendation=advice(action("b")))
    after = revised(before, NOW_S + STANDS_S, other)
    assert after is not None
    assert (after.actions[0].robot, after.changed_because) == ("b", "Robot b is now the first to act")


def test_advice_stands_for_some_seconds_at_least() -> None:
    before = revised(None, NOW_S, conflict("ab", recommendation=advice(action("a"))))
    assert revised(before, NOW_S + 1, conflict("ab", recommendation=advice(action("b")))) == before


def test_a_wait_that_is_over_is_no_advice() -> None:
    before = revised(None, NOW_S, conflict("ab", recommendation=advice(action("a"))))
    assert revised(before, NOW_S + 5, conflict("ab")) is None


def test_advice_to_a_robot_that_has_left_the_situation_ends() -> None:
    before = revised(None, NOW_S, conflict("ab", recommendation=advice(action("a"))))
    assert revised(before, NOW_S + 1, conflict("bc")) is None


def test_a_person_is_asked_to_look_at_a_blocker() -> None:
    found = revised(None, NOW_S, blockage("xab", recommendation=advice(action("x", "look"))))
    assert found is not None
    assert found.text == "somebody should look at Robot x"
