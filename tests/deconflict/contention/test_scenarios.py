"""Scenarios of contention, each a short script of robots through fleet and engine."""

import re
from itertools import pairwise
from types import ModuleType
from typing import Any

import pytest

from deconflict.contention.waiting import blockages, wait_graph
from deconflict.settings.shared_places import Zone
from deconflict_client.advisory import BlockageAdvisory, ContentionAdvisory, DeadlockAdvisory
from ingest.settings import Vendor
from tests.deconflict.contention.scenes import (
    NOW_S,
    Scene,
    Script,
    after_s,
    aisle,
    box,
    cleared,
    raised,
    resource,
    site,
)
from tests.helpers.saying import HALL, robot


def waits(*_: float) -> str:
    return "waitingExternalEvent"


def standing(x: float, y: float, *destinations: tuple[float, float, float], **fields: Any) -> Script:
    return Script([(0, x, y)], destinations, state=waits, **fields)


def ring(advisory: DeadlockAdvisory) -> list[tuple[str, str]]:
    return [(wait.waiter, wait.holder) for wait in advisory.cycle]


def test_two_that_enter_an_aisle_from_both_ends_lock_each_other_ahead_of_time() -> None:
    east = Script([(0, -16, 0), (40, 24, 0)])
    west = Script([(0, 20, 0), (40, -20, 0)], vendor="Corvid")
    scene = Scene(site(aisle("lane", -8, 12)), {"A": east, "B": west})
    advisories = scene.run(12)
    (advisory,) = raised(advisories, "deadlock")
    assert isinstance(advisory, DeadlockAdvisory)
    assert advisory.robots == tuple(sorted((robot("A"), robot("B"))))
    assert {link.where for link in advisory.cycle} == {"lane"}
    assert sorted(ring(advisory)) == sorted([(robot("A"), robot("B")), (robot("B"), robot("A"))])
    # nose to nose where their middles are a metre apart, 17.5 s on
    assert advisory.predicted_at.timestamp() - NOW_S == pytest.approx(17.5, abs=0.7)
    assert advisory.time_to_conflict_s > 5
    assert advisory.recommendation
    first, second = advisory.recommendation.slots
    assert first.wait_s == 0
    assert second.start_at >= first.end_at
    assert second.wait_s == pytest.approx(24, abs=3), "for as long as the first is in the lane of 20 m, and a little"
    assert f"should wait {second.wait_s:.0f} s before lane" in advisory.summary


def test_waiting_at_the_aisles_end_as_advised_ends_the_deadlock_at_the_promised_cost() -> None:
    east, west = Script([(0, -16, 0), (40, 24, 0)]), Script([(0, 22, 0), (40, -18, 0)])
    scene = Scene(site(aisle("lane", -8, 12)), {"A": east, "B": west})
    (advisory,) = raised(scene.run(6), "deadlock")
    assert advisory.recommendation
    second = advisory.recommendation.slots[1]
    assert second.robot == robot("B")
    enters_s = second.start_at.timestamp() - NOW_S
    assert enters_s - second.wait_s == pytest.approx(9.25, abs=0.5), "when B would have come to the lane"
    scene.robots["B"] = Script(
        [(6, 16, 0), (9, 14, 3), (enters_s - 2, 14, 3), (enters_s, 12.5, 0), (enters_s + 30, -17.5, 0)]
    )
    advisories = scene.run(enters_s + 25, from_s=6)
    assert [each.id for each in cleared(advisories, "deadlock")] == [advisory.id]
    assert raised(advisories, "deadlock") == []


def test_of_two_in_an_aisle_the_one_less_far_in_should_back_out() -> None:
    robots = {"A": Script([(0, -16, 0), (40, 24, 0)]), "B": Script([(0, 16, 0), (40, -24, 0)])}
    scene = Scene(site(aisle("lane", -8, 12)), robots)
    (advisory,) = raised(scene.run(8), "deadlock")
    last = [each for each in scene.run(12, from_s=8) if each.id == advisory.id][-1]
    assert last.recommendation
    assert re.search(r"Alder A should back out of lane, [0-3] m$", last.summary)
    first, second = last.recommendation.slots
    assert (first.robot, first.wait_s) == (robot("B"), 0.0)
    assert second.robot == robot("A")
    # B has about 16 m to go until it is out, 4 s later A may come, and has its way back to go
    assert second.wait_s == pytest.approx(16 + 4, abs=3)
    assert last.recommendation.cost_s >= second.wait_s


def test_two_that_follow_each_other_through_an_aisle_do_not_lock() -> None:
    scene = Scene(
        site(aisle("lane", -8, 12)), {"A": Script([(0, -12, 0), (40, 28, 0)]), "B": Script([(0, -16, 0), (40, 24, 0)])}
    )
    assert raised(scene.run(30), "deadlock") == []


def test_two_that_keep_right_in_a_wide_aisle_do_not_lock() -> None:
    wide = aisle("lane", -8, 12).model_copy(update={"polygon": box(2, 0, 20, 3)})
    east, west = Script([(0, -16, -0.6), (40, 24, -0.6)]), Script([(0, 20, 0.6), (40, -20, 0.6)])
    assert raised(Scene(site(wide), {"A": east, "B": west}).run(30), "deadlock") == []
    narrow = [Script([(t, x, y / 3) for t, x, y in script.knots]) for script in (east, west)]
    assert raised(Scene(site(wide), dict(zip("AB", narrow, strict=True))).run(12), "deadlock")


def test_a_robot_that_stops_in_an_aisle_before_the_other_does_not_lock() -> None:
    scene = Scene(
        site(aisle("lane", -8, 12)),
        {"A": Script([(0, -12, 0), (8, -4, 0)]), "B": Script([(0, 16, 0), (8, 8, 0)])},
    )
    assert raised(scene.run(20), "deadlock") == []


def test_two_that_will_swap_docks_have_an_advisory_a_minute_ahead() -> None:
    docks = site(resource("d1", 0, 0), resource("d2", 20, 0))
    scene = Scene(docks, {"A": standing(0, 0, (80, 20, 0)), "B": standing(20, 0, (80, 0, 0))})
    advisories = scene.run(5)
    (advisory,) = raised(advisories, "deadlock")
    assert isinstance(advisory, DeadlockAdvisory)
    assert {link.where for link in advisory.cycle} == {"d1", "d2"}
    # they set out 20 s before they mean to arrive
    assert advisory.time_to_conflict_s == pytest.approx(60, abs=3)
    assert advisory.severity == "caution"
    assert advisory.recommendation
    assert "one of them has to go elsewhere" in advisory.recommendation.note


def test_one_of_two_that_swap_is_advised_to_go_to_the_nearest_free_place_first() -> None:
    parking = [resource(name, x, y, kind="parking") for name, x, y in (("p1", 10, -8), ("p2", 10, 5), ("p3", 10, 1))]
    docks = site(resource("d1", 0, 0), resource("d2", 20, 0), *parking)
    robots = {"A": standing(0, 0, (80, 20, 0)), "B": standing(20, 0, (80, 0, 0)), "C": standing(10, 1)}
    (advisory,) = raised(Scene(docks, robots).run(5), "deadlock")
    assert advisory.recommendation
    stay, *slots = advisory.recommendation.slots
    assert stay.resource == "p2", "p3 is taken, p1 is farther"
    other = slots[0]
    assert [slot.robot for slot in slots] == [other.robot, stay.robot]
    assert {stay.robot, other.robot} == {robot("A"), robot("B")}
    # it has 22.4 m to go instead of 20; the other one sets out 2 s after it
    assert advisory.recommendation.cost_s == pytest.approx(2.36 + 2.0, abs=0.1)
    assert "should go to p2 first, which costs 4 s in all" in advisory.summary


def test_two_that_swap_places_outside_resources_have_an_advisory_too() -> None:
    scene = Scene(site(), {"A": standing(0, 0, (80, 20, 0)), "B": standing(20, 0, (80, 0, 0))})
    (advisory,) = raised(scene.run(5), "deadlock")
    assert isinstance(advisory, DeadlockAdvisory)
    assert {link.where for link in advisory.cycle} == {"path"}


def test_a_ring_of_three_docks_is_named_in_order() -> None:
    places = [(0.0, 0.0), (20.0, 0.0), (10.0, 15.0)]
    docks = site(*(resource(f"d{row}", *place) for row, place in enumerate(places)))
    goals = [*places[1:], places[0]]
    robots = {name: standing(*place, (60.0, *goal)) for name, place, goal in zip("ABC", places, goals, strict=True)}
    (advisory,) = raised(Scene(docks, robots).run(5), "deadlock")
    assert isinstance(advisory, DeadlockAdvisory)
    links = ring(advisory)
    assert {waiter for waiter, _ in links} == {robot(name) for name in "ABC"}
    assert all(a[1] == b[0] for a, b in pairwise([*links, links[0]]))
    assert (robot("A"), robot("B")) in links


def test_a_chain_whose_last_robot_has_a_free_place_to_go_to_is_no_deadlock() -> None:
    docks = site(*(resource(f"d{row}", 20.0 * row, 0) for row in range(4)))
    robots = {name: standing(20.0 * row, 0, (60.0, 20.0 * (row + 1), 0)) for row, name in enumerate("ABC")}
    assert raised(Scene(docks, robots).run(5), "deadlock") == []


def test_a_contended_lift_with_a_free_twin_has_the_twin_advised() -> None:
    (advisory,) = raised(two_lifts().run(5), "contention")
    assert isinstance(advisory, ContentionAdvisory)
    assert (advisory.resource, advisory.capacity, advisory.queue_length) == ("l1", 1, 1)
    assert advisory.wait_s == pytest.approx(34, abs=4)
    assert advisory.recommendation
    (slot,) = advisory.recommendation.slots
    assert (slot.robot, slot.resource, slot.wait_s) == (robot("B"), "l2", 0.0)
    assert advisory.recommendation.first_come_cost_s == pytest.approx(advisory.wait_s, abs=1)
    assert advisory.summary.endswith("Alder B should take l2, which saves 34 s in all")


def two_lifts() -> Scene:
    lifts = [resource(name, x, 0, kind="lift", group="lifts", service_s=60.0) for name, x in (("l1", 0), ("l2", 8))]
    robots = {"A": standing(0, 0), "B": Script([(0, 0, 30), (30, 0, 0)], [(30, 0, 0)])}
    return Scene(site(*lifts), robots)


def test_a_robot_that_follows_the_advice_waits_no_longer_than_promised() -> None:
    scene = two_lifts()
    (advisory,) = raised(scene.run(5), "contention")
    assert advisory.recommendation
    (slot,) = advisory.recommendation.slots
    scene.robots["B"] = Script([(5, 0, 25), (30, 8, 0), (60, 8, 0)], [(30, 8, 0)])
    advisories = scene.run(45, from_s=5)
    (over,) = cleared(advisories, "contention")
    assert over.id == advisory.id
    assert over.updated_at.timestamp() - NOW_S < 12, "once it has told its new destination"
    assert slot.start_at.timestamp() - NOW_S == pytest.approx(30, abs=1)
    scene.engine.measures.as_document()
    occupied = scene.engine.measures.values["deconflict_resource_occupancy"]
    assert (occupied["l1",], occupied["l2",]) == (1, 1)
    assert raised(advisories, "double_occupancy") == []


def test_a_robot_that_ignores_the_advice_keeps_the_advisory_open_until_its_wait_is_over() -> None:
    scene = two_lifts()
    scene.robots["A"] = Script([(0, 0, 0), (58, 0, 0), (66, 0, -8)])
    scene.robots["B"] = Script([(0, 0, 30), (27, 0, 3), (68, 0, 3), (71, 0, 0)], [(30, 0, 0)])
    advisories = scene.run(85)
    assert len({advisory.id for advisory in advisories if advisory.kind == "contention"}) == 1
    (over,) = cleared(advisories, "contention")
    assert 40 < over.updated_at.timestamp() - NOW_S < 70


def test_a_queue_for_a_charger_has_an_advisory_with_length_and_wait_before_it_forms() -> None:
    charger = resource("c1", 0, 0, kind="charger", service_s=100.0, name="Charger 1")
    robots = {
        "A": Script([(0, 0, 0)], state=lambda _: "charging"),
        "B": standing(30, 10, (60, 0, 0)),
        "C": standing(30, 20, (70, 0, 0), vendor="Basalt"),
    }
    (advisory,) = raised(Scene(site(charger), robots).run(5), "contention")
    assert isinstance(advisory, ContentionAdvisory)
    assert advisory.queue_length == 2
    # A leaves at 100 s, B charges from 104 s to 204 s, C comes at 70 s
    assert advisory.wait_s == pytest.approx(138, abs=4)
    assert advisory.time_to_conflict_s == pytest.approx(60, abs=4)
    assert "B and Basalt C will find Charger 1 taken in 5" in advisory.summary
    assert ", give or take 1" in advisory.summary, (
        "20 % either way of a minute, as long as nothing is known of the vendor"
    )
    assert set(advisory.robots) == {robot(name) for name in "ABC"}


def test_a_queue_that_dissolves_clears_its_advisory() -> None:
    charger = resource("c1", 0, 0, kind="charger", service_s=100.0)
    leaving = Script([(0, 0, 0), (10, 0, 0), (20, 0, -10)], state=lambda t: "charging" if t < 10 else "navigating")
    scene = Scene(site(charger), {"A": leaving, "B": standing(30, 10, (60, 0, 0))})
    advisories = scene.run(30)
    (begun,), (over,) = raised(advisories, "contention"), cleared(advisories, "contention")
    assert begun.id == over.id
    assert over.cleared_because == "nobody is expected to wait long any more"


def test_a_dock_that_is_taken_is_double_occupancy_once_the_second_robot_is_in() -> None:
    dock = resource("d1", 0, 0, polygon=box(0, 0, 6, 6))
    scene = Scene(site(dock), {"A": standing(-1.5, 0), "B": Script([(0, 16, 0), (14, 2, 0)])})
    advisories = scene.run(25)
    (advisory,) = raised(advisories, "double_occupancy")
    assert isinstance(advisory, ContentionAdvisory)
    assert (advisory.demand, advisory.capacity) == (2, 1)
    assert advisory.time_to_conflict_s == 0
    assert 13 <= after_s(advisory) <= 17
    (before,) = raised(advisories, "contention")
    assert after_s(before) < 8, "that it will find the dock taken is told before"
    assert re.search(r"; Alder B should come \d+ s later$", before.summary)


def test_four_vendors_at_a_crossing_make_a_queue() -> None:
    crossing = Zone(id="x", kind="crossing", datum=HALL, polygon=box(0, 0, 8, 8))
    ways = {"A": (-1, 0), "B": (1, 0), "C": (0, -1), "D": (0, 1)}
    robots = {
        name: Script([(0, 12 * dx, 12 * dy), (48, -12 * dx, -12 * dy)], vendor=f"Vendor {name}")
        for name, (dx, dy) in ways.items()
    }
    advisories = Scene(site(crossing), robots).run(14)
    (advisory,) = raised(advisories, "contention")
    assert isinstance(advisory, ContentionAdvisory)
    assert len(set(advisory.vendors)) == 4
    assert advisory.queue_length >= 2
    assert advisory.time_to_conflict_s > 2
    assert advisory.recommendation
    slots = advisory.recommendation.slots
    assert len(slots) == 4
    assert all(b.start_at >= a.end_at for a, b in pairwise(slots)), "one after the other"
    assert advisory.recommendation.cost_s <= (advisory.recommendation.first_come_cost_s or 0)


def test_a_blockage_names_the_blocker_and_all_robots_it_holds_up() -> None:
    robots = {
        "A": Script([(0, 0, 0)], state=lambda _: "waitingHumanEvent"),
        "B": Script([(0, -30, 0), (28, -2, 0)], means=[(0, -30, 0), (60, 30, 0)], vendor="Corvid"),
        "C": Script([(0, -34, 0), (30, -4, 0)], means=[(0, -34, 0), (60, 26, 0)]),
    }
    advisories = Scene(site(), robots).run(40)
    (advisory,) = raised(advisories, "blockage")
    last = [each for each in advisories if each.id == advisory.id][-1]
    assert isinstance(last, BlockageAdvisory)
    assert last.blocker == robot("A")
    assert last.since_at.timestamp() == pytest.approx(NOW_S, abs=0.5)
    assert last.holds_up == (robot("B"), robot("C"))
    assert 18 < after_s(advisory) < 24, "as soon as B's path reaches A"
    assert "Alder A has stood for" in advisory.summary


@pytest.mark.parametrize(
    ("bounds", "blockers", "held_up"),
    [({}, "AD", "BC"), ({(wait_graph, "MOST_IN_WAY"): 1}, "A", "BC"), ({(blockages, "MOST_HELD_UP"): 1}, "AD", "B")],
)
def test_a_robot_is_held_up_by_the_nearest_and_holds_up_the_next(
    bounds: dict[tuple[ModuleType, str], int], blockers: str, held_up: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    for (module, name), most in bounds.items():
        monkeypatch.setattr(module, name, most)
    robots = {
        "A": Script([(0, 0, 0)], state=lambda _: "waitingHumanEvent"),
        "B": Script([(0, -30, 0), (28, -2, 0)], means=[(0, -30, 0), (60, 30, 0)], vendor="Corvid"),
        "C": Script([(0, -34, 0), (30, -4, 0)], means=[(0, -34, 0), (60, 26, 0)]),
        "D": Script([(0, 3, 0)], state=lambda _: "waitingHumanEvent"),
    }
    found = [each for each in Scene(site(), robots).run(40) if isinstance(each, BlockageAdvisory)]
    assert {each.blocker for each in found} == set(map(robot, blockers))
    assert [each for each in found if each.blocker == robot("A")][-1].holds_up == tuple(map(robot, held_up))


def test_a_robot_without_a_path_is_held_up_only_by_what_is_just_ahead() -> None:
    def walks(_: float) -> str:
        return "manualOverride"

    robots = {"A": standing(0, 0), "B": Script([(0, -14, 0), (14, -1, 0)], state=walks, vendor="Corvid")}
    (advisory,) = raised(Scene(site(), robots).run(16), "blockage")
    assert after_s(advisory) > 10
    assert "waits for something around it" in advisory.summary


def test_a_robot_that_has_arrived_is_held_up_by_nobody() -> None:
    arrives = Script([(0, -10, 0), (10, 0, 0)], state=lambda t: "navigating" if t < 10 else waits())
    behind = Script([(0, -1, 30), (30, -1, 0)], state=lambda t: "navigating" if t < 30 else waits())
    assert raised(Scene(site(), {"A": arrives, "C": behind}).run(45), "blockage") == []


def test_a_robot_that_rests_in_a_dock_is_no_blockage() -> None:
    dock = resource("d1", 0, 0)
    scene = Scene(site(dock), {"A": standing(0, 0), "B": Script([(0, -20, 0), (40, 20, 0)])})
    assert raised(scene.run(20), "blockage") == []


@pytest.mark.parametrize("half_m", [0.7, 2.0])
def test_two_that_stand_nose_to_nose_have_an_advisory_within_seconds(half_m: float) -> None:
    forth, back = [(0.0, -8.0, 0.0), (60.0, 52.0, 0.0)], [(0.0, 8.0, 0.0), (60.0, -52.0, 0.0)]
    stops_s = 8 - half_m

    def state(t: float) -> str:
        return "navigating" if t < stops_s + 1.7 else waits()

    robots = {
        "A": Script([(0, -8, 0), (stops_s, -half_m, 0)], state=state, means=forth),
        "B": Script([(0, 8, 0), (stops_s, half_m, 0)], state=state, means=back),
    }
    advisories = Scene(site(), robots).run(20)
    (advisory,) = raised(advisories, "deadlock")
    assert isinstance(advisory, DeadlockAdvisory)
    assert stops_s + 0.7 <= after_s(advisory) <= stops_s + 5.7
    assert advisory.time_to_conflict_s == 0
    assert advisory.severity == "critical"
    assert raised(advisories, "blockage") == []
    people = site(vendors=(Vendor(name="Walkers", manufacturers=("Alder",), participant="person"),))
    assert raised(Scene(people, robots).run(20), "deadlock") == [], "people step aside"


def test_two_that_stand_nose_to_nose_in_an_aisle_keep_the_order_to_back_out() -> None:
    forth, back = [(0.0, -16.0, 0.0), (70.0, 54.0, 0.0)], [(0.0, 17.0, 0.0), (70.0, -53.0, 0.0)]

    def state(t: float) -> str:
        return "navigating" if t < 17 else waits()

    robots = {
        "A": Script([(0, -16, 0), (15.8, -0.2, 0)], state=state, means=forth),
        "B": Script([(0, 17, 0), (15.8, 1.2, 0)], state=state, means=back),
    }
    advisories = Scene(site(aisle("lane", -8, 12)), robots).run(60)
    locked = [each for each in advisories if isinstance(each, DeadlockAdvisory)]
    orders = [each.recommendation.actions[0] for each in locked if each.recommendation]
    since_inside = orders[[order.action for order in orders].index("back_out") :]
    assert {(order.action, order.robot) for order in since_inside} == {("back_out", robot("A"))}
    assert cleared(advisories, "deadlock") == []
    assert {link.where for each in locked for link in each.cycle} == {"lane"}


def test_a_queue_that_blocks_the_exit_of_what_it_waits_for_is_a_deadlock() -> None:
    charger = resource("c1", 0, 0, kind="charger", service_s=30.0)
    leaving = Script(
        [(0, 0, 0)],
        [(60, 20, 0)],
        state=lambda t: "charging" if t < 20 else "navigating",
        means=[(0, 0, 0), (20, 0, 0), (40, 20, 0)],
    )
    robots = {"A": leaving, "B": standing(2.2, 0, (40, 0, 0))}
    advisories = Scene(site(charger), robots).run(32)
    (advisory,) = raised(advisories, "deadlock")
    assert isinstance(advisory, DeadlockAdvisory)
    assert {link.where for link in advisory.cycle} == {"c1", "path"}
    assert after_s(advisory) < 27


def test_arrivals_are_corrected_by_how_late_their_vendor_has_been() -> None:
    late = {f"A{y}": Script([(0, 0, y), (40, 40, y)], [(20, 40, y)]) for y in range(0, 12, 2)}
    punctual = {f"C{y}": Script([(0, 0, y), (40, 40, y)], [(40, 40, y)], vendor="Corvid") for y in range(20, 32, 2)}
    scene = Scene(site(), late | punctual)
    scene.run(50)
    scene.engine.measures.as_document()
    ratios = scene.engine.measures.values["deconflict_arrival_time_ratio"]
    assert ratios["Alder",] == pytest.approx(2.0, abs=0.1)
    assert ratios["Corvid",] == pytest.approx(1.0, abs=0.05)
    off_s = scene.engine.measures.values["deconflict_arrival_error_seconds"]
    assert off_s["Alder", "60", "0.5"] == pytest.approx(20.0, abs=2.5)
    assert off_s["Corvid", "60", "0.9"] <= 1.5


def test_the_same_messages_and_ticks_give_the_same_advisories() -> None:
    def told() -> list[str]:
        charger = resource("c1", 0, 0, kind="charger", service_s=100.0)
        robots = {"A": standing(0, 0), "B": standing(30, 10, (60, 0, 0)), "C": standing(30, 20, (70, 0, 0))}
        return [advisory.model_dump_json() for advisory in Scene(site(charger), robots).run(20)]

    assert told()
    assert told() == told()


def test_robots_in_a_crowd_block_nobody() -> None:
    passing = {"A": Script([(0, -20, 0), (40, 20, 0)]), "B": Script([(0, 0, -20), (40, 0, 20)], vendor="Corvid")}
    crowd = {f"M-{n}": Script([(0, 0.1 * n, 0)], vendor="Mallory", state=lambda _: "idle") for n in range(12)}
    few = dict(list(crowd.items())[:3])
    assert raised(Scene(site(), passing | few).run(16), "blockage")
    advisories = Scene(site(), passing | crowd).run(16)
    assert raised(advisories, "blockage") == []
    assert len(raised(advisories, "crowd")) == 1
