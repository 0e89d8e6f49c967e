"""What the adviser does about robots that obey, refuse or lie."""

from collections.abc import Callable
from dataclasses import replace
from math import cos, pi, sin

import pytest

from deconflict.adviser import Request
from tests.deconflict.adviser.floors import LOWER, START_S, UPPER, Floor, Robot, before_crossing, face_to_face


def test_a_robot_keeps_its_request_while_it_turns_and_drives_around_the_other() -> None:
    floor = Floor(face_to_face())
    request = floor.until("go_around")
    asked = floor.robot(request.robot)
    floor.adviser.answer(request.id, "accepted")
    ahead_rad, found = asked.yaw_rad, list[Request]()
    for turned_rad in (0.25, 0.25, 0.25, pi / 2):
        asked.yaw_rad = ahead_rad + turned_rad
        found += floor.second()
    for _ in range(2):
        asked.x_m, asked.y_m = asked.x_m + cos(asked.yaw_rad), asked.y_m + sin(asked.yaw_rad)
        found += floor.second()
    assert found == []


def test_a_robot_that_has_accepted_keeps_its_request_while_its_new_way_is_free() -> None:
    floor = Floor(face_to_face())
    request = floor.until("go_around")
    floor.adviser.answer(request.id, "accepted")
    floor.robot(request.robot).means_to_go = False
    assert [each for each in floor.seconds(8) if each.id == request.id] == []


def test_a_robot_that_sets_out_and_stands_again_twice_is_told_so_before_the_other_is_asked() -> None:
    floor = Floor(face_to_face())
    request = floor.until("go_around")
    for asked_next in (request.robot, request.other):
        floor.robot(request.robot).x_m += 0.2 * cos(floor.robot(request.robot).yaw_rad)
        found: list[Request] = []
        while len(found) < 2:
            found += floor.second()
        ended, asked = found
        assert (ended.id, ended.withdrawn, asked.withdrawn) == (request.id, True, False)
        assert asked.robot == asked_next
        request = asked


def test_an_answer_that_is_repeated_counts_once() -> None:
    def answered(times: int) -> list[str]:
        floor, found = Floor(face_to_face()), []
        for _ in range(250):
            for request in floor.second():
                found += [request.robot] if not request.withdrawn else []
                for _ in range(times if floor.now_s < START_S + 100 else 0):
                    floor.adviser.answer(request.id, "declined", "busy")
        return found

    asked = answered(times=3)
    assert asked == answered(times=1)
    assert len(asked) > 4


@pytest.mark.parametrize(
    ("why", "asked_of_third"), [("cannot", False), ("cannot: no arm", False), ("cannot now", True)]
)
def test_a_vendor_is_unable_once_two_of_its_robots_cannot(why: str, asked_of_third: bool) -> None:
    robots = [robot for k in range(3) for robot in face_to_face(0.0, 20.0 * k, str(k))]
    floor, verb = Floor(tuple(robots)), "go_around"
    for k, pair in enumerate((robots[:2], robots[2:4], robots[4:])):
        floor.robots = tuple(pair)
        asked = {request.robot for request in floor.seconds(30, lambda _: ("declined", why)) if request.verb == verb}
        assert asked == ({robot.uuid for robot in pair} if k < 2 or asked_of_third else set())


def test_one_robot_that_cannot_twice_says_nothing_of_its_vendor() -> None:
    first, second = face_to_face(), face_to_face(0.0, 20.0, "2")
    floor = Floor((*first, *second))
    floor.robots = first
    assert len(floor.seconds(1300, lambda _: ("declined", "cannot"))) >= 4
    floor.robots = second
    assert {request.robot for request in floor.seconds(30, lambda _: ("declined", "busy"))} == {
        robot.uuid for robot in second
    }


@pytest.mark.parametrize("first_accepts", [False, True])
def test_if_one_declines_to_wait_the_other_is_not_to_go_first(first_accepts: bool) -> None:
    floor = Floor(before_crossing())
    while not (asked := floor.second()):
        pass
    first, wait = asked
    if first_accepts:
        floor.adviser.answer(first.id, "accepted")
    floor.adviser.answer(wait.id, "declined", "busy")
    assert {(each.id, each.withdrawn) for each in floor.second()[:2]} == {(first.id, True), (wait.id, True)}


def test_an_answer_to_wait_is_none_of_the_robot_that_goes_first() -> None:
    floor = Floor(before_crossing())
    while not (asked := floor.second()):
        pass
    floor.adviser.answer(asked[1].id, "accepted")
    assert {each.id for each in floor.seconds(4)} >= {asked[0].id}, "it has neither answered nor set out"


def test_robots_of_two_floors_or_heights_do_not_stand_for_each_other() -> None:
    assert Floor(face_to_face()).seconds(30)
    assert Floor(face_to_face(datum=UPPER)).seconds(30) == []
    assert Floor(face_to_face(z_m=6.0)).seconds(30) == []


def _backs_out(lift: bool = False, parked: str | None = None) -> list[Request]:
    """The second robot came around a corner, maybe from another floor; another may be parked where it came from."""
    left, right = face_to_face()
    stands = [Robot("p", "Pine", right.x_m, 2.0, 0.0, datum=parked, means_to_go=False)] if parked else []
    floor = Floor((left, right, *stands))
    right.yaw_rad = -pi / 2
    for k in range(8, -1, -1):
        right.y_m, right.datum = 0.5 * k, UPPER if lift and k > 0 else LOWER
        floor.second()
    right.yaw_rad = pi
    asked = floor.seconds(30, lambda each: ("declined", "no room") if each.verb == "go_around" else ("accepted",))
    return [request for request in asked if request.verb == "back_out" and request.robot == right.uuid]


def test_a_robot_backs_out_on_its_own_floor_past_nobody_of_it() -> None:
    assert _backs_out()
    assert _backs_out(parked=UPPER)
    assert _backs_out(parked=LOWER) == []
    assert _backs_out(lift=True) == []


def test_of_a_robot_that_says_done_where_it_stands_nothing_is_learned() -> None:
    floor = Floor(face_to_face())
    request = floor.until("go_around")
    before_s = floor.adviser._advice._worth.takes["go_around"].value_s
    floor.adviser.answer(request.id, "done")
    later = floor.seconds(4)
    assert request.id not in {each.id for each in later}, "it has ended"
    assert later[0].robot == request.other
    assert floor.adviser._advice._worth.takes["go_around"].value_s == before_s
    assert floor.adviser._advice._following.likely(request.robot) < floor.adviser._advice._following.likely("unknown")


def test_a_robot_that_says_done_after_it_has_moved_has_yielded() -> None:
    floor = Floor(face_to_face())
    request = floor.until("go_around")
    floor.robot(request.robot).y_m += 1.0
    floor.second()
    floor.adviser.answer(request.id, "done")
    floor.second()
    assert list(floor.adviser._advice._worth.yielded_s) == [
        (floor.robot(request.robot).maker, floor.robot(request.other or "").maker)
    ]


@pytest.mark.parametrize("stand", [face_to_face, before_crossing])
def test_robots_that_tell_only_where_they_go_are_asked_as_those_with_a_path(
    stand: Callable[[], tuple[Robot, Robot]],
) -> None:
    asked = []
    for by_destination in (False, True):
        robots = tuple(replace(robot, by_destination=by_destination) for robot in stand())
        requests = Floor(robots).seconds(40)
        asked.append([(request.verb, request.robot) for request in requests if not request.withdrawn])
    assert asked[0]
    assert asked[1] == asked[0]
