"""Knots and velocities against the oracle's tracks, and the reasons for invalid forecasts."""

import dataclasses
from math import inf, nan, pi

import numpy as np
import pytest

from deconflict.sweep.geometry.knots import KNOT, ROBOT, Knots, faults, replace
from ingest.batch import Forecasts
from ingest.shapes import Shape, shapes_of
from tests.helpers.made_encounters import FAMILIES, encounters, robot
from tests.helpers.oracle import Track

SQUARE = (1.0, 1.0)
BOW_TIE = Shape.polygon([(0, 0), (1, 1), (1, 0), (0, 1)])


def knots_of(forecasts: Forecasts) -> Knots:
    made, robots = np.zeros(len(forecasts.t_s), KNOT), np.zeros(len(forecasts), ROBOT)
    assert replace(robots, made, np.arange(len(forecasts)), 0, forecasts) == len(made)
    return made


@pytest.mark.parametrize("family", FAMILIES)
def test_knots_go_on_just_as_the_forecast_says(family: str) -> None:
    forecasts = encounters(family, 8, 61, 0.25)
    knots = knots_of(forecasts)
    for row in range(len(forecasts)):
        own = knots[forecasts.start[row] : forecasts.start[row + 1]]
        until = np.append(own["t"][1:], own["t"][-1] + 5.0)
        on_floor, pose0, pose1 = Track(forecasts, row).between(own["t"], until)
        np.testing.assert_array_equal(own["floor"], on_floor)
        np.testing.assert_array_equal(own["reported_yaw"], forecasts.single(row).yaw_rad)
        span = until - own["t"]
        for axis, (at, rate) in enumerate((("x", "vx"), ("y", "vy"))):
            np.testing.assert_allclose(own[at], pose0[:, axis], atol=1e-5)
            np.testing.assert_allclose(own[at] + own[rate] * span, pose1[:, axis], atol=1e-5)
        for yaw, true in ((own["yaw"], pose0[:, 2]), (own["yaw"] + own["turn"] * span, pose1[:, 2])):
            np.testing.assert_allclose(np.exp(1j * yaw), np.exp(1j * true), atol=1e-5)


def test_a_heading_turns_along_the_shorter_arc() -> None:
    knots = knots_of(robot([0, 2], [0, 0], [0, 0], [pi - 0.1, -pi + 0.1], SQUARE))
    assert knots["turn"][0] == pytest.approx(0.1)


def test_a_robot_stands_after_its_last_knot_and_where_its_floor_changes() -> None:
    knots = knots_of(robot([0, 2, 4], [0, 1, 5], [0, 0, 2], 0, SQUARE, floor=[0, 0, 1]))
    assert knots["vx"].tolist() == [0.5, 0, 0]
    assert knots["vy"].tolist() == [0, 0, 0]


def test_robots_have_half_the_sides_of_their_envelopes_and_their_own_knots() -> None:
    f = encounters(next(iter(FAMILIES)), 8, 61, 0.25)
    counts, half_m = np.diff(f.start), np.stack([f.length_m, f.width_m]) / 2
    radius_m = np.sqrt(half_m[0] * half_m[0] + half_m[1] * half_m[1])
    no_shape = np.zeros(len(f)), *np.zeros((2, len(f)), np.int64)
    columns = (*half_m, radius_m, f.bottom_m, f.top_m, f.t_s[f.start[:-1]], f.start[:-1], counts, *no_shape)
    kept = np.zeros(len(f), ROBOT)
    replace(kept, np.zeros(len(f.t_s), KNOT), np.arange(len(f)), 0, f)
    assert kept.tolist() == list(zip(*(column.tolist() for column in columns), strict=True))


def test_nothing_is_written_if_there_is_no_room() -> None:
    f = encounters(next(iter(FAMILIES)), 8, 61, 0.25)
    kept, knots = np.zeros(len(f), ROBOT), np.zeros(len(f.t_s) + 4, KNOT)
    assert replace(kept, knots, np.arange(len(f)), 5, f) == len(knots) + 1
    assert not kept["count"].any()
    assert not knots["t"].any()


@pytest.mark.parametrize(
    ("reason", "wrong"),
    [
        ("no-knots", robot([], [], [], [], SQUARE)),
        ("not-finite", robot([0, nan], [0, 0], [0, 0], 0, SQUARE)),
        ("not-finite", robot([0], [inf], [0], 0, SQUARE)),
        ("not-finite", robot([0], [0], [nan], 0, SQUARE)),
        ("not-finite", robot([0], [0], [0], -inf, SQUARE)),
        ("times-not-increasing", robot([0, 0], [0, 1], [0, 0], 0, SQUARE)),
        ("times-not-increasing", robot([0, 2, 1], [0, 1, 2], [0, 0, 0], 0, SQUARE)),
        ("out-of-range", robot([0], [2e8], [0], 0, SQUARE)),
        ("out-of-range", robot([0], [0], [0], 2e6, SQUARE)),
        ("out-of-range", robot([0], [0], [0], 0, (1, 2e8))),
        ("size-not-positive", robot([0], [0], [0], 0, (0, 1))),
        ("size-not-positive", robot([0], [0], [0], 0, (1, -1))),
        ("size-not-finite", robot([0], [0], [0], 0, (1, nan))),
        ("size-not-finite", robot([0], [0], [0], 0, (inf, 1))),
        ("heights-not-ordered", robot([0], [0], [0], 0, SQUARE, height=(1, 0.5))),
        ("heights-not-ordered", robot([0], [0], [0], 0, SQUARE, height=(nan, 1))),
        ("shape-not-valid", dataclasses.replace(robot([0], [0], [0], 0, SQUARE), shapes=shapes_of([BOW_TIE]))),
    ],
)
def test_what_is_wrong_with_a_forecast_is_named(reason: str, wrong: Forecasts) -> None:
    good = robot([0, 1], [0, 1], [0, 0], 0, SQUARE, height=(-inf, inf))
    assert faults(Forecasts.joined([good, wrong, good])) == {1: reason}


def test_valid_forecasts_have_no_faults() -> None:
    for family in FAMILIES:
        assert faults(encounters(family, 10, 62, 0.25)) == {}
    assert faults(Forecasts.empty()) == {}
