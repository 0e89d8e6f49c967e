from math import nan, pi

import pytest
from msgspec.structs import replace

from ingest.fleet.prediction.forecast_model import Sighting
from ingest.fleet.prediction.plausibility import frequency, reconcile

BEFORE = Sighting(100.0, 0, 0.0, 0.0, 0.0, 1.0)
AFTER = Sighting(101.0, 0, 1.0, 0.0, 0.0, 1.0, is_driving=True)


def test_motion_that_agrees_is_left_alone() -> None:
    assert reconcile(BEFORE, AFTER) == (replace(AFTER, interval_s=1.0, moves_anyway=True), ())


def test_the_first_sighting_has_nothing_to_contradict() -> None:
    assert reconcile(None, AFTER) == (AFTER, ())


@pytest.mark.parametrize(("gap_s", "yaw_rad"), [(10.0, 0.0), (30.0, nan)])
def test_a_robot_that_reports_its_position_alone_and_seldom_drives_as_it_was_displaced(
    gap_s: float, yaw_rad: float
) -> None:
    before = replace(BEFORE, linear_mps=None, yaw_rad=yaw_rad)
    now = replace(AFTER, t_s=100.0 + gap_s, x_m=1.2 * gap_s, linear_mps=None, yaw_rad=yaw_rad)
    mended, findings = reconcile(before, now)
    assert mended.linear_mps == pytest.approx(1.2)
    assert mended.yaw_rad == 0.0
    assert (mended.interval_s, mended.is_driving, findings) == (gap_s, True, ())


def test_a_speed_of_zero_that_the_positions_contradict_twice_is_the_observed_one() -> None:
    said_still = replace(AFTER, linear_mps=0.0)
    assert reconcile(BEFORE, said_still)[0].linear_mps == 0.0
    mended, findings = reconcile(replace(BEFORE, linear_mps=0.0), said_still)
    assert mended.linear_mps == pytest.approx(1.0)
    assert findings == ("speed-contradicts-motion",)
    again, _ = reconcile(mended, replace(said_still, t_s=102.0, x_m=2.0))
    assert again.linear_mps == pytest.approx(1.0)
    still, _ = reconcile(again, replace(said_still, t_s=103.0, x_m=2.0))
    assert (still.linear_mps, still.is_driving) == (0.0, False)


@pytest.mark.parametrize(
    ("before_mps", "now_mps", "moved_m", "is_driving"),
    [
        (0.5, 0.5, 0.5, True),
        (0.0, 0.5, 0.3, True),
        (0.5, 0.0, 0.3, False),
        (0.0, 0.5, 0.0, False),
        (0.0, 0.05, 0.05, False),
    ],
)
def test_a_robot_drives_if_two_reports_say_so(
    before_mps: float, now_mps: float, moved_m: float, is_driving: bool
) -> None:
    mended, _ = reconcile(replace(BEFORE, linear_mps=before_mps), replace(AFTER, linear_mps=now_mps, x_m=moved_m))
    assert mended.is_driving is is_driving


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
