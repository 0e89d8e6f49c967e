"""Which of two robots is asked, and how soon."""

from math import cos

import pytest

from deconflict.adviser import Request
from deconflict.adviser.standoffs import standing
from tests.deconflict.adviser.advised_floor import AdvisedFloor
from tests.deconflict.adviser.floors import Floor, face_to_face


def come_together(speed_mps: float) -> tuple[Floor, Request]:
    """Two robots come to where they stand face to face, until one is asked. Others have agreed to go around before."""
    left, right = face_to_face()
    floor = Floor((*face_to_face(50.0, 50.0, "-there"), left, right))
    left.x_m, right.x_m = -20.0, 20.0
    floor.seconds(9, lambda _: ("accepted",))
    for k in range(4, -1, -1):
        left.x_m, right.x_m = -k * speed_mps, 1.6 + k * speed_mps
        for request in floor.second():
            if request.robot in {left.uuid, right.uuid}:
                return floor, request
    raise AssertionError("nobody is asked before they stand")


def test_robots_that_slow_down_for_each_other_are_asked_before_they_stand() -> None:
    floor, request = come_together(0.6)
    assert request.verb == "go_around"
    assert floor.robots[3].x_m - floor.robots[2].x_m > 1.6


def test_a_robot_that_only_rolls_to_where_it_stands_has_not_begun() -> None:
    floor, request = come_together(0.6)
    asked = floor.robot(request.robot)
    asked.x_m += 0.4 * cos(asked.yaw_rad)
    pair = {request.robot, request.other}
    found = [each for each in floor.seconds(5) if not each.withdrawn and each.robot in pair]
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


def test_robots_in_a_crowd_stand_for_nobody() -> None:
    floor = AdvisedFloor(list(face_to_face())).run(6)
    robots, crowd = floor.engine._shared.contention.robots, {floor.robots[0].uuid: 1}
    assert len(standing(robots, floor.now_s, foresees=False).rings) == 1
    assert standing(robots, floor.now_s, foresees=False, crowds=crowd).rings == []
