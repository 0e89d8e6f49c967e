"""Tugger trains: where their trailers go, and what comes near them."""

from dataclasses import replace
from functools import partial
from math import ceil

import numpy as np
import pytest
import shapely

from deconflict.sweep.incremental import Sweeper
from deconflict.sweep.robot_slots import RobotSlots
from deconflict.sweep.shapes.shape_encounters import encounter, separation_m
from deconflict.sweep.shapes.trailers import trailer_forecasts
from deconflict.sweep.shapes.trains import with_trailers
from deconflict.sweep.sweep_once import first_contacts, sweep
from ingest.batch import Floats, Forecasts
from ingest.shapes import Shape, Trailer, shapes_of
from tests.helpers.made_encounters import NOW_S, robot
from tests.helpers.oracle import Track

HORIZON_S, LENGTH_M, WIDTH_M, HITCH_M = 10.0, 1.2, 0.8, 1.6
STEP_S = 0.002
TRAILERS = (Trailer(LENGTH_M, WIDTH_M, HITCH_M),) * 4
NEAR_M = 0.03
"""The forecast of a trailer is straight between its knots."""


def tug(turn_radps: float = 0.3, trailers: tuple[Trailer, ...] = TRAILERS) -> Forecasts:
    """A tug on a bend to the left, whose trailers are straight behind it at first."""
    t = np.arange(0.0, 11.0)
    yaw = turn_radps * t
    x = np.cumsum(np.concatenate([[0.0], np.cos(yaw[:-1] + turn_radps / 2)]))
    y = np.cumsum(np.concatenate([[0.0], np.sin(yaw[:-1] + turn_radps / 2)]))
    shape = Shape((), (-0.3, 0.0), trailers)
    return replace(robot(t, x, y, yaw, (1.4, 0.8)), shapes=shapes_of([shape]))


def simulated(forecast: Forecasts) -> Floats:
    """(steps, 4, 3) x, y and heading of each trailer, by small steps of the tug."""
    track = Track(forecast, 0)
    t = NOW_S + np.linspace(0.0, HORIZON_S, ceil(HORIZON_S / STEP_S) + 1)
    _, pose, _ = track.between(t, t)
    ahead = pose[:, :2] - 0.3 * np.stack([np.cos(pose[:, 2]), np.sin(pose[:, 2])], -1)
    trailers = []
    for trailer in TRAILERS:
        behind = np.empty_like(ahead)
        behind[0] = ahead[0] - [trailer.hitch_m, 0.0]
        for step in range(1, len(ahead)):
            way = ahead[step] - behind[step - 1]
            behind[step] = ahead[step] - trailer.hitch_m * way / np.hypot(*way)
        yaw = np.arctan2(*(ahead - behind).T[::-1])
        trailers.append(np.column_stack([behind, yaw]))
        ahead = behind
    return np.stack(trailers, 1)


def boxes(poses: Floats) -> np.ndarray:
    x, y, yaw = poses.T[..., None]
    along, across = np.array([1, -1, -1, 1]) * LENGTH_M / 2, np.array([1, 1, -1, -1]) * WIDTH_M / 2
    corners = (x + np.cos(yaw) * along - np.sin(yaw) * across, y + np.sin(yaw) * along + np.cos(yaw) * across)
    return shapely.polygons(np.stack(corners, -1))


@pytest.mark.parametrize("turn_radps", [0.0, 0.1, 0.3, -0.6])
def test_trailers_follow_as_simulated(turn_radps: float) -> None:
    trailers, pulled_by = trailer_forecasts(tug(turn_radps))
    expected = simulated(tug(turn_radps))
    assert pulled_by.tolist() == [0, 0, 0, 0]
    t = NOW_S + np.linspace(0.0, HORIZON_S, len(expected))
    for row in range(4):
        _, poses, _ = Track(trailers, row).between(t, t)
        assert np.hypot(*(poses - expected[:, row])[:, :2].T).max() < NEAR_M
    if turn_radps == 0.0:
        assert len(trailers.t_s) == 4 * 11


@pytest.mark.parametrize("seed", range(6))
def test_what_comes_near_a_trailer_is_a_conflict_of_its_train(seed: int) -> None:
    rng = np.random.default_rng(seed)
    train, clearance_m = tug(), 0.2
    places = rng.uniform([-8, -4], [8, 10], (40, 2))
    standing = [robot([0], [x], [y], 0.0, (0.4, 0.4)) for x, y in places]
    found = sweep(Forecasts.joined([train, *standing]), now_s=NOW_S, horizon_s=HORIZON_S, clearance_m=clearance_m)
    contact_s = {b: at_s - NOW_S for (a, b), at_s in zip(found.pairs.tolist(), found.contact_s, strict=True) if a == 0}
    t = np.linspace(0.0, HORIZON_S, ceil(HORIZON_S / STEP_S) + 1)
    _, pose, _ = Track(train, 0).between(NOW_S + t, NOW_S + t)
    envelopes = shapely.union(*(boxes(simulated(train)[:, row]) for row in (0, 1)))
    envelopes = shapely.union_all(
        [envelopes, *(boxes(simulated(train)[:, row]) for row in (2, 3)), boxes(pose)], axis=0
    )
    by_trailers = 0
    for number, (x, y) in enumerate(places, 1):
        apart_m = shapely.distance(envelopes, shapely.box(x - 0.2, y - 0.2, x + 0.2, y + 0.2))
        if apart_m.min() > clearance_m + NEAR_M:
            assert number not in contact_s
        elif apart_m.min() < clearance_m - NEAR_M:
            latest_s = t[np.flatnonzero(apart_m < clearance_m - NEAR_M)[0]]
            assert contact_s[number] <= latest_s
            by_trailers += 1
    assert by_trailers > 2


def test_a_train_is_one_robot() -> None:
    sweeper = Sweeper(clearance_m=0.2)
    beside = robot([0], [-5.0], [0.0], 0.0, (0.5, 0.5))
    sweeper.update(["b", "train"], Forecasts.joined([beside, tug()]))
    found = sweeper.find_conflicts(NOW_S)
    assert found.pairs == (("b", "train"),)
    assert (found.separation_m.tolist(), found.start_separation_m.tolist()) == ([0.0], [0.0])
    sweeper.update(["train"], tug(trailers=TRAILERS[:1]))
    assert not sweeper.find_conflicts(NOW_S).pairs
    sweeper.update(["train"], tug())
    assert sweeper.find_conflicts(NOW_S).pairs
    sweeper.discard(["train"])
    assert not sweeper.find_conflicts(NOW_S).pairs


def test_trailers_that_are_gone_are_near_nobody() -> None:
    """The other catches up; it begins where the last trailer was."""
    sweeper, follows = Sweeper(clearance_m=0.2), robot([0, 10], [-6.7, 23.3], [0, 0], 0.0, (0.5, 0.5))
    sweeper.update(["b", "train"], Forecasts.joined([follows, tug(0.0)]))
    assert sweeper.find_conflicts(NOW_S).start_separation_m.tolist() == [0.0]
    sweeper.update(["train"], tug(0.0, trailers=TRAILERS[:1]))
    assert sweeper.find_conflicts(NOW_S).start_separation_m.tolist() == pytest.approx([6.45 - 2.5])


def test_two_trains_meet_by_their_trailers_alone() -> None:
    other = tug(0.0)
    other = replace(other, x_m=other.x_m[::-1] * 0 - 6.0, y_m=other.y_m + 1.0)
    found = sweep(Forecasts.joined([tug(0.0), other]), now_s=NOW_S, clearance_m=0.3)
    assert found.pairs.tolist() == [[0, 1]]
    assert found.separation_m[0] == pytest.approx(0.2, abs=2e-3)


def test_an_invalid_tug_has_no_trailers() -> None:
    wrong = replace(tug(), x_m=np.full(11, np.nan))
    sweeper = Sweeper(clearance_m=0.2)
    sweeper.update(["train"], tug())
    assert sweeper.update(["train"], wrong) == (("train", "not-finite"),)
    sweeper.update(["b"], robot([0], [-5.0], [0.0], 0.0, (0.5, 0.5)))
    assert not sweeper.find_conflicts(NOW_S).pairs


def test_the_place_of_an_encounter_is_at_the_trailer() -> None:
    beside = robot([0], [-5.0], [1.0], 0.0, (0.5, 0.5))
    met = encounter((tug(0.0), 0), (beside, 0), NOW_S)
    assert (met.x_m, met.y_m) == pytest.approx((-5.0, 0.575), abs=0.3)
    assert separation_m((tug(0.0), 0), (beside, 0), NOW_S) == pytest.approx(0.35)


def test_advice_sees_the_trailers() -> None:
    sweeper = Sweeper(clearance_m=0.2)
    sweeper.update(["b", "train"], Forecasts.joined([robot([0], [-5.0], [0.0], 0.0, (0.5, 0.5)), tug()]))
    robots, knots = sweeper.copied(["b", "train"])
    assert len(robots) == 2 + 4
    rows, holds_s, trailers = with_trailers(robots, 2, np.array([0, 1]), np.array([0.0, 3.0]))
    assert trailers == {1: [2, 3, 4, 5]}
    assert holds_s.tolist() == [0.0, 3.0, 3.0, 3.0, 3.0, 3.0]
    a, b, until_s = np.array([0]), np.array([1]), np.array([NOW_S + 5])
    look = partial(first_contacts, robots[rows], knots, a, b, now_s=NOW_S, until_s=until_s, clearance_m=0.2)
    assert look(trailers=trailers)[0].tolist() == [NOW_S]
    assert look()[0].tolist() == [np.inf]


@pytest.mark.parametrize(("widened_m", "conflicts"), [(0.0, 0), (0.6, 1)])
def test_trailers_are_as_uncertain_as_the_robot_that_pulls_them(widened_m: float, conflicts: int) -> None:
    """The other stands 0.35 m beside a trailer."""
    sweeper, train = Sweeper(clearance_m=0.2), tug(0.0)
    wide = replace(train, length_m=train.length_m + widened_m, width_m=train.width_m + widened_m)
    sweeper.update(["train"], wide, np.array([widened_m]))
    sweeper.update(["b"], robot([0], [-5.0], [1.0], 0.0, (0.5, 0.5)))
    assert len(sweeper.find_conflicts(NOW_S).pairs) == conflicts


def test_a_train_keeps_its_slot_until_whoever_gave_it_frees_it_and_the_sweep_frees_those_of_its_trailers() -> None:
    slots = RobotSlots()
    slots.assign(["other", "train"])
    sweeper = Sweeper(clearance_m=0.2, slots=slots)
    sweeper.update(["train"], tug(0.0))
    assert len(slots.by_uuid) > 2
    sweeper.discard(["train"])
    assert slots.by_uuid == {"other": 0, "train": 1}
    assert sweeper.copied(["train"])[0]["count"].tolist() == [0]
