"""Robots on errands do what they say that they will do, and what they are told."""

from math import pi

import numpy as np
import pytest
import shapely

from deconflict.simulation.drills.errands import PACE_MPS, STEP_S, TURN_RADPS, Errand, ErrandGroup, Visit
from deconflict.simulation.participants import ALDER, BASALT, Participant

ROUND = (Visit(5, 0), Visit(5, 5, "dock", 3.0), Visit(0, 5))
QUARTER_S = pi / 2 / TURN_RADPS


def errand() -> Errand:
    return Errand(Participant(1, ALDER), (0.0, 0.0), ROUND)


def run(party: ErrandGroup, seconds: float) -> None:
    for _ in range(round(seconds / STEP_S)):
        party.step(STEP_S)


def test_an_errand_follows_its_reported_plan() -> None:
    driven = errand()
    plan, party = driven.robot().plan, ErrandGroup([driven])
    for step in range(1, 250):
        run(party, STEP_S)
        values, _ = plan.at(np.array([step * STEP_S]))
        assert (driven.x_m, driven.y_m) == pytest.approx(tuple(values[0, :2]), abs=1e-6)
        assert driven.yaw_rad == pytest.approx(values[0, 2], abs=0.02)
    assert driven.through_s == pytest.approx(15 / PACE_MPS + 3 + 2 * QUARTER_S)
    assert driven.late_s == pytest.approx(0.0, abs=1e-6)


def test_an_instruction_is_in_the_plan_and_costs_its_time() -> None:
    driven = errand()
    comes_s = driven.comes_s("dock") or 0.0
    assert comes_s == pytest.approx(10 / PACE_MPS + QUARTER_S)
    run(ErrandGroup([driven]), 2.0)
    driven.wait(6.0)
    assert driven.comes_s("dock") == pytest.approx(comes_s + 6.0)
    driven.wait(-4.0)
    assert driven.comes_s("dock") == pytest.approx(comes_s + 2.0)
    run(ErrandGroup([driven]), 40.0)
    assert driven.late_s == pytest.approx(2.0)


def test_a_robot_that_slows_down_for_a_while_drives_as_it_plans() -> None:
    driven = errand()
    driven.slow_down(0.4, 15.0)
    plan, party = driven.robot().plan, ErrandGroup([driven])
    for step in range(1, 300):
        run(party, STEP_S)
        values, _ = plan.at(np.array([step * STEP_S]))
        assert (driven.x_m, driven.y_m) == pytest.approx(tuple(values[0, :2]), abs=1e-6)
    assert driven.late_s == pytest.approx(15.0 * (1 - 0.4 / PACE_MPS), abs=1e-6)


def test_a_robot_that_is_sent_elsewhere_stays_there_as_long() -> None:
    driven = errand()
    driven.go_instead(Visit(5, 7, "twin"))
    assert driven.comes_s("dock") is None
    run(ErrandGroup([driven]), 40.0)
    assert driven.late_s == pytest.approx(2.0 + (5**2 + 2**2) ** 0.5 - 5.0, abs=0.3)


def test_an_errand_predicts_when_its_front_enters_an_outline() -> None:
    assert errand().enters_s(shapely.box(3, -1, 4, 1)) == pytest.approx(2.5, abs=STEP_S)
    assert errand().enters_s(shapely.box(3, 2, 4, 3)) is None


def test_a_robot_stops_for_one_ahead_and_waits_for_an_occupied_place() -> None:
    ahead = Errand(Participant(2, BASALT), (3.0, 0.0), [Visit(3, 0, "dock", 20.0), Visit(3, 9)])
    behind = Errand(Participant(1, ALDER), (0.0, 0.0), [Visit(9, 0)])
    waits = Errand(Participant(3, ALDER), (0.0, 20.0), [Visit(0, 20, "other", 2.0), Visit(3, 0, "dock", 1.0)])
    party = ErrandGroup([ahead, behind, waits])
    run(party, 18.0)
    assert not ahead.body().intersects(behind.body())
    assert behind.x_m < 2.2
    assert (waits.x_m, waits.y_m) == (0.0, 20.0)
    run(party, 40.0)
    assert all(errand.through_s for errand in party.errands)
