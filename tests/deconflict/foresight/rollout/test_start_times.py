"""When robots start that stand although their forecasts go at once."""

import numpy as np
import pytest

from deconflict.foresight.forecast_errors.error_ledger import ForecastKind
from deconflict.foresight.rollout.start_times import LATE_S, STOOD_S, StartTimes
from ingest.batch import Basis, Bools, Floats

NOW_S = 1_790_000_000.0


FREE, BLOCKED = np.array([False]), np.array([True])


def weights(start_times: StartTimes, kind: int, stood_s: float, blocked: Bools = FREE) -> Floats:
    (row,) = start_times.weights(np.array([kind]), blocked, np.array([stood_s]))
    return np.asarray(row)


def waited(start_times: StartTimes, kind: int, lasts_s: int, robots: int) -> None:
    """Record robots of a kind that stand for `lasts_s` seconds and then start."""
    for robot in range(robots):
        for second in range(lasts_s):
            started = np.array([float(second == lasts_s - 1)])
            start_times.record(np.array([kind]), FREE, np.array([float(second)]), np.ones(1), started, NOW_S + robot)


def test_delays_are_a_distribution_and_long_waits_are_longer_still() -> None:
    fresh, long = weights(StartTimes(), 0, 0.5), weights(StartTimes(), 0, 30.0)
    assert (fresh >= 0).all()
    assert fresh.sum() == pytest.approx(1.0)
    assert long.sum() == pytest.approx(1.0)
    assert long @ LATE_S > 1.5 * (fresh @ LATE_S)


def test_a_blocked_robot_starts_later() -> None:
    assert weights(StartTimes(), 0, 0.5, BLOCKED) @ LATE_S > 2 * (weights(StartTimes(), 0, 0.5) @ LATE_S)


def test_parts_of_the_delay_agree_with_its_distribution() -> None:
    """Half of those that stood for 2 s start within the median delay."""
    start_times, part = StartTimes(), np.array([[0.2], [0.5], [0.9]])
    waited(start_times, 0, 6, 40)
    late_s = start_times.late_s(np.array([0]), np.array([2.0]), part)[:, 0]
    per_s = start_times.per_s(np.array([0]), FREE)[0]
    grid_s = np.arange(2.0, 300.0, 0.01)
    hazard = np.cumsum(per_s[np.searchsorted(STOOD_S, grid_s, side="right") - 1]) * 0.01
    expected_s = [np.interp(-np.log(1 - each), hazard, grid_s - 2.0) for each in part[:, 0]]
    assert late_s == pytest.approx(expected_s, abs=0.03)


def test_each_kind_is_learned_apart_and_drawn_towards_all_kinds() -> None:
    start_times = StartTimes()
    waited(start_times, 0, 2, 200)
    waited(start_times, 1, 15, 60)
    quick, slow, unknown = (float(weights(start_times, kind, 1.0) @ LATE_S) for kind in (0, 1, 2))
    assert quick < unknown < slow


def test_a_kind_that_does_not_count_for_all_is_learned_for_itself_alone() -> None:
    kinds = {ForecastKind(vendor, "", Basis.PATH): row for row, vendor in enumerate(("Alder", "Mallory", "Corvid"))}
    start_times, alone = (StartTimes(kinds, lambda vendor: vendor != "Mallory") for _ in range(2))
    for each in (start_times, alone):
        waited(each, 0, 2, 200)
    waited(start_times, 1, 15, 60)
    for kind in (0, 2):
        assert weights(start_times, kind, 1.0) == pytest.approx(weights(alone, kind, 1.0), abs=1e-3)
    assert weights(start_times, 1, 1.0) @ LATE_S > 1.5 * (weights(alone, 1, 1.0) @ LATE_S)
