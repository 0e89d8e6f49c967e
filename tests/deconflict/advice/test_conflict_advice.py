"""The advice for one conflict: it names no robots that do not matter to it, and asks no short waits of people."""

from deconflict.advice.conflict_advice import COSTS_MORE, advise_conflicts
from deconflict.advice.holds.hold_windows import DelayWindows
from deconflict_client.advisory import Recommendation, moment
from tests.deconflict.advice.made_near import WINDOW, SeenRobot, eastward, held_s, near, northward


def advised(movers: list[SeenRobot], *pairs: tuple[str, str]) -> list[Recommendation]:
    advice = advise_conflicts(near(movers), pairs, WINDOW)
    return [advice[pair] for pair in pairs]


def actions(advice: Recommendation) -> list[tuple[str, str, float | None]]:
    return [(action.robot, action.action, action.seconds) for action in advice.actions]


def test_the_advice_on_a_conflict_leaves_out_the_holds_that_it_does_not_need() -> None:
    """b crosses a first and c later; only the later conflict needs c to wait."""
    a, b, c = eastward("a", -4.0), northward("b", -4.0, priority=10.0), eastward("c", -7.0, y_m=3.0)
    first, second = advised([a, b, c], ("a", "b"), ("b", "c"))
    assert held_s(first).keys() == {"a"}
    assert held_s(second).keys() == {"c"}
    assert first.proven_optimal
    assert first.cost_s == sum(held_s(first).values())


def test_the_advice_on_a_conflict_holds_who_would_run_into_its_robots() -> None:
    a, b, behind = eastward("a", -5.0), northward("b", -5.0, priority=10.0), eastward("c", -6.8)
    (advice,) = advised([a, b, behind], ("a", "b"))
    assert held_s(advice).keys() == {"a", "c"}
    assert actions(advice) == [("a", "wait", 3.0), ("c", "wait", 3.0), ("b", "go_first", None)]
    assert [action.reason for action in advice.actions] == [
        "",
        "it would come too near to a otherwise",
        "a waits for it",
    ]


def test_a_wait_that_is_too_short_for_people_is_made_longer_if_that_is_proven() -> None:
    (advice,) = advised([eastward("a", -5.0), northward("b", -5.0, priority=10.0)], ("a", "b"))
    assert held_s(advice) == {"a": 2.5}
    assert actions(advice) == [("a", "wait", 3.0), ("b", "go_first", None)]


def test_nobody_is_asked_to_have_a_robot_wait_if_only_a_short_hold_works() -> None:
    """c would come too near to a if that waited 3 s."""
    a, b, behind = eastward("a", -5.0), northward("b", -5.0, priority=10.0), eastward("c", -9.0, holdable=False)
    (advice,) = advised([a, b, behind], ("a", "b"))
    assert held_s(advice) == {"a": 2.5}
    assert not any(action.action == "wait" for action in advice.actions)


def test_no_hold_is_shorter_than_a_second() -> None:
    """b is nearly through: half a second would do."""
    a, b = eastward("a", -5.0), northward("b", -3.3, priority=10.0)
    delays = DelayWindows(near([a, b]), WINDOW)
    assert delays.contacts_s({}, "ab")
    assert not delays.contacts_s({"a": 0.5}, "ab")
    (advice,) = advised([a, b], ("a", "b"))
    assert held_s(advice) == {"a": 1.0}


PAIR = ("a", "b")


def worth(loss_s: float, before: Recommendation | None = None) -> Recommendation:
    """The advice on a conflict that is expected to cost `loss_s`."""
    robots, standing = near([eastward("a", -4.0), northward("b", -4.0)]), {PAIR: before} if before else None
    return advise_conflicts(robots, [PAIR], WINDOW, standing=standing, losses_s={PAIR: loss_s})[PAIR]


def test_holds_that_take_longer_than_their_conflict_is_expected_to_cost_are_left_out() -> None:
    best = worth(1000.0)
    longest_s = sum(held_s(best).values())
    assert longest_s > 0
    assert worth(longest_s) == best
    vain = worth(0.9 * longest_s)
    assert (vain.holds, vain.actions, vain.note) == ((), (), COSTS_MORE)


def test_holds_that_stand_are_given_up_only_if_they_clearly_cost_more() -> None:
    before = worth(1000.0).model_copy(update={"given_at": moment(WINDOW.start_s)})
    longest_s = sum(held_s(before).values())
    assert worth(0.7 * longest_s, before) == before
    given_up = worth(0.5 * longest_s, before)
    assert (given_up.holds, given_up.changed_because) == ((), COSTS_MORE)
