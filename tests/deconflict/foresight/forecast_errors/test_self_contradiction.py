"""Robots compared with the ways that they state."""

import numpy as np
import pytest

from deconflict.foresight.forecast_errors.self_contradiction import (
    AHEAD_S,
    DOUBTED_MPS,
    KEEPS,
    SLACK_M,
    SLACK_SHARE,
    blank_records,
    compare_with_stated_ways,
    straight_on,
)
from ingest.batch import Basis, Forecasts, Ints
from tests.deconflict.foresight.probability.made_stage import Stage, Walk
from tests.helpers.made_encounters import robot

SLOT = np.array([1])


def contradicting(ways: np.ndarray, forecasts: Forecasts) -> Ints:
    f = forecasts
    return compare_with_stated_ways(ways, SLOT, f.start, f.t_s, f.x_m, f.y_m, f.floor)


def forecast(t_s: float, x_m: float, y_m: float, says: tuple[float, float], every_s: float = 1.0) -> Forecasts:
    ahead_s = np.arange(0.0, 11.0, every_s)
    return robot(
        (t_s + ahead_s).tolist(),
        (x_m + ahead_s * says[0]).tolist(),
        (y_m + ahead_s * says[1]).tolist(),
        0.0,
        (1.0, 0.5),
    )


def walked(does: tuple[float, float], says: tuple[float, float], seconds: int, every_s: float = 1.0) -> list[bool]:
    """Whether the robot's forecast is replaced, report by report."""
    ways = blank_records(3)
    times_s = np.arange(0.0, seconds, every_s).tolist()
    return [len(contradicting(ways, forecast(t_s, does[0] * t_s, does[1] * t_s, says))) > 0 for t_s in times_s]


@pytest.mark.parametrize("every_s", [0.1, 1.0, 2.0])
@pytest.mark.parametrize("says", [(0.0, 0.0), (-1.0, 0.0), (0.0, 1.0)])
def test_the_forecast_of_a_robot_that_goes_elsewhere_is_replaced_after_a_few_reports(
    says: tuple[float, float], every_s: float
) -> None:
    aside = walked((1.0, 0.0), says, 12, every_s)
    assert not any(aside[: int(2 / every_s) + 1])
    assert all(aside[int(8 / every_s) :])


@pytest.mark.parametrize(
    ("does", "says"),
    [((1.0, 0.0), (1.0, 0.0)), ((0.4, 0.0), (1.5, 0.0)), ((1.5, 0.0), (0.8, 0.0)), ((1.0, 0.3), (1.0, 0.0))],
    ids=["true", "slow", "fast", "beside"],
)
def test_a_robot_on_its_way_is_believed_at_any_delay(does: tuple[float, float], says: tuple[float, float]) -> None:
    assert not any(walked(does, says, 30))


def test_points_far_apart_in_time_state_no_way() -> None:
    ways = blank_records(2)
    aside = [len(contradicting(ways, forecast(float(t), float(t), 0.0, (-1.0, 0.0)))) for t in range(8)]
    assert aside[-1] == 1
    aside = [
        len(contradicting(ways, forecast(float(t), float(t), 0.0, (-1.0, 0.0), every_s=5.0))) for t in range(8, 16)
    ]
    assert aside == [1, 1, 0, 0, 0, 0, 0, 0]
    standing = [
        len(contradicting(ways, forecast(float(t), float(t), 0.0, (0.0, 0.0), every_s=5.0))) for t in range(16, 24)
    ]
    assert standing[-1] == 1


def test_a_robot_that_waits_although_it_says_that_it_goes_is_believed() -> None:
    assert not any(walked((0.0, 0.0), (1.0, 0.0), 30))


def test_a_contradiction_is_the_distance_from_the_stated_way_over_the_allowed_one() -> None:
    ways = blank_records(2)
    turning = robot([0.0, 1.0, 2.0, 3.0], [0.0, 1.0, 1.0, 1.0], [0.0, 0.0, 1.0, 2.0], 0.0, (1.0, 0.5))
    contradicting(ways, turning)
    contradicting(ways, forecast(1.0, 1.3, 0.6, (0.0, 1.0)))
    allowed_m = SLACK_M + SLACK_SHARE * np.hypot(1.3, 0.6)
    assert ways["contradiction"][1] == pytest.approx((1 - KEEPS) * 0.3 / allowed_m)
    assert ways["way_m"][1, :, 1] == pytest.approx(0.6 + np.array(AHEAD_S))
    assert (ways["x_mps"][1], ways["y_mps"][1]) == pytest.approx((1.3, 0.6))
    assert np.isneginf(ways["at_s"][0])


def test_a_robot_that_stands_or_was_away_is_believed_again() -> None:
    ways = blank_records(2)
    aside = [len(contradicting(ways, forecast(float(t), float(t), 0.0, (-1.0, 0.0)))) for t in range(8)]
    assert aside[-1] == 1
    slow_m = 7.0 + 0.9 * DOUBTED_MPS
    assert len(contradicting(ways, forecast(8.0, slow_m, 0.0, (-1.0, 0.0)))) == 0
    assert len(contradicting(ways, forecast(9.0, slow_m + 1.0, 0.0, (-1.0, 0.0)))) == 1
    assert len(contradicting(ways, forecast(60.0, 70.0, 0.0, (-1.0, 0.0)))) == 0


def test_replaced_forecasts_go_straight_on_and_the_others_stay() -> None:
    stage = Stage({"a": Walk((0.0, 0.0), (1.0, 0.0)), "b": Walk((0.0, 9.0), (0.5, 0.0), (-0.5, 0.0))})
    batch = stage.batch(0.0)
    ways = blank_records(2)
    ways["x_mps"][1], ways["y_mps"][1] = 0.5, 0.25
    believed = straight_on(batch, np.array([1]), np.array([1]), ways, 10.0)
    assert believed.basis.tolist() == [Basis.PATH, Basis.VELOCITY]
    a, b, forecasts = believed.forecasts.single(0), believed.forecasts.single(1), batch.forecasts
    assert a.x_m.tolist() == forecasts.single(0).x_m.tolist()
    assert (b.x_m.tolist(), b.y_m.tolist()) == ([0.0, 5.0], [9.0, 11.5])
    assert (b.t_s - forecasts.single(1).t_s[0]).tolist() == [0.0, 10.0]
    assert (b.length_m.tolist(), b.yaw_rad.tolist()) == (
        forecasts.single(1).length_m.tolist(),
        [forecasts.single(1).yaw_rad[0]] * 2,
    )


def test_two_robots_that_wrongly_say_they_stand_are_predicted_to_meet_and_distrusted() -> None:
    stage = Stage({"a": Walk((-12.0, 0.0), (1.0, 0.0), (0.0, 0.0)), "b": Walk((12.0, 0.0), (-1.0, 0.0), (0.0, 0.0))})
    by_step = stage.run(9)
    assert by_step[2].get(("a", "b"), 0.0) < 0.1
    assert by_step[8]["a", "b"] > 0.5
    assert [name for name in ("a", "b") if stage.foresight.is_distrusted(name)] == ["a", "b"]
