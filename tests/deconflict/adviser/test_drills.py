"""Drills of advice: what is asked, how it is refused or lapses, what is asked next, and how each ends."""

from collections.abc import Callable
from math import pi
from typing import get_args

import pytest

from deconflict.adviser.asked import Verb
from deconflict_client.advisory.robot_advice import RobotAdvice
from tests.deconflict.adviser.advised_floor import (
    BUSY,
    CANNOT,
    DONE_STANDING,
    HALF_DONE,
    NO_ROOM,
    OBEYS,
    OBEYS_AND_SAYS_SO,
    SILENT,
    UNBEGUN,
    AdvisedFloor,
    Reply,
)
from tests.deconflict.adviser.floors import before_crossing, face_to_face
from tests.deconflict.adviser.site_ground import REFUGE, site_of

Floors = Callable[[Callable[[RobotAdvice], Reply]], AdvisedFloor]
REPLIES = {
    "obeys": OBEYS,
    "cannot": CANNOT,
    "busy": BUSY,
    "no room": NO_ROOM,
    "silent": SILENT,
    "accepts and stands": UNBEGUN,
    "begins and stands": HALF_DONE,
    "done where it stands": DONE_STANDING,
}
DECLINED, WITHOUT_WORDS = {"cannot", "busy", "no room"}, {"silent", "accepts and stands", "done where it stands"}
"""What is a refusal. Of a robot that should wait the others are none: it stands."""


def facing(reply: Callable[[RobotAdvice], Reply]) -> AdvisedFloor:
    return AdvisedFloor(list(face_to_face()), reply)


def at_corner(reply: Callable[[RobotAdvice], Reply]) -> AdvisedFloor:
    """The second of two that face each other came around a corner."""
    floor = facing(reply)
    comes = floor.robots[1]
    comes.yaw_rad = -pi / 2
    for k in range(8, -1, -1):
        comes.y_m = 0.5 * k
        floor.run(1)
    comes.yaw_rad = pi
    return floor


def crossing(reply: Callable[[RobotAdvice], Reply]) -> AdvisedFloor:
    return AdvisedFloor(list(before_crossing()), reply)


def with_room(reply: Callable[[RobotAdvice], Reply]) -> AdvisedFloor:
    """Beside two that face each other, of vendors that are known to be able to step aside."""
    vendors = [{"name": name, "verbs": list(get_args(Verb))} for name in ("Larch", "Rowan")]
    return AdvisedFloor(list(face_to_face()), reply, site_of(REFUGE, vendors=vendors))


FLOORS: dict[str, tuple[Floors, tuple[str, ...]]] = {
    "go_around": (facing, ()),
    "other_way": (facing, ("go_around",)),
    "back_out": (at_corner, ("go_around",)),
    "step_aside": (with_room, ("go_around",)),
    "go_first": (crossing, ()),
    "wait_before": (crossing, ()),
}
"""By verb: where it is asked, and for which verbs there is no room."""
PAIRED = {"wait_before": "go_first"}
"""What is asked beside it, first."""

DRILLS: dict[str, dict[str, list[str]]] = {
    "go_around": {
        "obeys": [
            "0: l go_around for r until r passed, 20 at the latest; done at 4",
        ],
        "cannot, busy, no room": [
            "0: l go_around for r until r passed, 20 at the latest; declined at 1",
            "1: r go_around for l until l passed, 21 at the latest; done at 5",
        ],
        "silent": [
            "0: l go_around for r until r passed, 20 at the latest; withdrawn at 3",
            "3: r go_around for l until l passed, 23 at the latest; done at 7",
        ],
        "accepts and stands": [
            "0: l go_around for r until r passed, 20 at the latest; withdrawn at 5",
            "5: r go_around for l until l passed, 25 at the latest; done at 9",
        ],
        "begins and stands": [
            "0: l go_around for r until r passed, 20 at the latest; withdrawn at 4",
            "4: l go_around for r until r passed, 24 at the latest; done at 8",
        ],
        "done where it stands": [
            "0: l go_around for r until r passed, 20 at the latest; done at 1",
            "1: r go_around for l until l passed, 21 at the latest; done at 5",
        ],
    },
    "other_way": {
        "obeys": [
            "0: l other_way for r until r passed, 20 at the latest; done at 4",
        ],
        "cannot, busy": [
            "0: l other_way for r until r passed, 20 at the latest; declined at 1",
            "1: r other_way for l until l passed, 21 at the latest; done at 6",
        ],
        "no room": [
            "0: l other_way for r until r passed, 20 at the latest; declined at 1",
            "5: r other_way for l until l passed, 25 at the latest; done at 10",
        ],
        "silent": [
            "0: l other_way for r until r passed, 20 at the latest; withdrawn at 2",
            "2: r other_way for l until l passed, 22 at the latest; done at 7",
        ],
        "accepts and stands": [
            "0: l other_way for r until r passed, 20 at the latest; withdrawn at 5",
            "5: r other_way for l until l passed, 25 at the latest; done at 10",
        ],
        "begins and stands": [
            "0: l other_way for r until r passed, 20 at the latest; withdrawn at 4",
            "4: r other_way for l until l passed, 24 at the latest; done at 9",
        ],
        "done where it stands": [
            "0: l other_way for r until r passed, 20 at the latest; done at 1",
            "1: r other_way for l until l passed, 21 at the latest; done at 6",
        ],
    },
    "back_out": {
        "obeys": [
            "0: r back_out for l until l passed, 40 at the latest; done at 8",
        ],
        "cannot, no room": [
            "0: r back_out for l until l passed, 40 at the latest; declined at 1",
            "1: l go_around for r until r passed, 21 at the latest; declined at 2",
            "13: r other_way for l until l passed, 33 at the latest; done at 18",
        ],
        "busy": [
            "0: r back_out for l until l passed, 40 at the latest; declined at 1",
            "1: l go_around for r until r passed, 21 at the latest; declined at 2",
            "4: r back_out for l until l passed, 44 at the latest; done at 12",
        ],
        "silent": [
            "0: r back_out for l until l passed, 40 at the latest; withdrawn at 2",
            "2: l go_around for r until r passed, 22 at the latest; declined at 3",
            "13: l other_way for r until r passed, 33 at the latest; done at 17",
        ],
        "accepts and stands": [
            "0: r back_out for l until l passed, 40 at the latest; withdrawn at 5",
            "5: l go_around for r until r passed, 25 at the latest; declined at 6",
            "13: l other_way for r until r passed, 33 at the latest; done at 17",
        ],
        "begins and stands": [
            "0: r back_out for l until l passed, 40 at the latest; withdrawn at 4",
            "4: r back_out for l until l passed, 44 at the latest; done at 12",
        ],
        "done where it stands": [
            "0: r back_out for l until l passed, 40 at the latest; done at 1",
            "1: l go_around for r until r passed, 21 at the latest; declined at 2",
            "13: l other_way for r until r passed, 33 at the latest; done at 17",
        ],
    },
    "step_aside": {
        "obeys": [
            "0: l step_aside for r until r passed, 40 at the latest; done at 8",
        ],
        "cannot, busy": [
            "0: l step_aside for r until r passed, 40 at the latest; declined at 1",
            "1: r step_aside for l until l passed, 41 at the latest; done at 9",
        ],
        "no room": [
            "0: l step_aside for r until r passed, 40 at the latest; declined at 1",
            "1: r go_around for l until l passed, 21 at the latest; declined at 2",
            "2: r step_aside for l until l passed, 42 at the latest; done at 10",
        ],
        "silent": [
            "0: l step_aside for r until r passed, 40 at the latest; withdrawn at 2",
            "2: r step_aside for l until l passed, 42 at the latest; done at 10",
        ],
        "accepts and stands": [
            "0: l step_aside for r until r passed, 40 at the latest; withdrawn at 5",
            "5: r step_aside for l until l passed, 45 at the latest; done at 13",
        ],
        "begins and stands": [
            "0: l step_aside for r until r passed, 40 at the latest; withdrawn at 4",
            "4: l step_aside for r until r passed, 44 at the latest; done at 12",
        ],
        "done where it stands": [
            "0: l step_aside for r until r passed, 40 at the latest; done at 1",
            "1: r step_aside for l until l passed, 41 at the latest; done at 9",
        ],
    },
    "go_first": {
        "obeys": [
            "0: e go_first for n, 20 at the latest; done at 3",
            "0: n wait_before for e until e passed, 20 at the latest; done at 3",
        ],
        "cannot, busy, no room": [
            "0: e go_first for n, 20 at the latest; declined at 1",
            "0: n wait_before for e until e passed, 20 at the latest; withdrawn at 1",
            "1: n go_first for e, 21 at the latest; done at 4",
            "1: e wait_before for n until n passed, 21 at the latest; done at 4",
        ],
        "silent": [
            "0: e go_first for n, 20 at the latest; withdrawn at 3",
            "0: n wait_before for e until e passed, 20 at the latest; withdrawn at 3",
            "3: n go_first for e, 23 at the latest; done at 6",
            "3: e wait_before for n until n passed, 23 at the latest; done at 6",
        ],
        "accepts and stands": [
            "0: e go_first for n, 20 at the latest; withdrawn at 5",
            "0: n wait_before for e until e passed, 20 at the latest; withdrawn at 5",
            "5: n go_first for e, 25 at the latest; done at 8",
            "5: e wait_before for n until n passed, 25 at the latest; done at 8",
        ],
        "begins and stands": [
            "0: e go_first for n, 20 at the latest; withdrawn at 5",
            "0: n wait_before for e until e passed, 20 at the latest; withdrawn at 5",
            "9: n go_first for e, 29 at the latest; done at 12",
            "9: e wait_before for n until n passed, 29 at the latest; done at 12",
        ],
        "done where it stands": [
            "0: e go_first for n, 20 at the latest; done at 1",
            "0: n wait_before for e until e passed, 20 at the latest; done at 1",
            "1: n go_first for e, 21 at the latest; done at 4",
            "1: e wait_before for n until n passed, 21 at the latest; done at 4",
        ],
    },
    "wait_before": {
        "obeys, silent, accepts and stands, begins and stands, done where it stands": [
            "0: e go_first for n, 20 at the latest; done at 3",
            "0: n wait_before for e until e passed, 20 at the latest; done at 3",
        ],
        "cannot, busy, no room": [
            "0: e go_first for n, 20 at the latest; withdrawn at 1",
            "0: n wait_before for e until e passed, 20 at the latest; declined at 1",
            "9: n go_first for e, 29 at the latest; done at 12",
            "9: e wait_before for n until n passed, 29 at the latest; done at 12",
        ],
    },
}
"""By the verb that the first robot is asked for, and by its replies: what is asked from then on, in seconds since then.
All others obey."""
EACH = [
    (verb, name, asked)
    for verb, by_replies in DRILLS.items()
    for names, asked in by_replies.items()
    for name in names.split(", ")
]


def drilled(verb: str, name: str) -> AdvisedFloor:
    """A minute of a drill."""
    make, without_room = FLOORS[verb]
    first: list[str] = []

    def reply(advice: RobotAdvice) -> Reply:
        if advice.verb in without_room:
            return NO_ROOM
        if advice.verb == verb and not first and name != "obeys":
            first.append(advice.id)
            return REPLIES[name]
        return OBEYS_AND_SAYS_SO if advice.verb in {"back_out", "step_aside"} else OBEYS

    return make(reply).run(60)


@pytest.mark.parametrize(("verb", "name", "asked"), EACH, ids=[f"{verb} {name}" for verb, name, _ in EACH])
def test_what_is_asked_how_it_ends_and_what_is_asked_next(verb: str, name: str, asked: list[str]) -> None:
    floor = drilled(verb, name)
    assert floor.asked(PAIRED.get(verb, verb)) == asked
    first = next(advice for advice in floor.revisions if advice.verb == verb)
    (ended_s,) = (each.updated_at.timestamp() for each in floor.revisions if each.id == first.id and each.cleared_code)
    booked = [each for each in floor.refusals if (each.robot, each.since_s) == (first.robot, ended_s)]
    refuses = name in DECLINED or (name in WITHOUT_WORDS and verb != "wait_before")
    assert [each.is_unable for each in booked] == [name == "cannot"] * refuses


def test_each_verb_and_each_reply_has_a_drill() -> None:
    assert {(verb, name) for verb, name, _ in EACH} == {(verb, name) for verb in get_args(Verb) for name in REPLIES}
