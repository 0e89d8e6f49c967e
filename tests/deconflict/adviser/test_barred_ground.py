"""Ground of the site file onto which no robot is sent."""

from math import pi
from pathlib import Path
from typing import Any

import pytest

from deconflict.adviser import Adviser
from tests.deconflict.adviser.advised_floor import AdvisedFloor
from tests.deconflict.adviser.floors import LOWER, UPPER, Floor, Point, Robot, face_to_face
from tests.deconflict.adviser.site_ground import Section, area, box, landing, obstacle, resource, site_of, zone

BACKS_OUT = [{"name": "Larch", "verbs": ["back_out"]}, {"name": "Rowan", "verbs": []}]
LANE_X_M = -2.0
"""x of the lane from which a robot turned into the way of the other."""


def backed_out_to_m(*sections: Section) -> Point | None:
    """Where a robot is asked to back out to that came down a lane, and turned into the way of another."""
    left, right = face_to_face()
    floor = Floor((left, right), Adviser(site_of(*sections, vendors=BACKS_OUT)))
    steps = [(LANE_X_M, float(y_m), -pi / 2) for y_m in range(7, -1, -1)]
    for left.x_m, left.y_m, left.yaw_rad in (*steps, (-1.0, 0.0, 0.0), (0.0, 0.0, 0.0)):
        right.x_m += 10.0 if left.y_m else 0.0
        floor.second()
        right.x_m = 1.6
    asked = floor.seconds(30)
    assert {request.verb for request in asked} <= {"back_out"}
    return asked[0].at if asked else None


BARRED = box(-3.0, 1.5, -1.0, 3.0)
"""Touched by a robot that stands in its lane at y = 2 or 3."""
WHOLE_LANE = box(-3.0, 1.0, -1.0, 9.0)


@pytest.mark.parametrize(
    "section",
    [
        {},
        area(BARRED, keep_clear=False),
        area(BARRED, UPPER),
        zone("aisle", BARRED),
        zone("crossing", BARRED),
        area(box(-1.62, 1.5, -1.0, 3.0)),
        area(box(-3.0, 2.58, -1.0, 3.0)),
        area(box(-0.5, -0.5, 0.5, 0.5)),
    ],
    ids=["none", "named", "another-floor", "aisle", "crossing", "beside", "behind", "where-it-stands"],
)
def test_a_robot_is_sent_to_the_nearest_place_that_it_may_stand_on(section: Section) -> None:
    assert backed_out_to_m(section) == pytest.approx((LANE_X_M, 2.0))


@pytest.mark.parametrize(
    "section",
    [
        area(BARRED),
        obstacle(BARRED),
        *(resource(kind, BARRED) for kind in ("dock", "charger", "station", "lift", "parking")),
        landing(BARRED),
        zone("door", BARRED),
        area(box(-3.0, 2.52, -1.0, 3.0)),
        area(box(-1.68, 1.5, -1.0, 3.0)),
    ],
    ids=["area", "obstacle", "dock", "charger", "station", "lift", "parking", "landing", "door", "tail", "side"],
)
def test_a_robot_is_sent_through_ground_where_it_should_not_stand_and_never_onto_it(section: Section) -> None:
    assert backed_out_to_m(section) == pytest.approx((LANE_X_M, 4.0))


def test_a_robot_that_would_have_to_stand_where_it_should_not_is_not_asked_to_back_out() -> None:
    assert backed_out_to_m(area(WHOLE_LANE)) is None


def test_a_robot_on_ground_where_it_should_not_stand_is_let_off_it() -> None:
    assert backed_out_to_m(area(box(-3.0, -1.0, 3.0, 3.0))) == pytest.approx((LANE_X_M, 4.0))


def verbs(robots: tuple[Robot, ...], *sections: Section) -> set[str]:
    floor = Floor(robots, Adviser(site_of(*sections)))
    return {request.verb for request in floor.seconds(30, lambda _: ("declined", "no room"))}


def crosswise() -> tuple[Robot, ...]:
    """A robot before another that stands across its way."""
    ahead, across = face_to_face()
    across.yaw_rad, across.means_to_go = pi / 2, False
    return ahead, across


NORTH_OF, SOUTH_OF = box(-5.0, 1.0, 5.0, 3.0), box(-5.0, -3.0, 5.0, -1.0)
WIDER = box(-5.0, 1.3, 5.0, 3.0), box(-5.0, -3.0, 5.0, -1.3)


@pytest.mark.parametrize("closed", [area, obstacle])
def test_no_robot_is_asked_to_go_around_where_both_sides_are_closed(closed: Any) -> None:
    assert verbs(face_to_face(), closed(NORTH_OF), closed(SOUTH_OF)) == {"other_way"}


def test_sides_are_closed_by_an_area_and_an_obstacle_together() -> None:
    assert verbs(face_to_face(), area(NORTH_OF), obstacle(SOUTH_OF)) == {"other_way"}


@pytest.mark.parametrize(
    "sections",
    [
        (area(NORTH_OF),),
        (obstacle(SOUTH_OF),),
        (area(WIDER[0]), obstacle(WIDER[1])),
        (area(NORTH_OF, UPPER), area(SOUTH_OF, UPPER)),
        (resource("dock", NORTH_OF), zone("door", SOUTH_OF)),
    ],
    ids=["south-is-free", "north-is-free", "wide", "another-floor", "only-not-to-stand-on"],
)
def test_one_side_is_enough_to_go_around(sections: tuple[Section, ...]) -> None:
    assert "go_around" in verbs(face_to_face(), *sections)


def test_the_sides_are_those_of_the_way_and_not_of_the_body_that_stands_in_it() -> None:
    assert "go_around" in verbs(crosswise())
    assert "go_around" not in verbs(crosswise(), area(WIDER[0]), obstacle(WIDER[1]))


def test_the_service_keeps_to_the_site_file_too() -> None:
    site = site_of(area(NORTH_OF), obstacle(SOUTH_OF))
    asked = {advice.verb for advice in AdvisedFloor(list(face_to_face()), site=site).run(30).revisions}
    assert asked == {"other_way"}
    assert "go_around" in {advice.verb for advice in AdvisedFloor(list(face_to_face())).run(30).revisions}


def test_ground_is_read_from_the_site_file_in_the_frame_of_its_floor(tmp_path: Path) -> None:
    """Both vendors' maps are 100 m east of the floor's."""
    marks = [("p", 0.0, 0.0), ("q", 50.0, 0.0), ("r", 0.0, 50.0)]
    points = "".join(f'[[datums.reference_points]]\nid = "{at}"\nx = {x_m}\ny = {y_m}\n' for at, x_m, y_m in marks)
    readings = ", ".join(f"{at} = [{x_m + 100.0}, {y_m}]" for at, x_m, y_m in marks)
    vendors = "".join(
        f'[[vendors]]\nname = "{name}"\n[[vendors.maps]]\ndatum = "{UPPER}"\nsite_datum = "{LOWER}"\n'
        f"readings = {{ {readings} }}\n"
        for name in ("Larch", "Rowan")
    )
    areas = "".join(
        f'[[areas]]\nname = "Crossing of people"\nkeep_clear = true\noutline_m = {list(map(list, outline_m))}\n'
        for outline_m in (NORTH_OF, SOUTH_OF)
    )
    path = tmp_path / "site.toml"
    datum = f'name = "s"\n[[datums]]\nid = "{LOWER}"\nname = "Lower hall"\n'
    path.write_text(f"{datum}{points}{vendors}{areas}", encoding="utf-8")
    robots = face_to_face(100.0)
    for robot in robots:
        robot.datum = UPPER
    found = {request.verb for request in Floor(robots, Adviser(path)).seconds(30, lambda _: ("declined", "no room"))}
    assert found == {"other_way"}
