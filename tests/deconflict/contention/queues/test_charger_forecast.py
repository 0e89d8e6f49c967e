"""Robots that will need a charger, on a small made-up floor."""

from itertools import product
from typing import Any

import numpy as np
import pytest

from deconflict.contention.queues.charger_forecast import AHEAD_S, ChargingNeed, charger_shortages, more_than, pools
from deconflict.contention.queues.queue_forecast import QueueEntry, forecast_queues
from deconflict.contention.robots.place_geometry import PlaceGeometry
from deconflict.settings.shared_places import Resource
from deconflict_client.advisory import ContentionAdvisory
from ingest.batch import Floats
from tests.deconflict.contention.queues.made_driver import Driver, Levels
from tests.deconflict.contention.scenes import Scene, Script, raised, resource, site
from tests.helpers.saying import robot


def charger(place: str, x: float, y: float = 0.0, **fields: Any) -> Resource:
    return resource(place, x, y, kind="charger", service_s=900.0, **fields)


def at(level_pct: float, drain_pct_per_s: float = 0.0) -> Levels:
    return lambda t: level_pct - drain_pct_per_s * t


def stands(x: float, level: Levels, lasts_s: float | None = None, state: str = "idle", **fields: Any) -> Driver:
    return Driver([(0, x, 20)], state=lambda _: state, level=level, lasts_s=lasts_s, **fields)


def inside(place: Resource, level_pct: float = 50.0) -> Driver:
    """It is at a charger."""
    (x0, y0), _, (x1, y1), _ = place.polygon
    return Driver([(0, (x0 + x1) / 2, (y0 + y1) / 2)], state=lambda _: "charging", level=at(level_pct))


def needed(scene: Scene) -> dict[str, float]:
    """By robot, how likely it is to need a charger within a quarter of an hour."""
    contention = scene.engine._shared.contention
    return {need.robot: round(float(need.likely[-1]), 2) for need in contention.needs}


C1, C2 = charger("c1", 0.0), charger("c2", 6.0)


def test_a_robot_whose_battery_will_be_low_is_expected_at_a_charger_before_it_announces_it() -> None:
    robots: dict[str, Script] = {
        "A": stands(20, at(30.0), 1800.0),
        "B": stands(30, at(80.0), 1800.0),
        "C": stands(40, at(60.0), 900.0),
    }
    scene = Scene(site(C1), robots)
    scene.run(15)
    # A falls to 15 % within a quarter of an hour, B to 40 %, and C is empty by then
    assert needed(scene) == {robot("A"): 1.0, robot("C"): 1.0}
    scene.engine.measures.as_document()
    assert scene.engine.measures.values["deconflict_resource_expected_demand"] == {("c1",): 2.0}


def test_a_robot_at_or_on_its_way_to_a_charger_or_at_rest_or_far_below_usual_levels_is_not_expected() -> None:
    robots: dict[str, Script] = {
        "A": inside(C1, 24.0),
        "B": Driver([(0, 60, 0), (60, 0, 0)], [(60, 0, 0)], level=at(24.0), lasts_s=600.0),
        "C": stands(30, at(24.0), 600.0, state="offline"),
        "D": stands(40, at(5.0), 600.0),
        "E": stands(50, at(24.0), 600.0),
    }
    scene = Scene(site(C1), robots)
    scene.run(15)
    assert needed(scene) == {robot("E"): 1.0}


def test_without_chargers_there_are_no_needs() -> None:
    scene = Scene(site(resource("d1", 0, 0)), {"A": stands(20, at(24.0), 600.0)})
    scene.run(15)
    assert needed(scene) == {}


def test_a_measured_drain_counts_more_than_the_reported_run_time() -> None:
    scene = Scene(site(C1), {"A": stands(20, at(45.0, 0.025), 36000.0)})
    scene.run(15)
    assert needed(scene) == {}
    scene.run(620, from_s=15)
    # at 29.5 %, and 7 % in a quarter of an hour by its run time; 22.5 % by how it fell
    assert needed(scene) == {robot("A"): pytest.approx(1.0, abs=0.01)}


def told_of(scene: Scene, until_s: float) -> list[ContentionAdvisory]:
    return [
        advisory for advisory in raised(scene.run(until_s), "contention") if isinstance(advisory, ContentionAdvisory)
    ]


def test_a_taken_charger_is_a_shortage_for_a_robot_that_needs_it() -> None:
    scene = Scene(site(C1), {"A": inside(C1), "B": stands(20, at(24.0), 600.0)})
    (advisory,) = told_of(scene, 15)
    assert (advisory.resource, advisory.resources, advisory.expected, advisory.demand, advisory.queue_length) == (
        "c1",
        ("c1",),
        1,
        2,
        1,
    )
    assert advisory.probability is not None
    assert advisory.probability >= 0.8
    assert set(advisory.robots) == {robot("A"), robot("B")}
    assert advisory.severity == "caution"
    assert 60 <= advisory.time_to_conflict_s <= 900
    assert advisory.wait_s > 10
    assert "will probably be full" in advisory.summary
    assert "Alder B 24 %" in advisory.summary
    assert advisory.recommendation is None


def test_full_chargers_are_one_line_that_names_them() -> None:
    robots: dict[str, Script] = {"A": inside(C1), "B": inside(C2), "C": stands(20, at(24.0), 600.0)}
    (advisory,) = told_of(Scene(site(C1, C2), robots), 15)
    assert advisory.resources == ("c1", "c2")
    assert advisory.resource_name == "one of c1 and c2"
    assert advisory.summary.startswith("c1 and c2 will probably be full in ")


def test_a_robot_that_has_announced_its_arrival_is_not_expected_twice() -> None:
    b = Driver([(0, 60, 0), (60, 0, 0)], [(60, 0, 0)], level=at(24.0), lasts_s=600.0)
    (advisory,) = told_of(Scene(site(C1), {"A": inside(C1), "B": b}), 15)
    assert (advisory.expected, advisory.probability, advisory.resources) == (0, None, ())


@pytest.mark.parametrize("level_pct", [35.0, 60.0])
def test_a_need_that_is_not_likely_enough_makes_no_shortage(level_pct: float) -> None:
    robots: dict[str, Script] = {"A": inside(C1), "B": stands(20, at(level_pct), 36.0 * level_pct * 2)}
    assert told_of(Scene(site(C1), robots), 30) == []


def test_room_for_all_makes_no_shortage() -> None:
    assert told_of(Scene(site(C1, C2), {"A": inside(C1), "B": stands(20, at(24.0), 600.0)}), 30) == []


def test_a_vendor_that_charges_at_one_of_two_chargers_needs_that_one() -> None:
    scene = Scene(site(C1, C2), {"A": inside(C1), "B": stands(20, at(24.0), 600.0)})
    batteries = scene.engine._shared.contention.robots.batteries
    scene.run(1)
    slot = scene.engine._shared.contention.robots.slots.by_uuid[robot("A")]
    batteries.arrive_at_charger(slot, 24.0)
    batteries.leave_charger(slot, "Alder", "c1", 90.0)
    (advisory,) = told_of(scene, 30)
    assert advisory.resources == ("c1",)


def test_a_shortage_has_one_advisory_until_the_need_is_over() -> None:
    b = Driver([(0, 20, 20)], state=lambda t: "idle" if t < 60 else "disabled", level=at(24.0), lasts_s=600.0)
    scene = Scene(site(C1), {"A": inside(C1), "B": b})
    advisories = [advisory for advisory in scene.run(100) if advisory.kind == "contention"]
    assert [advisory.state for advisory in advisories if advisory.state != "updated"] == ["raised", "cleared"]
    assert scene.engine.open() == []


@pytest.mark.parametrize("likely", [(), (0.3,), (0.9, 0.9), (0.2, 0.5, 0.8, 1.0)])
def test_the_probability_of_more_than_a_number_is_that_of_all_cases(likely: tuple[float, ...]) -> None:
    counts = np.arange(len(likely) + 1)
    found = more_than(counts, np.repeat(np.array(likely)[:, None], len(counts), axis=1))
    for count in counts.tolist():
        cases = product((0, 1), repeat=len(likely))
        expected = sum(
            np.prod([value if came else 1 - value for came, value in zip(case, likely, strict=True)])
            for case in cases
            if sum(case) > count
        )
        assert found[count] == pytest.approx(expected)


def more_than_alone(count: int, likely: Floats) -> float:
    """The same for one moment, robot by robot."""
    exactly = [1.0] + [0.0] * count
    for probability in likely.tolist():
        before = [0.0, *exactly]
        exactly = [held * (1 - probability) + below * probability for held, below in zip(exactly, before, strict=False)]
    return max(1.0 - sum(exactly), 0.0)


def test_the_probabilities_of_all_moments_are_those_of_each_moment_alone() -> None:
    random = np.random.default_rng(1)
    likely = np.sort(random.random((60, len(AHEAD_S))), axis=1) * random.random(60)[:, None]
    counts = random.integers(0, 80, len(AHEAD_S))
    counts[:2] = 0, 7
    alone = [more_than_alone(count, likely[:, column]) for column, count in enumerate(counts.tolist())]
    assert more_than(counts, likely) == pytest.approx(alone, abs=1e-12)


def need(name: str, likely: float, *chargers: str) -> ChargingNeed:
    return ChargingNeed(name, 25.0, frozenset(chargers), np.full(len(AHEAD_S), likely))


def test_chargers_among_which_a_robot_may_choose_are_one_pool() -> None:
    geometry = PlaceGeometry([charger(name, 6.0 * row) for row, name in enumerate("abcd")], ())
    assert pools([need("r", 1.0, "a", "c"), need("s", 1.0, "b")], geometry) == [("a", "c"), ("b",)]
    assert pools([need("r", 1.0, "d", "c"), need("s", 1.0, "b"), need("t", 1.0, "b", "c")], geometry) == [
        ("b", "c", "d")
    ]


@pytest.mark.parametrize(
    ("robots", "likely", "expected"), [(2, 0.99, False), (3, 0.99, True), (3, 0.8, False), (8, 0.6, True)]
)
def test_a_shortage_is_as_likely_as_more_robots_than_there_is_room_for(
    robots: int, likely: float, expected: bool
) -> None:
    geometry = PlaceGeometry([C1, C2], ())
    found = [need(f"r{number}", likely, "c1", "c2") for number in range(robots)]
    shortage = charger_shortages(found, {}, geometry, 0.0, {"c1": 900.0, "c2": 900.0})
    assert bool(shortage) is expected
    if shortage:
        (charger_shortage,) = shortage
        assert (
            charger_shortage.capacity,
            charger_shortage.from_s,
            charger_shortage.wait_s,
            len(charger_shortage.needs),
        ) == (2, 60.0, 900.0, robots)


def test_robots_with_announced_arrivals_take_room_until_they_leave() -> None:
    geometry = PlaceGeometry([C1], ())
    found = [need("r", 0.9, "c1")]
    leaving = forecast_queues({"c1": [QueueEntry(False, -9.0, "s", 30.0, 0.0)]}, geometry, 0.0)
    staying = forecast_queues({"c1": [QueueEntry(False, -9.0, "s", 400.0, 0.0)]}, geometry, 0.0)
    assert charger_shortages(found, leaving, geometry, 0.0, {"c1": 900.0}) == []
    (charger_shortage,) = charger_shortages(found, staying, geometry, 0.0, {"c1": 900.0})
    assert (charger_shortage.announced, charger_shortage.wait_s) == (("s",), 340.0)


def test_while_more_have_announced_than_there_is_room_for_nobody_else_makes_a_shortage() -> None:
    geometry = PlaceGeometry([C1], ())
    entries = [QueueEntry(False, -9.0, "s", 400.0, 0.0), QueueEntry(False, -8.0, "t", 300.0, 0.0)]
    turns = forecast_queues({"c1": entries}, geometry, 0.0)
    (shortage,) = charger_shortages([need("r", 0.9, "c1")], turns, geometry, 0.0, {"c1": 900.0})
    assert (shortage.from_s, shortage.announced) == (300.0, ("s",))


def test_a_standing_shortage_needs_a_lower_probability() -> None:
    geometry = PlaceGeometry([C1], ())
    turns = forecast_queues({"c1": [QueueEntry(False, -9.0, "s", 400.0, 0.0)]}, geometry, 0.0)
    for likely, anew, still in ((0.85, True, True), (0.7, False, True), (0.5, False, False)):
        found = [need("r", likely, "c1")]
        assert bool(charger_shortages(found, turns, geometry, 0.0, {"c1": 900.0})) is anew
        assert bool(charger_shortages(found, turns, geometry, 0.0, {"c1": 900.0}, ["c1"])) is still
