"""A robot is in a place while its body is there, and not while its path leads there."""

from collections.abc import Mapping
from random import Random

import pytest

from deconflict.settings.shared_places import Resource, Zone
from tests.deconflict.contention.scenes import Scene, Script, box, comes, raised, resource, site
from tests.helpers.saying import HALL

LENGTH_M = 1.0
"""Of robots along their headings; see `identity`."""


def crossing(half_m: float) -> Zone:
    return Zone(id="c", kind="crossing", datum=HALL, polygon=box(0, 0, 2 * half_m, 2 * half_m), capacity=1)


def occupancy(place: Zone | Resource, robots: Mapping[str, Script], until_s: float, from_s: float = 12.0) -> set[float]:
    """The numbers of robots inside at each second."""
    scene, found = Scene(site(place), dict(robots)), set[float]()
    scene.run(from_s)
    for second in range(round(from_s), round(until_s)):
        scene.run(second + 1, from_s=second)
        scene.engine.measures.as_document()
        found.add(scene.engine.measures.values["deconflict_resource_occupancy"][place.id,])
    assert not raised(scene.advisories, "double_occupancy")
    return found


@pytest.mark.parametrize("number", range(6))
def test_robots_that_stand_before_a_crossing_are_not_in_it(number: int) -> None:
    """Their fronts are just before it, and their paths lead in at once."""
    draw = Random(number)
    half_m = draw.uniform(1.0, 1.6)
    stops_m = [half_m + LENGTH_M / 2 + draw.uniform(0.05, 0.5) for _ in range(2)]
    robots = {"a": comes(number, stops_m[0]), "b": comes(number + 1, stops_m[1], "Birch")}
    assert occupancy(crossing(half_m), robots, 24) == {0}


@pytest.mark.parametrize("number", range(6))
def test_a_robot_that_stands_in_a_crossing_is_in_it_although_its_path_leads_out(number: int) -> None:
    draw = Random(number)
    half_m = draw.uniform(1.0, 1.6)
    assert occupancy(crossing(half_m), {"a": comes(number, -half_m + draw.uniform(-0.4, 0.4))}, 24) == {1}


@pytest.mark.parametrize("number", range(6))
def test_a_robot_that_stands_before_a_dock_does_not_have_it(number: int) -> None:
    """The middle of its body is just before it."""
    half_m = Random(number).uniform(1.0, 2.0)
    dock = resource("d", 0, 0, polygon=box(0, 0, 2 * half_m, 2 * half_m))
    assert occupancy(dock, {"a": comes(number, half_m + Random(number + 9).uniform(0.1, 0.5))}, 20) == {0}


def test_a_robot_that_drives_is_in_a_crossing_as_soon_as_it_gets_there() -> None:
    """Between its reports, too: its front reaches the crossing at 8.5 s."""
    scene = Scene(site(crossing(1.0)), {"a": comes(0, -20.0, at_s=30.0)})
    scene.run(10)
    scene.engine.measures.as_document()
    assert scene.engine.measures.values["deconflict_resource_occupancy"]["c",] == 1
