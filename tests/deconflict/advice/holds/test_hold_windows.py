"""Held robots stand, then follow their forecasts late; they meet whom a sweep of that says."""

from dataclasses import replace
from math import pi

import numpy as np
import pytest

from deconflict.advice.holds.hold_windows import SHORT_S, DelayWindows, HoldWindow
from deconflict.sweep.geometry.knots import Knots, Robots, delayed
from deconflict.sweep.robot_slots import RobotSlots
from deconflict.sweep.slot_table import SlotTable
from ingest.batch import Forecasts
from tests.deconflict.advice.made_near import SeenRobot, near
from tests.helpers.made_encounters import NOW_S, robot

LEAVES_S, HORIZON_S, BEYOND_S = NOW_S + 1.3, 10.0, 20.0
RNG = np.random.default_rng(8)


def wandering(ends_s: float) -> Forecasts:
    """Turns at each of eight knots, from before the hold until so long after it."""
    t_s = np.sort(RNG.uniform(0.0, 1.3 + ends_s, 8))
    t_s[-1] = 1.3 + ends_s
    return replace(
        robot(t_s, RNG.uniform(-9, 9, 8), RNG.uniform(-9, 9, 8), 0.0, (1.0, 0.6)), yaw_rad=RNG.uniform(-pi, pi, 8)
    )


def late(forecasts: Forecasts, hold_s: list[float]) -> tuple[Robots, Knots]:
    table, keys = SlotTable(RobotSlots()), [str(row) for row in range(len(forecasts))]
    table.replace_forecasts(keys, forecasts)
    until = (LEAVES_S, HORIZON_S, SHORT_S, BEYOND_S)
    return delayed(*table.copied(keys), np.arange(len(hold_s)), np.array(hold_s), *until)


def pose(void: np.void, knots: Knots, t: float) -> tuple[float, float, float]:
    own = knots[void["first"] : void["first"] + void["count"]]
    knot = own[np.searchsorted(own["t"], t, "right") - 1]
    into = t - knot["t"]
    return knot["x"] + knot["vx"] * into, knot["y"] + knot["vy"] * into, knot["yaw"] + knot["turn"] * into


def said(forecast: Forecasts, t: float) -> tuple[float, float, float]:
    """The pose by interpolation."""
    x_m, y_m = (float(np.interp(t, forecast.t_s, column)) for column in (forecast.x_m, forecast.y_m))
    yaw_rad = float(np.interp(t, forecast.t_s, np.unwrap(forecast.yaw_rad)))
    return x_m, y_m, yaw_rad


def test_a_held_robot_stands_and_then_follows_its_forecast_late() -> None:
    forecasts = [wandering(HORIZON_S + 5.0) for _ in range(6)]
    hold_s = [0.0, 0.5, 3.0, 7.5, 0.0, 15.0]
    robots, knots = late(Forecasts.joined(forecasts), hold_s)
    assert robots["appears"].tolist() == [LEAVES_S] * 6
    for each, forecast, hold in zip(robots, forecasts, hold_s, strict=True):
        for t in np.linspace(LEAVES_S, LEAVES_S + HORIZON_S + hold, 50):
            x, y, yaw = said(forecast, max(LEAVES_S, t - hold))
            then = pose(each, knots, t)
            assert then[:2] == pytest.approx((x, y), abs=1e-5)
            assert (then[2] - yaw + pi) % (2 * pi) - pi == pytest.approx(0.0, abs=1e-5)


@pytest.mark.parametrize(("short_s", "stands"), [(SHORT_S / 2, False), (SHORT_S * 2, True)])
def test_a_forecast_that_ends_shortly_before_the_horizon_is_extrapolated(short_s: float, stands: bool) -> None:
    forecast = wandering(HORIZON_S - short_s)
    (found,), knots = late(forecast, [2.0])
    end_s, after_s = float(forecast.t_s[-1]) + 2.0, 5.0
    speed = (forecast.x_m[-1] - forecast.x_m[-2]) / (forecast.t_s[-1] - forecast.t_s[-2])
    goes_m = 0.0 if stands else speed * after_s
    assert pose(found, knots, end_s + after_s)[0] == pytest.approx(forecast.x_m[-1] + goes_m, abs=1e-4)


def test_a_robot_that_cannot_be_swept_meets_nobody() -> None:
    crossing = [robot([0, 8], [-4, 4], [0, 0], 0.0, (1.0, 0.6)), robot([0, 8], [0, 0], [-4, 4], 1.6, (1.0, 0.6))]
    forecasts = [*crossing, replace(crossing[1], width_m=np.array([np.nan]))]
    robots = [SeenRobot(name, forecast) for name, forecast in zip("abc", forecasts, strict=True)]
    delays = DelayWindows(near(robots), HoldWindow(NOW_S, 10, 0.3, 2))
    assert delays.contacts_s({}, "abc").keys() == {("a", "b")}
    none, every = delays.allowed([("a", "b"), ("a", "c")])
    assert sum(none) < sum(every) == 9


def test_the_contacts_of_some_robots_are_theirs_among_all_contacts() -> None:
    names, window = "abcdef", HoldWindow(NOW_S + 0.5, HORIZON_S, 0.5, 4.0)
    delays = DelayWindows(near([SeenRobot(name, wandering(HORIZON_S)) for name in names]), window)
    for held_s in ({}, {"b": 1.5, "e": 4.0}):
        every = delays.contacts_s(held_s, names)
        some = delays.contacts_s(held_s, "bd")
        assert some == {pair: at_s for pair, at_s in every.items() if not {"b", "d"}.isdisjoint(pair)}
        assert 0 < len(some) < len(every)
