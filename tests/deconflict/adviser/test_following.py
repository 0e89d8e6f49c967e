"""What is learned from answers."""

import pytest

from deconflict.adviser.asked import Asked, Following, Option, Request, Verb

FAR_M = 500.0, 500.0


def answered(following: Following, verb: Verb, answer: str, why: str, at_m: tuple[float, float], now_s: float) -> None:
    request = Request("1", "a", verb, None, "b", ("b",), now_s + 20.0)
    following.ask("a", now_s)
    following.answer(Asked(request, now_s, at_m, 0.0), "Alder", answer, why, now_s)


def test_what_is_declined_at_many_places_is_unlikely_at_another() -> None:
    following = Following({})
    before = following.possible("go_around", FAR_M)
    for k in range(20):
        answered(following, "go_around", "declined", "no room", (10.0 * k, 0.0), float(k))
    assert before == pytest.approx(0.8)
    assert following.possible("go_around", FAR_M) < 0.3
    assert following.possible("back_out", FAR_M) == pytest.approx(0.8)


def test_a_busy_robot_is_asked_nothing_and_no_place_is_blamed() -> None:
    following = Following({})
    answered(following, "go_around", "declined", "busy", (0.0, 0.0), 100.0)
    other = Option("a", "back_out", "c")
    assert not following.may_be_asked(other, "Alder", 102.0)
    assert following.may_be_asked(other, "Alder", 103.0)
    assert following.possible("go_around", (0.0, 0.0)) == pytest.approx(0.8)
