"""Where the robots of a batch go: what they are at, and when they can be at the rest."""

import pytest

from deconflict.contention.robots.destinations import FASTEST_MPS, MOST_STOPS, PlannedStop
from deconflict.contention.robots.place_geometry import PlaceGeometry
from deconflict.contention.robots.robot_table import RobotTable
from deconflict.sweep.robot_slots import RobotSlots
from tests.deconflict.contention.scenes import LINE, NOW_S, Scene, Script, Spot, resource, site

DOCK = resource("d1", 40, 0)


def told(at: Spot, *stops: tuple[float, float, float]) -> tuple[PlannedStop, ...]:
    """By one robot that stands at `at`, beside one that tells nothing."""
    scene = Scene(site(DOCK), {"a": Script([(0, *at)], stops), "b": Script([(0, 90, 90)])})
    for name, script in scene.robots.items():
        scene.fleet.receive(script.says(name, 0.0), NOW_S, LINE)
    robots = RobotTable(PlaceGeometry([DOCK], ()), RobotSlots())
    robots.update(scene.fleet.next_batch(NOW_S))
    first, other = sorted(robots.values(), key=lambda seen: seen.y_m)
    assert other.stops == ()
    return first.stops


def test_stops_that_a_robot_is_at_already_are_left_out() -> None:
    assert [stop.x_m for stop in told((0, 0), (5, 0.6, 0), (60, 40, 0), (90, 9, 0))] == [40, 9]


def test_a_stop_in_the_resource_that_a_robot_has_is_left_out() -> None:
    assert [stop.x_m for stop in told((39.1, 0), (5, 40.9, 0), (60, 9, 0))] == [9]
    assert [stop.x_m for stop in told((39.1, 0), (5, 40.9, 0), (50, 39.2, 0), (60, 9, 0), (70, 40, 0))] == [9, 40]
    assert [stop.x_m for stop in told((38.9, 0), (5, 40.9, 0), (60, 9, 0))] == [40.9, 9]


def test_a_stop_is_expected_as_announced_but_no_sooner_than_possible() -> None:
    late, soon = told((0, 0), (60, 40, 0), (61, 300, 0))
    assert (late.t_s, late.resource) == (NOW_S + 60, "d1")
    assert late.spread_s == pytest.approx(12.0)
    assert soon.t_s == pytest.approx(NOW_S + 300 / FASTEST_MPS)
    assert soon.resource is None


@pytest.mark.parametrize(("announced", "kept"), [(15, 15), (40, MOST_STOPS)])
def test_the_first_stops_are_kept_also_if_a_robot_has_more_than_any_before(announced: int, kept: int) -> None:
    stops = told((0, 0), *((60.0 + t, 9.0 + t, 30.0) for t in range(announced)))
    assert [stop.x_m for stop in stops] == [9.0 + t for t in range(kept)]


def test_without_announcements_there_are_no_stops() -> None:
    assert told((0, 0)) == ()
