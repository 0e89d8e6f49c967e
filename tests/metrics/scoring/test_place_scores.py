"""What was said of places, held against what then happened, where both are known by construction."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest

from metrics.scoring.place_scores import AHEAD_S, PlaceForecast, PlaceScores, PlannedStay
from metrics.truth.resource_use import PlaceEntry
from tests.deconflict.contention.scenes import resource

LAST_S = 2000.0
NOBODY = np.empty((0, 2))


def places(capacity: int = 1) -> PlaceScores:
    return PlaceScores([resource("d1", 0, 0, capacity=capacity, kind="charger")], {"r": LAST_S, "s": LAST_S})


def comes(begin_s: float, end_s: float = 1e9, robot: str = "r") -> PlannedStay:
    return PlannedStay("d1", robot, True, begin_s, end_s)


def say(found: PlaceScores, now_s: float, turns: Sequence[PlannedStay], **needs: Sequence[float]) -> None:
    found.add_forecast(now_s, PlaceForecast(turns, {robot: np.array(likely) for robot, likely in needs.items()}))


def figures(found: PlaceScores, stays_s: Any = NOBODY, last_s: float = LAST_S) -> dict[float, dict[str, Any]]:
    return {figure["ahead_up_to_s"]: figure for figure in found.figures(last_s, {"d1": stays_s})}


@pytest.mark.parametrize(
    ("ahead_s", "up_to_s"), [(0, 30), (30, 30), (31, 60), (100, 120), (299, 300), (301, 900), (900, 900)]
)
def test_predictions_are_counted_by_time_ahead(ahead_s: float, up_to_s: float) -> None:
    found = places()
    say(found, 0.0, [comes(ahead_s)])
    found.add_entry(PlaceEntry("d1", "r", ahead_s + 12.0, 0.0))
    rows = figures(found)
    assert {value: row["said"] for value, row in rows.items()} == {each: int(each == up_to_s) for each in AHEAD_S}
    row = rows[up_to_s]
    assert (row["came"], row["late"], row["off_median_s"]) == (1.0, 1.0, pytest.approx(12.0, rel=0.02))


def test_predictions_beyond_a_quarter_of_an_hour_are_not_counted() -> None:
    found = places()
    say(found, 0.0, [comes(901.0)])
    found.add_entry(PlaceEntry("d1", "r", 901.0, 0.0))
    assert figures(found)[900.0]["said"] == 0


def test_an_early_arrival_is_not_late_but_has_an_error() -> None:
    found = places()
    say(found, 0.0, [comes(50.0)])
    found.add_entry(PlaceEntry("d1", "r", 40.0, 0.0))
    row = figures(found)[60.0]
    assert (row["came"], row["late"], row["off_median_s"]) == (1.0, 0.0, pytest.approx(10.0, rel=0.02))


@pytest.mark.parametrize(("heard_s", "expected"), [(40.0, 0), (200.0, 1)])
def test_a_robot_that_never_arrives_is_late_by_the_time_to_its_last_report(heard_s: float, expected: int) -> None:
    found = PlaceScores([resource("d1", 0, 0)], {"r": heard_s})
    say(found, 0.0, [comes(50.0), comes(5.0, robot="s")])
    found.add_entry(PlaceEntry("d1", "s", 5.0, 0.0))
    row = figures(found)[60.0]
    assert (row["said"], row["came"]) == (expected, 0.0 if expected else None)
    assert row["off_median_s"] == (pytest.approx(150.0, rel=0.02) if expected else None)


def test_predictions_for_a_robot_that_left_are_not_counted() -> None:
    found = places()
    say(found, 0.0, [comes(50.0), comes(5.0, robot="s")])
    found.add_entry(PlaceEntry("d1", "s", 5.0, 0.0))
    found.forget("r")
    assert figures(found)[60.0]["said"] == 0


def test_a_repeated_prediction_counts_again_until_the_robot_arrives() -> None:
    found = places()
    for now_s in (0.0, 10.0, 20.0):
        say(found, now_s, [comes(70.0)])
    found.add_entry(PlaceEntry("d1", "r", 15.0, 0.0))
    rows = figures(found)
    assert (rows[120.0]["said"], rows[60.0]["said"]) == (1, 2)
    assert (rows[120.0]["came"], rows[60.0]["came"]) == (1.0, 0.5), (
        "what was said after it had come was of another time"
    )


def test_an_arrival_is_predicted_in_the_classes_of_time_ahead_of_its_predictions() -> None:
    found = places()
    say(found, 0.0, [])
    say(found, 900.0, [comes(1500.0)])
    say(found, 960.0, [comes(970.0)])
    found.add_entry(PlaceEntry("d1", "r", 1000.0, 0.0))
    found.add_entry(PlaceEntry("d1", "s", 1000.0, 950.0))
    rows = figures(found)
    assert {value: row["entries"] for value, row in rows.items()} == {30: 2, 60: 1, 120: 1, 300: 1, 900: 1}
    assert {value: row["foretold"] for value, row in rows.items()} == {30: 0.0, 60: 1.0, 120: 1.0, 300: 0.0, 900: 0.0}


def test_a_place_was_full_as_predicted() -> None:
    found = places(capacity=2)
    say(found, 0.0, [PlannedStay("d1", "s", False, -9.0, 200.0), comes(50.0, 100.0)])
    found.add_entry(PlaceEntry("d1", "r", 50.0, 0.0))
    stays_s = np.array([(-9.0, 200.0), (50.0, 400.0)])
    rows = figures(found, stays_s)
    assert {value: (row["full_said"], row["full_happened"]) for value, row in rows.items()} == {
        30: (0, 0),
        60: (1, 1),
        120: (0, 1),
        300: (0, 0),
        900: (0, 0),
    }
    assert (rows[60.0]["full_precision"], rows[120.0]["full_recall"]) == (1.0, 0.0)


def test_after_the_end_of_the_log_it_is_unknown_whether_a_place_is_full() -> None:
    found = places()
    say(found, 0.0, [comes(5.0)])
    found.add_entry(PlaceEntry("d1", "r", 5.0, 0.0))
    rows = figures(found, np.array([(5.0, 100.0)]), last_s=100.0)
    assert [row["full_said"] for row in rows.values()] == [1, 1, 0, 0, 0]


def test_a_robot_that_is_too_late_counts_as_never_arriving() -> None:
    found = places()
    say(found, 0.0, [comes(50.0)])
    found.advance(1000.0)
    found.add_entry(PlaceEntry("d1", "r", 1001.0, 0.0))
    row = figures(found)[60.0]
    assert (row["came"], row["off_median_s"]) == (0.0, pytest.approx(900.0, rel=0.02))


def test_without_arrivals_and_predictions_there_are_no_figures() -> None:
    found = places()
    say(found, 0.0, [])
    assert figures(found) == {}


def test_a_predicted_need_is_compared_with_whether_the_robot_came_to_a_charger_in_time() -> None:
    found = places()
    say(found, 0.0, [], r=[0.1, 0.2, 0.4, 0.6, 1.0], s=[0.0, 0.0, 0.0, 0.0, 0.5])
    found.add_entry(PlaceEntry("d1", "r", 200.0, 0.0))
    found.advance(1000.0)
    rows = figures(found)
    assert [row["need_said"] for row in rows.values()] == [2] * 5
    assert [row["need_likely"] for row in rows.values()] == pytest.approx([0.05, 0.1, 0.2, 0.3, 0.75])
    assert [row["need_came"] for row in rows.values()] == [0.0, 0.0, 0.0, 0.5, 0.5]
    assert [row["need_brier"] for row in rows.values()] == pytest.approx([0.005, 0.02, 0.08, 0.08, 0.125])


def test_the_outcome_of_a_need_is_known_up_to_the_last_report() -> None:
    found = PlaceScores([resource("c1", 0, 0, kind="charger")], {"r": 150.0})
    say(found, 0.0, [], r=[0.5] * 5)
    rows = {figure["ahead_up_to_s"]: figure for figure in found.figures(1e4, {"c1": NOBODY})}
    assert [row["need_said"] for row in rows.values()] == [1, 1, 1, 0, 0]
    assert rows[300.0]["need_brier"] is None


@pytest.mark.parametrize(("likely", "foretold"), [(0.6, 1.0), (0.4, 0.0)])
def test_an_arrival_at_a_charger_is_predicted_by_a_probable_need(likely: float, foretold: float) -> None:
    found = places()
    say(found, 0.0, [], r=[0.0, 0.0, 0.0, 0.0, likely])
    found.add_entry(PlaceEntry("d1", "r", 900.0, 0.0))
    assert figures(found)[900.0]["foretold"] == foretold
    assert figures(found)[60.0]["foretold"] == 0.0


def test_a_need_ends_when_the_robot_leaves_or_arrives() -> None:
    found = places()
    say(found, 0.0, [comes(5.0, robot="s")], r=[0.5] * 5, s=[0.5] * 5)
    found.forget("r")
    found.add_entry(PlaceEntry("d1", "s", 5.0, 0.0))
    found.add_entry(PlaceEntry("d1", "s", 50.0, 0.0))
    assert [row["need_said"] for row in figures(found).values()] == [1] * 5
