"""The table holds the newest forecast of each robot while robots come, leave, and change their number of knots."""

from dataclasses import replace as replaced

import numpy as np
import pytest

from deconflict.sweep import slot_table as module
from deconflict.sweep.geometry.knots import KNOT, ROBOT, replace
from deconflict.sweep.robot_slots import RobotSlots
from deconflict.sweep.slot_table import SlotTable
from ingest.batch import Forecasts
from tests.helpers.made_encounters import wanderer


def assert_holds(table: SlotTable, newest: dict[str, Forecasts]) -> None:
    assert set(table.slots.names(np.flatnonzero(table.robots["count"]))) == newest.keys()
    for key, forecast in newest.items():
        robot = table.robots[table.slots.by_uuid[key]]
        values = np.zeros(len(forecast.t_s), KNOT)
        replace(np.zeros(1, ROBOT), values, np.zeros(1, np.int64), 0, forecast)
        np.testing.assert_array_equal(table.knots[robot["first"] : robot["first"] + robot["count"]], values)
        assert 2 * robot["half_length"] == forecast.length_m[0]
        assert robot["appears"] == forecast.t_s[0]
    keys = ["nobody", *reversed(newest)]
    robots, knots = table.copied(keys)
    for key, row in zip(keys, robots, strict=True):
        own = table.robots[table.slots.by_uuid[key]] if key in newest else np.zeros(1, ROBOT)[0]
        assert row[["half_length", "top", "count"]] == own[["half_length", "top", "count"]]
        of = table.knots[own["first"] : own["first"] + own["count"]]
        np.testing.assert_array_equal(knots[row["first"] : row["first"] + row["count"]], of)


def test_robots_come_go_and_change_their_number_of_knots(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "FEWEST_KNOTS", 10)
    rng, table, newest, most = np.random.default_rng(71), SlotTable(RobotSlots()), dict[str, Forecasts](), 0
    for _ in range(60):
        forecasts = {
            f"r{row}": wanderer(rng, knots=int(rng.integers(1, 12))) for row in rng.choice(20, 6, replace=False)
        }
        table.replace_forecasts(list(forecasts), Forecasts.joined(forecasts.values()))
        newest |= forecasts
        gone = [key for key in newest if rng.random() < 0.1]
        table.discard(gone)
        newest = {key: forecast for key, forecast in newest.items() if key not in gone}
        assert_holds(table, newest)
        most = max(most, len(table.slots))
    assert most <= 20
    assert len(table.knots) <= 20 * 12 * 2


def test_as_many_knots_as_before_take_the_place_of_the_old_ones() -> None:
    rng, table = np.random.default_rng(72), SlotTable(RobotSlots())
    for _ in range(5):
        forecasts = wanderer(rng, knots=7)
        table.replace_forecasts(["a"], forecasts)
        assert_holds(table, {"a": forecasts})
        assert table.robots["first"][table.slots.by_uuid["a"]] == 0


def test_nothing_is_replaced_if_a_forecast_cannot_be_swept() -> None:
    rng, table = np.random.default_rng(75), SlotTable(RobotSlots())
    newest = {"a": wanderer(rng), "b": wanderer(rng)}
    table.replace_forecasts(list(newest), Forecasts.joined(newest.values()))
    wrong = replaced(wanderer(rng), width_m=np.zeros(1))
    assert table.replace_forecasts(["a", "b"], Forecasts.joined([wanderer(rng), wrong])) is None
    assert_holds(table, newest)
    assert table.replace_forecasts(["c"], wrong) is None
    assert not len(table.present(np.arange(3))[2:])


def test_ranks_follow_the_keys_not_the_slots() -> None:
    rng, table = np.random.default_rng(73), SlotTable(RobotSlots())
    table.replace_forecasts(["c", "a"], Forecasts.joined([wanderer(rng), wanderer(rng)]))
    assert table.slots.ranks()[[table.slots.by_uuid["a"], table.slots.by_uuid["c"]]].tolist() == [0, 1]
    table.replace_forecasts(["b"], wanderer(rng))
    assert table.slots.ranks()[[table.slots.by_uuid[key] for key in "abc"]].tolist() == [0, 1, 2]
    table.discard(["a"])
    assert table.present(np.arange(3)).tolist() == sorted([table.slots.by_uuid["b"], table.slots.by_uuid["c"]])


def test_columns_may_lie_anywhere_in_memory_and_need_not_be_writable() -> None:
    """As in a batch that was read from bytes."""
    forecasts = wanderer(np.random.default_rng(74), knots=5)
    moved = {}
    for name in ("t_s", "x_m", "y_m", "yaw_rad", "floor"):
        column = getattr(forecasts, name)
        moved[name] = np.frombuffer(b"x" + column.tobytes(), column.dtype, len(column), 1)
        assert not moved[name].flags.aligned
    by_robot = {name: getattr(forecasts, name) for name in ("start", "length_m", "width_m", "bottom_m", "top_m")}
    table = SlotTable(RobotSlots())
    table.replace_forecasts(["a"], Forecasts(**by_robot, **moved))
    assert_holds(table, {"a": forecasts})
