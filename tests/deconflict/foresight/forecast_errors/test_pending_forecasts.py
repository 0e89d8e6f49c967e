"""Forecasts compared with the next reports of the same robot."""

import time
from dataclasses import replace
from itertools import combinations
from math import pi

import numpy as np
import pytest

from deconflict.foresight.forecast_errors.error_ledger import HORIZONS
from deconflict.foresight.forecast_errors.pending_forecasts import (
    TRACK_LOOKS,
    TRACK_S,
    PendingForecasts,
    ReportedTracks,
)
from deconflict.foresight.forecast_errors.track_kernels import ROBOT, Errors
from deconflict.foresight.forecast_errors.upper_quantiles import BINS, bins
from deconflict.sweep.geometry.pose import poses_at
from ingest.batch import Forecasts
from tests.helpers.made_encounters import NOW_S, robot

BANDS_M = np.ones((1, HORIZONS, 3))


def straight(t_s: float, x_m: float, y_m: float, speed_mps: float, yaw_rad: float = 0.0) -> Forecasts:
    """A forecast that goes straight for 20 s."""
    far = (x_m + 20 * speed_mps * np.cos(yaw_rad), y_m + 20 * speed_mps * np.sin(yaw_rad))
    return robot([t_s - NOW_S, t_s - NOW_S + 20], [x_m, far[0]], [y_m, far[1]], yaw_rad, (1.0, 0.5))


def add_report(pending: PendingForecasts, forecast: Forecasts, slot: int = 0) -> Errors:
    pending.grow(slot + 1)
    event_s = forecast.t_s[:1]
    sizes_m = (np.zeros(1), forecast.length_m, forecast.width_m)
    reports = ReportedTracks(
        np.array([slot]), np.array([0]), event_s, *sizes_m, poses_at(forecast, event_s, TRACK_LOOKS)
    )
    errors, _ = pending.add_reports(np.zeros(slot + 1, ROBOT), np.zeros((2, slot + 1)), reports, BANDS_M)
    return errors


def run(course: list[tuple[float, float]], says_mps: float, yaw_rad: float = 0.0, every_s: float = 1.0) -> list[Errors]:
    pending = PendingForecasts()
    return [
        add_report(pending, straight(NOW_S + n * every_s, x_m, y_m, says_mps, yaw_rad))
        for n, (x_m, y_m) in enumerate(course)
    ]


def test_a_robot_that_does_what_it_says_has_no_error() -> None:
    by_step = run([(0.8 * n, 0.0) for n in range(14)], 0.8)
    assert len(by_step[0]) == 0
    assert [len(values) for values in by_step[1:]] == [min(n, HORIZONS) for n in range(1, 14)]
    assert max(numbers["radial_m"].max() for numbers in by_step[1:]) < 1e-6


def test_one_that_is_slower_falls_behind_along_its_heading_by_the_horizon() -> None:
    last = run([(0.0, 0.5 * n) for n in range(12)], 0.8, yaw_rad=pi / 2)[-1]
    assert sorted(last["horizon_s"].tolist()) == list(range(1, HORIZONS + 1))
    assert last["along_m"] == pytest.approx(-0.3 * last["horizon_s"])
    assert last["across_m"] == pytest.approx(0, abs=1e-6)


def test_one_that_veers_to_the_left_is_off_across() -> None:
    last = run([(0.8 * n, 0.1 * n) for n in range(4)], 0.8)[-1]
    assert last["across_m"] == pytest.approx(0.1 * last["horizon_s"])


def test_sizes_are_counted_in_the_bins_of_the_sketch() -> None:
    rng = np.random.default_rng(6)
    course = np.cumsum(rng.normal(0, 1, (60, 2)) * np.geomspace(1e-5, 1e3, 60)[:, None], axis=0)
    shown = np.concatenate(run([(x_m, y_m) for x_m, y_m in course.tolist()], 0.0))
    assert shown["radial_m"] == pytest.approx(np.hypot(shown["along_m"], shown["across_m"]))
    for name in ("radial", "along", "across"):
        assert shown[f"{name}_bin"].tolist() == bins(np.abs(shown[f"{name}_m"])).tolist()
    assert set(shown["radial_bin"].tolist()) > set(range(0, BINS, BINS - 1))


def test_robots_stand_by_their_forecasts_or_their_last_two_reports() -> None:
    """A track that is not finite is left out."""
    pending, robots = PendingForecasts(), np.zeros(3, ROBOT)
    pending.grow(3)
    found = []
    for n in range(2):
        forecasts = [
            straight(NOW_S + n, 0.0, 0.0, 0.8),
            straight(NOW_S + n, 0.8 * n, 0.0, 0.0),
            straight(NOW_S + n, 0.8 * n, 0.0, 0.8),
        ]
        since_s = np.array([NOW_S + n] * 3)
        track = poses_at(Forecasts.joined(forecasts), since_s, TRACK_LOOKS)
        alike = np.ones(3)
        reports = ReportedTracks(np.arange(3), np.array([0, 0, 0]), since_s, alike / 5, alike, alike / 2, track)
        half = np.zeros((2, 3))
        found.append(pending.add_reports(robots, half, reports, BANDS_M)[1].tolist())
        assert half.tolist() == [[0.5] * 3, [0.25] * 3]
    assert found == [[False, True, False], [True, True, False]]
    assert robots["rests"].tolist() == [False, True, False]
    track[:, 5, 0] = np.nan
    _, stands = pending.add_reports(robots, half, reports._replace(event_s=since_s + 1, track=track), BANDS_M)
    assert not stands.any()
    assert pending.newest[:, 0].tolist() == since_s.tolist()


def test_reports_between_whole_seconds_are_joined() -> None:
    by_step = run([(0.7 * n, 0.0) for n in range(10)], 1.0, every_s=0.7)
    assert sum(map(len, by_step)) > 8
    for numbers in by_step:
        assert numbers["along_m"] == pytest.approx(0, abs=1e-6)


def test_a_gap_in_the_reports_gives_no_error() -> None:
    pending = PendingForecasts()
    add_report(pending, straight(NOW_S, 0.0, 0.0, 1.0))
    assert len(add_report(pending, straight(NOW_S + 5, 2.0, 0.0, 1.0))) == 0


def test_a_repeated_report_counts_once() -> None:
    pending = PendingForecasts()
    add_report(pending, straight(NOW_S, 0.0, 0.0, 1.0))
    again = straight(NOW_S + 1, 1.0, 0.0, 1.0)
    assert [len(add_report(pending, again)), len(add_report(pending, again))] == [1, 0]


def test_a_report_that_is_older_than_the_newest_is_left_out() -> None:
    pending, punctual = PendingForecasts(), PendingForecasts()
    by_step = [straight(NOW_S + n, 0.8 * n, 0.0, 1.0) for n in range(5)]
    for forecasts in by_step[:4]:
        add_report(pending, forecasts)
        add_report(punctual, forecasts)
    assert len(add_report(pending, straight(NOW_S + 1.5, 9.0, 9.0, 1.0))) == 0
    assert pending.newest[0, 0] == NOW_S + 3
    late, expected = add_report(pending, by_step[4]), add_report(punctual, by_step[4])
    assert len(expected) == 4
    for name in ("along_m", "horizon_s"):
        assert late[name].tolist() == expected[name].tolist()


def test_another_robot_in_a_slot_has_no_pending_forecasts() -> None:
    pending = PendingForecasts()
    add_report(pending, straight(NOW_S, 0.0, 0.0, 1.0))
    pending.forget(np.array([0]))
    assert len(add_report(pending, straight(NOW_S + 1, 9.0, 0.0, 1.0))) == 0


def test_each_pair_that_comes_near_at_a_whole_second_is_found_once() -> None:
    """On random ways, with reports of different ages; of two robots one that waits may stay where it was reported."""
    pending, rng, robots = PendingForecasts(), np.random.default_rng(4), 60
    t_s, forecasts = [float(n) for n in range(0, 24, 2)], []
    for slot in range(robots):
        x_m, y_m = (np.cumsum(rng.normal(0, 1.5, (2, len(t_s))), axis=1) + rng.uniform(-25, 25, (2, 1))).tolist()
        forecasts.append(robot([t - slot % 5 for t in t_s], x_m, y_m, 0.0, (1.0, 0.5)))
        add_report(pending, forecasts[-1], slot)
    slots, result, reach_m = np.arange(robots - 2), np.arange(robots) % 3 == 0, rng.uniform(0.2, 1.5, robots)
    rank, waits = rng.permutation(robots), rng.random(robots) < 0.25
    found = pending.candidate_pairs(result, np.zeros(robots, bool), waits, slots, rank, reach_m, NOW_S + 1.3, 10.0)
    until_s = np.array([forecast.t_s[0] for forecast in forecasts])[:, None] + TRACK_S
    at_s = np.minimum(NOW_S + 1.3 + np.arange(11.0), until_s)
    way = np.concatenate([poses_at(forecasts, s[:1], s - s[0]) for forecasts, s in zip(forecasts, at_s, strict=True)])[
        ..., :2
    ]
    step_m = np.hypot(*np.diff(way, axis=1).transpose(2, 0, 1)).max(axis=1)
    reported = np.array([[forecast.x_m[0], forecast.y_m[0]] for forecast in forecasts])[:, None]
    stay = np.where(waits[:, None, None], reported, way)
    near = {
        (a, b)
        for a, b in combinations(slots.tolist(), 2)
        for ways in ((way[a], way[b]), (stay[a], stay[b]) if waits[a] != waits[b] else (way[a], way[b]))
        if (result[a] or result[b])
        and (np.hypot(*(ways[0] - ways[1]).T) <= reach_m[a] + reach_m[b] + (step_m[a] + step_m[b]) / 2).any()
    }
    assert sorted((min(pair), max(pair)) for *pair, _ in found.tolist()) == sorted(near)
    assert np.all(rank[found[:, 0]] < rank[found[:, 1]])
    assert 20 < len(near) < robots * robots / 5


def test_robots_on_different_floors_do_not_come_near() -> None:
    pending = PendingForecasts()
    for slot, floor in enumerate((0, 1, -1, -1)):
        there = straight(NOW_S, 0.0, 0.0, 0.0)
        add_report(pending, replace(there, floor=np.full(2, floor)), slot)
    args = (np.ones(4, bool), np.zeros(4, bool), np.zeros(4, bool), np.arange(4), np.arange(4), np.ones(4), NOW_S, 10.0)
    assert pending.candidate_pairs(*args).tolist() == []
    add_report(pending, straight(NOW_S + 1, 0.0, 0.0, 0.0), 1)
    assert sorted(pending.candidate_pairs(*args)[0, :2].tolist()) == [0, 1]


def test_of_robots_that_rest_no_forecasts_are_kept_and_a_robot_that_is_back_begins_anew() -> None:
    pending = PendingForecasts()
    for slot in range(60):
        add_report(pending, straight(NOW_S, float(slot), 0.0, 1.0), slot)
        pending.rest(np.array([slot]))
    assert len(pending.history.forecast) < 20
    assert pending.newest[:, 1].tolist() == list(range(60))
    assert len(add_report(pending, straight(NOW_S + 1, 9.0, 0.0, 1.0), 3)) == 0
    assert len(add_report(pending, straight(NOW_S + 2, 9.5, 0.0, 1.0), 3)) == 1


def test_robots_on_no_floor_cost_as_little_as_robots_that_are_far_from_each_other() -> None:
    """A fleet whose floors the site does not know may report all its robots from one place."""

    def cost_s(floor: int, apart_m: float) -> float:
        pending, robots = PendingForecasts(), 3000
        there = replace(straight(NOW_S, 0.0, 0.0, 0.0), floor=np.full(2, floor))
        add_report(pending, there, robots - 1)
        for name in ("newest", "track", "around"):
            column = getattr(pending.history, name)
            column[:] = column[-1]
        away_m = apart_m * np.arange(robots)
        pending.history.newest[:, 1], pending.history.around[:, 0] = away_m, away_m
        pending.history.track[:, :, 0] = away_m[:, None]
        news, none, slots = np.ones(robots, bool), np.zeros(robots, bool), np.arange(robots)
        costs_s = []
        for _ in range(4):
            begun_s = time.thread_time()
            assert not len(pending.candidate_pairs(news, none, none, slots, slots, np.ones(robots), NOW_S, 10.0))
            costs_s.append(time.thread_time() - begun_s)
        return min(costs_s)

    assert cost_s(-1, 0.0) < 5 * cost_s(0, 20.0)
