"""Speeds that robots state and do not drive: the last command, those of a place that is seldom renewed, other units."""

from collections.abc import Callable
from typing import Any

import pytest

from ingest.fleet.fleet import Fleet
from ingest.fleet.prediction.forecast_model import Forecast
from ingest.fleet.prediction.pace import ObservedSpeeds
from ingest.fleet.robot import Robot
from ingest.settings import Datum
from tests.helpers.saying import HALL, robot, status
from tests.helpers.vda_saying import MAP, factsheet, line, node, order, state, under_way
from tests.ingest.fleet.made_fleet import LINE, NOW_S, fleet

FAR = [node(0, 0.0), node(1, 2000.0)]


def hall() -> Fleet:
    return fleet(datums=(Datum(id=MAP, name="Hall"), Datum(id=HALL, name="Other hall")))


def x_at(forecast: Forecast | None, t_s: float) -> float:
    assert forecast is not None
    (before_s, x, *_), (after_s, to_x, *_) = forecast.knots[0], forecast.knots[-1]
    return float(x + (to_x - x) * min((t_s - before_s) / (after_s - before_s), 1.0)) if after_s > before_s else float(x)


def in_massrobotics(place: Callable[[float], float], *, seconds: float, every_s: float, mps: float) -> Robot:
    of = hall()
    for count in range(round(seconds / every_s) + 1):
        t_s = every_s * count
        of.receive(status("A", NOW_S + t_s, place(t_s), velocity={"linear": mps}), NOW_S + t_s, LINE)
    return of.robots[robot("A")]


def in_vda(place: Callable[[float], float], *, seconds: float, every_s: float, mps: float) -> Robot:
    of = hall()
    for count in range(round(seconds / every_s) + 1):
        t_s, velocity = every_s * count, {"vx": mps, "vy": 0.0, "omega": 0.0}
        raw = state(NOW_S + t_s, place(t_s), driving=True, velocity=velocity)
        of.receive(raw, NOW_S + t_s, line("state"))
    (only,) = of.robots.values()
    return only


@pytest.mark.parametrize("sender", [in_massrobotics, in_vda])
@pytest.mark.parametrize(("every_s", "mps"), [(0.5, 1.2), (1.0, 0.8), (3.0, 0.4)])
def test_a_robot_stands_that_does_not_move_whatever_speed_it_sends(
    sender: Callable[..., Robot], every_s: float, mps: float
) -> None:
    made = sender(lambda t_s: min(t_s, 12.0) * mps, seconds=24.0, every_s=every_s, mps=mps)
    assert x_at(made.forecast, NOW_S + 34) == pytest.approx(12.0 * mps, abs=0.01)
    assert made.deviations["speed-contradicts-motion"] >= 2
    made = sender(lambda t_s: t_s * mps, seconds=24.0, every_s=every_s, mps=mps)
    assert x_at(made.forecast, NOW_S + 34) == pytest.approx(34.0 * mps, abs=0.01)


def test_a_place_that_is_renewed_every_few_seconds_does_not_stop_the_robot_between() -> None:
    made = in_massrobotics(lambda t_s: t_s // 4 * 4.0, seconds=23.0, every_s=1.0, mps=1.0)
    assert x_at(made.forecast, NOW_S + 33) == pytest.approx(33.0)
    made = in_massrobotics(lambda t_s: min(t_s, 23.0) // 4 * 4.0, seconds=40.0, every_s=1.0, mps=1.0)
    assert x_at(made.forecast, NOW_S + 50) == pytest.approx(20.0)


def test_a_speed_that_no_robot_has_is_not_believed_once() -> None:
    """cm/s, while the robot speeds up, so that no two reports are off by the same factor."""
    of = hall()
    for t_s in range(6):
        x, mps = 0.1 * t_s * t_s, 0.2 * t_s
        of.receive(status("A", NOW_S + t_s, x, velocity={"linear": 100.0 * mps}), NOW_S + t_s, LINE)
        assert t_s < 2 or x_at(of.robots[robot("A")].forecast, NOW_S + t_s + 5) < x + 6.0 * mps


def waiting(t_s: float, x: float, **keys: Any) -> bytes:
    return under_way(NOW_S + t_s, x, 0.0, TURN[1:], driving=False, velocity=None, **keys)


TURN = [node(0, 0.0), node(1, 10.0), node(2, 10.0, 30.0)]


@pytest.mark.parametrize(
    "keys", [{"paused": True}, {"actionStates": [{"actionId": "a", "actionType": "beep", "actionStatus": "RUNNING"}]}]
)
def test_a_robot_that_waits_by_its_words_and_drives_follows_its_order(keys: dict[str, Any]) -> None:
    of = hall()
    of.receive(factsheet(NOW_S), NOW_S, line("factsheet"))
    of.receive(order(NOW_S, TURN), NOW_S, line("order"))
    for t_s in range(8):
        of.receive(waiting(t_s, min(t_s, 6.0), **keys), NOW_S + t_s, line("state"))
        (made,) = of.robots.values()
        assert made.forecast is not None
        if t_s == 5:
            assert made.forecast.knots[-1][1] == 10.0
            assert made.forecast.knots[-1][2] > 1.0
    of.receive(waiting(8.0, 6.0, **keys), NOW_S + 8, line("state"))
    assert made.forecast is not None
    assert made.forecast.knots[-1][1:3] == (6.0, 0.0)
    assert len(made.stops) == 0


def test_observed_speeds_count_by_how_long_they_lasted() -> None:
    """A robot with a state each five seconds, and on events while it starts and brakes."""
    speeds = ObservedSpeeds(30.0, 0.5)
    for lasted_s, mps in ((0.5, 0.2), (0.5, 0.3), (5.0, 0.8), (5.0, 0.8), (0.5, 0.3), (0.5, 0.2), (0.5, 0.2)):
        speeds.add(lasted_s, mps)
    assert speeds.usual == 0.8
