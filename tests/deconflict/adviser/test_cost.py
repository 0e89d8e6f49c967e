"""What the adviser costs on crowded floors."""

import time
from collections.abc import Callable
from math import pi
from typing import Any

import pytest

from deconflict.adviser import Request
from deconflict.adviser.ground import goals
from deconflict.adviser.ground.tracks import Tracks
from deconflict.adviser.standoffs import Standing
from tests.deconflict.adviser.advised_floor import AdvisedFloor
from tests.deconflict.adviser.floors import LOWER, Floor, Robot, face_to_face


def _crowd() -> tuple[Robot, ...]:
    pairs = [face_to_face(8.0 * (k % 12), 8.0 * (k // 12), str(k)) for k in range(150)]
    return tuple(robot for pair in pairs for robot in pair)


def _jam() -> tuple[Robot, ...]:
    makers = "Larch", "Rowan"
    return tuple(
        Robot(f"j{k}", makers[k % 2], 1.6 * (k % 18), 1.6 * (k // 18), pi * (k % 18 > 8), LOWER) for k in range(300)
    )


def _driving() -> tuple[Robot, ...]:
    return tuple(
        Robot(f"d{k}", "Larch", 300.0 + 12.0 * (k % 35), 12.0 * (k // 35), 0.0, means_to_go=False) for k in range(700)
    )


MOST_LOOPS = 4.0
"""How many loops a step may take."""


def loop_s() -> float:
    """Processor time of a loop of plain Python."""
    begun_s = time.thread_time()
    sum(number * number for number in range(200_000))
    return time.thread_time() - begun_s


@pytest.mark.parametrize("crowd", [_crowd, _jam], ids=["pairs", "jam"])
def test_a_step_on_a_crowded_floor_of_a_thousand_robots_is_cheap(
    crowd: Callable[[], tuple[Robot, ...]], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A step takes twice as long as a loop of plain Python. A core that is slow, or shared, is so for both."""
    floor = Floor((*crowd(), *_driving()))
    advice, costs_s, searches = floor.adviser._advice, list[float](), list[int]()
    loops_s = list[float]()
    step, search = advice.step, Tracks.refuge_m

    def timed(*args: Any) -> list[Request]:
        searches.append(0)
        begun_s = time.thread_time()
        requests = step(*args)
        costs_s.append(time.thread_time() - begun_s)
        loops_s.append(loop_s())
        return requests

    def counted(*args: Any) -> Any:
        searches[-1] += 1
        return search(*args)

    monkeypatch.setattr(advice, "step", timed)
    monkeypatch.setattr(Tracks, "refuge_m", counted)
    floor.seconds(9, lambda _: ("declined", "cannot"))
    assert max(searches) <= 6
    assert sum(sorted(costs_s)[2:-2]) < MOST_LOOPS * sum(sorted(loops_s)[2:-2]), (costs_s, loops_s)


def test_robots_for_which_no_place_was_looked_for_come_first_in_the_next_step(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(goals, "FINDS", 4)
    pairs = [face_to_face(8.0 * number, name=str(number)) for number in range(12)]
    floor = Floor(tuple(robot for pair in pairs for robot in pair))
    requests = floor.seconds(25, lambda _: ("declined", "cannot"))
    asked = {request.robot for request in requests}
    assert all(asked & {left.uuid, right.uuid} for left, right in pairs)


def test_of_a_long_line_of_robots_that_do_not_answer_each_queue_is_counted_a_few_times(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Each of a hundred stands behind the next, and most of them refuse by silence in one second."""
    behind, counts = getattr(Standing, "_robots_behind"), list[str]()  # noqa: B009

    def counted(self: Standing, robot: str) -> set[str]:
        counts.append(robot)
        found: set[str] = behind(self, robot)
        return found

    monkeypatch.setattr(Standing, "_robots_behind", counted)
    floor = AdvisedFloor([Robot(f"q{k}", ("Larch", "Rowan")[k % 2], 1.6 * k, 0.0, 0.0) for k in range(100)])
    most = 0
    for _ in range(25):
        counts.clear()
        floor.run(1)
        most = max(most, len(counts))
    assert floor.refusals
    assert most <= 4 * len(floor.robots)
