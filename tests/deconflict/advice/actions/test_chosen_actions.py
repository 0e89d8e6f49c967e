"""Actions beside waiting: each is carried out here, and swept by itself."""

from dataclasses import replace
from math import pi

import pytest

from deconflict.advice.conflict_advice import NO_LONGER_WORKS, advise_conflicts
from deconflict.advice.holds.hold_windows import DelayWindows
from deconflict_client.advisory import Action, Recommendation
from ingest.shapes import Shape, Trailer, shapes_of
from tests.deconflict.advice.made_near import WINDOW, SeenRobot, eastward, held_s, near, northward
from tests.helpers.made_encounters import robot

PAIR = ("a", "b")
SIZE_M = (1.0, 0.6)


def advised(*robots: SeenRobot, before: Recommendation | None = None) -> Recommendation:
    return advise_conflicts(near(robots), [PAIR], WINDOW, standing={PAIR: before} if before else None)[PAIR]


def kinds(advice: Recommendation) -> list[tuple[str, str]]:
    return [(action.robot, action.action) for action in advice.actions]


def meet(*robots: SeenRobot) -> set[tuple[str, str]]:
    return set(DelayWindows(near(robots), WINDOW).contacts_s({}, [each.robot for each in robots]))


def with_trailers(tug: SeenRobot, yaw_rad: float = 0.0) -> SeenRobot:
    """Two trailers straight behind a robot. The last reaches 3.5 m behind its middle."""
    trailers = (Trailer(1.0, 0.6, 1.5, yaw_rad),) * 2
    return tug._replace(forecast=replace(tug.forecast, shapes=shapes_of([Shape((), (0.0, 0.0), trailers)])))


def slower(x_m: float, action: Action, usual_mps: float) -> SeenRobot:
    """Robot a eastward as the action says, then as fast as before, for 20 s."""
    assert action.seconds
    assert action.speed_mps
    slow_s = action.seconds if action.seconds < WINDOW.horizon_s else 20.0
    change_m = x_m + slow_s * action.speed_mps
    times_s, x = [0, slow_s, 40], [x_m, change_m, change_m + (40 - slow_s) * usual_mps]
    return SeenRobot(action.robot, robot(times_s, x, [0.0] * 3, 0.0, SIZE_M))


def test_a_follower_that_is_faster_slows_down() -> None:
    """No hold keeps them apart for long: it only has to be no faster than the robot ahead."""
    behind, ahead = eastward("a", -7.0, speed_mps=1.5), eastward("b", -3.0, speed_mps=0.5)
    assert meet(behind, ahead) == {PAIR}
    advice = advised(behind, ahead)
    assert advice.holds == ()
    assert kinds(advice) == [("a", "slow_down"), ("b", "go_first")]
    assert meet(slower(-7.0, advice.actions[0], 1.5), ahead) == set()
    assert advice.note == "no hold keeps a and b apart: a should slow down to 0.5 m/s for 10 s"


def test_slowing_down_takes_the_place_of_a_long_wait_that_costs_more() -> None:
    behind, ahead = eastward("a", -6.9, speed_mps=1.2), eastward("b", -3.0, speed_mps=0.6)
    advice = advised(behind, ahead)
    assert held_s(advice)["a"] > 4.0
    slow = advice.actions[0]
    assert (slow.robot, slow.action) == ("a", "slow_down")
    assert meet(slower(-6.9, slow, 1.2), ahead) == set()


def test_nobody_slows_down_in_front_of_a_robot_that_would_come_too_near() -> None:
    behind, ahead = eastward("a", -7.0, speed_mps=1.5), eastward("b", -3.0, speed_mps=0.5)
    last = eastward("c", -8.5, speed_mps=1.5, holdable=False)
    assert kinds(advised(behind, ahead, last)) == [("a", "take_another_route")]


def test_a_train_slows_down_with_its_trailers() -> None:
    train, ahead = with_trailers(eastward("a", -7.0, speed_mps=1.5)), eastward("b", -3.0, speed_mps=0.5)
    advice = advised(train, ahead)
    assert kinds(advice) == [("a", "slow_down"), ("b", "go_first")]
    assert meet(with_trailers(slower(-7.0, advice.actions[0], 1.5)), ahead) == set()


def test_no_train_slows_down_if_its_trailers_would_be_met() -> None:
    train, ahead = with_trailers(eastward("a", -7.0, speed_mps=1.5)), eastward("b", -3.0, speed_mps=0.5)
    last = SeenRobot("c", robot([0, 2], [-12.5, -9.5], [0.0, 0.0], 0.0, SIZE_M), holdable=False)
    assert meet(train, last) == set()
    assert kinds(advised(train, ahead, last)) == [("a", "take_another_route")]
    assert kinds(advised(eastward("a", -7.0, speed_mps=1.5), ahead, last)) == [("a", "slow_down"), ("b", "go_first")]


def test_a_robot_backs_out_if_the_other_one_passes_its_place_and_then_turns_off() -> None:
    a = SeenRobot("a", robot([0, 10], [0.0, -10.0], [0.0, 0.0], pi, SIZE_M))
    b = SeenRobot("b", robot([0, 9.5, 11, 20], [-8.0, 1.5, 1.5, 1.5], [0, 0, 0, 9], [0, 0, pi / 2, pi / 2], SIZE_M))
    advice = advised(a, b)
    assert kinds(advice) == [("a", "back_out"), ("b", "go_first")]
    back_m = float(advice.actions[0].where.split()[0])
    backed = SeenRobot("a", robot([0, 2 * back_m, 60], [0.0, back_m, back_m], [0.0] * 3, pi, SIZE_M))
    assert meet(backed, b) == set()
    assert "back_out" not in [action for _, action in kinds(advised(with_trailers(a, pi), b))]


def test_advice_to_back_out_says_why_this_robot() -> None:
    a = SeenRobot("a", robot([0, 10], [0.0, -10.0], [0.0, 0.0], pi, SIZE_M))
    b = SeenRobot("b", robot([0, 9.5, 11, 20], [-8.0, 1.5, 1.5, 1.5], [0, 0, 0, 9], [0, 0, pi / 2, pi / 2], SIZE_M))
    assert advised(a, b).actions[0].reason == "if b backed out, they would still meet, or it would meet another robot"
    assert advised(a, with_trailers(b)).actions[0].reason == "b pulls trailers and can't"


def test_only_another_route_leads_around_a_robot_that_stands() -> None:
    stands = eastward("b", 0.0, speed_mps=0.0, holdable=False)
    assert kinds(advised(eastward("a", -5.0), stands)) == [("a", "take_another_route")]


def test_a_person_has_to_look_if_nobody_can_give_way() -> None:
    advice = advised(eastward("a", -5.0, holdable=False), SeenRobot(*northward("b", -5.0)[:3], holdable=False))
    assert kinds(advice) == [("a", "look")]


@pytest.mark.parametrize("speed_mps", [0.5, 0.4])
def test_a_lower_speed_that_was_advised_stands_while_it_still_works(speed_mps: float) -> None:
    behind, ahead = eastward("a", -7.0, speed_mps=1.5), eastward("b", -3.0, speed_mps=0.5)
    fresh = advised(behind, ahead)
    slow = fresh.actions[0].model_copy(update={"speed_mps": speed_mps})
    before = fresh.model_copy(update={"actions": (slow, *fresh.actions[1:])})
    assert advised(behind, ahead, before=before) is before


def test_what_no_longer_works_changes_and_says_so() -> None:
    behind, ahead = eastward("a", -7.0, speed_mps=1.5), eastward("b", -3.0, speed_mps=0.5)
    stopped = eastward("b", -3.0, speed_mps=0.0, holdable=False)
    changed = advised(behind, stopped, before=advised(behind, ahead))
    assert kinds(changed) == [("a", "take_another_route")]
    assert changed.changed_because == NO_LONGER_WORKS
