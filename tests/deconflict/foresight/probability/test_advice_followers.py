"""Advice that robots follow: its outcomes do not show how good forecasts are."""

from datetime import timedelta

import numpy as np
import pytest

from deconflict.foresight.probability.advice_followers import KEPT_S, AdviceFollowers, waits_until_s
from deconflict.foresight.probability.pair_table import codes
from deconflict_client.advisory import ClearedCode, Hold, Recommendation, Slot
from tests.deconflict.foresight.probability.made_stage import Stage, Walk
from tests.helpers.made_advisories import ROBOTS, START, made
from tests.helpers.made_encounters import NOW_S

TOLD_S, WAITS_S = 4, 8
PAIRS = codes(np.array([0, 0, 1]), np.array([1, 2, 2]))


def advice(holds: tuple[Hold, ...] = (), slots: tuple[Slot, ...] = ()) -> Recommendation:
    return Recommendation(holds=holds, slots=slots, cost_s=5, bound_s=5, proven_optimal=True)


def crossing(expected: bool) -> Stage:
    """Two robots would meet. One stops 4 s before, advised or not, drives on 8 s later, and passes behind the other."""
    stage = Stage({"a": Walk((0.0, -12.0), (0.0, 1.0)), "b": Walk((-12.0, 0.0), (1.0, 0.0))})
    stage.run(TOLD_S + 1)
    if expected:
        stage.foresight.note_advice(NOW_S + TOLD_S, {"a": NOW_S + TOLD_S + WAITS_S})
    at = -12.0 + TOLD_S
    stage.walks["a"] = Walk((0.0, at), (0.0, 0.0), says=(0.0, 1.0))
    for t_s in range(TOLD_S + 1, TOLD_S + WAITS_S + 1):
        stage.second(t_s)
    assert stage.foresight.following_advice(NOW_S + TOLD_S + WAITS_S) == (["a"] if expected else [])
    stage.walks["a"] = Walk((0.0, at - TOLD_S - WAITS_S), (0.0, 1.0))
    for t_s in range(TOLD_S + WAITS_S + 1, 40):
        stage.second(t_s)
    return stage


def test_a_conflict_that_advice_prevented_does_not_lower_later_probabilities() -> None:
    stage, untold = crossing(True), crossing(False)
    outcomes, others = (
        staged.foresight.measures.values["deconflict_probability_outcomes_total"] for staged in (stage, untold)
    )
    assert others["passed",] > outcomes.get(("passed",), 0) + 5
    assert outcomes["left",] > others.get(("left",), 0)
    seen, alike = np.array([[1.0, 2.0, 2.0, 0.3, 0.0]]), np.zeros(1, np.int64)
    prior = Stage({}).foresight.learning.contact.estimate(seen, alike).probability
    after_told, after_untold = (
        staged.foresight.learning.contact.estimate(seen, alike).probability for staged in (stage, untold)
    )
    assert after_untold < prior - 0.01
    assert after_told == pytest.approx(prior, abs=0.002)


def test_a_robot_that_waits_as_advised_does_not_widen_the_bands_of_its_vendor() -> None:
    advised, unadvised = crossing(True).foresight, crossing(False).foresight
    assert advised.ledger.bands_m.max() < unadvised.ledger.bands_m.max()


def test_a_robot_that_waits_is_not_taken_for_one_that_follows_its_path_badly() -> None:
    waited = crossing(False).foresight
    assert waited.following.bands_m.max() < waited.ledger.bands_m.max()
    assert waited.measures.values.get("deconflict_forecasts_distrusted_total", {}) == {}


def new_followers() -> AdviceFollowers:
    followers = AdviceFollowers()
    followers.grow(3)
    return followers


def record_waits(followers: AdviceFollowers, at_s: float, *stand: bool, apart_m: float = 20.0) -> list[int]:
    """Robots of 1 x 0.6 m that head east, each so far east of the one before."""
    slots = np.arange(len(stand))
    newest = np.array([(at_s, apart_m * slot, 0.0, 0.0, 0.0) for slot in slots])
    half_m = np.repeat([[0.5], [0.3]], len(stand), axis=1)
    return list(followers.record_waits(slots, np.array(stand), newest, half_m))


def test_a_robot_follows_advice_if_it_was_moving_before_and_stands_now() -> None:
    followers = new_followers()
    followers.note_advice(0, 10.0, 20.0, stands=False)
    followers.note_advice(1, 10.0, 20.0, stands=True)
    assert record_waits(followers, 9.0, False, True, True) == []
    assert record_waits(followers, 11.0, False, True, True) == []
    assert record_waits(followers, 12.0, True, True, True) == [0]
    assert record_waits(followers, 21.0, True, True, True) == []
    followers.forget(np.array([0]))
    assert followers.waiting(0.0).tolist() == []


@pytest.mark.parametrize(("apart_m", "waits"), [(2.0, [1]), (2.2, [0, 1]), (-2.0, [0])])
def test_a_robot_that_comes_to_stand_before_another_body_stops_by_itself(apart_m: float, waits: list[int]) -> None:
    followers = new_followers()
    for slot in range(2):
        followers.note_advice(slot, 10.0, 20.0, stands=False)
    assert record_waits(followers, 12.0, True, True, apart_m=apart_m) == waits
    assert record_waits(followers, 13.0, True, True) == waits, "it stood already when the way was free again"


def test_a_robot_that_waits_as_advised_goes_on_with_that_while_others_pass_right_before_it() -> None:
    followers = new_followers()
    followers.note_advice(0, 10.0, 20.0, stands=False)
    assert record_waits(followers, 12.0, True, False) == [0]
    assert record_waits(followers, 13.0, True, False, apart_m=1.5) == [0]


def test_unadvised_time_ends_when_a_robot_begins_to_wait_as_advised() -> None:
    followers = new_followers()
    followers.note_advice(0, 10.0, 20.0, stands=False)
    for at_s in (12.0, 13.0, 14.0):
        record_waits(followers, at_s, True)
    heard = np.zeros((3, 5))
    heard[:, 0] = (100.0, 100.0, 3.0)
    until_s = [followers.own_until_s(heard, PAIRS, asked_s, 10.0).tolist() for asked_s in (1.0, 5.0, 13.0, 15.0)]
    assert until_s == [[first_s, min(first_s, 3.0), 3.0] for first_s in (100.0, 12.0, -np.inf, 100.0)]


def test_unadvised_time_of_a_pair_ends_while_one_does_what_it_was_asked_for_the_other() -> None:
    followers, heard = new_followers(), np.full((3, 5), 100.0)
    for at_s in (12.0, 13.0, 14.0):
        followers.note_followed(int(PAIRS[0]), at_s)
    until_s = [followers.own_until_s(heard, PAIRS, asked_s, 10.0).tolist() for asked_s in (1.0, 5.0, 13.0, 15.0)]
    assert until_s == [[first_s, 100.0, 100.0] for first_s in (100.0, 12.0, -np.inf, 100.0)]
    assert followers.own_until_s(heard, PAIRS[1:], 13.0, 10.0).tolist() == [100.0, 100.0], "it is not asked about"
    assert followers.followed(14.0).tolist() == PAIRS[:1].tolist()
    assert [followers.has_followed(int(PAIRS[0]), at_s) for at_s in (11.9, 12.0, 14.0, 14.1)] == [
        False,
        True,
        True,
        False,
    ]


def test_what_a_pair_followed_is_forgotten_with_its_robots_and_after_a_while() -> None:
    followers = new_followers()
    for code in PAIRS.tolist():
        followers.note_followed(code, 10.0)
    followers.forget(np.array([1]))
    assert followers.followed(0.0).tolist() == PAIRS[1:2].tolist()
    followers.note_followed(int(PAIRS[2]), 10.0 + 2 * KEPT_S)
    assert followers.followed(0.0).tolist() == PAIRS[2:].tolist()


def test_open_advice_gives_the_end_of_each_wait() -> None:
    hold = Hold(robot=ROBOTS[0], hold_s=4.0)
    start_at = START + timedelta(minutes=3)
    slots = tuple(
        Slot(robot=robot, resource="dock", start_at=start_at, end_at=start_at, wait_s=wait_s)
        for robot, wait_s in (("x", 0.0), ("y", 9.0))
    )
    raised = made(1, recommendation=advice(holds=(hold,)))
    values = waits_until_s([raised, made(2), made(3, recommendation=advice(slots=slots))])
    assert values == {ROBOTS[0]: raised.updated_at.timestamp() + 4.0, "y": start_at.timestamp()}
    assert waits_until_s([raised.cleared_revision(NOW_S, ClearedCode.PASSED, "over")]) == {}
