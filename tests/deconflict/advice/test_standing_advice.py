"""Advice stands until it is done, no longer works, or is clearly beaten; then it says why it changes."""

from dataclasses import replace
from functools import partial

from deconflict.advice.conflict_advice import advise_conflicts
from deconflict.advice.standing_advice import DONE
from deconflict_client.advisory import Hold, Recommendation, moment
from tests.deconflict.advice.made_near import WINDOW, SeenRobot, eastward, held_s, near, northward
from tests.helpers.made_encounters import NOW_S

PAIR = ("a", "b")
A, B = eastward("a", -5.3), northward("b", -5.0)


def given(hold: Hold, seconds_ago: float = 3.0) -> Recommendation:
    at = moment(NOW_S - seconds_ago)
    return Recommendation(holds=(hold,), cost_s=hold.hold_s, bound_s=0.0, proven_optimal=False, given_at=at)


def again(before: Recommendation, *robots: SeenRobot) -> Recommendation:
    """The advice for a and b, if `before` stands."""
    return advise_conflicts(near(robots), [PAIR], WINDOW, standing={PAIR: before})[PAIR]


def test_advice_that_still_works_is_given_again_although_another_hold_would_be_shorter() -> None:
    best = advise_conflicts(near([A, B]), [PAIR], WINDOW)[PAIR]
    assert held_s(best) == {"a": 2.0}
    for hold in (Hold(robot="a", hold_s=3.5), Hold(robot="b", hold_s=3.5)):
        before = given(hold, seconds_ago=0.5)
        assert again(before, A, B) is before


def test_a_robot_that_waits_as_advised_is_not_advised_anew() -> None:
    """It reports that it stands, and b passes it."""
    waiting = eastward("a", -5.3, holdable=False, speed_mps=0.0)
    before = given(Hold(robot="a", hold_s=6.0))
    assert again(before, waiting, B) is before


def test_advice_that_would_not_keep_them_apart_any_more_changes_and_says_why() -> None:
    before = given(Hold(robot="a", hold_s=1.0), seconds_ago=0.5)
    changed = again(before, A, B)
    assert held_s(changed) == {"a": 2.0}
    assert changed.changed_because == "a and b would meet even if a waited as advised"


def test_advice_that_brings_others_together_changes_and_names_them() -> None:
    behind = eastward("c", -8.0, holdable=False)
    changed = again(given(Hold(robot="a", hold_s=3.0), seconds_ago=0.0), A, northward("b", -5.0, priority=0.5), behind)
    assert held_s(changed).keys() == {"b"}
    assert changed.changed_because == "a and c would meet even if a waited as advised"


def test_advice_that_is_clearly_beaten_changes_and_says_by_how_much() -> None:
    before = given(Hold(robot="a", hold_s=5.0), seconds_ago=0.0)
    changed = again(before, A, B)
    assert held_s(changed) == {"a": 2.0}
    assert changed.changed_because == "other advice saves 3 s"


def test_a_wait_that_is_over_is_advised_anew_if_the_conflict_is_still_there() -> None:
    """a stands in the way of b, which has to wait now."""
    waited = eastward("a", -0.5, holdable=False, speed_mps=0.0)
    changed = again(given(Hold(robot="a", hold_s=3.0), seconds_ago=4.0), waited, B)
    assert changed.note.startswith("no hold keeps a and b apart: b should")
    assert changed.changed_because == DONE


def test_a_robot_that_has_not_waited_by_its_time_may_still_do_so() -> None:
    before = given(Hold(robot="a", hold_s=3.0), seconds_ago=4.0)
    assert again(before, A, B) is before


def test_a_robot_that_has_waited_and_drives_on_is_advised_anew() -> None:
    before = given(Hold(robot="a", hold_s=3.0), seconds_ago=4.0)
    changed = again(before, A._replace(waited_s=NOW_S - 1.0), B)
    assert held_s(changed) == {"a": 2.0}
    assert changed.changed_because == DONE


def test_the_first_advice_changes_nothing() -> None:
    question = partial(advise_conflicts, near([A, B]), [PAIR], replace(WINDOW))
    assert question()[PAIR].changed_because == ""
