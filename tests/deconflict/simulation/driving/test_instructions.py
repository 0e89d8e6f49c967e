"""Robots of the moving world that are told to wait, to slow down or to back off."""

import numpy as np
import pytest

from deconflict.simulation.driving.motion import Activity
from deconflict.simulation.driving.traffic import World
from deconflict.simulation.fleet_plans import plan_of
from deconflict.simulation.floor_layout import layout_for
from deconflict.simulation.participants import participants
from deconflict.simulation.robot_state import robot_states

STEP_S = 0.1


def driving_alone() -> tuple[World, int]:
    """A world in which a robot drives along a straight part of its path."""
    world = World(layout_for(4), participants(4), np.random.default_rng(3))
    while True:
        world.step(STEP_S)
        free = (world.doing == Activity.DRIVING) & (world.speed_mps > 0.8) & ~world.person
        for row in np.flatnonzero(free).tolist():
            ahead_m = world.tracks.speed_mps(np.array(row), world.progress_m[row] + np.arange(0.0, 8.0))
            if ahead_m.min() > 0.8:
                return world, row


def run(world: World, seconds: float) -> None:
    for _ in range(round(seconds / STEP_S)):
        world.step(STEP_S)


def test_a_robot_that_is_told_to_wait_stands_for_that_long_and_then_goes_on() -> None:
    world, row = driving_alone()
    world.instructions.wait(row, 4.0, world.t_s)
    run(world, 3.5)
    assert world.speed_mps[row] == 0.0
    stood_m = world.progress_m[row]
    assert world.waits.waited_s[row] == 0.0, "nobody blocks it"
    run(world, 3.0)
    assert world.progress_m[row] > stood_m + 0.5


def test_a_second_wait_is_added_to_the_first() -> None:
    world, row = driving_alone()
    world.instructions.wait(row, 4.0, world.t_s)
    world.instructions.wait(row, 3.0, world.t_s)
    assert world.instructions.top_of_mps(row, world.t_s)[1] == pytest.approx(7.0)


def test_a_robot_reports_the_wait_that_it_was_told() -> None:
    world, row = driving_alone()
    world.instructions.wait(row, 6.0, world.t_s)
    here = world.locations()[row]
    plan = plan_of(world, row, int(world.floor[row]), here, [])
    assert np.allclose(plan.at(np.array([5.9]))[0][0], here)
    assert not np.allclose(plan.at(np.array([8.0]))[0][0], here)
    (state,) = robot_states(world, np.array([row]))
    assert (state.state == "waitingExternalEvent") is world.members[row].make.tells_waiting


def test_a_robot_that_is_told_to_slow_down_drives_and_plans_no_faster() -> None:
    world, row = driving_alone()
    world.instructions.slow_down(row, 0.4, 5.0, world.t_s)
    run(world, 2.0)
    assert 0.3 < world.speed_mps[row] <= 0.4
    plan = plan_of(world, row, int(world.floor[row]), world.locations()[row], [])
    at_m = plan.at(np.array([0.0, 2.0]))[0][:, :2]
    assert np.hypot(*(at_m[1] - at_m[0])) <= 0.4 * 2.0 + 0.05
    run(world, 5.0)
    assert world.speed_mps[row] > 0.5


def test_a_robot_that_is_told_to_back_off_drives_backwards() -> None:
    world, row = driving_alone()
    before_m = world.progress_m[row]
    world.back_off(row)
    assert world.doing[row] == Activity.BACKING
    run(world, 8.0)
    assert world.progress_m[row] < before_m
