from math import nan, pi

import pytest
from msgspec.structs import replace

from ingest.fleet.prediction.forecast_model import Sighting
from ingest.fleet.prediction.plausibility import frequency, reconcile

BEFORE = Sighting(100.0, 0, 0.0, 0.0, 0.0, 1.0)
AFTER = Sighting(101.0, 0, 1.0, 0.0, 0.0, 1.0)


def test_motion_that_agrees_is_left_alone() -> None:
    assert reconcile(BEFORE, AFTER) == (AFTER, ())


def test_the_first_sighting_has_nothing_to_contradict() -> None:
    assert reconcile(None, AFTER) == (AFTER, ())


def test_a_speed_without_sign_gets_the_sign_of_the_motion() -> None:
    backing = replace(AFTER, yaw_rad=pi)
    mended, findings = reconcile(BEFORE, backing)
    assert mended.linear_mps == -1.0
    assert findings == ("speed-sign-lost",)


def test_a_heading_across_the_motion_is_found() -> None:
    _, findings = reconcile(BEFORE, replace(AFTER, yaw_rad=pi / 2))
    assert findings == ("heading-contradicts-motion",)


def test_an_unknown_heading_is_the_direction_of_travel() -> None:
    mended, _ = reconcile(BEFORE, replace(AFTER, x_m=0.0, y_m=1.0, yaw_rad=nan))
    assert mended.yaw_rad == pytest.approx(pi / 2)


def test_an_unknown_heading_stays_while_the_robot_stands() -> None:
    mended, _ = reconcile(replace(BEFORE, yaw_rad=0.7), replace(AFTER, x_m=0.0, yaw_rad=nan))
    assert mended.yaw_rad == 0.7


def test_a_speed_that_was_not_sent_is_the_observed_one() -> None:
    mended, _ = reconcile(BEFORE, replace(AFTER, linear_mps=None))
    assert mended.linear_mps == pytest.approx(1.0)
    backing, _ = reconcile(BEFORE, replace(AFTER, yaw_rad=pi, linear_mps=None))
    assert backing.linear_mps == pytest.approx(-1.0)


@pytest.mark.parametrize(("turn_radps", "yaw_rad", "kept"), [(0.4, 0.4, True), (1.5, 0.0, False), (9.0, 0.0, False)])
def test_a_turn_rate_that_contradicts_the_headings_is_ignored(turn_radps: float, yaw_rad: float, kept: bool) -> None:
    mended, findings = reconcile(BEFORE, replace(AFTER, turn_radps=turn_radps, yaw_rad=yaw_rad))
    assert mended.turn_radps == (turn_radps if kept else 0.0)
    assert ("turn-rate-contradicts-motion" in findings) is not kept


@pytest.mark.parametrize("change", [{"t_s": 200.0}, {"floor": 1}, {"t_s": 100.0}])
def test_sightings_too_far_apart_are_not_compared(change: dict[str, float]) -> None:
    later = replace(AFTER, yaw_rad=pi, **change)
    assert reconcile(BEFORE, later) == (later, ())


def test_too_frequent_and_too_rare_statuses_are_found() -> None:
    assert frequency(0.5, 30.0) == ("status-too-frequent",)
    assert frequency(1.0, 30.0) == frequency(29.0, 30.0) == ()
    assert frequency(31.0, 30.0) == ("status-too-rare",)
