"""Pairs of every two kinds of shape against an oracle that shares nothing with the sweep."""

from dataclasses import replace
from itertools import combinations_with_replacement

import numpy as np
import pytest

from deconflict.sweep import incremental
from deconflict.sweep.shapes import fcl_shapes, shape_decisions
from deconflict.sweep.sweep_once import Conflicts, sweep
from ingest.batch import Forecasts
from ingest.shapes import Shape, ShapePart, shapes_of
from tests.helpers.made_encounters import HORIZON_S, NOW_S, encounters, robot, rows_of_pairs
from tests.helpers.made_shapes import KINDS
from tests.helpers.shape_oracle import approach, bodies, distances

DISTANCE_M, LATE_S, SEPARATION_M = 1e-3, 1e-3, 2e-3
FAMILIES = ("random", "spinning", "near_miss", "heights")
CLEARANCE_M = 0.25


def mixed(family: str, kinds: tuple[str, str], pairs: int, seed: int) -> Forecasts:
    rng = np.random.default_rng([seed, *map(ord, "".join(kinds))])
    forecasts = encounters(family, pairs, seed, CLEARANCE_M)
    shapes = [KINDS[kinds[row % 2]](rng) for row in range(2 * pairs)]
    return replace(forecasts, shapes=shapes_of(shapes))


def disagreements(forecasts: Forecasts, found: Conflicts, clearance_m: float) -> list[str]:
    """The differences between the sweep and the oracle on the pairs (0, 1), (2, 3), ...: `kind pair by-how-much`."""
    rows = {(a, b): row for row, (a, b) in enumerate(found.pairs.tolist())}
    lines = [f"invalid {invalid}" for invalid in found.invalid]
    for pair in rows_of_pairs(len(forecasts) // 2):
        true = approach(forecasts, pair, now_s=NOW_S, horizon_s=HORIZON_S, clearance_m=clearance_m)
        row = rows.get(pair)
        if row is None:
            lines += [f"missed {pair} {true.closest_m}"] if true.closest_m <= clearance_m else []
            continue
        a, b = (bodies(forecasts, each) for each in pair)
        contact_s = found.contact_s[row]
        contact_m = distances(a, b, np.array([contact_s, contact_s - 1e-6])).min()
        for kind, much, most in (
            ("false", true.closest_m - clearance_m, DISTANCE_M),
            ("early", contact_m - clearance_m, DISTANCE_M + 1e-6),
            ("late", contact_s - NOW_S - true.touch_s, LATE_S),
            ("separation", abs(found.separation_m[row] - true.closest_m), SEPARATION_M),
            ("start", abs(found.start_separation_m[row] - true.start_m) if true.start_m < np.inf else 0.0, 1e-6),
        ):
            lines += [f"{kind} {pair} {much}"] if much > most else []
    return lines


@pytest.mark.parametrize("kinds", list(combinations_with_replacement(KINDS, 2)), ids="-".join)
def test_agrees_with_the_oracle(kinds: tuple[str, str]) -> None:
    hits = pairs = 0
    for family in FAMILIES:
        forecasts = mixed(family, kinds, 12, 1)
        found = sweep(forecasts, now_s=NOW_S, horizon_s=HORIZON_S, clearance_m=CLEARANCE_M)
        assert not disagreements(forecasts, found, CLEARANCE_M), family
        hits, pairs = hits + len(found.pairs), pairs + 12
    assert 5 <= hits <= pairs - 5


@pytest.mark.parametrize("kinds", [("circle", "polygon"), ("star", "rectangle"), ("parts", "circle")], ids="-".join)
def test_agrees_where_fcl_finds_every_contact(kinds: tuple[str, str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(incremental, "ROUNDS", 0)
    forecasts = mixed("random", kinds, 12, 2)
    found = sweep(forecasts, now_s=NOW_S, horizon_s=HORIZON_S, clearance_m=CLEARANCE_M)
    assert len(found.pairs)
    assert not disagreements(forecasts, found, CLEARANCE_M)


def test_the_comparison_detects_a_deliberate_fault(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(incremental, "TOLERANCE_M", 0.05)
    forecasts = mixed("random", ("circle", "polygon"), 40, 3)
    found = sweep(forecasts, now_s=NOW_S, horizon_s=HORIZON_S, clearance_m=CLEARANCE_M)
    assert {line.split()[0] for line in disagreements(forecasts, found, CLEARANCE_M)} >= {"early"}


@pytest.mark.parametrize("kind", ["circle", "polygon", "star"])
@pytest.mark.parametrize("clearance_m", [0.0, CLEARANCE_M])
def test_a_shape_wholly_inside_another_is_in_contact(kind: str, clearance_m: float) -> None:
    """A mesh is a surface: these surfaces do not touch."""
    rng = np.random.default_rng(4)
    inner, outer = robot([0], [0.05], [0.02], 0.3, (0.1, 0.1)), robot([0], [0], [0], 0.0, (4, 4))
    shapes = shapes_of([Shape.circle(0.05), KINDS[kind](rng) if kind != "circle" else Shape.circle(3.0)])
    both = replace(Forecasts.joined([inner, outer]), shapes=shapes)
    for forecasts in (both, both.take([1, 0])):
        found = sweep(forecasts, now_s=NOW_S, clearance_m=clearance_m)
        assert found.contact_s.tolist() == [NOW_S]
        assert found.separation_m.tolist() == [0.0]


def test_a_part_counts_where_it_is_though_the_robot_was_reported_lower() -> None:
    flat, high = robot([0], [0], [0], 0.0, (1, 1), height=(0, 0.5)), robot([0], [0], [0], 0.0, (1, 1), height=(1.2, 2))
    mast = Shape((ShapePart(((0.0, 0.0),), 0.3, 0.0, 1.5),))
    both = replace(Forecasts.joined([flat, high]), shapes=shapes_of([mast, None]))
    assert len(sweep(both, now_s=NOW_S, clearance_m=0.0).pairs) == 1


def test_round_robots_that_pass_corner_to_corner_are_no_conflict() -> None:
    """Their rectangles overlap, and they do not."""
    standing, passing = robot([0], [0], [0], 0.0, (1, 1)), robot([0, 10], [-5, 5], [0.9 + 6, 0.9 - 4], 0.0, (1, 1))
    squares = Forecasts.joined([standing, passing])
    circles = replace(squares, shapes=shapes_of([Shape.circle(1.0)] * 2))
    assert len(sweep(squares, now_s=NOW_S, clearance_m=0.0).pairs) == 1
    assert len(sweep(circles, now_s=NOW_S, clearance_m=0.0).pairs) == 0


def test_fcl_decides_each_new_contact_once(monkeypatch: pytest.MonkeyPatch) -> None:
    forecasts = mixed("random", ("circle", "polygon"), 40, 5)
    sweeper = incremental.Sweeper(clearance_m=CLEARANCE_M)
    sweeper.update([f"{row:03}" for row in range(len(forecasts))], forecasts)
    found = sweeper.find_conflicts(NOW_S)
    assert len(found.pairs) <= found.fcl_calls <= 2 * len(found.pairs)
    assert sweeper.find_conflicts(NOW_S).fcl_calls == 0


def test_circles_and_rectangles_need_no_confirmation() -> None:
    forecasts = mixed("random", ("circle", "rectangle"), 40, 5)
    sweeper = incremental.Sweeper(clearance_m=CLEARANCE_M)
    sweeper.update([f"{row:03}" for row in range(len(forecasts))], forecasts)
    found = sweeper.find_conflicts(NOW_S)
    assert len(found.pairs)
    assert found.fcl_calls == 0


def test_what_fcl_denies_is_looked_at_again(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(shape_decisions, "touches", lambda pairs, _: np.zeros(len(pairs), bool))
    monkeypatch.setattr(fcl_shapes, "touch", lambda *_: False)
    forecasts = mixed("random", ("circle", "polygon"), 40, 5)
    assert not len(sweep(forecasts, now_s=NOW_S, clearance_m=CLEARANCE_M).pairs)
