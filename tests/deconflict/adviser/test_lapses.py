"""How advice ends if nobody does it: its time passes, robots leave, clocks go back, or the service stops asking."""

from collections.abc import Callable
from typing import get_args

import pytest

from deconflict.adviser import Request
from deconflict.adviser.advice_lifecycle import AnsweredAdvice
from deconflict.engine.load_shedding import Effort
from deconflict.settings.site import Site
from deconflict_client.advisory import AdviceAnswer
from ingest.settings import Reading
from tests.deconflict.adviser.advised_floor import HALF_M, SILENT, UNBEGUN, AdvisedFloor, Reply, forward
from tests.deconflict.adviser.floors import Floor, Robot, before_crossing, face_to_face

FORGETS = Site(name="forgets", reading=Reading(quiet_after_s=2.0, silent_after_s=3.0, forget_after_s=6.0))
"""A robot that leaves is soon known to have left."""
Happens = Callable[[AdvisedFloor], object]


def asked_of(robots: tuple[Robot, ...], reply: Reply) -> AdvisedFloor:
    """A floor whose robots were just asked, and reply."""
    floor = AdvisedFloor(list(robots), lambda _: reply, FORGETS)
    while not floor.revisions:
        floor.run(1)
    return floor.run(1)


def leaves(name: str) -> Happens:
    def happens(floor: AdvisedFloor) -> None:
        floor.robots = [robot for robot in floor.robots if robot.name != name]

    return happens


def drives_away(name: str) -> Happens:
    def happens(floor: AdvisedFloor) -> None:
        next(robot for robot in floor.robots if robot.name == name).y_m += 6.0

    return happens


def parks(name: str) -> Happens:
    def happens(floor: AdvisedFloor) -> None:
        robot = next(robot for robot in floor.robots if robot.name == name)
        forward(robot, HALF_M)
        robot.means_to_go = False

    return happens


def is_overloaded_once(floor: AdvisedFloor) -> None:
    floor.effort = Effort.NEAR
    floor.run(1)
    floor.effort = Effort.FULL


def restarts(floor: AdvisedFloor) -> None:
    floor.restart()


def nothing(_: AdvisedFloor) -> None:
    pass


AROUND, FIRST, WAIT = (
    "2: l go_around for r until r passed, 22 at the latest",
    "9: e go_first for n, 29 at the latest",
    "9: n wait_before for e until e passed, 29 at the latest",
)
FACING: dict[str, tuple[Reply, Happens, list[str]]] = {
    "its time passes": (UNBEGUN, nothing, [
        f"{AROUND}; withdrawn at 7",
        "7: r go_around for l until l passed, 27 at the latest; withdrawn at 12",
        "12: l go_around for r until r passed, 32 at the latest; withdrawn at 17",
        "17: r go_around for l until l passed, 37 at the latest; withdrawn at 22",
    ]),
    "it begins and parks": (UNBEGUN, parks("l"), [
        f"{AROUND}; lapsed at 22",
        "22: r go_around for l until l passed, 42 at the latest; open",
    ]),
    "it leaves the floor": (UNBEGUN, leaves("l"), [
        f"{AROUND}; withdrawn at 7",
        "7: r go_around for l until l passed, 27 at the latest; open",
    ]),
    "it leaves without an answer": (SILENT, leaves("l"), [
        f"{AROUND}; withdrawn at 5",
        "5: r go_around for l until l passed, 25 at the latest; withdrawn at 8",
    ]),
    "the other leaves the floor": (UNBEGUN, leaves("r"), [
        f"{AROUND}; withdrawn at 7",
        "7: r go_around for l until l passed, 27 at the latest; left at 10",
    ]),
    "the other drives away": (UNBEGUN, drives_away("r"), [f"{AROUND}; lapsed at 22"]),
    "the other drives away before an answer": (SILENT, drives_away("r"), [f"{AROUND}; withdrawn at 4"]),
    "it drives away without an answer": (SILENT, drives_away("l"), [f"{AROUND}; done at 4"]),
    "the engine can't keep up": (UNBEGUN, is_overloaded_once, [
        f"{AROUND}; withdrawn at 4",
        "5: r go_around for l until l passed, 25 at the latest; withdrawn at 10",
        "12: l go_around for r until r passed, 32 at the latest; withdrawn at 17",
        "17: r go_around for l until l passed, 37 at the latest; withdrawn at 22",
    ]),
    "the service restarts": (UNBEGUN, restarts, [
        f"{AROUND}; restarted at 4",
        "5: l go_around for r until r passed, 25 at the latest; withdrawn at 10",
        "10: r go_around for l until l passed, 30 at the latest; withdrawn at 15",
        "15: l go_around for r until r passed, 35 at the latest; withdrawn at 20",
        "20: r go_around for l until l passed, 40 at the latest; open",
    ]),
}  # fmt: skip
CROSSING: dict[str, tuple[Reply, Happens, list[str]]] = {
    "their time passes": (UNBEGUN, nothing, [
        f"{FIRST}; withdrawn at 14",
        f"{WAIT}; withdrawn at 14",
        "14: n go_first for e, 34 at the latest; withdrawn at 19",
        "14: e wait_before for n until n passed, 34 at the latest; withdrawn at 19",
        "19: e go_first for n, 39 at the latest; withdrawn at 24",
        "19: n wait_before for e until e passed, 39 at the latest; withdrawn at 24",
        "24: n go_first for e, 44 at the latest; withdrawn at 29",
        "24: e wait_before for n until n passed, 44 at the latest; withdrawn at 29",
    ]),
    "the first leaves the floor": (UNBEGUN, leaves("e"), [
        f"{FIRST}; withdrawn at 14",
        f"{WAIT}; withdrawn at 14",
        "14: n go_first for e, 34 at the latest; withdrawn at 19",
        "14: e wait_before for n until n passed, 34 at the latest; withdrawn at 19",
    ]),
    "the one that waits leaves": (UNBEGUN, leaves("n"), [
        f"{FIRST}; withdrawn at 14",
        f"{WAIT}; withdrawn at 14",
        "14: n go_first for e, 34 at the latest; left at 17",
        "14: e wait_before for n until n passed, 34 at the latest; withdrawn at 17",
    ]),
    "the one that waits drives away": (SILENT, drives_away("n"), [
        f"{FIRST}; withdrawn at 12",
        f"{WAIT}; withdrawn at 12",
    ]),
    "the engine can't keep up": (UNBEGUN, is_overloaded_once, [
        f"{FIRST}; withdrawn at 11",
        f"{WAIT}; withdrawn at 11",
        "12: n go_first for e, 32 at the latest; withdrawn at 17",
        "12: e wait_before for n until n passed, 32 at the latest; withdrawn at 17",
        "19: e go_first for n, 39 at the latest; withdrawn at 24",
        "19: n wait_before for e until e passed, 39 at the latest; withdrawn at 24",
        "24: n go_first for e, 44 at the latest; withdrawn at 29",
        "24: e wait_before for n until n passed, 44 at the latest; withdrawn at 29",
    ]),
    "the service restarts": (UNBEGUN, restarts, [
        f"{FIRST}; restarted at 11",
        f"{WAIT}; restarted at 11",
        "19: e go_first for n, 39 at the latest; withdrawn at 24",
        "19: n wait_before for e until e passed, 39 at the latest; withdrawn at 24",
        "24: n go_first for e, 44 at the latest; withdrawn at 29",
        "24: e wait_before for n until n passed, 44 at the latest; withdrawn at 29",
        "29: e go_first for n, 49 at the latest; open",
        "29: n wait_before for e until e passed, 49 at the latest; open",
    ]),
}  # fmt: skip
"""What robots reply, what happens a second later, and what has been asked 20 s after that."""


@pytest.mark.parametrize(("reply", "happens", "asked"), FACING.values(), ids=FACING)
def test_how_advice_to_one_of_two_ends_that_it_does_not_do(reply: Reply, happens: Happens, asked: list[str]) -> None:
    floor = asked_of(face_to_face(), reply)
    happens(floor)
    assert floor.run(20).asked() == asked


@pytest.mark.parametrize(("reply", "happens", "asked"), CROSSING.values(), ids=CROSSING)
def test_how_advice_before_a_crossing_ends_that_nobody_does(reply: Reply, happens: Happens, asked: list[str]) -> None:
    floor = asked_of(before_crossing(), reply)
    happens(floor)
    assert floor.run(20).asked() == asked


def test_a_late_answer_changes_nothing() -> None:
    floor = asked_of(face_to_face(), SILENT).run(4)
    assert floor.revisions[1].cleared_code == "withdrawn"
    floor.answers += [AnsweredAdvice(floor.revisions[0].id, answer, "cannot") for answer in get_args(AdviceAnswer)]
    unanswered = asked_of(face_to_face(), SILENT)
    assert floor.run(20).asked() == unanswered.run(24).asked()


@pytest.mark.parametrize(
    ("robots", "verbs"), [(face_to_face, ["go_around"]), (before_crossing, ["go_first", "wait_before"])]
)
def test_all_is_withdrawn_and_asked_anew_if_the_clock_goes_back(
    robots: Callable[[], tuple[Robot, ...]], verbs: list[str]
) -> None:
    floor, asked = Floor(robots()), list[Request]()
    while not asked:
        asked = floor.second()
    floor.now_s -= 3600.0
    found = floor.seconds(20)
    assert [(each.id, each.verb) for each in found if each.withdrawn][: len(verbs)] == [
        (each.id, each.verb) for each in asked
    ]
    anew = [each for each in found if not each.withdrawn][: len(verbs)]
    assert [(each.robot, each.verb) for each in anew] == [(each.robot, each.verb) for each in asked]
    assert all(each.latest_s > floor.now_s - 20.0 and each.latest_s <= floor.now_s + 20.0 for each in anew)
