"""Right of way: ways that meet are never open together."""

from itertools import pairwise

import numpy as np
import pytest

from deconflict.simulation.driving.crossings import CrossingPassage, Crossings, passages
from deconflict.simulation.driving.routes import drive, lane
from deconflict.simulation.floor_layout import layout_for
from deconflict.simulation.participants import ALDER

EAST, WEST, NORTH = (1, 0), (-1, 0), (0, 1)


def passage(inward: tuple[int, int], *, left: bool = False) -> CrossingPassage:
    return CrossingPassage(7, 5.0, 9.0, inward, left)


@pytest.mark.parametrize(
    ("crossing_passage", "other", "meet"),
    [
        (passage(EAST), passage(WEST), False),
        (passage(EAST), passage(EAST, left=True), False),
        (passage(EAST), passage(WEST, left=True), True),
        (passage(EAST), passage(NORTH), True),
    ],
)
def test_paths_through_a_crossing_touch_as_expected(
    crossing_passage: CrossingPassage, other: CrossingPassage, meet: bool
) -> None:
    assert crossing_passage.meets(other) is meet
    assert other.meets(crossing_passage) is meet


def test_the_second_robot_waits_until_the_first_has_left() -> None:
    crossings = Crossings(np.zeros(2, np.int64))
    for robot, inward in enumerate((EAST, NORTH)):
        crossings.set_drive(robot, [passage(inward)])
    both = np.arange(2)
    crossings.update(np.array([4.0, 4.0]), both)
    assert crossings.stop_m.tolist() == [np.inf, 5.0]
    assert crossings.waits_for[1] == 0
    crossings.update(np.array([9.5, 5.0]), both)
    crossings.update(np.array([9.5, 5.0]), both)
    assert crossings.stop_m.tolist() == [np.inf, np.inf]
    assert crossings.back_to_m[0] == 9.0


def test_fleets_do_not_know_of_each_other() -> None:
    crossings = Crossings(np.array([0, 1]))
    for robot, inward in enumerate((EAST, NORTH)):
        crossings.set_drive(robot, [passage(inward)])
    crossings.update(np.array([4.0, 4.0]), np.arange(2))
    assert crossings.stop_m.tolist() == [np.inf, np.inf]


def test_a_robot_that_has_backed_out_requests_the_crossing_again() -> None:
    crossings = Crossings(np.zeros(2, np.int64))
    for robot, inward in enumerate((EAST, NORTH)):
        crossings.set_drive(robot, [passage(inward)])
    crossings.update(np.array([4.0, 4.0]), np.arange(2))
    crossings.give_way(0, 4.5)
    assert crossings.stop_m[0] == 5.0
    crossings.update(np.array([4.5, 4.0]), np.array([1]))
    assert crossings.stop_m.tolist() == [5.0, np.inf]


def test_a_drive_has_the_crossings_of_its_path_in_order() -> None:
    layout = layout_for(24)
    nodes = layout.route(layout.bays[1].node, layout.bays[20].node, np.ones(len(layout.places)))
    way = drive(lane(layout, nodes, 0.47), layout.heading_rad(layout.bays[1]), ALDER)
    found = passages(layout, nodes, way)
    assert [each.node for each in found] == [node for node in nodes if node in layout.crossings]
    for made_crossing_passage in found:
        x, y = layout.places[made_crossing_passage.node]
        inside = slice(
            round(made_crossing_passage.enter_m / way.step_m), round(made_crossing_passage.leave_m / way.step_m)
        )
        assert np.hypot(way.x_m[inside] - x, way.y_m[inside] - y).min() < 1.5
        assert 2.5 < made_crossing_passage.leave_m - made_crossing_passage.enter_m < 6.0


def test_a_path_that_returns_to_its_start_has_its_crossings_in_order() -> None:
    """A crossing near the start that is come through in the end is not taken for one at the start."""
    layout = layout_for(24)
    ways = 0
    for start in layout.bays:
        for goal in layout.bays:
            if start.floor != goal.floor or start.node == goal.node:
                continue
            nodes = layout.route(start.node, goal.node, np.ones(len(layout.places)))
            if sum(node in layout.crossings for node in nodes) < 3:
                continue
            way = drive(lane(layout, nodes, 0.7), layout.heading_rad(start), ALDER)
            found = passages(layout, nodes, way)
            assert all(before.leave_m <= after.enter_m + 0.2 for before, after in pairwise(found))
            assert all(made_crossing_passage.enter_m < made_crossing_passage.leave_m for made_crossing_passage in found)
            ways += 1
            break
    assert ways > 20
