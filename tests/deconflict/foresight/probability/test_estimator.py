"""Robots that report once a second. Their forecasts and their motion are given apart."""

from dataclasses import replace

import numpy as np
import pytest

from deconflict.foresight.probability.estimator import ProbabilityEstimator
from deconflict.foresight.probability.pair_candidates import SweptConflicts
from ingest.measures.measures import Measures
from tests.deconflict.foresight.probability.made_stage import CLEARANCE_M, Stage, Velocity, Walk
from tests.helpers.made_encounters import NOW_S


def test_the_probability_of_crossing_robots_rises_as_they_come_nearer() -> None:
    by_step = Stage({"b": Walk((-12.0, 0.0), (1.0, 0.0)), "a": Walk((0.0, -12.0), (0.0, 1.0))}).run(12)
    course = [values[("a", "b")] for values in by_step[4:10]]
    assert course == sorted(course)
    assert course[-1] > 0.9


def test_contact_is_never_more_probable_than_getting_in_each_others_way() -> None:
    walks = {
        "b": Walk((-12.0, 0.0), (1.0, 0.0)),
        "a": Walk((0.0, -12.0), (0.0, 1.0)),
        "c": Walk((4.0, 0.0), (0.0, 0.0)),
    }
    stage, compared = Stage(walks), 0
    for t_s in range(12):
        probabilities = stage.second(t_s)
        for pair, contact in stage.foresight.contact_probabilities():
            compared += 1
            assert contact <= probabilities[pair]
    assert compared > 12


def test_robots_that_never_come_near_are_not_watched() -> None:
    by_step = Stage({"a": Walk((0.0, 0.0), (1.0, 0.0)), "b": Walk((0.0, 30.0), (1.0, 0.0))}).run(12)
    assert all(values == {} for values in by_step)


def test_a_wrong_forecast_does_not_hide_a_conflict() -> None:
    # it says that it will pass 2.5 m away, and has said as wrong things before
    wrong = Walk((0.0, -12.0), (0.0, 1.0), says=(0.3, 1.0))
    by_step = Stage({"a": wrong, "b": Walk((-12.0, 0.0), (1.0, 0.0))}).run(11)
    honest = Stage({"a": Walk((3.0, -12.0), (0.0, 1.0)), "b": Walk((-12.0, 0.0), (1.0, 0.0))}).run(11)
    assert by_step[9][("a", "b")] > 0.3
    assert honest[9].get(("a", "b"), 0.0) < by_step[9][("a", "b")] / 3


def test_a_robot_is_distrusted_while_it_contradicts_its_own_motion() -> None:
    stage = Stage({"a": Walk((0.0, 0.0), (0.0, 1.0))})
    stage.run(30)
    assert not stage.foresight.is_distrusted("a")
    stage.walks["a"].says = (1.0, 0.0)
    for t_s in range(30, 36):
        stage.second(t_s)
    assert stage.foresight.is_distrusted("a")
    assert stage.foresight.measures.values["deconflict_forecasts_distrusted_total"]["Alder",] >= 3
    stage.walks["a"].says = None
    for t_s in range(36, 50):
        stage.second(t_s)
    assert not stage.foresight.is_distrusted("a")


def named(stage: Stage, since_s: int, until_s: int, says: Velocity | None) -> list[int]:
    """The seconds at which a robot is named that says that it drives so."""
    seconds = []
    stage.walks["a"].says = says
    for t_s in range(since_s, until_s):
        stage.second(t_s)
        stage.foresight.measures.as_document()
        counted = stage.foresight.measures.values["deconflict_robots_distrusted"]["Alder",]
        assert counted == len(stage.foresight.distrusted())
        seconds += [t_s] * int(counted)
    return seconds


def test_a_robot_is_named_and_counted_after_10_s_on_end_and_until_30_s_after() -> None:
    stage = Stage({"a": Walk((0.0, 0.0), (0.0, 1.0)), "b": Walk((90.0, 0.0), (0.0, 1.0))})
    assert named(stage, 0, 100, None) == []
    assert named(stage, 100, 115, (1.0, 0.0)) == [111, 112, 113, 114]
    agrees = named(stage, 115, 170, None)
    assert agrees == list(range(115, agrees[-1] + 1))
    assert 144 <= agrees[-1] <= 155
    assert not stage.foresight.is_distrusted("a")


def test_a_robot_that_contradicts_its_motion_now_and_then_is_not_named() -> None:
    stage = Stage({"a": Walk((0.0, 0.0), (0.0, 1.0))})
    assert named(stage, 0, 100, None) == []
    assert named(stage, 100, 106, (1.0, 0.0)) == []
    assert stage.foresight.is_distrusted("a")
    assert named(stage, 106, 130, None) == []


@pytest.mark.parametrize("leaves", [True, False])
def test_a_pair_has_no_probability_in_an_encounter_or_after_a_robot_has_gone(leaves: bool) -> None:
    stage = Stage({"a": Walk((0.0, 0.0), (0.0, 0.0)), "b": Walk((-8.0, 0.0), (1.0, 0.0))})
    assert ("a", "b") in stage.run(6)[-1]
    if leaves:
        del stage.walks["b"]
    assert ("a", "b") not in [stage.second(t_s) for t_s in range(6, 10)][-1]


def test_outcomes_are_counted_and_learned() -> None:
    stage = Stage({"a": Walk((0.0, 0.0), (0.0, 0.0)), "b": Walk((-12.0, 0.0), (1.0, 0.0))})
    prior = stage.foresight.learning.calibration.of_all.weights.copy()
    stage.run(30)
    outcomes = stage.foresight.measures.values["deconflict_probability_outcomes_total"]
    assert outcomes[("met",)] >= 8
    assert stage.foresight.learning.calibration.of_all.weights.tolist() != prior.tolist()


def test_passing_the_last_place_of_a_silent_robot_is_no_meeting() -> None:
    stage = Stage({"a": Walk((-12.0, 0.0), (1.0, 0.0)), "b": Walk((0.0, 0.0), (0.0, 0.0))})
    stage.run(5)
    del stage.walks["b"]
    for t_s in range(5, 30):
        stage.second(t_s)
    outcomes = stage.foresight.measures.values["deconflict_probability_outcomes_total"]
    assert outcomes[("left",)] >= 4
    assert outcomes.get(("met",), 0) == 0


def test_the_same_calls_give_the_same_answers() -> None:
    walks = {"a": Walk((0.0, -12.0), (0.0, 1.0), says=(0.2, 1.1)), "b": Walk((-12.0, 0.0), (1.0, 0.0))}
    assert Stage(dict(walks)).run(20) == Stage(dict(walks)).run(20)


def test_robots_that_return_in_other_slots_are_not_confused() -> None:
    far, near = Walk((0.0, 90.0), (1.0, 0.0)), {"b": Walk((-8.0, 0.0), (1.0, 0.0)), "a": Walk((0.0, 0.0), (0.0, 0.0))}
    stage = Stage({"c": far} | near)
    swept = SweptConflicts((("a", "b"),), np.array([0.1]), np.array([NOW_S + 8]), np.array([NOW_S + 8]))
    stage.second(0)
    stage.foresight.estimate(NOW_S, swept, 0.5)
    stage.foresight.receive(replace(stage.batch(0.5).take(np.arange(0)), gone=tuple(stage.walks)))
    stage.foresight.receive(stage.batch(1.0))
    stage.foresight.estimate(NOW_S + 1, swept, 0.5)
    assert [pair for pair, _ in stage.foresight.probabilities()] == [("a", "b")]


@pytest.mark.parametrize("silent", ["a", "b"])
def test_giving_way_is_forgotten_when_one_of_the_two_falls_silent(silent: str) -> None:
    stage = Stage({"a": Walk((0.0, -9.6), (0.0, 1.0)), "b": Walk((-10.0, 0.0), (1.0, 0.0))})
    stage.run(9)
    stage.walks["a"] = Walk((0.0, -1.6), (0.0, 0.0), says=(0.0, 1.0))
    for t_s in range(9, 12):
        stage.second(t_s)
    pairs = stage.foresight.pairs
    assert pairs["gives_way"].tolist() == [True]
    stage.foresight.mark_silent(["nobody"])
    assert pairs["gives_way"].tolist() == [True]
    stage.foresight.mark_silent([silent])
    assert pairs["gives_way"].tolist() == [False]
    assert pairs["gave_way_s"].tolist() == [-np.inf]


def test_of_a_robot_in_a_crowd_only_conflicts_that_the_sweep_finds_are_estimated_and_are_likely() -> None:
    walks = {"a": Walk((-8.0, 0.0), (1.0, 0.0)), "b": Walk((0.0, -8.0), (0.0, 1.0))}
    alone, crowded = (
        Stage(walks, ProbabilityEstimator(CLEARANCE_M, CLEARANCE_M + 0.1, 10.0, Measures(), crowds))
        for crowds in ({}, {"b": 1})
    )
    assert alone.second(0).keys() == {("a", "b")}
    assert crowded.second(0) == {}
    crowded.foresight.receive(crowded.batch(1.0))
    swept = SweptConflicts((("a", "b"),), np.zeros(1), np.array([NOW_S + 8]), np.array([NOW_S + 7.4]))
    (probability,) = crowded.foresight.estimate(NOW_S + 1, swept, 0.5).probability.tolist()
    assert 0.5 < probability < 0.9
