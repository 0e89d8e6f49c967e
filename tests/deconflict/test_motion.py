from math import floor, inf, nan, pi

import numpy as np
import pytest

from deconflict.motion import Segments, faults, segments
from ingest.seam import Floats, Forecasts
from tests.deconflict.made_encounters import FAMILIES, NOW_S, encounters, robot
from tests.oracle import Track

FIRST, SLABS = floor(NOW_S), 12
SQUARE = (1.0, 1.0)


def cut(forecast: Forecasts) -> Segments:
    return segments(forecast, FIRST, SLABS)


def ends(s: Segments) -> tuple[Floats, Floats]:
    """(n,) beginnings and ends, seconds since the first slab."""
    return s.slab - FIRST + s.t0, s.slab - FIRST + s.t1


@pytest.mark.parametrize("family", FAMILIES)
def test_segments_say_just_what_the_forecast_says(family: str) -> None:
    forecasts = encounters(family, 8, 61, 0.25)
    s = cut(forecasts)
    begin, end = ends(s)
    assert (s.t1 > s.t0).all()
    assert ((s.t0 >= 0) & (s.t1 <= 1)).all()
    for row in range(len(forecasts)):
        own = np.flatnonzero(s.robot == row)
        assert (begin[own][1:] >= end[own][:-1]).all()
        track = Track(forecasts, row)
        on_floor, pose0, pose1 = track.between(FIRST + begin[own], FIRST + end[own])
        np.testing.assert_array_equal(s.floor[own], on_floor)
        span = (s.t1 - s.t0)[own]
        for axis, (at, rate) in enumerate(((s.x, s.vx), (s.y, s.vy))):
            np.testing.assert_allclose(at[own], pose0[:, axis], atol=1e-5)
            np.testing.assert_allclose(at[own] + rate[own] * span, pose1[:, axis], atol=1e-5)
        for yaw, true in ((s.yaw[own], pose0[:, 2]), (s.yaw[own] + s.turn[own] * span, pose1[:, 2])):
            np.testing.assert_allclose(np.exp(1j * yaw), np.exp(1j * true), atol=1e-5)


def test_segments_cover_the_time_on_known_floors_and_no_other() -> None:
    forecast = robot([0.7, 3.2, 5.0, 6.5], [0, 1, 2, 3], [0] * 4, 0, SQUARE, floor=[0, -1, 1, 1])
    begin, end = ends(cut(forecast))
    known = [(1.0, 3.5), (5.3, float(SLABS))]
    for low, high in known:
        inside = (begin >= low - 1e-6) & (end <= high + 1e-6)
        assert (end - begin)[inside].sum() == pytest.approx(high - low, abs=1e-6)
    assert (end - begin).sum() == pytest.approx(sum(high - low for low, high in known), abs=1e-6)


def test_a_heading_turns_along_the_shorter_arc() -> None:
    s = cut(robot([0, 2], [0, 0], [0, 0], [pi - 0.1, -pi + 0.1], SQUARE))
    assert s.turn[0] == pytest.approx(0.1)


def test_after_the_last_knot_a_robot_stands_and_before_the_first_it_is_not_there() -> None:
    s = cut(robot([2.5, 4.5], [0, 4], [0, 0], 0, SQUARE))
    begin, _ = ends(s)
    assert begin.min() == pytest.approx(2.8)
    after = begin > 4.9
    assert (s.vx[after] == 0).all()
    np.testing.assert_allclose(s.x[after], 4.0)


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
        ("size-not-positive", robot([0], [0], [0], 0, (0, 1))),
        ("size-not-positive", robot([0], [0], [0], 0, (1, -1))),
        ("size-not-finite", robot([0], [0], [0], 0, (1, nan))),
        ("size-not-finite", robot([0], [0], [0], 0, (inf, 1))),
        ("heights-not-ordered", robot([0], [0], [0], 0, SQUARE, height=(1, 0.5))),
        ("heights-not-ordered", robot([0], [0], [0], 0, SQUARE, height=(nan, 1))),
    ],
)
def test_what_is_wrong_with_a_forecast_is_named(reason: str, wrong: Forecasts) -> None:
    good = robot([0, 1], [0, 1], [0, 0], 0, SQUARE, height=(-inf, inf))
    assert faults(Forecasts.joined([good, wrong, good])) == {1: reason}


def test_valid_forecasts_have_no_faults() -> None:
    for family in FAMILIES:
        assert faults(encounters(family, 10, 62, 0.25)) == {}
    assert faults(Forecasts.empty()) == {}
