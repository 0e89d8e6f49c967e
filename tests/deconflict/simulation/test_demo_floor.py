"""The demo's robots with and without advice."""

from datetime import timedelta
from typing import Any

import numpy as np

from deconflict.simulation.demo.demo_floor import DemoFloor
from deconflict.simulation.driving.motion import Activity
from deconflict.simulation.robot_state import robot_states
from deconflict_client.advisory import ClearedCode
from deconflict_client.advisory.robot_advice import RobotAdvice
from tests.helpers.made_advisories import START, made_advice

ROBOTS, STEPS = 24, 300


def test_robots_that_follow_no_advice_move_as_those_beside_them_that_get_none() -> None:
    floor = DemoFloor(ROBOTS, 3, follows_advice=True)
    for _ in range(STEPS):
        floor.step()
        robot_states(floor.world, np.arange(len(floor.world)))
    result = floor.result()
    assert result.pop("without_advice") == result
    assert result["trips"] + result["delay_s"] > 0
    assert "lost_s" not in result, "that is what the ledger books"


def test_an_order_to_wait_is_lost_time_that_the_robots_beside_do_not_have() -> None:
    floor = DemoFloor(ROBOTS, 3, follows_advice=True)
    for step in range(STEPS):
        if step == STEPS // 2:
            for robot in range(len(floor.world)):
                floor.world.instructions.wait(robot, 10.0, floor.world.t_s)
        floor.step()
    result = floor.result()
    assert result["delay_s"] > result["without_advice"]["delay_s"]
    assert f"{result['delay_s']:.0f} s late on their way" in floor.sentence()


def test_a_floor_without_advice_says_nothing_of_it() -> None:
    floor = DemoFloor(ROBOTS, 3, follows_advice=False)
    floor.step()
    assert floor.sentence() == ""
    assert "without_advice" not in floor.result()


def asked_of(floor: DemoFloor, row: int, number: int, verb: str, **fields: Any) -> RobotAdvice:
    robot, other = floor.world.members[row].uuid, floor.world.members[row - 1].uuid
    pair = tuple(sorted((robot, other)))
    asked: dict[str, Any] = {"robots": pair, "robot": robot, "other": other, "verb": verb, "raised_at": START}
    return made_advice(number, **asked, latest_at=START + timedelta(seconds=20), **fields)


def test_robots_do_what_is_asked_or_say_why_not() -> None:
    floor = DemoFloor(ROBOTS, 3, follows_advice=True)
    for _ in range(STEPS):
        floor.step()
    doing = floor.world.doing
    row, stands = (int(row) for row in np.flatnonzero(doing == Activity.DRIVING)[:2])
    doing[stands] = Activity.HALTED
    waits = asked_of(floor, row, 1, "wait_before")
    unable = [asked_of(floor, row, 2, "go_around"), asked_of(floor, row, 3, "other_way")]
    for each in (waits, *unable, asked_of(floor, stands, 4, "back_out"), waits.next_revision(begun_at=START)):
        floor.pass_on(each, START.timestamp())
    answers = {each.advice_id: (each.answer, each.why) for each in floor.take_answers()}
    assert answers == {
        "advice-1": ("accepted", ""),
        "advice-2": ("declined", "no room"),
        "advice-3": ("declined", "cannot"),
        "advice-4": ("declined", "busy"),
    }
    assert floor.world.instructions.waits(row, floor.world.t_s)
    floor.pass_on(waits.cleared_revision(START.timestamp() + 2, ClearedCode.DONE), START.timestamp() + 2)
    assert not floor.world.instructions.waits(row, floor.world.t_s), "it goes on once its advice has ended"
    floor.pass_on(asked_of(floor, row, 5, "back_out"), START.timestamp() + 3)
    assert floor.world.doing[row] == Activity.BACKING
    assert not floor.take_answers()[1:]
