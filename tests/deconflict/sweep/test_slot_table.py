"""A roster holds the newest forecast of each robot, whoever came, left or said more than before."""

from dataclasses import replace as replaced

import numpy as np
import pytest

from deconflict.sweep import slot_table as module
from deconflict.sweep.geometry.knots import KNOT, ROBOT, replace
from deconflict.sweep.slot_table import Roster
from ingest.batch import Forecasts
from tests.helpers.made_encounters import wanderer


def assert_holds(roster: Roster, newest: dict[str, Forecasts]) -> None:
    assert roster.slots.keys() == newest.keys()
    for key, forecast in newest.items():
        robot = roster.robots[roster.slots[key]]
        said = np.zeros(len(forecast.t_s), KNOT)
        replace(np.zeros(1, ROBOT), said, np.zeros(1, np.int64), 0, forecast)
        np.testing.assert_array_equal(roster.knots[robot["first"] : robot["first"] + robot["count"]], said)
        assert 2 * robot["half_length"] == forecast.length_m[0]
        assert robot["appears"] == forecast.t_s[0]
        assert roster.keys[roster.slots[key]] == key
    keys = ["nobody", *reversed(newest)]
    robots, knots = roster.swept(keys)
    for key, one in zip(keys, robots, strict=True):
        own = roster.robots[roster.slots[key]] if key in newest else np.zeros(1, ROBOT)[0]
        assert one[["half_length", "top", "count"]] == own[["half_length", "top", "count"]]
        of = roster.knots[own["first"] : own["first"] + own["count"]]
        np.testing.assert_array_equal(knots[one["first"] : one["first"] + one["count"]], of)


def test_robots_come_go_and_say_more_or_less_than_before(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "FEWEST_KNOTS", 10)
    rng, roster, newest, most = np.random.default_rng(71), Roster(), dict[str, Forecasts](), 0
    for _ in range(60):
        said = {f"r{row}": wanderer(rng, knots=int(rng.integers(1, 12))) for row in rng.choice(20, 6, replace=False)}
        roster.put(list(said), Forecasts.joined(said.values()))
        newest |= said
        gone = [key for key in newest if rng.random() < 0.1]
        roster.discard(gone)
        newest = {key: forecast for key, forecast in newest.items() if key not in gone}
        assert_holds(roster, newest)
        most = max(most, len(roster))
    assert most <= 20
    assert len(roster.knots) <= 20 * 12 * 2


def test_as_many_knots_as_before_take_the_place_of_the_old_ones() -> None:
    rng, roster = np.random.default_rng(72), Roster()
    for _ in range(5):
        said = wanderer(rng, knots=7)
        roster.put(["a"], said)
        assert_holds(roster, {"a": said})
        assert roster.robots["first"][roster.slots["a"]] == 0


def test_nothing_is_replaced_where_a_forecast_cannot_be_swept() -> None:
    rng, roster = np.random.default_rng(75), Roster()
    newest = {"a": wanderer(rng), "b": wanderer(rng)}
    roster.put(list(newest), Forecasts.joined(newest.values()))
    wrong = replaced(wanderer(rng), width_m=np.zeros(1))
    assert roster.put(["a", "b"], Forecasts.joined([wanderer(rng), wrong])) is None
    assert_holds(roster, newest)
    assert roster.put(["c"], wrong) is None
    assert not len(roster.present(np.arange(3))[2:])


def test_ranks_follow_the_keys_not_the_slots() -> None:
    rng, roster = np.random.default_rng(73), Roster()
    roster.put(["c", "a"], Forecasts.joined([wanderer(rng), wanderer(rng)]))
    assert roster.ranks()[[roster.slots["a"], roster.slots["c"]]].tolist() == [0, 1]
    roster.put(["b"], wanderer(rng))
    assert roster.ranks()[[roster.slots[key] for key in "abc"]].tolist() == [0, 1, 2]
    roster.discard(["a"])
    assert roster.present(np.arange(3)).tolist() == sorted([roster.slots["b"], roster.slots["c"]])


def test_columns_may_lie_anywhere_in_memory_and_need_not_be_writable() -> None:
    """As they do where a batch was read from bytes."""
    said = wanderer(np.random.default_rng(74), knots=5)
    moved = {}
    for name in ("t_s", "x_m", "y_m", "yaw_rad", "floor"):
        column = getattr(said, name)
        moved[name] = np.frombuffer(b"x" + column.tobytes(), column.dtype, len(column), 1)
        assert not moved[name].flags.aligned
    by_robot = {name: getattr(said, name) for name in ("start", "length_m", "width_m", "bottom_m", "top_m")}
    roster = Roster()
    roster.put(["a"], Forecasts(**by_robot, **moved))
    assert_holds(roster, {"a": said})
