"""A robot whose localisation is slower than its messages drives on between two poses; one that is stuck stands."""

from collections.abc import Callable
from math import floor

import pytest

from ingest.fleet.fleet import Fleet
from ingest.fleet.repeat_status import load
from ingest.fleet.robot import Robot
from tests.helpers.saying import robot, status
from tests.ingest.fleet.made_fleet import LINE, NOW_S, at, hall

Drive = Callable[[float], float]


def told(of: Fleet, x_m: Drive, *, every_s: float, seconds: float, says_mps: float | None = None) -> Robot:
    """A robot that tells where it is after some seconds."""
    for count in range(round(seconds / every_s) + 1):
        after_s = every_s * count
        velocity = None if says_mps is None else {"linear": says_mps}
        of.receive(status("A", NOW_S + after_s, x_m(after_s), velocity=velocity), NOW_S + after_s, LINE)
    return of.robots[robot("A")]


def in_steps(each_s: float, mps: float, until_s: float = 1e9) -> Drive:
    return lambda after_s: mps * min(floor(after_s / each_s + 1e-9) * each_s, until_s)


@pytest.mark.parametrize("fast", [False, True])
@pytest.mark.parametrize("says_mps", [None, 1.5])
@pytest.mark.parametrize(("every_s", "each_s"), [(1.0, 2.0), (1.0, 3.0), (0.2, 1.0), (2.0, 4.0)])
@pytest.mark.parametrize("last", [0, 1])
def test_a_pose_that_comes_again_while_the_robot_drives_is_as_old_as_its_first_message(
    every_s: float, each_s: float, says_mps: float | None, fast: bool, last: int
) -> None:
    of = hall()
    if fast:
        of.use(load())
    seconds = 10 * each_s + last * every_s
    made = told(of, in_steps(each_s, 1.5), every_s=every_s, seconds=seconds, says_mps=says_mps)
    assert at(made.forecast, NOW_S + seconds + 8)[0] == pytest.approx(1.5 * (seconds + 8), abs=0.01)
    assert made.moved is None


@pytest.mark.parametrize("says_mps", [None, 0.0])
def test_a_robot_that_stops_and_held_its_poses_before_is_foreseen_to_stand(says_mps: float | None) -> None:
    of = hall()
    told(of, in_steps(2.0, 1.0), every_s=1.0, seconds=20)
    for second in range(21, 25):
        velocity = None if says_mps is None else {"linear": says_mps}
        of.receive(status("A", NOW_S + second, 20.0, velocity=velocity), NOW_S + second, LINE)
    made = of.robots[robot("A")]
    assert at(made.forecast, NOW_S + 34)[0] == 20.0


def test_a_robot_that_holds_its_poses_no_longer_is_seen_to_stand_at_once() -> None:
    of = hall()
    told(of, lambda s: in_steps(2.0, 1.0)(s) if s < 20 else 20.0 + min(s - 20, 10.0), every_s=1.0, seconds=31)
    assert at(of.robots[robot("A")].forecast, NOW_S + 40)[0] == 30.0


def test_a_robot_that_sets_out_after_it_stood_is_as_fast_as_it_was() -> None:
    of, mps = hall(), 1.0
    steps = in_steps(3.0, mps)
    made = told(of, lambda s: steps(s) if s < 16 else max(15.0, steps(s) - 15.0), every_s=1.0, seconds=33)
    assert made.seen
    assert made.seen.linear_mps == pytest.approx(mps)


@pytest.mark.parametrize("fast", [False, True])
@pytest.mark.parametrize("noise_m", [0.0, 0.03])
@pytest.mark.parametrize(("every_s", "mps"), [(0.2, 0.5), (1.0, 1.0), (2.0, 0.4)])
def test_a_robot_that_states_a_speed_but_does_not_move_stands(
    every_s: float, mps: float, noise_m: float, fast: bool
) -> None:
    of = hall()
    if fast:
        of.use(load())
    stops_s, seconds = 4 * every_s, 4 * every_s + max(4.0, 3 * every_s)

    def x_m(after_s: float) -> float:
        return mps * min(after_s, stops_s) + noise_m * (round(after_s / every_s) % 2)

    made = told(of, x_m, every_s=every_s, seconds=seconds, says_mps=mps)
    assert at(made.forecast, NOW_S + seconds + 10)[0] == pytest.approx(mps * stops_s, abs=0.5)
    assert made.deviations["speed-contradicts-motion"] >= 1
    more_s = seconds + 3 * every_s
    for count in range(1, 4):
        after_s = seconds + every_s * count
        x = x_m(seconds) + mps * every_s * count
        of.receive(status("A", NOW_S + after_s, x, velocity={"linear": mps}), NOW_S + after_s, LINE)
    assert at(made.forecast, NOW_S + more_s + 5)[0] == pytest.approx(x + mps * 5, abs=0.2)


@pytest.mark.parametrize("every_s", [0.5, 1.0])
def test_a_slow_start_is_no_stuck_speed(every_s: float) -> None:
    of = hall()
    for count in range(round(8 / every_s) + 1):
        after_s = every_s * count
        mps = min(0.2 * after_s, 1.0)
        x_m = 0.1 * min(after_s, 5.0) ** 2 + max(after_s - 5.0, 0.0)
        of.receive(status("A", NOW_S + after_s, x_m, velocity={"linear": mps}), NOW_S + after_s, LINE)
        assert of.robots[robot("A")].deviations.get("speed-contradicts-motion", 0) == 0


@pytest.mark.parametrize("fast", [False, True])
@pytest.mark.parametrize("rate", [2.0, 3.0, 20.0])
@pytest.mark.parametrize("every_s", [0.25, 0.5])
def test_messages_of_one_second_that_were_held_up_with_one_stamp_are_as_old_as_that(
    every_s: float, rate: float, fast: bool
) -> None:
    of, mps = hall(), 1.0
    if fast:
        of.use(load())
    for count in range(round(25 / every_s)):
        after_s = every_s * count
        arrives_s = after_s if after_s <= 8.5 else max(after_s, 20.0 + (after_s - 8.5) / rate)
        raw = status("A", NOW_S + floor(after_s), mps * after_s, velocity={"linear": mps})
        of.receive(raw, NOW_S + arrives_s, LINE)
        made = of.robots[robot("A")]
        assert made.seen
        assert made.seen.x_m == mps * after_s
        assert after_s - 1.0 <= made.seen.t_s - NOW_S <= after_s + 1e-6
    assert "stamp-unchanged" not in made.deviations


@pytest.mark.parametrize("every_s", [0.2, 0.4])
def test_messages_of_one_second_with_one_stamp_count_as_they_come(every_s: float) -> None:
    of = hall()
    for count in range(round(20 / every_s)):
        after_s = every_s * count
        raw = status("A", NOW_S + floor(after_s + 1e-9), after_s, velocity={"linear": 1.0})
        of.receive(raw, NOW_S + after_s, LINE)
    assert at(of.robots[robot("A")].forecast, NOW_S + 25)[0] == pytest.approx(25.0, abs=every_s)


def test_a_message_that_comes_again_at_once_does_not_grow_newer() -> None:
    of = hall()
    raw = status("A", NOW_S, 0.0, velocity={"linear": 1.0})
    for count in range(5):
        of.receive(raw, NOW_S + 0.3 * count, LINE)
    assert of.robots[robot("A")].seen.t_s == NOW_S  # type: ignore[union-attr]
