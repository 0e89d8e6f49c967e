"""Advice that robots follow: what comes of it teaches nothing of what forecasts are worth."""

from datetime import timedelta

import numpy as np
import pytest

from deconflict.advisory import Hold, Recommendation, Slot
from deconflict.foresight.probability.advice_followers import AdviceFollowers, waits_until_s
from tests.deconflict.foresight.probability.made_stage import Stage, Walk
from tests.helpers.made_advisories import ROBOTS, START, cleared, made
from tests.helpers.made_encounters import NOW_S

TOLD_S, WAITS_S = 4, 8


def advice(holds: tuple[Hold, ...] = (), slots: tuple[Slot, ...] = ()) -> Recommendation:
    return Recommendation(holds=holds, slots=slots, cost_s=5, bound_s=5, proven_optimal=True)


def crossing(told: bool) -> Stage:
    """Two robots on their way to meet; one stops 4 s before, told to or not, goes on 8 s later, and passes behind."""
    stage = Stage({"a": Walk((0.0, -12.0), (0.0, 1.0)), "b": Walk((-12.0, 0.0), (1.0, 0.0))})
    stage.run(TOLD_S + 1)
    if told:
        stage.foresight.note_advice(NOW_S + TOLD_S, {"a": NOW_S + TOLD_S + WAITS_S})
    at = -12.0 + TOLD_S
    stage.walks["a"] = Walk((0.0, at), (0.0, 0.0), says=(0.0, 1.0))
    for t_s in range(TOLD_S + 1, TOLD_S + WAITS_S + 1):
        stage.second(t_s)
    assert stage.foresight.robots_following_advice(NOW_S + TOLD_S + WAITS_S) == (["a"] if told else [])
    stage.walks["a"] = Walk((0.0, at - TOLD_S - WAITS_S), (0.0, 1.0))
    for t_s in range(TOLD_S + WAITS_S + 1, 40):
        stage.second(t_s)
    return stage


def test_a_conflict_that_advice_ended_teaches_no_doubt() -> None:
    told, untold = crossing(True), crossing(False)
    outcomes, others = (
        one.foresight.measures.values["deconflict_probability_outcomes_total"] for one in (told, untold)
    )
    assert others["passed",] > outcomes.get(("passed",), 0) + 5
    assert outcomes["left",] > others.get(("left",), 0)
    seen, alike = np.array([[1.0, 2.0, 2.0, 0.3, 0.0]]), np.zeros(1, np.int64)
    prior = Stage({}).foresight.contact.estimate(seen, alike).probability
    after_told, after_untold = (one.foresight.contact.estimate(seen, alike).probability for one in (told, untold))
    assert after_untold < prior - 0.01
    assert after_told == pytest.approx(prior, abs=0.002)


def test_a_robot_that_waits_as_advised_does_not_widen_the_bands_of_its_vendor() -> None:
    advised, unadvised = crossing(True).foresight, crossing(False).foresight
    assert advised.ledger.bands_m.max() < unadvised.ledger.bands_m.max()


def test_a_robot_that_waits_is_not_taken_for_one_that_follows_its_path_badly() -> None:
    waited = crossing(False).foresight
    assert waited.following.bands_m.max() < waited.ledger.bands_m.max()
    assert waited.measures.values.get("deconflict_forecasts_distrusted_total", {}) == {}


def heeded() -> AdviceFollowers:
    one = AdviceFollowers()
    one.grow(3)
    return one


def seen(one: AdviceFollowers, at_s: float, *stand: bool) -> list[int]:
    slots = np.arange(len(stand))
    return list(one.record_waits(slots, np.full(len(stand), at_s), np.array(stand)))


def test_only_one_that_was_on_its_way_and_stands_heeds_advice() -> None:
    one = heeded()
    one.note_advice(0, 10.0, 20.0, stands=False)
    one.note_advice(1, 10.0, 20.0, stands=True)
    assert seen(one, 9.0, False, True, True) == []
    assert seen(one, 11.0, False, True, True) == []
    assert seen(one, 12.0, True, True, True) == [0]
    assert seen(one, 21.0, True, True, True) == []
    one.forget(np.array([0]))
    assert one.waiting(0.0).tolist() == []


def test_until_when_a_robot_went_its_own_way() -> None:
    one = heeded()
    one.note_advice(0, 10.0, 20.0, stands=False)
    for at_s in (12.0, 13.0, 14.0):
        seen(one, at_s, True)
    heard = np.zeros((3, 5))
    heard[:, 0] = (100.0, 100.0, 3.0)
    until_s = [one.own_until_s(heard, asked_s, 10.0).tolist() for asked_s in (1.0, 5.0, 13.0, 15.0)]
    assert until_s == [[first_s, 100.0, 3.0] for first_s in (100.0, 12.0, -np.inf, 100.0)]


def test_advice_that_stands_says_until_when_to_wait() -> None:
    hold = Hold(robot=ROBOTS[0], hold_s=4.0)
    start_at = START + timedelta(minutes=3)
    slots = tuple(
        Slot(robot=robot, resource="dock", start_at=start_at, end_at=start_at, wait_s=wait_s)
        for robot, wait_s in (("x", 0.0), ("y", 9.0))
    )
    raised = made(1, recommendation=advice(holds=(hold,)))
    told = waits_until_s([raised, made(2), made(3, recommendation=advice(slots=slots))])
    assert told == {ROBOTS[0]: raised.updated_at.timestamp() + 4.0, "y": start_at.timestamp()}
    assert waits_until_s([cleared(1, recommendation=advice(holds=(hold,)))]) == {}
