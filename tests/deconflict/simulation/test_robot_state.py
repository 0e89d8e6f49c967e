"""What robots know of themselves: plans come true where nobody is in the way."""

import numpy as np
import pytest

from deconflict.simulation.driving.motion import Activity
from deconflict.simulation.driving.traffic import RIDE_S, World
from deconflict.simulation.fleet_plans import FleetPlan
from deconflict.simulation.floor_layout import BayKind, layout_for
from deconflict.simulation.participants import participants
from deconflict.simulation.robot_state import RobotState, robot_states
from deconflict.simulation.trips import NOWHERE

STEP_S = 0.1
STATES = {"navigating", "idle", "charging", "waitingHumanEvent", "waitingExternalEvent"}


def world(robots_in_all: int, seed: int = 1) -> World:
    return World(layout_for(24), participants(robots_in_all), np.random.default_rng(seed))


def test_a_plan_is_linear_between_knots_and_stands_after_the_last() -> None:
    plan = FleetPlan(np.array([0.0, 2.0]), np.array([[0.0, 0.0, 0.0], [4.0, 2.0, 1.0]]), np.array([0, 0]))
    poses, floors = plan.at(np.array([0.0, 1.0, 2.0, 9.0]))
    assert poses.tolist() == [[0.0, 0.0, 0.0], [2.0, 1.0, 0.5], [4.0, 2.0, 1.0], [4.0, 2.0, 1.0]]
    assert floors.tolist() == [0, 0, 0, 0]


def test_a_robot_stands_in_the_lift_until_it_is_on_the_other_floor() -> None:
    plan = FleetPlan(np.array([0.0, 6.0]), np.array([[4.0, 5.0, 0.0], [20.0, 9.0, 1.0]]), np.array([0, 1]))
    poses, floors = plan.at(np.array([5.9, 6.0]))
    assert poses.tolist() == [[4.0, 5.0, 0.0], [20.0, 9.0, 1.0]]
    assert floors.tolist() == [0, 1]


@pytest.mark.parametrize("row", [0, 1, 2])
def test_alone_on_the_floor_a_robot_is_where_it_planned_to_be(row: int) -> None:
    simulated = world(row + 1)
    others = np.arange(row)
    compared = 0
    for _ in range(60):
        simulated.until_s[others] = np.inf
        for _ in range(round(2.0 / STEP_S)):
            simulated.step(STEP_S)
        state = robot_states(simulated, np.arange(len(simulated)))[row]
        if simulated.doing[row] != Activity.DRIVING:
            continue
        for after_s in (1.0, 4.0):
            planned, floors = state.plan.at(np.array([after_s]))
            for _ in range(round((after_s if after_s == 1.0 else 3.0) / STEP_S)):
                simulated.step(STEP_S)
            if simulated.doing[row] == Activity.DRIVING and simulated.waits.waited_s[row] == 0.0:
                assert simulated.floor[row] == floors[0]
                assert np.hypot(*(simulated.locations()[row, :2] - planned[0, :2])) < 0.1 + 0.075 * after_s
                compared += 1
    assert compared > 20


def test_a_plan_includes_the_time_to_accelerate() -> None:
    simulated = world(1)
    while simulated.doing[0] != Activity.DRIVING or simulated.progress_m[0] < 5.0:
        simulated.step(STEP_S)
    fast, _ = robot_states(simulated, np.arange(len(simulated)))[0].plan.at(np.array([1.0]))
    simulated.speed_mps[0] = 0.0
    slow, _ = robot_states(simulated, np.arange(len(simulated)))[0].plan.at(np.array([1.0]))
    here, gain = simulated.locations()[0, :2], simulated.members[0].make.gain_mps2
    assert np.hypot(*(slow[0, :2] - here)) == pytest.approx(gain / 2, abs=0.06)
    assert np.hypot(*(fast[0, :2] - here)) > gain


def told_while(simulated: World, seconds: float) -> list[RobotState]:
    states: list[RobotState] = []
    for _ in range(round(seconds)):
        for _ in range(round(1.0 / STEP_S)):
            simulated.step(STEP_S)
        states += robot_states(simulated, np.arange(len(simulated)))
    return states


def test_reported_values_are_plausible() -> None:
    states = told_while(world(24), 240.0)
    assert {state.state for state in states} == STATES
    assert all(0.0 <= state.battery_pct <= 100.0 and 0.0 <= state.load_pct < 100.0 for state in states)
    assert all(state.plan.after_s[0] == 0.0 and np.all(np.diff(state.plan.after_s) > 0) for state in states)
    assert all(np.allclose(state.plan.poses[0], (state.x_m, state.y_m, state.yaw_rad)) for state in states)
    assert {code for state in states for code in state.errors} >= {"Robot Stuck"}
    to_come_s = [after_s for state in states for after_s, *_ in state.destinations]
    assert 0.0 <= min(to_come_s) < max(to_come_s) < 900.0


def test_a_robot_in_a_lift_reports_destinations_on_the_other_floor() -> None:
    simulated = world(24, seed=3)
    for _ in range(3000):
        simulated.step(STEP_S)
        riding = (
            (simulated.doing == Activity.STANDING)
            & (simulated.trips.beyond != NOWHERE)
            & simulated.trips.standing_at(BayKind.LIFT)
        )
        if riding.any():
            break
    row = int(np.flatnonzero(riding)[0])
    state = robot_states(simulated, np.arange(len(simulated)))[row]
    assert state.state == "navigating"
    assert state.plan.at(np.array([0.0, RIDE_S + STEP_S]))[1].tolist() == [state.floor, 1 - state.floor]
    for _ in range(round(RIDE_S / STEP_S) + 2):
        simulated.step(STEP_S)
    assert simulated.floor[row] == 1 - state.floor
