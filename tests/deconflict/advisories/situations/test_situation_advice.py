"""Which advice a situation gives, how long it stands, and why it changes."""

from deconflict.advisories.situations.situation import SituationAdvice
from deconflict.advisories.situations.situation_advice import STANDS_S, proposals_of, revised_advice
from deconflict.advisory import Action, AnyAdvisory, moment
from tests.deconflict.advisories.situations.made_situations import NOW_S, action, advice, blockage, conflict, queue


def revised(before: SituationAdvice | None, now_s: float, *advisories: AnyAdvisory) -> SituationAdvice | None:
    robots = {robot for advisory in advisories for robot in advisory.robots}
    return revised_advice(before, proposals_of(advisories, robots, now_s), robots, now_s)


def test_the_first_to_do_comes_first() -> None:
    soon = conflict("ab", 5.0, recommendation=advice(action("b")))
    later = conflict("bc", 9.0, recommendation=advice(action("c"), action("b", "slow_down", speed_mps=0.5)))
    found = revised(None, NOW_S, later, soon)
    assert found is not None
    assert found.text == "Robot b should wait 4 s; Robot c should wait 4 s"


def test_nobody_has_to_wait_for_less_than_a_person_can_do() -> None:
    short = conflict("ab", recommendation=advice(action("a", seconds=2.0)))
    assert revised(None, NOW_S, short) is None


def test_at_most_three_actions_are_advised() -> None:
    many, more = (conflict(pair, recommendation=advice(action(pair[0]), look(pair[1]))) for pair in ("ab", "cd"))
    found = revised(None, NOW_S, many, more)
    assert found is not None
    assert len(found.actions) == 3


def look(robot: str) -> Action:
    return action(robot, "look")


def test_a_wait_that_costs_more_than_the_conflict_is_no_advice() -> None:
    likely, unlikely = (
        conflict("ab", recommendation=advice(action("a")), probability=probability) for probability in (0.7, 0.6)
    )
    assert revised(None, NOW_S, likely) is not None
    assert revised(None, NOW_S, unlikely) is None


def test_waits_of_one_recommendation_cost_together() -> None:
    both = conflict("ab", recommendation=advice(action("a"), action("b")), probability=0.9)
    assert revised(None, NOW_S, both) is None


def test_a_wait_is_advised_once_although_its_recommendation_stands() -> None:
    given = advice(action("a")).model_copy(update={"given_at": moment(NOW_S)})
    advised = conflict("ab", recommendation=given)
    before = revised(None, NOW_S, advised)
    assert before is not None
    assert revised(before, NOW_S + 3.9, advised) == before
    assert revised(before, NOW_S + 4.1, advised) is None
    assert revised(None, NOW_S + 4.1, advised) is None


def test_advice_stands_until_everybody_has_had_their_time() -> None:
    first = conflict("ab", 5.0, recommendation=advice(action("a", seconds=3.0)))
    second = conflict("bc", 9.0, recommendation=advice(action("c", seconds=4.5)))
    before = revised(None, NOW_S, first, second)
    assert revised(before, NOW_S + 3.5, first) == before


def test_advice_stands_while_it_is_proposed_anywhere() -> None:
    first = conflict("ab", recommendation=advice(action("a", "slow_down", speed_mps=0.5, seconds=20.0)))
    before = revised(None, NOW_S, first)
    other = conflict("bc", 4.0, recommendation=advice(action("c")))
    assert revised(before, NOW_S + 2 * STANDS_S, other, first) == before


def test_a_change_says_why() -> None:
    before = revised(
        None, NOW_S, conflict("ab", recommendation=advice(action("a", "slow_down", speed_mps=0.5, seconds=20.0)))
    )
    other = conflict("ab", 30.0, recommendation=advice(action("b")))
    after = revised(before, NOW_S + STANDS_S, other)
    assert after is not None
    assert (after.actions[0].robot, after.changed_because) == ("b", "Robot b is now the first to act")


def test_advice_that_says_where_to_go_takes_the_place_of_vague_advice() -> None:
    vague = conflict("ab", recommendation=advice(action("a", "take_another_route")))
    before = revised(None, NOW_S, vague)
    assert before is not None
    twin = queue("ab", recommendation=advice(action("a", "take_another_route", where="to Lift 2", resource="lift-2")))
    after = revised(before, NOW_S + STANDS_S, vague, twin)
    assert after is not None
    assert after.text == "Robot a should go to Lift 2"


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
