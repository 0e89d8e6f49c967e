"""The demand of a log: trips and stays."""

import numpy as np
import pytest

from deconflict.foresight.losses.loss import Loss, LossKind
from metrics.whatif.demand import demand_of, simplified, without_loops
from metrics.whatif.recorded_tracks import RecordedFloor
from tests.metrics.whatif.made_floors import recorded, track

WAY = [((0.0, 0.0), 10.0), ((20.0, 0.0), 15.0), ((20.0, 10.0), 8.0)]


def loss(robot: str, from_s: float, until_s: float) -> Loss:
    vendors = "Alder", "", "Birch", "Birch"
    place = 0, 0.0, 0.0
    return Loss(robot, "B", "B", *vendors, LossKind.CROSSING, from_s, until_s, until_s - from_s, 0.0, True, *place)


def test_what_a_robot_drives_between_two_stops_is_a_trip() -> None:
    [robot] = demand_of(recorded(track("A", WAY))).robots
    assert [trip.stop.place for trip in robot.trips] == [(20.0, 0.0), (20.0, 10.0)]
    assert robot.trips[0].stop.stay_s == pytest.approx(15.0, abs=1.0)
    assert robot.trips[0].departs_s == pytest.approx(10.0, abs=1.0)


def test_standing_for_another_robot_is_no_stop() -> None:
    floor = recorded(track("A", WAY))
    waiting = RecordedFloor(floor.tracks, [loss("A", 30.0, 45.0)], floor.floors, floor.span_s)
    [robot] = demand_of(waiting).robots
    assert [trip.stop.place for trip in robot.trips] == [(20.0, 10.0)]
    assert robot.trips[0].corners == ((0.0, 0.0), (20.0, 0.0), (20.0, 10.0))


def test_a_robot_that_was_carried_has_no_trip_there() -> None:
    found = track("A", WAY)
    found.x_m[20:] += 100.0
    [robot] = demand_of(recorded(found)).robots
    assert [trip.stop.place for trip in robot.trips] == [(120.0, 10.0)]


def test_a_way_leaves_out_where_the_robot_backed_off() -> None:
    along = np.array([0.0, 1.0, 2.0, 3.0, 2.0, 1.0, 2.0, 3.0, 4.0, 5.0])
    way = without_loops(np.column_stack([along, np.zeros(10)]))
    assert np.all(np.diff(way[:, 0]) > 0)
    assert way[-1, 0] == 5.0


def test_a_simplified_way_keeps_its_corners() -> None:
    way = np.array([(0.0, 0.0), (1.0, 0.05), (2.0, 0.0), (2.0, 1.0), (2.0, 2.0)])
    assert simplified(way).tolist() == [[0.0, 0.0], [2.0, 0.0], [2.0, 2.0]]
