"""How much way a robot has left to others, where that can be worked out by hand."""

import numpy as np
import pytest

from deconflict.foresight.interactions.interaction_finder import WAY_M, way_from
from deconflict.foresight.interactions.progress_kernels import AHEAD_S
from deconflict.foresight.interactions.recent_reports import InteractionReports, RecentReports
from deconflict.foresight.interactions.way_kernels import TOUCHES_M
from ingest.batch import Floats
from tests.deconflict.foresight.interactions.made_reports import NOW_S

HALF_M = np.array([[0.5, 0.5], [0.3, 0.3]])
REPORTS_S = 4


def known(*motions: tuple[Floats, Floats]) -> RecentReports:
    """Robots that have reported every second until now. A motion is a pose (3,), and its change in a second (3,)."""
    recent = RecentReports()
    recent.grow(len(motions))
    for before_s in range(REPORTS_S - 1, -1, -1):
        after_s = np.arange(AHEAD_S + 1.0) - before_s
        tracks = [np.column_stack([pose + np.outer(after_s, per_s), 0.0 * after_s]) for pose, per_s in motions]
        slots, none = np.arange(len(motions)), np.zeros((len(motions), AHEAD_S))
        at_s = np.full(len(motions), NOW_S - before_s)
        recent.add(InteractionReports(slots, at_s, np.array(tracks), np.zeros(len(motions), np.bool_), none), HALF_M[1])
    return recent


def left_m(recent: RecentReports, ago_s: float = 2.0) -> float:
    """The way that robot 0 has left to robot 1 at looks from `ago_s` before the newest reports until these. It drives
    along x at 2 m/s."""
    at_s = np.arange(AHEAD_S + 1.0) - ago_s
    way = way_from(np.column_stack([2.0 * at_s, 0.0 * at_s, 0.0 * at_s]), -2.0 * ago_s, 0.0)
    looks_s = NOW_S + np.arange(-ago_s, 0.1, 0.25)
    return float(recent.ways_left_m(0, np.array([1]), looks_s, way, 2.0, HALF_M)[0])


DRIVES = np.array([0.0, 0.0, 0.0]), np.array([2.0, 0.0, 0.0])
STANDS_M = np.array([3.0, 0.0, 0.0])


def test_the_way_left_ends_where_the_envelopes_touch() -> None:
    apart_m = STANDS_M[0] - 2 * HALF_M[0, 0]
    assert left_m(known(DRIVES, (STANDS_M, np.zeros(3)))) == pytest.approx(apart_m - TOUCHES_M, abs=WAY_M)


def test_a_robot_beyond_the_stopping_distance_is_not_reached() -> None:
    assert left_m(known(DRIVES, (2 * STANDS_M, np.zeros(3)))) == np.inf


def test_a_robot_that_rests_is_where_its_forecast_ended() -> None:
    recent = known(DRIVES, (STANDS_M - [AHEAD_S, 0.0, 0.0], np.array([1.0, 0.0, 0.0])))
    before_m = left_m(recent)
    recent.rest(np.array([1]))
    assert left_m(recent) == left_m(known(DRIVES, (STANDS_M, np.zeros(3)))) < before_m


def test_a_heading_that_passes_half_a_turn_is_followed_the_short_way() -> None:
    # the heading goes on from pi - 0.1 to -pi + 0.1; half of that turn the other way would set the robot across the way
    beside, turning = np.array([2.0, 0.75, np.pi + 0.1]), np.array([0.0, 0.0, 0.2])
    recent = known(DRIVES, (beside, turning))
    wrapped = known(DRIVES, (beside, turning))
    tracks = wrapped.tracks
    tracks[..., 2] = (tracks[..., 2] + np.pi) % (2 * np.pi) - np.pi
    assert left_m(wrapped) == left_m(recent) == np.inf
