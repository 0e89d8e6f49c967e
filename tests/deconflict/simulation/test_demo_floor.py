"""The demo's robots with and without advice."""

import numpy as np

from deconflict.simulation.demo.demo_floor import DemoFloor
from deconflict.simulation.robot_state import robot_states

ROBOTS, STEPS = 24, 300


def test_robots_that_follow_no_advice_move_as_those_beside_them_that_get_none() -> None:
    floor = DemoFloor(ROBOTS, 3, follows_advice=True)
    for _ in range(STEPS):
        floor.step()
        robot_states(floor.world, np.arange(len(floor.world)))
    result = floor.result()
    assert result.pop("without_advice") == result
    assert result["trips"] + result["lost_s"] > 0


def test_an_order_to_wait_is_lost_time_that_the_robots_beside_do_not_have() -> None:
    floor = DemoFloor(ROBOTS, 3, follows_advice=True)
    for step in range(STEPS):
        if step == STEPS // 2:
            for robot in range(len(floor.world)):
                floor.world.instructions.wait(robot, 10.0, floor.world.t_s)
        floor.step()
    result = floor.result()
    assert result["lost_s"] > result["without_advice"]["lost_s"]
    assert f"{result['lost_s']:.0f} s on their way" in floor.sentence()


def test_a_floor_without_advice_says_nothing_of_it() -> None:
    floor = DemoFloor(ROBOTS, 3, follows_advice=False)
    floor.step()
    assert floor.sentence() == ""
    assert "without_advice" not in floor.result()
