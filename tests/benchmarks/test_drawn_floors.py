"""Drawn floors: honest robots do the same with and without others, and what they lose by others is found."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.drawn_floors.driving import Drive, Warned, drive
from benchmarks.drawn_floors.figures import MOST_RATIO
from benchmarks.drawn_floors.floor import drawn_floor, honest_floor
from benchmarks.drawn_floors.judging import compared, meetings, told_of
from benchmarks.drawn_floors.measuring import Terms, measured, reference
from benchmarks.drawn_floors.motion import Robot, Says, Way, sent_by
from benchmarks.drawn_floors.others import KINDS
from deconflict.sweep.pair_choice import PAIRS
from deconflict_client.advisory import Severity

SECONDS, ROBOTS = 20.0, 60
TERMS = Terms(SECONDS, passes=5)
HELD = (
    "standing-heap",
    "trembling-heap",
    "large-spread",
    "giants-and-small",
    "moving-heap",
    "waiting-rows",
    "fast",
    "falls-silent",
    "all-at-once",
)
"""Kinds beside which a pass examines no more pairs than it may."""


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_draws_as_many_robots_as_it_shall_and_the_same_each_time(kind: str) -> None:
    floor, again = (drawn_floor(3, ROBOTS, SECONDS, kinds=(kind,)) for _ in range(2))
    robots = (*floor.honest, *floor.others)
    assert len(robots) == len({robot.uuid for robot in robots}) == ROBOTS
    assert sent_by(robots, SECONDS) == sent_by((*again.honest, *again.others), SECONDS)


def test_honest_robots_send_the_same_whoever_else_is_there() -> None:
    floor, robots = drawn_floor(1, ROBOTS, SECONDS), len(drawn_floor(1, ROBOTS, SECONDS).honest)
    beside = [each for each in sent_by((*floor.honest, *floor.others), SECONDS) if each.robot < robots]
    assert beside == sent_by(floor.honest, SECONDS)


@pytest.fixture(scope="module")
def usual() -> dict[str, float]:
    return reference(100, 1, TERMS)


@pytest.mark.parametrize("kind", HELD)
def test_beside_others_a_pass_examines_few_more_pairs_and_no_warning_of_honest_robots_is_lost(
    kind: str, usual: dict[str, float]
) -> None:
    found = measured(drawn_floor(1, 100, SECONDS, kinds=(kind,)), TERMS, usual)
    assert found["pairs"] <= MOST_RATIO * found["usual_pairs"] + PAIRS.spare
    assert (found["warnings"]["missing"], found["warnings"]["late"]) == ([], [])


def test_every_meeting_of_honest_robots_alone_is_told_of() -> None:
    honest = honest_floor(12, SECONDS, 1)
    alone = drive(honest, sent_by(honest, SECONDS), SECONDS)
    floor = replace(drawn_floor(0, 2 * len(honest), SECONDS), honest=honest, others=())
    verdict = compared(floor, alone, alone, SECONDS)
    assert verdict.compared > 0
    assert (verdict.differ, verdict.missed, verdict.told_beside) == (0, 0, verdict.told_alone)


@pytest.mark.parametrize("says", ["nothing", "waits", "bound"])
def test_a_robot_is_warned_of_one_that_stands_whatever_that_one_says_of_its_way(says: Says) -> None:
    """It says nothing, that it goes on at once in one of eight directions, or that it goes to the dock."""
    standing, driving, seconds = list[Robot](), list[Robot](), 30.0
    for number in range(8):
        x_m, yaw_rad = 60.0 * number, np.pi / 4 * number
        to_m = np.array([[x_m - 24.0, 0.3], [x_m + 12.0, 0.3]])
        standing.append(replace(_standing(f"standing {number}", x_m, is_honest=True, yaw_rad=yaw_rad), says=says))
        driving.append(replace(_standing(f"driving {number}", 0.0, is_honest=True), way=Way.driven(to_m, 1.0)))
    both = *standing, *driving
    driven = drive(both, sent_by(both, seconds), seconds)
    found = meetings(driving, standing, 10.0, seconds)
    assert len(found) == 8
    warned = [told_of(meeting, driven) for meeting in found]
    assert [each is not None for each in warned] == [True] * 8
    assert all(abs(each.at_m[0] - 60.0 * number) < 1.0 for number, each in enumerate(warned) if each)


@pytest.mark.parametrize(
    ("beside", "found"),
    [
        ([Warned(10.2, Severity.WARNING)], (0, 0, 0, 0)),
        ([Warned(10.2, Severity.CRITICAL)], (0, 0, 0, 1)),
        ([Warned(11.0, Severity.WARNING)], (0, 1, 0, 0)),
        ([], (1, 0, 0, 0)),
        ([Warned(10.0, Severity.WARNING), Warned(17.0, Severity.WARNING)], (0, 0, 1, 0)),
    ],
)
@pytest.mark.parametrize("other_at_m", [500.0, 0.0])
def test_warnings_differ_if_missing_late_or_more_and_none_of_a_robot_that_meets_others(
    beside: list[Warned], found: tuple[int, int, int, int], other_at_m: float
) -> None:
    honest = tuple(_standing(f"honest {number}", 10.0 * number, is_honest=True) for number in range(2))
    others = (_standing("other", other_at_m, is_honest=False),)
    floor = replace(drawn_floor(0, ROBOTS, SECONDS), honest=honest, others=others)
    pair = (min(honest[0].uuid, honest[1].uuid), max(honest[0].uuid, honest[1].uuid))
    alone = Drive(warnings={pair: [Warned(10.0, Severity.WARNING)]})
    verdict = compared(floor, alone, Drive(warnings={pair: beside}), SECONDS)
    counts = len(verdict.missing), len(verdict.late), len(verdict.additional), len(verdict.severity)
    assert counts == (found if other_at_m else (0, 0, 0, 0))
    assert (verdict.compared, verdict.excused) == ((1, 0) if other_at_m else (0, 1))


def test_a_meeting_begins_when_bodies_come_within_the_clearance() -> None:
    standing = _standing("standing", 0.0, is_honest=True)
    ahead_m = np.array([[-10.0, 0.0], [10.0, 0.0]])
    driving = replace(_standing("driving", 0.0, is_honest=True), name="driving", way=Way.driven(ahead_m, 1.0))
    both = standing, driving
    (meeting,) = meetings(both, both, 0.0, SECONDS)
    assert meeting.at_s == pytest.approx(10.0 - 1.0 - 0.3, abs=0.2)


def _standing(name: str, x_m: float, *, is_honest: bool, yaw_rad: float = 0.0) -> Robot:
    return Robot(name, "Alder", "10.1.0.1", Way.standing(x_m, 0.0, yaw_rad), 1.0, 0.6, 0.5, is_honest=is_honest)
