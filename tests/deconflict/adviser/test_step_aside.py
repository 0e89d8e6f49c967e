"""Who is asked to step aside, to where, and until when."""

from math import pi
from typing import Any

import pytest

from deconflict.adviser import Adviser, Request
from deconflict.adviser.asked import Asked, Following, Option
from tests.deconflict.adviser.floors import LOWER, UPPER, Floor, Point, Robot, face_to_face
from tests.deconflict.adviser.site_ground import REFUGE, Section, area, box, obstacle, resource, site_of

ASIDE = [{"name": "Larch", "verbs": ["step_aside"]}, {"name": "Rowan", "verbs": []}]
RIGHT_M, LEFT_M = (0.0, -1.25), (0.0, 1.25)
"""Of a robot that drives east and has come to the origin."""


def refuge(outline_m: list[Point], floor: str = LOWER) -> Section:
    return {"areas": [{"name": "Bay", "refuge": True, "floor": floor, "outline_m": outline_m}]}


def asked(*sections: Section, vendors: list[Any] = ASIDE, others: tuple[Robot, ...] = ()) -> list[Request]:
    floor = Floor((*face_to_face(), *others), Adviser(site_of(*sections, vendors=vendors)))
    return floor.seconds(20)


def places_m(*sections: Section, others: tuple[Robot, ...] = ()) -> set[Point | None]:
    return {request.at for request in asked(*sections, others=others) if request.verb == "step_aside"}


def test_a_robot_steps_aside_to_the_nearest_place_off_the_way_of_the_other() -> None:
    assert places_m(REFUGE) == {RIGHT_M}
    assert places_m(refuge(box(-9.0, -0.5, 9.0, 9.0))) == {LEFT_M}


@pytest.mark.parametrize(
    "closed",
    [
        area(box(-2.0, -2.0, 2.0, -1.0)),
        obstacle(box(-2.0, -2.0, 2.0, -1.0)),
        area(box(-4.0, -0.9, 4.0, -0.8)),
        resource("dock", box(-4.0, -9.0, 4.0, -1.0)),
    ],
    ids=["area", "obstacle", "a line on the way there", "dock"],
)
def test_nobody_steps_onto_or_over_ground_that_is_barred(closed: Section) -> None:
    assert places_m(REFUGE, closed) == {LEFT_M}


def test_nobody_steps_where_another_stands() -> None:
    stands = Robot("s", "Elm", 0.0, -1.25, 0.0, means_to_go=False)
    assert places_m(REFUGE, others=(stands,)) == {LEFT_M}


@pytest.mark.parametrize("bay", [{}, refuge(box(-0.7, -3.0, 0.7, -0.6)), refuge(box(-9.0, -9.0, 9.0, 9.0), UPPER)])
def test_nobody_steps_over_ground_where_no_body_was(bay: Section) -> None:
    """Also not where the place itself is allowed, but not the way to it."""
    assert places_m(bay) == set()


@pytest.mark.parametrize(("width_m", "places"), [(1.2, {RIGHT_M}), (0.7, set())])
def test_the_track_of_any_robot_as_large_is_ground_to_step_on(width_m: float, places: set[Point]) -> None:
    """It came out of a side aisle, at the end of which two now stand for each other. One as long as these stand there
    does not fit into one as wide as they are."""
    pair, came = face_to_face(), Robot("c", "Elm", 0.0, -4.0, pi / 2, means_to_go=False)
    came.identity = lambda: Robot.identity(came) | {"baseRobotEnvelope": {"x": 1.2, "y": width_m, "z": 1.2}}  # type: ignore[method-assign]
    floor = Floor((*pair, came), Adviser(site_of(vendors=ASIDE)))
    pair[0].y_m, pair[1].y_m = 50.0, 60.0
    for came.y_m in [-4.0 + 0.5 * k for k in range(12)]:
        floor.second()
    came.x_m, pair[0].y_m, pair[1].y_m = 90.0, 0.0, 0.0
    assert {request.at for request in floor.seconds(20)} == places


def test_nobody_steps_backwards() -> None:
    """The only place is at the end of a strip that leads back and to the right."""
    strip = [(0.8, -0.27), (0.8, 0.93), (-4.5, -1.26), (-4.5, -2.46)]
    assert places_m(refuge(strip)) == set()


@pytest.mark.parametrize("vendors", [[], [{"name": "Larch"}, {"name": "Rowan"}]])
def test_only_vendors_that_are_known_to_be_able_are_asked(vendors: list[Any]) -> None:
    floor = Floor(face_to_face(), Adviser(site_of(REFUGE, vendors=vendors)))
    verbs = {request.verb for request in floor.seconds(40, lambda _: ("declined", "no room"))}
    assert verbs == {"go_around", "other_way"}


def test_a_vendor_is_able_if_one_of_its_robots_has_accepted() -> None:
    following = Following({})
    assert not following.can("Larch", "step_aside", 0.0)
    request = Request("1", "l", "step_aside", (0.0, 0.0), "r", ("r",), 40.0)
    following.answer(Asked(request, 0.0, (0.0, 0.0), 0.0), "Larch", "accepted", "", 0.0)
    assert following.may_be_asked(Option("l", "step_aside", "r"), "Larch", 0.0)
    assert not following.can("Rowan", "step_aside", 0.0)


def test_it_stands_aside_until_the_other_has_passed() -> None:
    floor = Floor(face_to_face(), Adviser(site_of(REFUGE, vendors=ASIDE)))
    left, right = floor.robots
    request = floor.until("step_aside")
    assert (request.robot, request.until) == (left.uuid, (right.uuid,))
    floor.adviser.answer(request.id, "accepted")
    left.x_m, left.y_m = request.at or (0.0, 0.0)
    assert floor.seconds(8) == []
    assert request.id in floor.adviser._advice.asked
    right.x_m -= 3.1
    assert floor.seconds(1) == []
    assert request.id not in floor.adviser._advice.asked


def idler(state: str, *sections: Section) -> set[str]:
    """Who is asked where a robot stands in another's way, and means to go nowhere."""
    ahead, stands = face_to_face()
    stands.means_to_go = False
    status = stands.status
    stands.status = lambda now_s: status(now_s) | {"operationalState": state}  # type: ignore[method-assign]
    vendors = [{"name": "Larch", "verbs": []}, {"name": "Rowan", "verbs": ["step_aside"]}]
    floor = Floor((ahead, stands), Adviser(site_of(REFUGE, *sections, vendors=vendors)))
    return {floor.robot(request.robot).name for request in floor.seconds(40)}


def test_a_robot_that_stands_idle_in_the_way_of_another_is_asked() -> None:
    assert idler("idle") == {"r"}


@pytest.mark.parametrize("state", ["charging", "disabled", "waitingHumanEvent", "waitingInternalEvent"])
def test_a_robot_that_is_held_by_something_of_its_own_is_not_asked(state: str) -> None:
    assert idler(state) == set()


def test_a_robot_at_its_dock_is_not_asked() -> None:
    assert idler("idle", resource("dock", box(1.0, -1.0, 2.2, 1.0))) == set()
