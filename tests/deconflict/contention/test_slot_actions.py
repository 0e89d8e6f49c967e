"""Actions for people out of advised slots, in scenes through fleet and engine."""

from typing import Any

from deconflict.advice.actions.action_text import action_text
from deconflict_client.advisory import Action, AnyAdvisory
from ingest.settings import Model, Trailers, Vendor
from tests.deconflict.contention.scenes import Scene, Script, aisle, raised, resource, site
from tests.helpers.saying import robot


def actions(advisory: AnyAdvisory) -> tuple[Action, ...]:
    assert advisory.recommendation
    return advisory.recommendation.actions


def texts(advisory: AnyAdvisory) -> list[str]:
    return [action_text(action) for action in actions(advisory)]


def standing(x: float, y: float, *destinations: tuple[float, float, float]) -> Script:
    return Script([(0, x, y)], destinations, state=lambda _: "waitingExternalEvent")


def test_of_two_that_come_to_a_lane_from_both_ends_one_waits_and_the_other_goes_first() -> None:
    robots = {"A": Script([(0, -16, 0), (40, 24, 0)]), "B": Script([(0, 22, 0), (40, -18, 0)])}
    (advisory,) = raised(Scene(site(aisle("lane", -8, 12)), robots).run(6), "deadlock")
    wait, first = actions(advisory)
    assert advisory.recommendation
    slot = advisory.recommendation.slots[1]
    assert (wait.robot, wait.action, wait.where, wait.resource) == (robot("B"), "wait", "before lane", "lane")
    assert wait.seconds is not None
    assert slot.wait_s <= wait.seconds < slot.wait_s + 1
    assert wait.start_at == slot.start_at
    assert (first.robot, first.action) == (robot("A"), "go_first")


def test_of_two_in_a_lane_one_backs_out() -> None:
    robots = {"A": Script([(0, -16, 0), (40, 24, 0)]), "B": Script([(0, 16, 0), (40, -24, 0)])}
    scene = Scene(site(aisle("lane", -8, 12)), robots)
    revisions = [each for each in scene.run(12) if each.kind == "deadlock"]
    assert texts(revisions[-1]) == ["Alder A should back out of lane", "Alder B should go first"]


def test_who_was_to_wait_before_a_lane_backs_out_of_it() -> None:
    """Both enter at the same time. Either of them could back out; the one that was asked to wait does."""
    robots = {"A": Script([(0, -16, 0), (40, 24, 0)]), "B": Script([(0, 20, 0), (40, -20, 0)])}
    revisions = [each for each in Scene(site(aisle("lane", -8, 12)), robots).run(14) if each.kind == "deadlock"]
    asked = [texts(each) for each in revisions]
    assert asked[0][0].startswith("Alder A should wait ")
    assert asked[-1] == ["Alder A should back out of lane", "Alder B should go first"]
    assert {first for _, first in asked} == {"Alder B should go first"}


def test_no_train_backs_out_of_a_lane() -> None:
    """Without trailers A would, which is less far in; with them B does, and if both pull some, nobody."""
    pulled = {"A1": Model(trailers=Trailers(count=2, length_m=1.0, width_m=0.7, hitch_m=1.3))}
    alder, corvid = Vendor(name="Alder", models=pulled), Vendor(name="Corvid", models=pulled)
    a, b = Script([(0, -16, 0), (40, 24, 0)]), Script([(0, 16, 0), (40, -24, 0)], vendor="Corvid")
    by_hand = "drive it aside by hand, so that the others can pass"
    nobody = f"somebody should go to Corvid B (no order of waiting ends it) and {by_hand}"
    for vendors, expected in (
        ((alder,), ["Corvid B should back out of lane", "Alder A should go first"]),
        ((alder, corvid), [nobody]),
    ):
        scene = Scene(site(aisle("lane", -8, 12), vendors=vendors), {"A": a, "B": b})
        (advisory,) = raised(scene.run(8), "deadlock")
        last = [each for each in scene.run(12, from_s=8) if each.id == advisory.id][-1]
        assert texts(last) == expected


def test_one_of_two_that_swap_goes_to_a_free_place_first() -> None:
    docks = site(resource("d1", 0, 0), resource("d2", 20, 0), resource("p1", 10, 5, kind="parking"))
    robots = {"A": standing(0, 0, (80, 20, 0)), "B": standing(20, 0, (80, 0, 0))}
    (advisory,) = raised(Scene(docks, robots).run(5), "deadlock")
    (action,) = actions(advisory)
    assert (action.action, action.resource, action.where) == ("take_another_route", "p1", "to p1 first")
    assert action.end_at
    assert action.start_at
    assert action.end_at >= action.start_at


def test_somebody_looks_at_a_ring_that_no_order_ends() -> None:
    docks = site(resource("d1", 0, 0), resource("d2", 20, 0))
    robots = {"A": standing(0, 0, (80, 20, 0)), "B": standing(20, 0, (80, 0, 0))}
    (advisory,) = raised(Scene(docks, robots).run(5), "deadlock")
    assert [action.action for action in actions(advisory)] == ["look"]


def test_a_robot_whose_lift_is_taken_goes_to_its_twin() -> None:
    lifts = [resource(name, x, 0, kind="lift", group="lifts", service_s=60.0) for name, x in (("l1", 0), ("l2", 8))]
    robots = {"A": standing(0, 0), "B": Script([(0, 0, 30), (30, 0, 0)], [(30, 0, 0)])}
    (advisory,) = raised(Scene(site(*lifts), robots).run(5), "contention")
    assert texts(advisory) == ["Alder B should go to l2 instead"]


def queue(**settings: Any) -> AnyAdvisory:
    """The advisory on a dock that is taken, to which robots of two vendors come."""
    dock = resource("d1", 0, 0, service_s=30.0)
    first = Script([(0, 0, 20), (20, 0, 0)], [(20, 0, 0)], vendor="Basalt")
    second = Script([(0, 24, 0), (24, 0, 0)], [(24, 0, 0)], vendor="Corvid")
    robots = {"A": standing(0, 0), "B": first, "C": second}
    (advisory,) = raised(Scene(site(dock, **settings), robots).run(5), "contention")
    return advisory


def test_a_queue_whose_order_saves_nothing_needs_no_action() -> None:
    advisory = queue()
    assert advisory.recommendation
    assert advisory.recommendation.slots
    assert advisory.recommendation.expected_saving_s < 1
    assert actions(advisory) == ()


def test_a_robot_lets_a_later_one_go_first_if_that_costs_less() -> None:
    wait, first = actions(queue(vendors=(Vendor(name="Corvid", priority=5.0),)))
    assert (wait.robot, wait.action, wait.where) == (robot("B"), "wait", "before d1")
    assert (first.robot, first.action) == (robot("C"), "go_first")
