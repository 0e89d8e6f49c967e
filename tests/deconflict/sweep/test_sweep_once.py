"""The sweep against an oracle that shares nothing with it, on more than 10,000 encounters of 17 families."""

from collections import Counter
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from multiprocessing import get_context
from typing import Any

import fcl
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from deconflict import sweep as package
from deconflict.sweep import fcl_check, incremental
from deconflict.sweep.geometry.knots import Knots, Robots
from deconflict.sweep.robot_slots import RobotSlots
from deconflict.sweep.slot_table import SlotTable
from deconflict.sweep.sweep_once import Conflicts, Invalid, first_contacts, sweep
from ingest.batch import Floats, Forecasts, Ints
from ingest.shapes import Shape, shapes_of
from tests.helpers.made_encounters import (
    FAMILIES,
    HORIZON_S,
    NOW_S,
    encounters,
    grazing,
    robot,
    rows_of_pairs,
    wanderer,
)
from tests.helpers.oracle import distances_at, truth

CLEARANCES_M = (0.0, 0.25)
COUNTS = {"graze": 100}
COUNT = 320
GRAZING = ("random", "spinning", "full_turns", "thin")
DISTANCE_M, LATE_S, SEPARATION_M, ROUNDING_M = 1e-3, 1e-3, 2e-3, 1e-6
PUT = SlotTable.replace_forecasts
MADE_EXACT = fcl_check.FclCheck.__init__
INSTANT_S = 1e-6
"""A few steps of a double that counts seconds since the epoch."""


def disagreements(forecasts: Forecasts, clearance_m: float, horizon_s: float = HORIZON_S) -> list[str]:
    """The differences between the sweep and the oracle on the pairs (0, 1), (2, 3), ...: `kind pair by-how-much`."""
    pairs = rows_of_pairs(len(forecasts) // 2)
    true = truth(forecasts, pairs, now_s=NOW_S, horizon_s=horizon_s, clearance_m=clearance_m)
    found = sweep(forecasts, now_s=NOW_S, horizon_s=horizon_s, clearance_m=clearance_m)
    contact_m, nearest_m, start_m = _distances(forecasts, found)
    rows = {(a, b): row for row, (a, b) in enumerate(found.pairs.tolist())}
    lines = [f"stray {pair}" for pair in rows.keys() - set(pairs)]
    lines += [f"invalid {invalid}" for invalid in found.invalid]
    for number, pair in enumerate(pairs):
        closest_m, touch_s = float(true.closest_m[number]), float(true.touch_s[number])
        row = rows.get(pair)
        if row is None:
            lines += [f"missed {pair} {closest_m}"] if closest_m <= clearance_m else []
            continue
        separation_m, starts = float(found.separation_m[row]), (start_m[row], found.start_separation_m[row])
        for kind, much, most in (
            ("false", closest_m - clearance_m, DISTANCE_M),
            ("early", contact_m[row] - clearance_m, DISTANCE_M + ROUNDING_M),
            ("late", found.contact_s[row] - NOW_S - touch_s, LATE_S),
            ("separation", abs(separation_m - closest_m), SEPARATION_M),
            ("separation-time", abs(nearest_m[row] - separation_m), ROUNDING_M * 100),
            ("start", 0.0 if starts[0] == starts[1] else abs(starts[0] - starts[1]), ROUNDING_M),
        ):
            lines += [f"{kind} {pair} {much}"] if much > most else []
    return lines


def _distances(forecasts: Forecasts, found: Conflicts) -> tuple[Floats, Floats, Floats]:
    """Of each pair found, at its contact, when it is nearest, and at its start.

    The first two are taken just before that time, too, where one of the robots leaves the floor at that very time.
    """
    starts_s = forecasts.t_s[forecasts.start[:-1]][found.pairs]
    begin_s = np.maximum(NOW_S, starts_s.max(axis=1))
    contact_s, nearest_s = found.contact_s, found.separation_at_s
    at_s = np.stack([contact_s, contact_s - INSTANT_S, nearest_s, nearest_s - INSTANT_S, begin_s], -1)
    distance = distances_at(forecasts, [(a, b) for a, b in found.pairs.tolist()], at_s)
    return distance[:, :2].min(axis=1), distance[:, 2:4].min(axis=1), distance[:, 4]


@pytest.mark.parametrize("clearance_m", CLEARANCES_M)
@pytest.mark.parametrize("family", FAMILIES)
def test_agrees_with_the_oracle(family: str, clearance_m: float) -> None:
    assert not disagreements(encounters(family, COUNTS.get(family, COUNT), 1, clearance_m), clearance_m)


@pytest.mark.parametrize("clearance_m", CLEARANCES_M)
@pytest.mark.parametrize("family", GRAZING)
def test_agrees_with_the_oracle_where_robots_almost_touch(family: str, clearance_m: float) -> None:
    assert not disagreements(grazing(family, 60, 2, clearance_m), clearance_m)


@pytest.mark.parametrize("clearance_m", CLEARANCES_M)
@pytest.mark.parametrize("family", ["random", "near_miss", "thin", "graze"])
def test_agrees_with_the_oracle_where_fcl_decides_everything(
    family: str, clearance_m: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(incremental, "ROUNDS", 0)
    assert not disagreements(encounters(family, 40, 3, clearance_m), clearance_m)


def test_the_cases_are_many_and_of_both_kinds() -> None:
    counts = [COUNTS.get(family, COUNT) * len(CLEARANCES_M) for family in FAMILIES]
    assert sum(counts) >= 10_000
    for family in FAMILIES:
        forecasts = encounters(family, 100, 1, 0.25)
        hits = len(sweep(forecasts, now_s=NOW_S, horizon_s=HORIZON_S, clearance_m=0.25).pairs)
        assert 4 <= hits <= 98, family


@pytest.mark.parametrize(
    ("broken", "kinds"),
    [
        ("tolerance of advancement", {"early"}),
        ("step", {"missed", "late"}),
        ("tolerance of FCL", {"early"}),
        ("accuracy of separation", {"separation"}),
    ],
)
def test_the_comparison_detects_deliberate_faults(
    broken: str, kinds: set[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    if broken == "tolerance of advancement":
        monkeypatch.setattr(incremental, "TOLERANCE_M", 10 * incremental.TOLERANCE_M)
    elif broken == "step":
        monkeypatch.setattr(SlotTable, "replace_forecasts", _put_with_small_circles)
    elif broken == "tolerance of FCL":
        monkeypatch.setattr(incremental, "ROUNDS", 0)
        monkeypatch.setattr(fcl_check.FclCheck, "__init__", _slack)
    else:
        monkeypatch.setattr(incremental, "ACCURACY_M", 50 * incremental.ACCURACY_M)
    counts = Counter(line.split()[0] for line in disagreements(encounters("spinning", 200, 1, 0.25), 0.25))
    assert kinds <= set(counts)


def _put_with_small_circles(table: SlotTable, keys: Sequence[str], forecasts: Forecasts, *rest: Any) -> Ints | None:
    """Makes turning count for less than it does."""
    slots = PUT(table, keys, forecasts, *rest)
    if slots is not None:
        table.robots["radius"][slots] *= 0.5
    return slots


def _slack(decider: fcl_check.FclCheck, target_m: float, tolerance_m: float) -> None:
    MADE_EXACT(decider, target_m, 10 * tolerance_m)


@settings(max_examples=150)
@given(
    seeds=st.tuples(st.integers(0, 2**32), st.integers(0, 2**32)),
    clearance_m=st.floats(0, 1),
    horizon_s=st.sampled_from([0.3, 1.0, 10.0, 31.7]),
    data=st.data(),
)
def test_agrees_with_the_oracle_wherever_hypothesis_looks(
    seeds: tuple[int, int], clearance_m: float, horizon_s: float, data: st.DataObject
) -> None:
    size = st.floats(0.01, 4)
    pair = []
    for seed in seeds:
        w = wanderer(np.random.default_rng(seed), speed_mps=data.draw(st.floats(0, 6)), spread_m=2.0)
        yaw = w.yaw_rad * data.draw(st.sampled_from([1.0, 0.0, 0.01])) + data.draw(st.sampled_from([0.0, 700.0]))
        t = w.t_s - NOW_S + data.draw(st.floats(-3, 3))
        pair.append(robot(t, w.x_m, w.y_m, yaw, (data.draw(size), data.draw(size))))
    assert not disagreements(Forecasts.joined(pair), clearance_m, horizon_s)


def test_invalid_robots_are_named_and_the_others_swept(monkeypatch: pytest.MonkeyPatch) -> None:
    nan, inf = float("nan"), float("inf")
    wheel = np.cos(np.arange(40) * np.pi / 20), np.sin(np.arange(40) * np.pi / 20)
    stands = robot([0], [0], [0], 0, (1, 1))
    invalid = {
        "not-finite": robot([0, 1], [0, nan], [0, 0], 0, (1, 1)),
        "times-not-increasing": robot([0, 2, 1], [0, 0, 0], [0, 0, 0], 0, (1, 1)),
        "size-not-positive": robot([0], [0], [0], 0, (0, 1)),
        "size-not-finite": robot([0], [0], [0], 0, (1, inf)),
        "heights-not-ordered": robot([0], [0], [0], 0, (1, 1), height=(2, 1)),
        "no-knots": robot([], [], [], [], (1, 1)),
        "shape-not-valid": replace(stands, shapes=shapes_of([Shape.polygon(zip(*wheel, strict=True))])),
    }
    asked: list[NDArray[np.float64]] = []

    def collide(a: Any, b: Any, *rest: Any) -> Any:
        asked.extend([a.getTranslation(), b.getTranslation(), a.getRotation(), b.getRotation()])
        return fcl_collide(a, b, *rest)

    fcl_collide = fcl.collide
    monkeypatch.setattr(fcl, "collide", collide)
    monkeypatch.setattr(incremental, "ROUNDS", 0)
    found = sweep(Forecasts.joined([stands, *invalid.values(), stands]), now_s=NOW_S, clearance_m=0.1)
    assert found.invalid == tuple(Invalid(1 + row, reason) for row, reason in enumerate(invalid))
    assert found.pairs.tolist() == [[0, len(invalid) + 1]]
    assert asked
    assert all(np.isfinite(values).all() for values in asked)


@pytest.mark.parametrize("wrong", [{"clearance_m": -0.1}, {"clearance_m": 0.1, "horizon_s": 0.0}])
def test_settings_that_make_no_sense_are_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(ValueError, match="clearance_m must be at least 0 and horizon_s above 0"):
        sweep(Forecasts.empty(), now_s=NOW_S, **wrong)


def test_no_robots_no_conflicts() -> None:
    found = sweep(Forecasts.empty(), now_s=NOW_S, clearance_m=0.1)
    assert (len(found.pairs), len(found.contact_s), found.invalid) == (0, 0, ())


COLUMNS = ("contact_s", "separation_m", "separation_at_s", "start_separation_m")


def crowd_of(robots: int, seed: int) -> Forecasts:
    """Robots on 24 m by 24 m. Some headings have wound up over a long day."""
    rng = np.random.default_rng(seed)
    crowd = Forecasts.joined(wanderer(rng, spread_m=12.0) for _ in range(robots))
    crowd.yaw_rad[:] += np.repeat(rng.choice([0.0, -400.0, 50_000.0], robots), np.diff(crowd.start))
    return crowd


@pytest.mark.parametrize("clearance_m", CLEARANCES_M)
@pytest.mark.parametrize("rounds", [0, incremental.ROUNDS])
def test_the_order_of_robots_makes_no_difference(
    rounds: int, clearance_m: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Times are near 0, so that a difference would show in the last digits. Without rounds, FCL decides most pairs."""
    monkeypatch.setattr(incremental, "ROUNDS", rounds)
    crowd = crowd_of(100, 3)
    crowd = replace(crowd, t_s=crowd.t_s - NOW_S)
    order = np.random.default_rng(3).permutation(len(crowd))
    straight = sweep(crowd, now_s=0.0, clearance_m=clearance_m)
    mixed = sweep(crowd.take(order), now_s=0.0, clearance_m=clearance_m)
    named = {tuple(sorted(order[list(pair)].tolist())): row for row, pair in enumerate(mixed.pairs.tolist())}
    assert len(straight.pairs) > 100
    assert sorted(named) == [tuple(pair) for pair in straight.pairs.tolist()]
    rows = [named[tuple(pair)] for pair in straight.pairs.tolist()]
    for column in COLUMNS:
        np.testing.assert_array_equal(getattr(mixed, column)[rows], getattr(straight, column), err_msg=column)


def test_other_robots_do_not_change_the_result_of_a_pair() -> None:
    crowd = crowd_of(60, 4)
    everyone = sweep(crowd, now_s=NOW_S, clearance_m=0.25)
    assert len(everyone.pairs) > 50
    for row, pair in enumerate(everyone.pairs[:40].tolist()):
        alone = sweep(crowd.take(pair), now_s=NOW_S, clearance_m=0.25)
        assert [getattr(alone, column).tolist() for column in COLUMNS] == [
            [getattr(everyone, column)[row]] for column in COLUMNS
        ]


def test_times_may_count_from_any_epoch() -> None:
    crowd = crowd_of(60, 5)
    since_1970 = sweep(crowd, now_s=NOW_S, clearance_m=0.25)
    for shift_s in (-NOW_S, -NOW_S - 1000.0):
        shifted = sweep(replace(crowd, t_s=crowd.t_s + shift_s), now_s=NOW_S + shift_s, clearance_m=0.25)
        np.testing.assert_array_equal(shifted.pairs, since_1970.pairs)
        np.testing.assert_allclose(shifted.separation_m, since_1970.separation_m, atol=2e-3)
        at_s = shifted.contact_s[:, None] - shift_s
        distance = distances_at(crowd, [(a, b) for a, b in shifted.pairs.tolist()], at_s)
        assert distance.max() <= 0.25 + DISTANCE_M + ROUNDING_M


def laid_out(forecasts: Forecasts) -> tuple[Robots, Knots]:
    table = SlotTable(RobotSlots())
    table.replace_forecasts([str(row) for row in range(len(forecasts))], forecasts)
    return table.robots, table.knots


@pytest.mark.parametrize("clearance_m", CLEARANCES_M)
@pytest.mark.parametrize("family", FAMILIES)
def test_chosen_pairs_have_the_contacts_of_the_whole_floor(family: str, clearance_m: float) -> None:
    forecasts = encounters(family, 60, 11, clearance_m)
    a, b = np.array(rows_of_pairs(60)).T.copy()
    until_s = np.full(len(a), NOW_S + HORIZON_S)
    contact_s, start_m = first_contacts(
        *laid_out(forecasts), b, a, now_s=NOW_S, until_s=until_s, clearance_m=clearance_m
    )
    whole = sweep(forecasts, now_s=NOW_S, horizon_s=HORIZON_S, clearance_m=clearance_m)
    met = np.flatnonzero(contact_s < np.inf)
    assert [[row, row + 1] for row in a[met].tolist()] == whole.pairs.tolist()
    assert np.abs(contact_s[met] - whole.contact_s).max(initial=0.0) < LATE_S
    np.testing.assert_allclose(start_m[met], whole.start_separation_m, atol=ROUNDING_M)


@pytest.mark.parametrize("rounds", [0, incremental.ROUNDS])
def test_chosen_pairs_are_swept_until_their_own_times(monkeypatch: pytest.MonkeyPatch, rounds: int) -> None:
    """FCL, which decides if advancement has no rounds, gives the same result to a millimetre."""
    forecasts = encounters("random", 60, 11, 0.25)
    a, b = np.array(rows_of_pairs(60)).T.copy()
    all_s, _ = first_contacts(
        *laid_out(forecasts), a, b, now_s=NOW_S, until_s=np.full(60, NOW_S + HORIZON_S), clearance_m=0.25
    )
    met = np.flatnonzero(all_s < np.inf)
    until_s = np.where(np.arange(60) % 2, all_s + 0.1, all_s - 0.1)
    until_s[all_s == np.inf] = NOW_S + HORIZON_S
    monkeypatch.setattr("deconflict.sweep.sweep_once.ROUNDS", rounds)
    told_s, _ = first_contacts(*laid_out(forecasts), a, b, now_s=NOW_S, until_s=until_s, clearance_m=0.25)
    in_time = met[(met % 2 == 1) & (until_s[met] > NOW_S)]
    assert len(in_time) > 5
    assert np.flatnonzero(told_s < np.inf).tolist() == in_time.tolist()
    assert np.abs(told_s[in_time] - all_s[in_time]).max() < (LATE_S if rounds == 0 else INSTANT_S)


def test_chosen_robots_without_knots_have_no_contact() -> None:
    crossing = [robot([0, 8], [-4, 4], [0, 0], 0.0, (1.0, 0.6)), robot([0, 8], [0, 0], [-4, 4], 1.6, (1.0, 0.6))]
    robots, knots = laid_out(Forecasts.joined([*crossing, crossing[1]]))
    robots["count"][2] = 0
    a, b, until_s = np.array([0, 0]), np.array([1, 2]), np.full(2, NOW_S + HORIZON_S)
    found = first_contacts(robots, knots, a, b, now_s=NOW_S, until_s=until_s, clearance_m=0.3)
    assert np.isfinite(found).tolist() == [[True, False], [True, False]]


def rows_of(crowd: Forecasts, chosen: list[int]) -> dict[tuple[int, int], tuple[float, ...]]:
    """The conflicts among the chosen robots, by their rows in the whole crowd: what one process of several finds."""
    found = sweep(crowd.take(chosen), now_s=NOW_S, clearance_m=0.25)
    figures = zip(*(getattr(found, column).tolist() for column in COLUMNS), strict=True)
    return {(chosen[a], chosen[b]): row for (a, b), row in zip(found.pairs.tolist(), figures, strict=True)}


def test_the_number_of_processes_makes_no_difference() -> None:
    """Each process has two of four parts of the crowd, so that every pair is swept by at least one of them."""
    crowd = crowd_of(60, 5)
    parts = [list(range(start, 60, 4)) for start in range(4)]
    shares = [sorted(parts[a] + parts[b]) for a in range(4) for b in range(a)]
    with ProcessPoolExecutor(3, mp_context=get_context("spawn")) as pool:
        by_step = list(pool.map(rows_of, [crowd] * len(shares), shares))
    whole = rows_of(crowd, list(range(60)))
    assert len(whole) > 50
    assert all(share.items() <= whole.items() for share in by_step)
    assert {pair: row for share in by_step for pair, row in share.items()} == whole


def test_the_package_offers_the_sweep_and_what_it_returns() -> None:
    conflicts = package.sweep(Forecasts.empty(), now_s=NOW_S, clearance_m=0.3)
    assert isinstance(conflicts, package.Conflicts)
    assert package.Invalid is Invalid
    with pytest.raises(AttributeError, match="no attribute 'swept'"):
        package.swept  # noqa: B018
