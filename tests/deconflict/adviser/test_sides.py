"""On which side a robot is asked to go around another, and where it drives then."""

from dataclasses import replace
from math import pi

import pytest

from deconflict.adviser import Adviser, Request
from deconflict.settings.site import DEFAULT, Site
from tests.deconflict.adviser.advised_floor import AdvisedFloor
from tests.deconflict.adviser.floors import Floor, Robot, face_to_face
from tests.deconflict.adviser.site_ground import REFUGE, area, box, obstacle, site_of

RIGHT_M, LEFT_M = (1.6, -0.8), (1.6, 0.8)
"""Beside the robot that stands before one which drives east."""
NORTH, SOUTH = box(-9.0, 0.5, 9.0, 3.0), box(-9.0, -3.0, 9.0, -0.5)


def drive_by(y_m: float, *, size_m: float = 0.0) -> Robot:
    """A robot that first drives past both, beside the one that is driven around."""
    robot = Robot(f"by {y_m} {size_m}", "Elm", -2.0, y_m, 0.0, means_to_go=False)
    if size_m:
        robot.identity = lambda: Robot.identity(robot) | {"baseRobotEnvelope": {"x": 1.1, "y": size_m, "z": 1.2}}  # type: ignore[method-assign]
    return robot


def asked(*drivers: Robot, site: Site = DEFAULT, stands: Robot | None = None) -> Request:
    """What is asked of the first of two that face each other, after others have driven by."""
    pair = face_to_face()
    floor = Floor((*pair, *drivers, *([stands] if stands else [])), Adviser(site))
    for robot in pair:
        robot.means_to_go = False
    for _ in range(12):
        floor.second()
        for driver in drivers:
            driver.x_m += 0.9
    for driver in drivers:
        driver.x_m = 90.0
    for robot in pair:
        robot.means_to_go = True
    return floor.until("go_around")


def test_a_robot_goes_around_over_ground_where_a_body_as_large_was_seen() -> None:
    south, north = asked(drive_by(-0.8)), asked(drive_by(0.8))
    assert (south.side, south.beside) == ("right", RIGHT_M)
    assert (north.side, north.beside) == ("left", LEFT_M)


def test_no_side_is_named_where_nobody_was() -> None:
    request = asked()
    assert (request.side, request.beside) == (None, None)


def test_a_smaller_body_says_nothing_of_the_room_for_a_larger_one() -> None:
    assert asked(drive_by(-0.8, size_m=0.5)).side is None


def test_the_ground_under_a_giant_is_not_kept() -> None:
    assert asked(drive_by(-4.0, size_m=7.5)).side == "right"
    assert asked(drive_by(-4.5, size_m=8.5)).side is None


def test_an_area_of_the_site_file_allows_a_side_where_nobody_was() -> None:
    assert asked(site=site_of(REFUGE)).side == "right"


@pytest.mark.parametrize(("closed", "side"), [(area(SOUTH), "left"), (obstacle(NORTH), "right")])
def test_a_side_that_the_site_file_closes_is_not_named(closed: dict[str, object], side: str) -> None:
    assert asked(drive_by(-0.8), drive_by(0.8), site=site_of(closed)).side == side


def test_a_side_on_which_another_stands_is_not_named() -> None:
    stands = Robot("s", "Elm", 1.6, -0.8, 0.0, means_to_go=False)
    assert asked(drive_by(0.8), stands=stands, site=site_of(REFUGE)).side == "left"


def test_of_two_sides_the_nearer_is_named() -> None:
    pair = face_to_face()
    pair[0].y_m = 0.2
    floor = Floor(pair, Adviser(site_of(REFUGE)))
    request = floor.until("go_around")
    assert (request.robot, request.side) == (pair[0].uuid, "left")


def test_the_side_is_of_the_way_and_not_of_the_map() -> None:
    pair = face_to_face()
    pair[1].x_m, pair[1].y_m, pair[1].yaw_rad = 0.0, 1.6, -pi / 2
    pair[0].yaw_rad = pi / 2
    request = Floor(pair, Adviser(site_of(REFUGE))).until("go_around")
    assert (request.side, request.beside) == ("right", (0.8, 1.6))


def test_the_service_publishes_side_and_place_and_says_it() -> None:
    floor = AdvisedFloor(list(face_to_face()), site=site_of(REFUGE)).run(10)
    advice = floor.revisions[0]
    assert advice.side == "right"
    assert advice.place
    assert (advice.place.x, advice.place.y) == RIGHT_M
    assert advice.headline == "Larch l should drive around Rowan r, on Larch l's right"
    without = AdvisedFloor(list(face_to_face())).run(10).revisions[0]
    assert (without.side, without.place, without.headline) == (None, None, "Larch l should drive around Rowan r")


def test_seen_ground_is_known_after_a_restart() -> None:
    pair = list(face_to_face())
    drivers = [drive_by(0.8)]
    floor = AdvisedFloor([*pair, *drivers])
    for robot in pair:
        robot.means_to_go = False
    for _ in range(12):
        drivers[0].x_m += 0.9
        floor.run(1)
    floor.restart()
    drivers[0].x_m = 90.0
    for robot in pair:
        robot.means_to_go = True
    floor.run(10)
    assert floor.revisions[0].side == "left"


@pytest.mark.parametrize("z_m", [-30.0, 20_000.0])
def test_seen_ground_is_known_after_a_restart_whatever_heights_robots_report(z_m: float) -> None:
    left, right = face_to_face()
    floor = AdvisedFloor([replace(left, z_m=z_m), right]).run(3)
    floor.restart()
    assert not floor.engine.set_aside


def test_nobody_backs_out_to_where_only_a_smaller_body_was() -> None:
    """It has been loaded since."""
    assert backed_out(loaded_m=0.7) == pytest.approx((-2.0, 2.0))
    assert backed_out(loaded_m=0.9) is None


def backed_out(loaded_m: float) -> tuple[float, float] | None:
    pair = face_to_face()
    vendors = [{"name": "Larch", "verbs": ["back_out"]}, {"name": "Rowan", "verbs": []}]
    floor = Floor(pair, Adviser(site_of(vendors=vendors)))
    left, right = pair
    for left.x_m, left.y_m, left.yaw_rad in [
        *((-2.0, float(y_m), -pi / 2) for y_m in range(7, -1, -1)),
        (-1.0, 0.0, 0.0),
        (0.0, 0.0, 0.0),
    ]:
        right.x_m += 10.0 if left.y_m else 0.0
        floor.second()
        right.x_m = 1.6
    identity = left.identity() | {"baseRobotEnvelope": {"x": 1.1, "y": loaded_m, "z": 1.2}}
    floor.adviser.hear(floor.now_s, [identity])
    found = floor.seconds(30)
    return found[0].at if found else None
