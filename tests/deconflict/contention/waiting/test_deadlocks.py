"""Rings of waits, held against brute force."""

from collections import Counter
from itertools import pairwise
from math import inf

import pytest
from hypothesis import given
from hypothesis import strategies as st

from deconflict.contention.waiting.deadlocks import Node, RingLink, Want, rings
from deconflict.contention.waiting.wait_graph import MOST_BEHIND, MOST_LEGS, Leg, place_wants

ROBOTS = [(name, 0) for name in "abcdef"]


def want(waiter: str, *holders: str, at_s: float = 0.0) -> Want:
    return Want((waiter, 0), tuple((holder, 0) for holder in holders), "path", at_s)


def who(found: list[tuple[RingLink, ...]]) -> list[str]:
    return ["".join(link.waiter for link in ring) for ring in found]


def test_two_that_want_each_others_place_are_a_ring_without_their_follower() -> None:
    assert who(rings([want("a", "b"), want("b", "a"), want("c", "a")])) == ["ab"]


@pytest.mark.parametrize("robots", [3, 20_000])
def test_a_chain_is_no_ring_however_long(robots: int) -> None:
    assert rings([want(str(number), str(number + 1)) for number in range(robots)]) == []


def test_one_free_holder_of_several_places_is_enough() -> None:
    assert rings([want("a", "b", "c"), want("b", "a")]) == []
    assert who(rings([want("a", "b", "c"), want("b", "a"), want("c", "a")])) == ["ab"]


def test_all_wants_of_a_robot_must_become_free() -> None:
    assert who(rings([want("a", "c"), want("a", "b"), want("b", "a")])) == ["ab"]


def test_two_rings_are_separate() -> None:
    found = rings([want("a", "b"), want("b", "a"), want("d", "e"), want("e", "f"), want("f", "d")])
    assert who(found) == ["ab", "def"]


wants = st.lists(
    st.builds(
        lambda waiter, holders: Want(waiter, tuple(sorted(holders - {waiter})) or (("z", 0),), "path", 0.0),
        st.sampled_from(ROBOTS),
        st.frozensets(st.sampled_from(ROBOTS), min_size=1, max_size=3),
    ),
    max_size=12,
)


def free(given: list[Want]) -> set[Node]:
    """Who goes on, one after the other."""
    gone = {("z", 0)} | {robot for robot in ROBOTS if all(want.waiter != robot for want in given)}
    while True:
        more = {
            robot
            for robot in ROBOTS
            if robot not in gone and all(gone & set(want.holders) for want in given if want.waiter == robot)
        }
        if not more:
            return gone
        gone |= more


@given(wants)
def test_there_is_a_ring_exactly_if_a_robot_can_never_move_on(given: list[Want]) -> None:
    locked = set(ROBOTS) - free(given)
    found = rings(given)
    assert bool(found) == bool(locked)
    seen: set[str] = set()
    for ring in found:
        members = {link.waiter for link in ring}
        assert {(member, 0) for member in members} <= locked
        assert not members & seen
        seen |= members
        assert all(a.holder == b.waiter for a, b in pairwise((*ring, ring[0])))
        assert ring[0].waiter == min(members)
        for link in ring:
            assert any(
                want.waiter[0] == link.waiter and (link.holder, 0) in want.holders and set(want.holders) <= locked
                for want in given
            )


@pytest.mark.parametrize(("capacity", "most"), [({"north": 1, "south": 1}, MOST_LEGS), ({}, MOST_BEHIND)])
def test_of_a_place_a_bounded_number_of_those_that_have_or_want_it_is_looked_at(
    capacity: dict[str, int], most: int
) -> None:
    def robots(place: str, wants: str) -> list[Leg]:
        return [Leg((f"{place} {n}", 0), place, 0.0, 1.0, -inf, inf, wants, 2.0) for n in range(3 * MOST_LEGS)]

    wants = place_wants([*robots("north", "south"), *robots("south", "north")], capacity)
    assert Counter((want.where, len(want.holders)) for want in wants) == {
        ("north", most + 1): most,
        ("south", most + 1): most,
    }
