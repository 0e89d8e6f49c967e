"""Robots of which one passes above the other do not wait for each other; at one height they do."""

import pytest

from deconflict.settings.shared_places import Resource, Zone
from deconflict_client.advisory import AnyAdvisory, ContentionAdvisory
from tests.deconflict.contention.scenes import Scene, Script, aisle, raised, resource, site
from tests.helpers.saying import robot

ABOVE_M = 5.0
LEVEL = pytest.mark.parametrize(("z_m", "met"), [(0.0, True), (ABOVE_M, False)])


def waits(*_: float) -> str:
    return "waitingExternalEvent"


def told(kind: str, until_s: float, robots: dict[str, Script], *places: Resource | Zone) -> list[AnyAdvisory]:
    return raised(Scene(site(*places), robots).run(until_s), kind)


@LEVEL
def test_a_robot_that_stands_below_another_is_no_blockage(z_m: float, met: bool) -> None:
    robots = {
        "A": Script([(0, 0, 0)], state=lambda _: "idle"),
        "B": Script([(0, -15, 0), (13, -2, 0), (60, -2, 0)], means=[(0, -15, 0), (20, 5, 0)], vendor="Corvid", z_m=z_m),
    }
    assert bool(told("blockage", 14, robots)) is met


@LEVEL
def test_two_that_go_through_a_lane_one_above_the_other_do_not_lock_each_other(z_m: float, met: bool) -> None:
    robots = {"A": Script([(0, -16, 0), (40, 24, 0)]), "B": Script([(0, 20, 0), (40, -20, 0)], z_m=z_m)}
    assert bool(told("deadlock", 8, robots, aisle("lane", -8, 12))) is met


@LEVEL
def test_two_that_will_swap_their_docks_one_above_the_other_do_not_lock_each_other(z_m: float, met: bool) -> None:
    docks = resource("d1", 0, 0), resource("d2", 20, 0)
    robots = {
        "A": Script([(0, 0, 0)], [(80, 20, 0)], state=waits),
        "B": Script([(0, 20, 0)], [(80, 0, 0)], state=waits, z_m=z_m),
    }
    assert bool(told("deadlock", 5, robots, *docks)) is met


@LEVEL
def test_two_that_swap_places_outside_resources_lock_each_other_at_one_height_only(z_m: float, met: bool) -> None:
    robots = {
        "A": Script([(0, 0, 0)], [(80, 20, 0)], state=waits),
        "B": Script([(0, 20, 0)], [(80, 0, 0)], state=waits, z_m=z_m),
    }
    assert bool(told("deadlock", 10, robots)) is met


@LEVEL
def test_a_robot_that_comes_to_a_dock_does_not_wait_for_one_above_it(z_m: float, met: bool) -> None:
    robots = {
        "A": Script([(0, 0, 0)], state=lambda _: "idle", z_m=z_m),
        "B": Script([(0, 30, 0), (30, 0, 0)], [(30, 0, 0)]),
    }
    assert bool(told("contention", 5, robots, resource("d1", 0, 0, service_s=100.0))) is met


@LEVEL
def test_two_in_a_dock_are_double_occupancy_if_neither_is_above_the_other(z_m: float, met: bool) -> None:
    robots = {
        "A": Script([(0, -0.6, 0)], state=lambda _: "idle"),
        "B": Script([(0, 0.6, 0.6)], state=lambda _: "idle", z_m=z_m),
    }
    assert bool(told("double_occupancy", 5, robots, resource("d1", 0, 0))) is met


def test_a_queue_leaves_out_robots_that_pass_above_it() -> None:
    robots = {
        "A": Script([(0, 0, 0)], state=lambda _: "idle"),
        "B": Script([(0, 30, 0), (30, 0, 0)], [(30, 0, 0)]),
        "C": Script([(0, 0, 0.5)], state=lambda _: "idle", z_m=ABOVE_M),
        "D": Script([(0, 0, 40), (40, 0, 0)], [(40, 0, 0)], z_m=ABOVE_M),
    }
    scene = Scene(site(resource("d1", 0, 0, service_s=60.0, capacity=1)), robots)
    (advisory,) = raised(scene.run(3), "contention")
    assert isinstance(advisory, ContentionAdvisory)
    assert set(advisory.robots) == {robot("A"), robot("B")}
    assert advisory.demand == 2
    assert advisory.recommendation
    assert [slot.robot for slot in advisory.recommendation.slots] == [robot("B")]
