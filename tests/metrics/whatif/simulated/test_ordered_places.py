"""A place into which robots are let from one side at a time."""

import numpy as np
import pytest
import shapely

from benchmarks.whatif.crossing_yard import crossing_yard
from benchmarks.whatif.yards import yard_figures
from deconflict.foresight.losses.loss import LossKind
from deconflict.simulation.driving.crossings import CrossingPassage, Crossings
from deconflict.simulation.driving.routes import drive
from deconflict.simulation.participants import ALDER
from metrics.whatif.change import NamedOutline
from metrics.whatif.demand import demand_of
from metrics.whatif.simulated.ordered_places import ordered, place_passage, with_order, without_order, without_stops
from tests.metrics.whatif.made_floors import met, recorded, track

BOX = NamedOutline("Box", 0, shapely.box(10.0, -2.0, 20.0, 2.0))
EAST = drive([(0.0, 0.0), (30.0, 0.0)], 0.0, ALDER)


def test_a_way_through_it_enters_and_leaves_where_it_does() -> None:
    passage = place_passage(EAST, 4, BOX)
    assert passage
    assert passage.enter_m == pytest.approx(10.0, abs=0.3)
    assert passage.leave_m == pytest.approx(20.0, abs=0.3)
    assert (passage.node, passage.inward) == (4, (1, 0))
    west = place_passage(drive([(30.0, 0.0), (0.0, 0.0)], np.pi, ALDER), 4, BOX)
    assert west
    assert passage.meets(west)


def test_a_way_that_ends_in_it_has_no_order() -> None:
    assert place_passage(drive([(0.0, 0.0), (15.0, 0.0)], 0.0, ALDER), 4, BOX) is None


def test_it_replaces_the_crossings_that_it_holds() -> None:
    inside, beyond = (CrossingPassage(node, at_m, at_m + 4.0, (1, 0), False) for node, at_m in ((0, 13.0), (1, 24.0)))
    assert [each.node for each in with_order(EAST, 0, [inside, beyond], [BOX], 2)] == [2, 1]
    assert [each.node for each in with_order(EAST, 1, [inside, beyond], [BOX], 2)] == [0, 1]


def test_crossings_in_a_place_without_order_are_left_out() -> None:
    inside, beyond = (CrossingPassage(node, at_m, at_m + 4.0, (1, 0), False) for node, at_m in ((0, 13.0), (1, 24.0)))
    assert without_order(EAST, 0, [inside, beyond], [BOX]) == (beyond,)
    assert without_order(EAST, 1, [inside, beyond], [BOX]) == (inside, beyond)


def test_an_order_is_compared_with_none_only_where_robots_stood_for_each_other() -> None:
    legs = [((0.0, 0.0), 5.0), ((30.0, 0.0), 6.0)] * 3
    demand = demand_of(recorded(track("A", legs)))
    jams = [met(LossKind.DEADLOCK, 15.0, length_s, 10.0 * length_s) for length_s in (20.0, 40.0, 60.0)]
    jammed, calm = ordered([BOX], demand, jams), ordered([BOX], demand, jams[:2])
    assert jammed.before
    assert jammed.before.unordered == (BOX,)
    assert [place.jam_s for place in jammed.before.wider] == [40.0]
    assert calm.before is None


@pytest.mark.parametrize(("stay_s", "trips"), [(10.0, 1), (90.0, 2)])
def test_who_waits_in_a_crossing_has_no_goal_there(stay_s: float, trips: int) -> None:
    demand = demand_of(recorded(track("A", [((0.0, 0.0), 5.0), ((15.0, 0.0), stay_s), ((30.0, 0.0), 6.0)])))
    assert len(demand.robots[0].trips) == 2
    [robot] = without_stops(demand, [BOX]).robots
    assert len(robot.trips) == trips
    assert (robot.trips[0].corners[0][0], robot.trips[-1].corners[-1][0]) == (0.0, 30.0)


def test_a_shared_crossing_has_one_order_for_all_fleets() -> None:
    north = CrossingPassage(0, 5.0, 9.0, (0, 1), False)
    for shared, waits in ((frozenset({0}), True), (frozenset[int](), False)):
        crossings = Crossings(np.array([1, 2]))
        crossings.shared = shared
        crossings.set_drive(0, [CrossingPassage(0, 5.0, 9.0, (1, 0), False)])
        crossings.set_drive(1, [north])
        crossings.update(np.array([4.0, 4.0]), np.array([0, 1]))
        assert (crossings.waits_for[1] == 0) == waits


def test_single_lanes_that_cross_lose_less_with_an_order() -> None:
    without, ordered = (yard_figures(crossing_yard(4, is_ordered=way), 1, 300.0).lost_s for way in (False, True))
    assert ordered < 0.7 * without
