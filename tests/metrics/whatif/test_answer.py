"""What a change changes, and when there is no answer."""

import numpy as np
import pytest
import shapely

from deconflict.foresight.losses.loss import LossKind
from deconflict.settings.site_file import load
from deconflict.simulation.demo.demo_site import demo_site
from metrics.whatif.answer import WhatIfModel
from metrics.whatif.change import (
    NO_CHANGE,
    ChangeError,
    NamedOutline,
    named_outlines,
    one_way,
    priority,
    slow_zone,
    wider,
)
from metrics.whatif.demand import demand_of
from metrics.whatif.recorded_tracks import RecordedFloor, RobotTrack
from metrics.whatif.simulated.model_runs import model_figures
from metrics.whatif.simulated.simulated_plan import Planner
from tests.metrics.whatif.made_floors import met, recorded, track

EVERYWHERE = NamedOutline("Hall", 0, shapely.box(-50, -50, 50, 50))
AISLE = NamedOutline("Aisle", 0, shapely.box(-15, -3, 15, 3))


def shuttle(name: str, a: tuple[float, float], b: tuple[float, float], vendor: str) -> RobotTrack:
    """A robot that drives there and back."""
    return track(name, [(a, 5.0), (b, 6.0)] * 4, vendor)


def crossing_robots() -> RecordedFloor:
    """Two robots whose ways cross again and again."""
    return recorded(shuttle("A", (-20.0, 0.0), (20.0, 0.0), "Alder"), shuttle("B", (0.0, -20.0), (0.0, 20.0), "Birch"))


def test_robots_drive_the_recorded_trips_again_and_lose_time_to_each_other() -> None:
    floor = crossing_robots()
    demand = demand_of(floor)
    lost_s, trips, _ = model_figures(Planner(demand).plan(), 1, floor.span_s + 120.0).sum(axis=0)
    assert trips == sum(len(robot.trips) for robot in demand.robots)
    assert 1.0 < lost_s < 60.0


def test_the_same_seed_gives_the_same_figures() -> None:
    plan = Planner(demand_of(crossing_robots())).plan()
    first, again, other = (model_figures(plan, seed, 60.0) for seed in (3, 3, 4))
    assert np.array_equal(first, again)
    assert not np.array_equal(first, other)


def test_a_slow_zone_takes_longer() -> None:
    demand = demand_of(recorded(shuttle("A", (-20.0, 0.0), (20.0, 0.0), "Alder")))
    before, after = Planner(demand).plan(), Planner(demand).plan(slow_zone([EVERYWHERE], 0.5))
    assert model_figures(after, 1, 120.0)[:, 1].sum() < model_figures(before, 1, 120.0)[:, 1].sum()


def test_a_one_way_aisle_sends_robots_around() -> None:
    """Around through the other aisle of a ring, where robots drive in both directions."""
    ring = [((-20.0, 0.0), 5.0), ((20.0, 0.0), 6.0), ((20.0, 12.0), 6.0), ((-20.0, 12.0), 6.0), ((-20.0, 0.0), 6.0)]
    demand = demand_of(recorded(track("A", [*ring, *ring[::-1], *ring]), shuttle("B", (-20.0, 0.0), (20.0, 0.0), "B")))
    change = one_way(AISLE, demand)
    plan = Planner(demand).plan(change)
    assert "Aisle is one-way towards larger x" in change.text
    assert plan.rerouted >= 4
    assert not plan.impossible


def test_robots_pass_each_other_in_a_wider_aisle_and_wait_elsewhere() -> None:
    """Two robots meet in one lane again and again. Jams last as long as in the log, whose mean is 40 s."""
    west, east = (-20.0, 0.0), (20.0, 0.0)
    demand = demand_of(recorded(shuttle("A", west, east, "Alder"), shuttle("B", east, west, "Birch")))
    losses = [met(LossKind.DEADLOCK, 1.0, length_s, 10.0 * length_s) for length_s in (30.0, 40.0, 50.0, 2.0)]
    change = wider([AISLE], demand, losses)
    assert change.before
    before, after = (
        model_figures(Planner(demand).plan(each), 1, 150.0)[:, 0].sum() for each in (change.before, change)
    )
    assert after < before / 1.5


def test_how_long_jams_last_is_read_from_the_aisle_only() -> None:
    demand = demand_of(crossing_robots())
    beside = [met(LossKind.DEADLOCK, 30.0, 40.0)] * 5
    others = [met(LossKind.FOLLOWING, 1.0, 40.0)] * 5
    assert wider([AISLE], demand, [*beside, *others]).wider[0].jam_s == 0.0


def test_a_jam_that_the_log_has_in_parts_is_one() -> None:
    jams = [met(LossKind.DEADLOCK, 1.0, 60.0, from_s) for from_s in (0.0, 60.0, 200.0, 400.0)]
    assert wider([AISLE], demand_of(crossing_robots()), jams).wider[0].jam_s == 80.0


def test_without_metres_an_aisle_gets_as_wide_as_robots_need_to_pass() -> None:
    demand = demand_of(crossing_robots())
    assert "Aisle is 0.5 m wider" in wider([AISLE], demand, []).text
    assert wider([AISLE], demand, [], 3.0).wider[0].beside_m == 1.5


def test_there_is_no_answer_if_the_model_does_not_repeat_the_log() -> None:
    floor = crossing_robots()
    found = WhatIfModel(floor, demand_of(floor), 1, 1).ask(NO_CHANGE)
    assert found.problems
    assert "no answer: robots lose only 0 s an hour" in "\n".join(found.lines())


def test_robots_with_priority_lose_less_to_others() -> None:
    floor = crossing_robots()
    demand = demand_of(floor)
    plans = [Planner(demand).plan(priority(vendor, demand)) for vendor in ("Alder", "Birch")]
    first, other = (sum((model_figures(plan, seed, 120.0) for seed in (1, 2)), np.zeros((2, 3))) for plan in plans)
    assert np.all(np.sign((first - other)[:, 0]) == [-1.0, 1.0])


def test_a_vendor_without_robots_has_no_priority() -> None:
    with pytest.raises(ChangeError, match="'Corvid' has no robots in the log; Alder, Birch have"):
        priority("Corvid", demand_of(crossing_robots()))


@pytest.mark.parametrize("name", ["Aisle 4", "aisle 4", "aisle-4"])
def test_a_place_is_found_however_its_name_is_written(name: str) -> None:
    site = load(demo_site())
    assert [found.name for found in named_outlines(site, [site.datums[0].id], name)] == ["Aisle 4"]


def test_the_only_vendor_has_nobody_to_go_before() -> None:
    with pytest.raises(ChangeError, match="all robots in the log are of Alder"):
        priority("Alder", demand_of(recorded(shuttle("A", (-20.0, 0.0), (20.0, 0.0), "Alder"))))
