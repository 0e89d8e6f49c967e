"""Orders of service: never dearer than first come, first served, and as cheap as any where all can be tried."""

from itertools import permutations, product

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from deconflict.contention.queues.place_group import PlaceGroup, PlaceQueue
from deconflict.contention.queues.queue_forecast import ServiceRequest
from deconflict.contention.queues.slot_scheduling import TIE_S, advise_slots
from deconflict.settings.site import Advice
from deconflict_client.advisory import Recommendation

NOW_S = 1_790_000_000.0


def request(
    robot: str,
    arrival_s: float,
    service_s: float,
    *,
    vendor: str = "acme",
    priority: float = 1.0,
    inside: bool = False,
) -> ServiceRequest:
    return ServiceRequest(robot, vendor, NOW_S + arrival_s, service_s, priority, inside)


def cheapest_s(places: list[PlaceQueue]) -> float:
    """The least cost over every order and every choice of places."""
    group = PlaceGroup(places, NOW_S)
    return min(
        sum(turn.cost for turn in group.schedule(list(zip(order, chosen, strict=True))))
        for order in permutations(group.jobs)
        for chosen in product(range(len(places)), repeat=len(order))
    ) / (1000 * 100)


@st.composite
def groups(draw: st.DrawFn, most: int) -> list[PlaceQueue]:
    places, changeover_s = [], draw(st.sampled_from([0.0, 4.0]))
    for row in range(draw(st.integers(1, 2))):
        requests = tuple(
            request(
                f"{row}-{number}",
                draw(st.integers(-200, 600)) / 10,
                draw(st.integers(1, 900)) / 10,
                vendor=draw(st.sampled_from(["acme", "bolt"])),
                priority=draw(st.sampled_from([0.5, 1.0, 3.0])),
                inside=draw(st.booleans()) and draw(st.booleans()),
            )
            for number in range(draw(st.integers(0, most)))
        )
        places.append(PlaceQueue(f"dock-{row}", draw(st.integers(1, 2)), requests, changeover_s))
    return places


@settings(max_examples=40, deadline=None)
@given(groups(2))
def test_small_cases_cost_no_more_than_any_order(places: list[PlaceQueue]) -> None:
    advice = advise_slots(places, NOW_S)
    assert advice.proven_optimal
    assert advice.cost_s == pytest.approx(cheapest_s(places), abs=TIE_S)


@settings(max_examples=25, deadline=None)
@given(groups(7), st.sampled_from([1e-4, 0.02]), st.sampled_from([{}, {"acme": 30.0}]))
def test_advice_never_costs_more_than_first_come_and_is_deterministic(
    places: list[PlaceQueue], effort: float, burdens_s: dict[str, float]
) -> None:
    advice = advise_slots(places, NOW_S, settings=Advice(effort=effort), burdens_s=burdens_s)
    assert advice.first_come_cost_s is not None
    assert advice.bound_s <= advice.cost_s <= advice.first_come_cost_s
    assert advice == advise_slots(places, NOW_S, settings=Advice(effort=effort), burdens_s=burdens_s)
    held = [request.robot for place in places for request in place.requests if not request.inside]
    assert sorted(slot.robot for slot in advice.slots) == sorted(held)


def test_the_bound_of_a_long_queue_is_near_its_cost() -> None:
    """Thirty robots in a quarter of an hour: too many to try every order, and more than one place can serve."""
    queue = tuple(request(f"r{row}", 37 * row % 900, 30 + 53 * row % 90) for row in range(30))
    advice = advise_slots([PlaceQueue("dock", 1, queue, 4.0)], NOW_S, settings=Advice(effort=1e-4))
    assert advice.first_come_cost_s is not None
    assert advice.cost_s < 0.9 * advice.first_come_cost_s
    assert 0.95 * advice.cost_s < advice.bound_s <= advice.cost_s


def test_an_order_within_the_tie_of_its_bound_is_not_searched() -> None:
    """The bound is a millionth short, so that it is one whatever is rounded; to prove the rest took longest of all."""
    queue = [request(f"r{row}", 20.0 * row, 40.0) for row in range(8)]
    advice = advise_slots(
        [PlaceQueue("dock", 1, (request("in", -5.0, 30.0, inside=True), *queue))], NOW_S, settings=Advice(effort=1e-9)
    )
    assert advice.cost_s == advice.first_come_cost_s == sum(30.0 + 20.0 * row for row in range(8))
    assert advice.proven_optimal


def test_a_short_visit_goes_before_a_long_one() -> None:
    charger = PlaceQueue(
        "charger", 1, (request("long", 0, 600), request("short", 1, 30), request("in", -5, 20, inside=True))
    )
    advice = advise_slots([charger], NOW_S)
    assert [slot.robot for slot in advice.slots] == ["short", "long"]
    assert [slot.wait_s for slot in advice.slots] == [19.0, 50.0]
    assert advice.first_come_cost_s == 20 + 619
    assert advice.expected_saving_s == 639 - 69


def test_a_free_interchangeable_place_is_used() -> None:
    both = (request("a", 5, 60), request("b", 6, 60))
    advice = advise_slots([PlaceQueue("lift-1", 1, both), PlaceQueue("lift-2", 1, ())], NOW_S)
    assert {slot.resource for slot in advice.slots} == {"lift-1", "lift-2"}
    assert advice.cost_s == 0
    assert advice.expected_saving_s == 59


def test_priority_goes_first() -> None:
    dock = PlaceQueue("dock", 1, (request("a", 0, 60), request("b", 0, 60, priority=3.0)))
    assert [slot.robot for slot in advise_slots([dock], NOW_S).slots] == ["b", "a"]


@pytest.mark.parametrize(("burdened", "first"), [("acme", "a"), ("bolt", "b")])
def test_in_a_tie_the_least_burdened_vendor_waits(burdened: str, first: str) -> None:
    dock = PlaceQueue("dock", 1, (request("a", 0, 60, vendor="acme"), request("b", 0, 60, vendor="bolt")))
    advice = advise_slots([dock], NOW_S, burdens_s={burdened: 120.0})
    assert advice.slots[0].robot == first


def test_advice_stands_until_another_saves_enough() -> None:
    def order(b_s: float, standing: Recommendation | None = None) -> list[str]:
        return [slot.robot for slot in advised(b_s, standing).slots]

    def advised(b_s: float, standing: Recommendation | None = None) -> Recommendation:
        waiting = (request("long", 0, 300), request("a", 0, 60), request("b", 0, b_s))
        came_first = request("longer", -1, 600)
        return advise_slots([PlaceQueue("dock", 1, (came_first, *waiting))], NOW_S, standing=standing)

    standing = advised(59)
    assert order(59) == ["b", "a", "long", "longer"]
    assert order(61, standing) == ["b", "a", "long", "longer"]
    assert order(70, standing) == ["a", "b", "long", "longer"]


def test_jobs_wait_for_robots_inside_beyond_the_capacity() -> None:
    inside = tuple(request(f"in-{end}", -9, end, inside=True) for end in (10, 20, 30))
    advice = advise_slots([PlaceQueue("dock", 2, (*inside, request("next", 0, 5)))], NOW_S)
    assert [slot.wait_s for slot in advice.slots] == [20.0]


def test_an_empty_group_costs_nothing() -> None:
    advice = advise_slots([PlaceQueue("dock", 1, ())], NOW_S)
    assert advice.slots == ()
    assert advice.proven_optimal
