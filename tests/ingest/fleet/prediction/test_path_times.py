"""Robots that are faster or slower than the times of their paths say."""

from typing import Any

import pytest

from ingest.fleet.repeat_status import load
from ingest.fleet.robot import Robot
from tests.helpers.saying import points, robot, status
from tests.ingest.fleet.made_fleet import LINE, NOW_S, at, hall


def told(share: float, *, mps: float = 1.0, seconds: int = 20, every_s: float = 1.0, fast: bool = False) -> Robot:
    """A robot that drives a share of each path that it sends in the time it says."""
    of = hall()
    if fast:
        of.use(load())
    for count in range(round(seconds / every_s) + 1):
        after_s = every_s * count
        ahead = ((NOW_S + after_s + s, mps * (after_s + s / share), 0.0, 0.0) for s in range(1, 11))
        keys: dict[str, Any] = {"path": points(*ahead), "velocity": {"linear": mps}}
        of.receive(status("A", NOW_S + after_s, mps * after_s, **keys), NOW_S + after_s, LINE)
    return of.robots[robot("A")]


@pytest.mark.parametrize("fast", [False, True])
@pytest.mark.parametrize("every_s", [0.5, 1.0, 5.0])
@pytest.mark.parametrize("share", [2.0, 0.5, 3.0, 0.4])
def test_times_of_paths_that_a_robot_never_keeps_are_replaced_by_its_pace(
    share: float, every_s: float, fast: bool
) -> None:
    made = told(share, every_s=every_s, fast=fast, seconds=30)
    assert at(made.forecast, NOW_S + 38)[0] == pytest.approx(38.0, abs=0.2)
    assert made.deviations["path-retimed"] >= 1


@pytest.mark.parametrize("share", [1.0, 1.2, 0.8])
def test_times_of_paths_that_a_robot_nearly_keeps_count(share: float) -> None:
    made = told(share)
    assert at(made.forecast, NOW_S + 28)[0] == pytest.approx(20.0 + 8.0 / share)
    assert "path-retimed" not in made.deviations


def test_a_robot_that_is_held_up_now_and_then_keeps_the_times_of_its_paths() -> None:
    of, x_m = hall(), 0.0
    for second in range(41):
        mps = 0.4 if second % 12 in (0, 1, 2) else 1.0
        ahead = ((NOW_S + second + s, x_m + s, 0.0, 0.0) for s in range(1, 11))
        keys: dict[str, Any] = {"path": points(*ahead), "velocity": {"linear": mps}}
        of.receive(status("A", NOW_S + second, x_m, **keys), NOW_S + second, LINE)
        x_m += mps
    made = of.robots[robot("A")]
    assert at(made.forecast, NOW_S + 48)[0] - made.seen.x_m == pytest.approx(8.0)  # type: ignore[union-attr]
    assert "path-retimed" not in made.deviations


def test_a_robot_that_is_held_up_for_long_after_it_kept_the_times_of_its_paths_keeps_them() -> None:
    of, x_m = hall(), 0.0
    for second in range(61):
        mps = 1.0 if second < 20 else 0.5
        ahead = ((NOW_S + second + s, x_m + s, 0.0, 0.0) for s in range(1, 11))
        keys: dict[str, Any] = {"path": points(*ahead), "velocity": {"linear": mps}}
        of.receive(status("A", NOW_S + second, x_m, **keys), NOW_S + second, LINE)
        x_m += mps
    assert "path-retimed" not in of.robots[robot("A")].deviations
