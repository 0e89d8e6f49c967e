"""Which advice a situation gives, how long it stands, and why it changes."""

from collections.abc import Collection

from deconflict.advisories.situations.advice.action_sets import PEOPLE_NOTICE_S, PEOPLE_STAND_S, proposal_of
from deconflict.advisories.situations.advice.situation_advice import STANDS_S, revised_advice
from deconflict_client.advisory import AnyAdvisory, EncounterClass, moment
from deconflict_client.situations import SituationAdvice
from tests.deconflict.advisories.situations.made_situations import (
    NOW_S,
    action,
    advice,
    blockage,
    conflict,
    deadlock,
    head_on,
    queue,
)


def revised(
    before: SituationAdvice | None, now_s: float, *advisories: AnyAdvisory, busy: Collection[str] = ()
) -> SituationAdvice | None:
    robots = {robot for advisory in advisories for robot in advisory.robots}
    free = [robot for robot in robots if robot not in busy]
    return revised_advice(before, proposal_of(advisories, free, now_s), robots, busy, now_s)


def test_the_first_to_do_comes_first() -> None:
    soon = head_on("ab", 5.0, recommendation=advice(action("b")))
    later = head_on("bc", 9.0, recommendation=advice(action("c")))
    found = revised(None, NOW_S, later, soon)
    assert found is not None
    assert found.text == "Robot b should wait 4 s; Robot c should wait 4 s"


def test_nobody_has_to_wait_for_less_than_a_person_can_do() -> None:
    short = head_on("ab", recommendation=advice(action("a", seconds=2.0)))
    assert revised(None, NOW_S, short) is None


def test_advice_stands_while_it_is_proposed_anywhere() -> None:
    first = head_on("ab", 30.0, recommendation=advice(action("a", "slow_down", seconds=14.0, speed_mps=0.5)))
    before = revised(None, NOW_S, first)
    other = head_on("bc", 29.0, recommendation=advice(action("c")))
    assert revised(before, NOW_S + 2 * STANDS_S, other, first) == before


def test_a_change_says_why() -> None:
    slowing = advice(action("a", "slow_down", seconds=6.0, speed_mps=0.5))
    before = revised(None, NOW_S, head_on("ab", recommendation=slowing))
    other = head_on("ab", 30.0, recommendation=advice(action("b")))
    after = revised(before, NOW_S + STANDS_S, other)
    assert after is not None
    assert (after.actions[0].robot, after.changed_because) == (
        "b",
        "Robot a does not have to slow down any more",
    )


def test_advice_stands_for_some_seconds_at_least() -> None:
    before = revised(None, NOW_S, head_on("ab", recommendation=advice(action("a"))))
    assert revised(before, NOW_S + 1, head_on("ab", recommendation=advice(action("b")))) == before


def test_a_wait_that_is_over_is_no_advice() -> None:
    before = revised(None, NOW_S, head_on("ab", recommendation=advice(action("a"))))
    assert revised(before, NOW_S + 5, head_on("ab")) is None


def test_a_wait_is_not_asked_for_again_after_its_time() -> None:
    given = advice(action("a")).model_copy(update={"given_at": moment(NOW_S)})
    waiting = head_on("ab", 30.0, recommendation=given)
    before = revised(None, NOW_S, waiting)
    assert before is not None
    assert revised(before, NOW_S + 5, waiting) is None


def test_what_is_left_of_a_wait_is_advised() -> None:
    given = advice(action("a", seconds=20.0)).model_copy(update={"given_at": moment(NOW_S - 15)})
    found = revised(None, NOW_S, head_on("ab", 10.0, recommendation=given, encounter_class=EncounterClass.HEAD_ON))
    assert found is not None
    assert found.actions[0].seconds == 5.0


def test_a_wait_that_nobody_asks_for_ends() -> None:
    before = revised(None, NOW_S, head_on("ab", recommendation=advice(action("a", seconds=60.0))))
    assert revised(before, NOW_S + STANDS_S, head_on("ab")) is None


def test_advice_to_a_robot_that_has_left_the_situation_ends() -> None:
    before = revised(None, NOW_S, head_on("ab", recommendation=advice(action("b"), action("a"))))
    assert revised(before, NOW_S + 1, head_on("bc", recommendation=advice(action("b")))) != before


def test_something_more_urgent_takes_the_place_of_advice_that_stands() -> None:
    stands = blockage("xab", predicted_at=moment(NOW_S + 60), recommendation=advice(action("x", "look")))
    before = revised(None, NOW_S, stands)
    urgent = blockage("ycd", predicted_at=moment(NOW_S + 20), recommendation=advice(action("y", "look")))
    after = revised(before, NOW_S + PEOPLE_STAND_S, stands, urgent)
    assert after is not None
    assert [each.robot for each in after.actions] == ["y", "x"]
    assert after.changed_because == "there is less time for Robot y"


def test_robots_in_an_unsolved_conflict_are_not_both_sent_first() -> None:
    found = revised(
        None,
        NOW_S,
        head_on("ab", recommendation=advice(action("a"), action("b", "go_first"))),
        head_on("ac", recommendation=advice(action("a"), action("c", "go_first"))),
        head_on("bc"),
    )
    assert found is not None
    assert [(each.robot, each.action) for each in found.actions] == [("a", "wait")]


def test_that_a_robot_goes_first_is_no_advice_by_itself() -> None:
    assert revised(None, NOW_S, head_on("ab", recommendation=advice(action("b", "go_first")))) is None


def test_robots_of_a_ring_do_not_all_wait() -> None:
    ring = [head_on(pair, recommendation=advice(action(waiter))) for pair, waiter in (("ab", "a"), ("bc", "b"))]
    last = head_on("ca", 9.0, recommendation=advice(action("c")))
    found = revised(None, NOW_S, *ring, last)
    assert found is not None
    assert [each.robot for each in found.actions] == ["a", "b"]


def test_the_actions_of_one_plan_are_taken_whole_or_not_at_all() -> None:
    first, other = (
        head_on(pair, recommendation=advice(*(action(robot, "back_out") for robot in pair))) for pair in ("ab", "cd")
    )
    found = revised(None, NOW_S, first, other)
    assert found is not None
    assert [each.robot for each in found.actions] == ["a", "b"]


def test_a_plan_with_a_robot_that_the_situation_does_not_list_is_left_out() -> None:
    assert revised(None, NOW_S, head_on("ab", recommendation=advice(action("a"), action("z")))) is None


def test_a_wait_that_costs_more_than_it_saves_is_no_advice() -> None:
    likely, unlikely = (
        head_on("ab", recommendation=advice(action("a")), probability=probability) for probability in (0.6, 0.5)
    )
    assert revised(None, NOW_S, likely) is not None
    assert revised(None, NOW_S, unlikely) is None


def test_waits_of_one_recommendation_cost_together() -> None:
    both = head_on("ab", recommendation=advice(action("a"), action("b")), probability=0.9)
    assert revised(None, NOW_S, both) is None


def test_advice_stands_until_everybody_has_had_their_time() -> None:
    first = head_on("ab", 5.0, recommendation=advice(action("a", seconds=3.0)))
    second = head_on("bc", 9.0, recommendation=advice(action("c", seconds=4.5)))
    before = revised(None, NOW_S, first, second)
    assert revised(before, NOW_S + 3.5, head_on("ab"), head_on("bc")) == before


def test_advice_that_says_where_to_go_takes_the_place_of_vague_advice() -> None:
    vague = conflict("ab", recommendation=advice(action("a", "take_another_route")))
    before = revised(None, NOW_S, vague)
    assert before is not None
    twin = queue("ab", recommendation=advice(action("a", "take_another_route", where="to Lift 2", resource="lift-2")))
    after = revised(before, NOW_S + STANDS_S, vague, twin)
    assert after is not None
    assert after.text == "Robot a should go to Lift 2"


def test_a_person_is_asked_to_look_at_a_blocker() -> None:
    found = revised(None, NOW_S, blockage("xab", recommendation=advice(action("x", "look"))))
    assert found is not None
    assert found.text == "somebody should go to Robot x"


def test_people_are_asked_first_and_for_long_enough() -> None:
    crossing = head_on("ab", 5.0, recommendation=advice(action("a")))
    blocked = blockage("xcd", recommendation=advice(action("x", "look")))
    found = revised(None, NOW_S, crossing, blocked)
    assert found is not None
    assert (found.for_people, found.text) == (True, "somebody should go to Robot x")
    short = blockage("xcd", recommendation=advice(action("c", seconds=PEOPLE_STAND_S - 1)))
    found = revised(None, NOW_S, short)
    assert found is not None
    assert not found.for_people


def test_people_are_asked_only_while_there_is_time_to_read_and_do_it() -> None:
    slowing = advice(action("a", "slow_down", seconds=8.0, speed_mps=0.5))
    in_time, too_late = (
        head_on("ab", left_s, recommendation=slowing) for left_s in (PEOPLE_NOTICE_S + 0.5, PEOPLE_NOTICE_S - 0.5)
    )
    asked, late = revised(None, NOW_S, in_time), revised(None, NOW_S, too_late)
    assert asked is not None
    assert late is not None
    assert (asked.for_people, late.for_people) == (True, False)
    assert revised(asked, NOW_S + PEOPLE_NOTICE_S - 1, in_time) == asked, "the time may run down"


def test_what_people_do_does_not_make_way_for_what_programs_do() -> None:
    slowing = advice(action("a", "slow_down", seconds=8.0, speed_mps=0.5))
    before = revised(None, NOW_S, head_on("ab", 20.0, recommendation=slowing))
    assert before is not None
    assert before.for_people
    now_s, sooner = NOW_S + PEOPLE_STAND_S + 6, head_on("cd", 15.0, recommendation=advice(action("c")))
    assert revised(before, now_s, head_on("ab", 20.0, recommendation=slowing), sooner) == before


def test_what_people_can_do_takes_the_place_of_what_programs_do() -> None:
    crossing = head_on("ab", 5.0, recommendation=advice(action("a")))
    before = revised(None, NOW_S, crossing)
    assert before is not None
    assert not before.for_people
    blocked = blockage("xcd", recommendation=advice(action("x", "look")))
    after = revised(before, NOW_S + 1, crossing, blocked)
    assert after is not None
    assert (after.for_people, after.changed_because) == (True, "robots would lose about 30 s otherwise")


def test_advice_for_people_stands_for_longer() -> None:
    before = revised(None, NOW_S, blockage("xcd", recommendation=advice(action("x", "look"))))
    nothing = blockage("xcd")
    assert revised(before, NOW_S + PEOPLE_STAND_S - 1, nothing) == before
    assert revised(before, NOW_S + PEOPLE_STAND_S, nothing) is None


def test_advice_for_people_makes_way_at_once_for_what_helps_instead() -> None:
    before = revised(None, NOW_S, deadlock("ab", recommendation=advice(action("a", seconds=20.0))))
    after = revised(before, NOW_S + 1, deadlock("ab", recommendation=advice(action("b", "back_out"))))
    assert after is not None
    assert (after.actions[0].robot, after.changed_because) == ("b", "Robot a does not have to wait any more")


def test_a_robot_that_is_busy_elsewhere_gets_no_advice() -> None:
    crossing = head_on("ab", 5.0, recommendation=advice(action("a"), action("b", "go_first")))
    assert revised(None, NOW_S, crossing, busy="a") is None
    assert revised(None, NOW_S, crossing, busy="b") is None


def test_advice_ends_if_its_robot_gets_something_more_urgent_to_do() -> None:
    crossing = head_on("ab", 5.0, recommendation=advice(action("a")))
    before = revised(None, NOW_S, crossing)
    other = head_on("bc", 6.0, recommendation=advice(action("c")))
    after = revised(before, NOW_S + 1, crossing, other, busy="a")
    assert after is not None
    assert after.changed_because == "Robot a has something more urgent to do"


def test_who_goes_first_is_no_step_of_its_own() -> None:
    crossing = head_on("ab", 5.0, recommendation=advice(action("a"), action("b", "go_first")))
    found = revised(None, NOW_S, crossing)
    assert found is not None
    assert found.text == "Robot a should wait 4 s, so that Robot b goes first"


def test_vague_advice_to_people_beside_advice_to_programs_that_says_where_to_go() -> None:
    vague = head_on("ab", 60.0, recommendation=advice(action("a", "take_another_route")))
    twin = queue("ab", recommendation=advice(action("a", "take_another_route", where="to Lift 2", resource="lift-2")))
    before = revised_advice(None, proposal_of([twin], "ab", NOW_S, passing=[twin.id]), "ab", (), NOW_S)
    assert before is not None
    proposal = proposal_of([vague, twin], "ab", NOW_S + 1, passing=[twin.id])
    after = revised_advice(before, proposal, "ab", (), NOW_S + 1)
    assert after is not None
    assert after.text == "Robot a should take another route"
