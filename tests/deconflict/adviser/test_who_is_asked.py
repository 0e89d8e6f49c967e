"""Which of two robots is asked, and how soon."""

from math import cos

import pytest

from deconflict.adviser import Request
from tests.deconflict.adviser.floors import Floor, face_to_face


def come_together(speed_mps: float) -> tuple[Floor, list[Request]]:
    """Robots come to where they stand face to face, until one is asked."""
    floor = Floor(face_to_face())
    for k in range(4, -1, -1):
        for robot in floor.robots:
            robot.x_m = (1.6 if robot.name == "r" else 0.0) - cos(robot.yaw_rad) * k * speed_mps
        if asked := floor.second():
            return floor, asked
    return floor, [request for _ in range(3) for request in floor.second()]


def test_robots_that_slow_down_for_each_other_are_asked_before_they_stand() -> None:
    floor, _ = come_together(0.6)
    left, right = floor.robots
    assert right.x_m - left.x_m > 1.6


def test_a_robot_that_only_rolls_to_where_it_stands_has_not_begun() -> None:
    floor, (request,) = come_together(0.6)
    asked = floor.robot(request.robot)
    asked.x_m += 0.4 * cos(asked.yaw_rad)
    found = [each for each in floor.seconds(5) if not each.withdrawn]
    assert found[0].robot == request.other


@pytest.mark.parametrize("name", ["l", "r"])
def test_of_two_that_stand_for_each_other_the_one_that_came_last_goes_around(name: str) -> None:
    floor = Floor(face_to_face())
    last = next(robot for robot in floor.robots if robot.name == name)
    there_m, ahead = last.x_m, cos(last.yaw_rad)
    last.x_m = there_m - 12.0 * ahead
    floor.seconds(6)
    while (request := next(iter(floor.second()), None)) is None:
        last.x_m += min(1.0, abs(there_m - last.x_m)) * ahead
    assert (request.robot, request.verb) == (last.uuid, "go_around")
