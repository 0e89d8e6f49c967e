"""A fleet's order at crossings, ahead of time: who waits where, and that told paths do so."""

import numpy as np
import pytest

from deconflict.simulation.driving.crossings import CrossingPassage
from deconflict.simulation.driving.motion import Activity
from deconflict.simulation.driving.routes import drive
from deconflict.simulation.driving.traffic import World
from deconflict.simulation.floor_layout import layout_for
from deconflict.simulation.participants import ALDER, CORVID, Make, Participant
from deconflict.simulation.robot_state import CrossingSchedule, robot_states

EAST, NORTH = (1, 0), (0, 1)


def two_that_cross(second: Make) -> World:
    """One drives east through a crossing at x 10, the other north through it, a second later."""
    world = World(layout_for(24), (Participant(1, ALDER), Participant(2, second)), np.random.default_rng(1))
    ways = (((0.0, 0.0), (30.0, 0.0), EAST), ((10.0, -11.4), (10.0, 20.0), NORTH))
    for robot, (start, end, inward) in enumerate(ways):
        make = world.members[robot].make
        world.tracks.set_drive(
            robot, drive([start, end], float(np.arctan2(end[1] - start[1], end[0] - start[0])), make)
        )
        enter_m = 7.4 if robot == 0 else 8.8
        world.crossings.set_drive(robot, [CrossingPassage(7, enter_m, enter_m + 4.8, inward, left=False)])
        world.trips.goal[robot] = world.trips.bay[robot]
    world.doing[:] = Activity.DRIVING
    world.progress_m[:], world.speed_mps[:] = 1.0, 1.0
    return world


def test_the_later_robot_of_a_fleet_waits_until_the_other_has_left() -> None:
    schedule = CrossingSchedule(two_that_cross(ALDER))
    assert schedule.waits(0) == []
    [(at_m, wait_s)] = schedule.waits(1)
    assert at_m == 8.8
    assert 1.5 < wait_s < 3.5


def test_robots_of_different_fleets_do_not_wait_for_each_other() -> None:
    schedule = CrossingSchedule(two_that_cross(CORVID))
    assert [schedule.waits(robot) for robot in (0, 1)] == [[], []]


@pytest.mark.parametrize(("second", "waits"), [(ALDER, True), (CORVID, False)])
def test_reported_paths_keep_only_the_order_of_the_own_fleet(second: Make, waits: bool) -> None:
    world = two_that_cross(second)
    _, later = robot_states(world, np.arange(len(world)))
    at_line_s = 8.0 / second.max_speed_mps
    poses, _ = later.plan.at(np.array([at_line_s + 1.5]))
    assert (poses[0, 1] <= -2.5) == waits
