"""What the adviser asks of robots that stand for each other."""

from collections.abc import Mapping
from datetime import UTC, datetime
from itertools import pairwise
from math import cos, inf, pi, sin
from pathlib import Path
from typing import Any, NamedTuple, get_args
from uuid import NAMESPACE_DNS, uuid5

import pytest

from deconflict.adviser import Adviser, Request
from deconflict.adviser.asked import Verb

START_S = 1_790_000_000.0
DATUM = str(uuid5(NAMESPACE_DNS, "hall"))
EAST, NORTH, WEST = 0.0, pi / 2, pi


class Robot(NamedTuple):
    """A robot that stands from second `stops_s` on and means to go straight on at 1 m/s. Before, it drives there."""

    name: str
    maker: str
    x_m: float
    y_m: float
    yaw_rad: float
    stops_s: float = 6.0
    means_to_go: bool = True
    corner_m: float = inf
    """How far before its place it came around a corner, from the left of its way."""

    @property
    def uuid(self) -> str:
        return str(uuid5(NAMESPACE_DNS, self.name))

    def identity(self) -> dict[str, Any]:
        return {
            "uuid": self.uuid,
            "timestamp": stamp(0.0),
            "manufacturerName": self.maker,
            "robotModel": "M",
            "robotSerialNumber": self.name,
            "baseRobotEnvelope": {"x": 0.9, "y": 0.7, "z": 1.0},
        }

    def status(self, at_s: float) -> dict[str, Any]:
        gone_m = min(at_s - self.stops_s, 0.0)
        ahead = range(1, 11) if self.means_to_go or gone_m < 0 else ()
        return {
            "uuid": self.uuid,
            "timestamp": stamp(at_s),
            "operationalState": "navigating",
            "location": {**self._place(gone_m), "planarDatum": DATUM},
            "velocity": {"linear": 1.0 if gone_m < 0 else 0.0},
            "path": [{"timestamp": stamp(at_s + k), **self._place(gone_m + k)} for k in ahead],
        }

    def _place(self, gone_m: float) -> dict[str, Any]:
        ahead_m, yaw_rad = max(gone_m, -self.corner_m), self.yaw_rad - (pi / 2 if gone_m < -self.corner_m else 0.0)
        left_m = ahead_m - gone_m
        x_m = self.x_m + ahead_m * cos(self.yaw_rad) - left_m * sin(self.yaw_rad)
        y_m = self.y_m + ahead_m * sin(self.yaw_rad) + left_m * cos(self.yaw_rad)
        angle = {"x": 0.0, "y": 0.0, "z": sin(yaw_rad / 2), "w": cos(yaw_rad / 2)}
        return {"x": x_m, "y": y_m, "angle": angle}


HEAD_ON = Robot("a", "Alder", 0.0, 0.0, EAST), Robot("b", "Birch", 1.4, 0.0, WEST)
CROSSING = Robot("a", "Alder", -2.0, 0.0, EAST), Robot("b", "Birch", 0.0, -2.0, NORTH)


def stamp(at_s: float) -> str:
    return datetime.fromtimestamp(START_S + at_s, UTC).isoformat(timespec="milliseconds").replace("+00:00", "Z")


def heard(
    robots: tuple[Robot, ...],
    seconds: int = 30,
    answers: Mapping[str, tuple[str, str]] | None = None,
    site: Path | None = None,
) -> list[tuple[int, Request]]:
    """What is asked, and at which second. `answers` has by verb what robots answer, and why."""
    adviser, found, due = Adviser(site), [], list[Request]()
    for second in range(1, seconds):
        for request in due:
            answer, why = (answers or {})[request.verb]
            adviser.answer(request.id, answer, why)  # type: ignore[arg-type]
        messages = [robot.status(float(second)) for robot in robots]
        messages = [*(robot.identity() for robot in robots), *messages] if second == 1 else messages
        asked = adviser.hear(START_S + second + 0.1, messages)
        due = [request for request in asked if not request.withdrawn and request.verb in (answers or {})]
        found += [(second, request) for request in asked]
    return found


def test_one_of_two_that_stand_for_each_other_is_asked_to_go_around() -> None:
    second, request = heard(HEAD_ON)[0]
    assert 7 <= second <= 8
    assert (request.verb, {request.robot, request.other}) == ("go_around", {robot.uuid for robot in HEAD_ON})
    assert request.until == (request.other,)


def test_robots_that_do_not_follow_are_asked_in_turns_and_ever_more_seldom() -> None:
    found = heard(HEAD_ON, seconds=80)
    asked = [(second, request.robot) for second, request in found if not request.withdrawn]
    assert asked[0][1] != asked[1][1]
    assert asked[1][0] - asked[0][0] == pytest.approx(3, abs=1)
    assert len(asked) <= 8
    pauses_s = [after - before for before, after in pairwise(second for second, robot in asked if robot == asked[0][1])]
    assert pauses_s == sorted(pauses_s)
    assert max(pauses_s) > 15


def test_never_are_two_robots_of_a_standoff_asked_at_once() -> None:
    open_requests: set[str] = set()
    for _, request in heard(HEAD_ON, seconds=80):
        if request.withdrawn:
            open_requests.remove(request.id)
        else:
            assert not open_requests
            open_requests.add(request.id)


def test_where_there_is_no_room_a_robot_backs_out_on_its_own_track_to_where_the_other_does_not_come() -> None:
    around_corner = HEAD_ON[0]._replace(corner_m=2.0)
    found = heard((around_corner, HEAD_ON[1]), 40, {"go_around": ("declined", "no room")})
    asked = [request for _, request in found if not request.withdrawn]
    assert [request.verb for request in asked[:2]] == ["go_around", "back_out"], "what one has no room for, none has"
    assert (asked[1].robot, asked[1].until) == (around_corner.uuid, (HEAD_ON[1].uuid,))
    assert asked[1].at is not None
    assert asked[1].at[1] > 1.0, "beside the other's way"


def test_nobody_backs_out_along_the_way_of_the_other() -> None:
    found = heard(HEAD_ON, 40, {"go_around": ("declined", "no room")})
    assert {request.verb for _, request in found} == {"go_around", "other_way"}


def test_where_there_is_no_room_a_robot_takes_another_way_than_to_where_the_other_is() -> None:
    found = heard(HEAD_ON, 40, {"go_around": ("declined", "no room")})
    request = next(request for _, request in found if request.verb == "other_way")
    other = next(robot for robot in HEAD_ON if robot.uuid == request.other)
    assert request.at == pytest.approx((other.x_m, other.y_m))


def test_a_busy_robot_is_asked_again_soon_and_ever_more_seldom() -> None:
    found = heard(HEAD_ON, 60, dict.fromkeys(get_args(Verb), ("declined", "busy")))
    seconds = [second for second, request in found if request.robot == HEAD_ON[0].uuid and not request.withdrawn]
    pauses_s = [after - before for before, after in pairwise(seconds)]
    assert 3 <= pauses_s[0] <= 6
    assert pauses_s == sorted(pauses_s)
    assert 20 <= pauses_s[-1] <= 24


def test_a_verb_that_a_vendor_cannot_do_is_not_asked_of_it_for_long() -> None:
    found = heard(HEAD_ON, 200, dict.fromkeys(("go_around", "other_way"), ("declined", "cannot")))
    for maker in HEAD_ON:
        assert sum(request.robot == maker.uuid and not request.withdrawn for _, request in found) <= 4


def test_of_two_before_a_free_crossing_one_goes_first_and_the_other_waits_for_it() -> None:
    found = heard(CROSSING)
    assert found[0][0] <= 6 + 15
    first, wait = found[0][1], found[1][1]
    assert (first.verb, wait.verb) == ("go_first", "wait_before")
    assert (first.robot, first.other) == (wait.other, wait.robot)
    assert wait.until == (first.robot,)
    assert wait.at == pytest.approx((-1.2, 0.0), abs=0.5) or wait.at == pytest.approx((0.0, -1.2), abs=0.5)


def test_a_robot_that_stands_long_in_the_way_is_gone_around() -> None:
    waiter, parked = Robot("a", "Alder", 0.0, 0.0, EAST), Robot("b", "Birch", 1.6, 0.0, NORTH, means_to_go=False)
    second, request = heard((waiter, parked))[0]
    assert (request.verb, request.robot) == ("go_around", waiter.uuid)
    assert second >= 6 + 4


def test_a_robot_that_stands_long_in_the_way_and_leaves_no_room_is_left_backwards_or_by_another_way() -> None:
    waiter, parked = Robot("a", "Alder", 0.0, 0.0, EAST), Robot("b", "Birch", 1.6, 0.0, NORTH, means_to_go=False)
    found = heard((waiter, parked), 40, {"go_around": ("declined", "no room")})
    second = next(second for second, request in found if request.verb in ("back_out", "other_way"))
    assert 6 + 12 <= second <= 6 + 16


def test_those_behind_two_that_can_do_nothing_are_asked_to_make_room() -> None:
    behind = Robot("c", "Cedar", -1.4, 0.0, EAST)
    declined = {"go_around": ("declined", "no room"), "other_way": ("declined", "no other way")}
    found = heard((*HEAD_ON, behind), 16, declined)
    second, request = next((second, request) for second, request in found if request.robot == behind.uuid)
    assert second >= 6 + 4
    assert (request.verb, request.other) == ("other_way", HEAD_ON[0].uuid)


def test_robots_of_one_vendor_are_left_to_it() -> None:
    found = heard(tuple(robot._replace(maker="Alder") for robot in HEAD_ON))
    assert 6 + 8 <= found[0][0] <= 6 + 10


def test_nothing_is_asked_where_nobody_stands_for_another() -> None:
    passing = Robot("a", "Alder", 30.0, 0.0, EAST, stops_s=60.0), Robot("b", "Birch", 0.0, 2.0, WEST, stops_s=60.0)
    assert heard(passing, seconds=50) == []


def test_people_are_asked_nothing(tmp_path: Path) -> None:
    site = tmp_path / "site.toml"
    site.write_text('name = "s"\n[[vendors]]\nname = "Birch"\nparticipant = "person"\n', encoding="utf-8")
    found = heard(HEAD_ON, 60, site=site)
    assert {request.robot for _, request in found} == {HEAD_ON[0].uuid}


@pytest.mark.parametrize("message", [{}, {"uuid": 3}, {"uuid": None, "location": []}, {"manufacturerName": 4}])
def test_what_is_no_report_is_ignored(message: dict[str, Any]) -> None:
    adviser = Adviser()
    assert adviser.hear(START_S, [message]) == []
    adviser.answer("unknown", "done")
