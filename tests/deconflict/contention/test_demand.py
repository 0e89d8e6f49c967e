"""Queues served in the order of arrival."""

import pytest

from deconflict.contention.demand import Request, first_come, free_at_s, longest_queue


def request(robot: str, arrival_s: float, service_s: float = 60.0, *, inside: bool = False) -> Request:
    return Request(robot, "Alder", arrival_s, 0.0, service_s, inside=inside)


def test_one_place_serves_one_after_the_other() -> None:
    turns = first_come([request("b", 20.0), request("a", 10.0), request("c", 200.0)], capacity=1, now_s=0.0)
    assert [(turn.request.robot, turn.start_s, turn.wait_s) for turn in turns] == [
        ("a", 10.0, 0.0),
        ("b", 70.0, 50.0),
        ("c", 200.0, 0.0),
    ]


def test_the_next_one_begins_when_the_one_before_is_out_of_its_way() -> None:
    waiting = [request("in", -9.0, 10.0, inside=True), request("a", 0.0), request("b", 0.0), request("c", 500.0)]
    turns = first_come(waiting, capacity=1, now_s=0.0, changeover_s=4.0)
    assert [turn.start_s for turn in turns[1:]] == [14.0, 78.0, 500.0]


def test_two_places_serve_two_at_once() -> None:
    turns = first_come([request(name, 0.0) for name in "abc"], capacity=2, now_s=0.0)
    assert [turn.start_s for turn in turns] == [0.0, 0.0, 60.0]


def test_a_robot_inside_keeps_its_place_for_the_rest_of_its_service() -> None:
    turns = first_come([request("late", 5.0), request("in", -100.0, 30.0, inside=True)], capacity=1, now_s=0.0)
    assert [turn.request.robot for turn in turns] == ["in", "late"]
    assert turns[1].wait_s == 25.0
    assert free_at_s(turns, 1, 0.0) == 30.0


def test_two_inside_where_one_fits_make_others_wait_for_the_later_one() -> None:
    inside = [request("x", -9.0, 10.0, inside=True), request("y", -9.0, 40.0, inside=True)]
    turns = first_come([*inside, request("z", 0.0)], capacity=1, now_s=0.0)
    assert turns[-1].start_s == 40.0


@pytest.mark.parametrize(("arrivals", "longest"), [((0, 100, 200), 0), ((0, 1, 2), 2), ((0, 10, 70), 1)])
def test_the_longest_queue_counts_those_that_wait_together(arrivals: tuple[float, ...], longest: int) -> None:
    turns = first_come([request(f"r{at}", at) for at in arrivals], capacity=1, now_s=0.0)
    assert longest_queue(turns) == longest


def test_a_free_place_is_free_now() -> None:
    assert free_at_s([], 1, 7.0) == 7.0
