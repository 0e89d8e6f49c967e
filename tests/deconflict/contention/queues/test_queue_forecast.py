"""Queues served in the order of arrival."""

from heapq import heapreplace
from math import inf

import pytest
from hypothesis import given
from hypothesis import strategies as st

from deconflict.contention.queues.queue_forecast import MOST_TURNS, QueueEntry, QueueForecast, forecast_queues
from deconflict.contention.robots.place_geometry import CHANGEOVER_S, PlaceGeometry
from tests.deconflict.contention.scenes import aisle, resource


def served(*wanted: QueueEntry, capacity: int = 1) -> QueueForecast:
    """At a lane, where there is no changeover, at 0."""
    lane = aisle("lane", 0, 9).model_copy(update={"capacity": capacity})
    return forecast_queues({"lane": list(wanted)}, PlaceGeometry((), [lane]), 0.0)["lane"]


def coming(robot: str, arrival_s: float, service_s: float = 60.0) -> QueueEntry:
    return QueueEntry(True, arrival_s, robot, service_s, 0.0)


def inside(robot: str, since_s: float, service_s: float) -> QueueEntry:
    return QueueEntry(False, since_s, robot, service_s, 0.0)


def robots(rows: list[QueueEntry]) -> list[str]:
    return [row[2] for row in rows]


def test_one_place_serves_one_after_the_other() -> None:
    turns = served(coming("b", 20.0), coming("a", 10.0), coming("c", 200.0))
    assert robots(turns.entries) == ["a", "b", "c"]
    assert turns.begin_s == [10.0, 70.0, 200.0]
    assert robots(turns.waiting) == ["b"]
    assert turns.longest_wait_s == 50.0


def test_the_next_turn_begins_after_the_changeover() -> None:
    wanted = [inside("in", -9.0, 10.0), coming("a", 0.0), coming("b", 0.0), coming("c", 500.0)]
    turns = forecast_queues({"c1": wanted}, PlaceGeometry([resource("c1", 0, 0)], ()), 0.0)["c1"]
    assert turns.begin_s[1:] == [10.0 + CHANGEOVER_S, 70.0 + 2 * CHANGEOVER_S, 500.0]


def test_two_places_serve_two_at_once() -> None:
    assert served(*(coming(name, 0.0) for name in "abc"), capacity=2).begin_s == [0.0, 0.0, 60.0]


def test_a_robot_inside_keeps_its_place_for_the_rest_of_its_service() -> None:
    turns = served(coming("late", 5.0), inside("in", -100.0, 30.0))
    assert (robots(turns.entries), turns.inside) == (["in", "late"], 1)
    assert turns.longest_wait_s == 25.0
    assert turns.free_s(1, 0.0) == 30.0
    assert turns.present_at(5.0) == ["in", "late"]
    assert turns.present_at(30.0) == ["late"]


def test_with_two_inside_where_one_fits_others_wait_for_the_later_one() -> None:
    turns = served(inside("x", -9.0, 10.0), inside("y", -9.0, 40.0), coming("z", 0.0))
    assert turns.begin_s[-1] == 40.0


@pytest.mark.parametrize(("arrivals", "longest"), [((0, 100, 200), 0), ((0, 1, 2), 2), ((0, 10, 70), 1)])
def test_the_longest_queue_counts_those_that_wait_together(arrivals: tuple[float, ...], longest: int) -> None:
    assert served(*(coming(f"r{at}", float(at)) for at in arrivals)).longest_queue == longest


def test_of_a_queue_of_thousands_those_inside_and_the_first_to_come_have_turns() -> None:
    turns = served(*(coming(f"{at:05}", float(at)) for at in range(9000)), inside("in", -9.0, 30.0))
    assert robots(turns.entries) == ["in", *(f"{at:05}" for at in range(MOST_TURNS))]
    assert turns.begin_s[1:3] == [30.0, 90.0]


def test_as_many_as_have_room_at_a_place_are_inside_and_more_wait() -> None:
    there = [inside(f"in {at:05}", -9.0, 30.0) for at in range(2 * MOST_TURNS)]
    turns = served(*there, *(coming(f"{at}", float(at)) for at in range(3)), capacity=2 * MOST_TURNS - 1)
    assert turns.inside == 2 * MOST_TURNS
    assert turns.longest_wait_s > 0.0


def test_robots_at_other_heights_take_nobody_the_turn() -> None:
    above = [coming(f"a {at:05}", 0.5)._replace(bottom_m=100.0 + at, top_m=100.5 + at) for at in range(MOST_TURNS + 5)]
    below = [inside("in", -9.0, 30.0), *(coming(f"{at}", float(at)) for at in range(1, 4))]
    turns = served(*above, *(each._replace(bottom_m=0.0, top_m=2.0) for each in below))
    assert turns.longest_wait_s == served(*below).longest_wait_s > 0.0


def test_a_place_without_a_queue_is_free_now() -> None:
    assert QueueForecast([], 0, [], [], 0.0, 0).free_s(1, 7.0) == 7.0


def test_without_entries_there_are_no_queues() -> None:
    assert forecast_queues({}, PlaceGeometry((), ()), 0.0) == {}


HEIGHTS = st.sampled_from([(0.0, 1.0), (0.5, 6.0), (5.0, 6.0), (-inf, inf)])
WANTED = st.lists(
    st.tuples(st.booleans(), st.integers(-20, 40).map(float), st.integers(0, 30).map(float), HEIGHTS),
    min_size=1,
    max_size=12,
)
"""Whether each is yet to come, when it comes, how long it keeps the place, and its heights."""


@given(lists=st.lists(st.tuples(WANTED, st.integers(1, 3)), min_size=1, max_size=3))
def test_many_places_are_served_as_each_is_alone(
    lists: list[tuple[list[tuple[bool, float, float, tuple[float, float]]], int]],
) -> None:
    wanted: dict[str, list[QueueEntry]] = {}
    for number, (each, _) in enumerate(lists):
        wanted[f"d{number}"] = [
            QueueEntry(coming, arrival_s, f"r{row:02}", service_s, 0.0, *heights_m)
            for row, (coming, arrival_s, service_s, heights_m) in enumerate(each)
        ]
    places = [resource(f"d{number}", 9.0 * number, 0, capacity=most) for number, (_, most) in enumerate(lists)]
    found = forecast_queues(wanted, PlaceGeometry(places, ()), 0.0)
    for place in places:
        turns, begin_s = found[place.id], by_hand(sorted(wanted[place.id]), place.capacity)
        assert turns.begin_s == begin_s
        waits = [
            (row[1], start) for row, start in zip(turns.entries, begin_s, strict=True) if row[0] and start > row[1]
        ]
        assert turns.longest_wait_s == max((start - came for came, start in waits), default=0.0)
        assert turns.longest_queue == max((sum(a <= at < b for a, b in waits) for at, _ in waits), default=0)


def by_hand(rows: list[QueueEntry], capacity: int) -> list[float]:
    """When each begins, with a heap of when room comes free to it from those that are not above or below it."""
    began: list[float] = []
    for number, row in enumerate(rows):
        if not row.coming:
            began.append(row.arrival_s)
            continue
        free_s = [0.0] * capacity
        for before, begin_s in zip(rows[:number], began, strict=True):
            if before.bottom_m <= row.top_m and row.bottom_m <= before.top_m:
                end_s = (begin_s if before.coming else 0.0) + before.service_s + CHANGEOVER_S
                heapreplace(free_s, max(free_s[0], end_s))
        began.append(max(free_s[0], row.arrival_s))
    return began
