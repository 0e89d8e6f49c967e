"""Robots that report once a second, what they say and what they do given apart."""

from dataclasses import replace

import numpy as np
import pytest

from deconflict.foresight.probability.pair_candidates import SweptConflicts
from tests.deconflict.foresight.probability.made_stage import Stage, Walk
from tests.helpers.made_encounters import NOW_S


def test_robots_that_will_cross_are_likelier_to_the_nearer_they_come() -> None:
    told = Stage({"b": Walk((-12.0, 0.0), (1.0, 0.0)), "a": Walk((0.0, -12.0), (0.0, 1.0))}).run(12)
    course = [one[("a", "b")] for one in told[4:10]]
    assert course == sorted(course)
    assert course[-1] > 0.9


def test_robots_that_never_come_near_are_not_watched() -> None:
    told = Stage({"a": Walk((0.0, 0.0), (1.0, 0.0)), "b": Walk((0.0, 30.0), (1.0, 0.0))}).run(12)
    assert all(one == {} for one in told)


def test_a_robot_that_says_otherwise_than_it_does_hides_no_conflict() -> None:
    # it says that it will pass 2.5 m away, and has said as wrong things before
    wrong = Walk((0.0, -12.0), (0.0, 1.0), says=(0.3, 1.0))
    told = Stage({"a": wrong, "b": Walk((-12.0, 0.0), (1.0, 0.0))}).run(11)
    honest = Stage({"a": Walk((3.0, -12.0), (0.0, 1.0)), "b": Walk((-12.0, 0.0), (1.0, 0.0))}).run(11)
    assert told[9][("a", "b")] > 0.3
    assert honest[9].get(("a", "b"), 0.0) < told[9][("a", "b")] / 3


def test_one_that_contradicts_its_own_motion_is_distrusted_until_it_does_as_it_says() -> None:
    stage = Stage({"a": Walk((0.0, 0.0), (0.0, 1.0))})
    stage.run(30)
    assert not stage.foresight.is_distrusted("a")
    stage.walks["a"].says = (1.0, 0.0)
    for t_s in range(30, 36):
        stage.second(t_s)
    assert stage.foresight.is_distrusted("a")
    stage.foresight.measures.as_document()
    values = stage.foresight.measures.values
    assert values["deconflict_robots_distrusted"] == {("Alder",): 1.0}
    assert values["deconflict_forecasts_distrusted_total"]["Alder",] >= 3
    stage.walks["a"].says = None
    for t_s in range(36, 50):
        stage.second(t_s)
    assert not stage.foresight.is_distrusted("a")
    stage.foresight.measures.as_document()
    assert values["deconflict_robots_distrusted"] == {("Alder",): 0.0}


@pytest.mark.parametrize("leaves", [True, False])
def test_a_pair_is_not_judged_while_it_is_in_an_encounter_or_a_robot_is_gone(leaves: bool) -> None:
    stage = Stage({"a": Walk((0.0, 0.0), (0.0, 0.0)), "b": Walk((-8.0, 0.0), (1.0, 0.0))})
    assert ("a", "b") in stage.run(6)[-1]
    if leaves:
        del stage.walks["b"]
    assert ("a", "b") not in [stage.second(t_s) for t_s in range(6, 10)][-1]


def test_what_became_of_pairs_is_counted_and_learned() -> None:
    stage = Stage({"a": Walk((0.0, 0.0), (0.0, 0.0)), "b": Walk((-12.0, 0.0), (1.0, 0.0))})
    prior = stage.foresight.calibration.of_all.weights.copy()
    stage.run(30)
    outcomes = stage.foresight.measures.values["deconflict_probability_outcomes_total"]
    assert outcomes[("met",)] >= 8
    assert stage.foresight.calibration.of_all.weights.tolist() != prior.tolist()


def test_passing_where_a_robot_was_last_heard_of_is_no_meeting() -> None:
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


def test_robots_that_left_and_came_back_in_other_places_are_not_taken_for_each_other() -> None:
    far, near = Walk((0.0, 90.0), (1.0, 0.0)), {"b": Walk((-8.0, 0.0), (1.0, 0.0)), "a": Walk((0.0, 0.0), (0.0, 0.0))}
    stage = Stage({"c": far} | near)
    swept = SweptConflicts((("a", "b"),), np.array([-1]), np.array([0.1]), np.array([NOW_S + 8]), np.array([NOW_S + 8]))
    stage.second(0)
    stage.foresight.estimate(NOW_S, swept, 0.5)
    stage.foresight.receive(replace(stage.batch(0.5).take(np.arange(0)), gone=tuple(stage.walks)))
    stage.foresight.receive(stage.batch(1.0))
    stage.foresight.estimate(NOW_S + 1, swept._replace(before=np.array([0])), 0.5)
    assert [pair for pair, _ in stage.foresight.probabilities()] == [("a", "b")]


@pytest.mark.parametrize("silent", ["a", "b"])
def test_whether_one_still_gives_way_is_not_known_once_one_of_the_two_is_silent(silent: str) -> None:
    stage = Stage({"a": Walk((0.0, -9.6), (0.0, 1.0)), "b": Walk((-10.0, 0.0), (1.0, 0.0))})
    stage.run(9)
    stage.walks["a"] = Walk((0.0, -1.6), (0.0, 0.0), says=(0.0, 1.0))
    for t_s in range(9, 12):
        stage.second(t_s)
    pairs = stage.foresight._pairs
    assert pairs["gives_way"].tolist() == [True]
    stage.foresight.mark_silent(["nobody"])
    assert pairs["gives_way"].tolist() == [True]
    stage.foresight.mark_silent([silent])
    assert pairs["gives_way"].tolist() == [False]
    assert pairs["gave_way_s"].tolist() == [-np.inf]
