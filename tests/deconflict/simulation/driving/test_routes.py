"""Drives: from corners to poses that a robot can follow."""

from math import pi

import numpy as np
import pytest

from deconflict.simulation.driving.routes import CREEP_MPS, SIDEWAYS_MPS2, TURN_M, Drive, drive, lane, standing
from deconflict.simulation.floor_layout import Place, layout_for
from deconflict.simulation.participants import ALDER, CORVID, MAKES, Make

CORNERS: list[Place] = [(0.0, 0.0), (0.0, 2.0), (10.0, 2.0), (10.0, 12.0)]


def steps(way: Drive) -> tuple[np.ndarray, np.ndarray]:
    return np.hypot(np.diff(way.x_m), np.diff(way.y_m)), np.abs(np.diff(way.yaw_rad))


@pytest.mark.parametrize("make", MAKES)
def test_a_drive_goes_from_the_first_corner_to_the_last_without_a_jump(make: Make) -> None:
    way = drive(CORNERS, pi / 2, make)
    assert (way.x_m[0], way.y_m[0]) == pytest.approx(CORNERS[0])
    assert (way.x_m[-1], way.y_m[-1]) == pytest.approx(CORNERS[-1])
    moved_m, turned_rad = steps(way)
    assert np.all(moved_m <= way.step_m + 1e-9)
    assert np.all(turned_rad <= way.step_m / TURN_M + 1e-9)
    assert way.yaw_rad[-1] == pytest.approx(pi / 2)


def test_a_robot_moves_along_its_heading() -> None:
    way = drive(CORNERS, pi / 2, ALDER)
    dx, dy = np.diff(way.x_m), np.diff(way.y_m)
    middle = (way.yaw_rad[1:] + way.yaw_rad[:-1]) / 2
    across = np.abs(dy * np.cos(middle) - dx * np.sin(middle))
    assert np.all(across < 0.02 * way.step_m)


def test_a_robot_turns_in_place_before_it_leaves_a_bay_forwards() -> None:
    way = drive(CORNERS, -pi / 2, CORVID)
    turning = round(pi * TURN_M / way.step_m)
    assert np.ptp(way.x_m[:turning]) == pytest.approx(0.0, abs=1e-9)
    assert abs(way.yaw_rad[turning] - way.yaw_rad[0]) == pytest.approx(pi, abs=0.2)
    assert np.all(way.speed_mps[: turning - 1] <= CORVID.turn_radps * TURN_M + 1e-9)


@pytest.mark.parametrize("make", MAKES)
def test_speeds_keep_the_limits_and_begin_and_end_at_rest(make: Make) -> None:
    way = drive(CORNERS, pi / 2, make)
    assert way.speed_mps.max() <= make.max_speed_mps + 1e-9
    assert way.speed_mps[0] == way.speed_mps[-1] == CREEP_MPS
    gained = np.diff(way.speed_mps**2) / (2 * way.step_m)
    assert gained.max() <= make.gain_mps2 + 1e-6 + CREEP_MPS**2 / way.step_m
    assert -gained.min() <= make.brake_mps2 + 1e-6 + CREEP_MPS**2 / way.step_m


def test_corners_are_taken_slowly() -> None:
    way = drive(CORNERS, pi / 2, ALDER)
    bend = np.abs(np.diff(way.yaw_rad)) / way.step_m
    sideways_mps2 = np.minimum(way.speed_mps[1:], way.speed_mps[:-1]) ** 2 * bend
    assert bend.max() > 1.0
    assert sideways_mps2.max() <= SIDEWAYS_MPS2 * 1.01


def test_lanes_are_right_of_the_middle_and_paths_end_in_the_bays() -> None:
    layout = layout_for(24)
    start, goal = layout.bays[1], layout.bays[2]
    corners = lane(layout, layout.route(start.node, goal.node, np.ones(len(layout.places))), 0.5)
    assert corners[0] == start.place
    assert corners[-1] == goal.place
    (x, y), (to_x, to_y) = corners[1:3]
    gate_x, gate_y = layout.places[next(iter(layout.onward[start.node]))]
    length_m = np.hypot(to_x - x, to_y - y)
    to_the_left_m = ((to_x - x) * (y - gate_y) - (to_y - y) * (x - gate_x)) / length_m
    assert to_the_left_m == pytest.approx(-0.5)


def test_a_standing_robot_stays() -> None:
    way = standing((3.0, 4.0), 1.0)
    assert set(way.x_m) == {3.0}
    assert set(way.yaw_rad) == {1.0}
