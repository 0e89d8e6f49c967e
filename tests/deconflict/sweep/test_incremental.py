"""Sweeping a floor pass after pass gives the result of a fresh sweep."""

from collections.abc import Iterable

import numpy as np
import pytest
from numpy.random import Generator

from deconflict.sweep import slot_table
from deconflict.sweep.contact_intervals import PairConflicts
from deconflict.sweep.incremental import Sweeper
from ingest.batch import Forecasts
from tests.helpers.made_encounters import NOW_S, robot, wanderer

CLEARANCE_M, SIDE_M = 0.25, 12.0
COLUMNS = ("contact_s", "separation_m", "separation_at_s", "start_separation_m")


def said(rng: Generator, now_s: float) -> Forecasts:
    """A random forecast around `now_s`: it drives, stands, changes floor, appears later, or reported long ago."""
    forecasts = wanderer(rng, spread_m=SIDE_M / 2)
    kind = rng.integers(0, 5)
    t = forecasts.t_s + (now_s - NOW_S) + (3.0 if kind == 1 else -9.0 if kind == 2 else 0.0)
    floor = rng.integers(0, 2, len(t)) if kind == 3 else forecasts.floor
    return robot(
        t - NOW_S,
        forecasts.x_m,
        forecasts.y_m,
        forecasts.yaw_rad,
        (forecasts.length_m[0], forecasts.width_m[0]),
        floor=floor,
    )


def swept_afresh(on_floor: dict[str, Forecasts], now_s: float, order: Iterable[str] | None = None) -> PairConflicts:
    sweeper = Sweeper(clearance_m=CLEARANCE_M)
    keys = list(on_floor if order is None else order)
    sweeper.update(keys, Forecasts.joined(on_floor[key] for key in keys))
    return sweeper.find_conflicts(now_s)


def assert_same(found: PairConflicts, fresh: PairConflicts) -> None:
    assert found.pairs == fresh.pairs
    for column in COLUMNS:
        np.testing.assert_array_equal(getattr(found, column), getattr(fresh, column), err_msg=column)


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("robots", [8, 60])
def test_many_passes_equal_a_fresh_sweep(robots: int, seed: int) -> None:
    rng = np.random.default_rng([seed, robots])
    sweeper, on_floor, now_s, hits = Sweeper(clearance_m=CLEARANCE_M), dict[str, Forecasts](), NOW_S, 0
    for _ in range(40):
        keys = [f"r{row}" for row in rng.choice(robots, rng.choice([0, 1, 2, robots // 2, robots]), replace=False)]
        new = {key: said(rng, now_s) for key in keys}
        sweeper.update(keys, Forecasts.joined(new.values()))
        on_floor |= new
        gone = [key for key in on_floor if rng.random() < 0.02]
        sweeper.discard(gone)
        for key in gone:
            del on_floor[key]
        found = sweeper.find_conflicts(now_s)
        assert_same(found, swept_afresh(on_floor, now_s))
        hits += len(found.pairs)
        now_s += float(rng.choice([0.0, 0.1, 0.5, 1.0, 1.0, 3.7, 14.0]))
    assert hits > 40


@pytest.mark.parametrize("seed", range(3))
def test_dormant_robots_have_all_pairs_but_those_among_themselves(seed: int) -> None:
    rng = np.random.default_rng([seed, 3])
    sweeper, on_floor, now_s = Sweeper(clearance_m=CLEARANCE_M), dict[str, Forecasts](), NOW_S
    dormant, left_out, kept = set[str](), 0, 0
    for _ in range(60):
        keys = [f"r{row}" for row in rng.choice(40, rng.choice([0, 1, 6, 25]), replace=False)]
        new = {key: said(rng, now_s) for key in keys}
        sweeper.update(keys, Forecasts.joined(new.values()))
        on_floor |= new
        asleep = {key for key in on_floor if rng.random() < 0.1}
        sweeper.let_sleep([*asleep, "nobody"])
        gone = [key for key in on_floor if rng.random() < 0.02]
        sweeper.discard(gone)
        for key in gone:
            del on_floor[key]
        dormant = (dormant.difference(keys) | asleep).difference(gone)
        fresh, found = swept_afresh(on_floor, now_s), sweeper.find_conflicts(now_s)
        rows = [row for row, pair in enumerate(fresh.pairs) if not dormant.issuperset(pair)]
        assert found.pairs == tuple(fresh.pairs[row] for row in rows)
        np.testing.assert_array_equal(found.contact_s, fresh.contact_s[rows])
        left_out += len(fresh.pairs) - len(rows)
        kept += sum(not dormant.isdisjoint(pair) for pair in found.pairs)
        now_s += float(rng.choice([0.0, 0.1, 0.5, 1.0, 1.0, 3.7]))
    assert left_out > 40 < kept


def test_time_may_go_back() -> None:
    rng = np.random.default_rng(5)
    on_floor = {f"r{row}": said(rng, NOW_S) for row in range(30)}
    sweeper = Sweeper(clearance_m=CLEARANCE_M)
    sweeper.update(list(on_floor), Forecasts.joined(on_floor.values()))
    for now_s in (NOW_S + 5, NOW_S, NOW_S + 2.5, NOW_S - 1.5):
        assert_same(sweeper.find_conflicts(now_s), swept_afresh(on_floor, now_s))


def test_time_may_go_back_after_a_pass_of_little_reach() -> None:
    rng = np.random.default_rng(9)
    on_floor = {f"r{row}": said(rng, NOW_S) for row in range(30)}
    sweeper = Sweeper(clearance_m=CLEARANCE_M)
    sweeper.update(list(on_floor), Forecasts.joined(on_floor.values()))
    sweeper.find_conflicts(NOW_S + 5, reach_s=2.0)
    assert_same(sweeper.find_conflicts(NOW_S), swept_afresh(on_floor, NOW_S))


def test_a_robot_that_changes_its_size_is_swept_with_the_new_one() -> None:
    sweeper = Sweeper(clearance_m=CLEARANCE_M)
    stands, other = robot([0], [0], [0], 0, (1, 1)), robot([0], [2], [0], 0, (1, 1))
    sweeper.update(["a", "b"], Forecasts.joined([stands, other]))
    assert sweeper.find_conflicts(NOW_S).pairs == ()
    sweeper.update(["b"], robot([0], [2], [0], 0, (2.8, 1)))
    found = sweeper.find_conflicts(NOW_S + 0.1)
    assert found.pairs == (("a", "b"),)
    assert found.separation_m[0] == pytest.approx(0.1)


def test_order_and_batches_make_no_difference() -> None:
    rng = np.random.default_rng(6)
    on_floor = {f"r{row}": said(rng, NOW_S) for row in range(120)}
    at_once = swept_afresh(on_floor, NOW_S)
    assert len(at_once.pairs) > 50
    assert_same(swept_afresh(on_floor, NOW_S, rng.permutation(list(on_floor)).tolist()), at_once)
    piecemeal = Sweeper(clearance_m=CLEARANCE_M)
    for key in rng.permutation(list(on_floor)).tolist():
        piecemeal.update([key], on_floor[key])
    assert_same(piecemeal.find_conflicts(NOW_S), at_once)
    stepped = Sweeper(clearance_m=CLEARANCE_M)
    for keys in np.array_split(rng.permutation(list(on_floor)), 7):
        stepped.update(keys.tolist(), Forecasts.joined(on_floor[key] for key in keys.tolist()))
        last = stepped.find_conflicts(NOW_S)
    assert_same(last, at_once)


def test_other_robots_do_not_change_the_result_of_a_pair() -> None:
    rng = np.random.default_rng(7)
    crowd = {f"r{row}": said(rng, NOW_S) for row in range(60)}
    everyone = swept_afresh(crowd, NOW_S)
    for row, pair in enumerate(everyone.pairs[:25]):
        alone = swept_afresh({key: crowd[key] for key in pair}, NOW_S)
        assert alone.pairs == (pair,)
        for column in COLUMNS:
            assert getattr(alone, column)[0] == getattr(everyone, column)[row]


def test_only_changed_robots_are_fresh_and_few_other_pairs_are_computed() -> None:
    rng = np.random.default_rng(8)
    on_floor = {f"r{row}": said(rng, NOW_S) for row in range(200)}
    sweeper = Sweeper(clearance_m=CLEARANCE_M)
    sweeper.update(list(on_floor), Forecasts.joined(on_floor.values()))
    first = sweeper.find_conflicts(NOW_S)
    assert first.fresh.all()
    again = sweeper.find_conflicts(NOW_S)
    assert again.pairs == first.pairs
    assert not again.fresh.any()
    assert again.segment_pairs < first.segment_pairs / 5
    key = first.pairs[0][0]
    sweeper.update([key], on_floor[key])
    pair_conflicts = sweeper.find_conflicts(NOW_S)
    assert pair_conflicts.fresh.tolist() == [key in pair for pair in pair_conflicts.pairs]
    assert_same(pair_conflicts, first)


def test_an_invalid_forecast_takes_its_robot_off_the_floor_until_the_next() -> None:
    sweeper = Sweeper(clearance_m=CLEARANCE_M)
    a, b = robot([0], [0], [0], 0, (1, 1)), robot([0], [1.1], [0], 0, (1, 1))
    assert sweeper.update(["a", "b"], Forecasts.joined([a, b])) == ()
    assert sweeper.find_conflicts(NOW_S).pairs == (("a", "b"),)
    assert sweeper.update(["b"], robot([0], [float("nan")], [0], 0, (1, 1))) == (("b", "not-finite"),)
    assert sweeper.find_conflicts(NOW_S + 0.1).pairs == ()
    assert sweeper.update(["b"], b) == ()
    assert sweeper.find_conflicts(NOW_S + 0.2).pairs == (("a", "b"),)


def test_discarding_an_unknown_robot_is_no_error() -> None:
    sweeper = Sweeper(clearance_m=CLEARANCE_M)
    sweeper.discard(["nobody"])
    assert sweeper.find_conflicts(NOW_S).pairs == ()


def test_a_silent_robot_is_still_swept_after_minutes() -> None:
    sweeper = Sweeper(clearance_m=CLEARANCE_M)
    silent = robot([0, 5], [-4, 0], [0, 0], 0, (1, 1))
    comes = robot([600, 610], [5, -5], [0, 0], 0, (1, 1))
    sweeper.update(["silent"], silent)
    for second in range(0, 600, 60):
        assert sweeper.find_conflicts(NOW_S + second).pairs == ()
    sweeper.update(["comes"], comes)
    found = sweeper.find_conflicts(NOW_S + 600)
    assert found.pairs == (("comes", "silent"),)
    assert found.contact_s[0] == pytest.approx(NOW_S + 603.75, abs=0.01)


def test_a_silent_robot_is_swept_only_in_the_slabs_that_the_horizon_reaches() -> None:
    row = Forecasts.joined(robot([0], [0.7 * n], [0], 0, (0.5, 0.5)) for n in range(40))
    sweeper = Sweeper(clearance_m=CLEARANCE_M)
    sweeper.update([str(n) for n in range(40)], row)
    whole = sweeper.find_conflicts(NOW_S)
    looked_at = [sweeper.find_conflicts(NOW_S + second).box_pairs for second in range(1, 9)]
    assert len(whole.pairs) == 39
    assert max(looked_at) < whole.box_pairs * 0.4


def test_a_contact_comes_into_view_begins_and_is_over() -> None:
    crosses = robot([0, 40], [-20, 20], [0, 0], 0, (1, 1))
    stands = robot([0], [0], [0], 0, (1, 1), height=(0.2, 0.5))
    sweeper = Sweeper(clearance_m=CLEARANCE_M)
    sweeper.update(["crosses", "stands"], Forecasts.joined([crosses, stands]))
    contact_s = NOW_S + 20 - 1.25
    assert not sweeper.find_conflicts(contact_s - 10.01).pairs
    seen = sweeper.find_conflicts(contact_s - 9.99)
    assert seen.pairs == (("crosses", "stands"),)
    assert seen.contact_s[0] == pytest.approx(contact_s, abs=1.5e-3)
    assert seen.start_separation_m[0] == pytest.approx(10.24, abs=1e-3)
    inside = sweeper.find_conflicts(NOW_S + 20.0)
    assert inside.contact_s[0] == NOW_S + 20.0
    assert inside.start_separation_m[0] == inside.separation_m[0] == 0
    drawing_apart = sweeper.find_conflicts(NOW_S + 21.1)
    assert drawing_apart.separation_m[0] == pytest.approx(0.1, abs=1e-3)
    assert not sweeper.find_conflicts(NOW_S + 21.3).pairs


def test_of_two_rows_of_one_robot_the_later_counts() -> None:
    sweeper = Sweeper(clearance_m=CLEARANCE_M)
    here, away = robot([0], [0], [0], 0, (1, 1)), robot([0], [9], [0], 0, (1, 1))
    sweeper.update(["a", "b", "b"], Forecasts.joined([here, here, away]))
    assert not sweeper.find_conflicts(NOW_S).pairs
    sweeper.update(["b", "b"], Forecasts.joined([away, here]))
    assert sweeper.find_conflicts(NOW_S).pairs == (("a", "b"),)


def test_a_robot_in_a_reused_slot_has_nothing_of_the_last_one() -> None:
    sweeper = Sweeper(clearance_m=CLEARANCE_M)
    here, away = robot([0], [0], [0], 0, (1, 1)), robot([0], [9], [0], 0, (1, 1))
    sweeper.update(["a", "b"], Forecasts.joined([here, here]))
    assert sweeper.find_conflicts(NOW_S).pairs == (("a", "b"),)
    sweeper.discard(["b"])
    sweeper.update(["c"], away)
    assert not sweeper.find_conflicts(NOW_S).pairs
    sweeper.update(["A"], here)
    assert sweeper.find_conflicts(NOW_S).pairs == (("A", "a"),)


def test_unused_knots_are_dropped(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(slot_table, "FEWEST_KNOTS", 10)
    rng = np.random.default_rng(4)
    sweeper = Sweeper(clearance_m=CLEARANCE_M)
    held = []
    for _ in range(30):
        on_floor = {f"r{row}": said(rng, NOW_S) for row in range(15)}
        sweeper.update(list(on_floor), Forecasts.joined(on_floor.values()))
        assert_same(sweeper.find_conflicts(NOW_S), swept_afresh(on_floor, NOW_S))
        held.append(len(sweeper._slot_table.knots))
    assert max(held[10:]) <= 2 * max(held[:10])
