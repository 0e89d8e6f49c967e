"""Levels that stay, move, come back, and wander as those of a steady vendor do."""

import json
from itertools import accumulate
from math import pi, sin
from random import Random

import pytest

from ingest.measures.change_detection import ADOPTED_S, LEARNED, ChangeDetector, ChangeLimits, LevelChange

NOW_S = 1_790_000_000.0
STEP_S = 120.0
DAY = int(86_400 / STEP_S)
LIMITS = ChangeLimits(least_spread=0.1, least_change=0.3)


def noise(n: int, seed: int, spread: float = 0.2, kept: float = 0.5) -> list[float]:
    """Each value is in part the one before it, as levels of traffic are."""
    rng, fresh = Random(seed), spread * (1 - kept**2) ** 0.5
    return list(accumulate((rng.gauss(0, fresh) for _ in range(n)), lambda before, new: kept * before + new))


def followed(values: list[float], limits: ChangeLimits = LIMITS) -> list[LevelChange | None]:
    level, changes = ChangeDetector(limits), []
    for number, value in enumerate(values):
        level.add(value, NOW_S + number * STEP_S)
        changes.append(level.change)
    return changes


def flags(changes: list[LevelChange | None]) -> int:
    return sum(now is not None and before is None for before, now in zip([None, *changes], changes, strict=False))


def test_steady_vendors_are_hardly_ever_flagged_in_a_day() -> None:
    days = [followed(noise(DAY, seed)) for seed in range(50)]
    assert sum(map(flags, days)) <= 1


def test_the_rhythm_of_a_day_is_no_change() -> None:
    wandering = [
        [value + 0.2 * sin(2 * pi * n / DAY) for n, value in enumerate(noise(3 * DAY, seed))] for seed in range(10)
    ]
    assert sum(flags(followed(values)) for values in wandering) <= len(wandering) * 3 / 10


@pytest.mark.parametrize("by", [1.0, -1.0])
def test_a_change_is_told_with_since_when_and_by_how_much_and_when_it_is_over(by: float) -> None:
    for seed in range(20):
        began, ended = 200, 260
        values = [v + (by if began <= n < ended else 0.0) for n, v in enumerate(noise(400, seed, spread=0.15))]
        changes = followed(values)
        assert flags(changes[:began]) == 0
        standing = changes[began + 15 : ended]
        assert all(standing)
        last = standing[-1]
        assert last
        assert abs(last.since_s - (NOW_S + began * STEP_S)) <= 7 * STEP_S
        assert last.by == pytest.approx(by, abs=0.3)
        assert changes[ended + 40] is None


def test_a_slow_drift_is_a_change_too() -> None:
    drifting = [value + max(n - 200, 0) / 100 for n, value in enumerate(noise(400, 3))]
    assert followed(drifting)[-1] is not None


def test_one_extreme_value_is_no_change() -> None:
    values = noise(100, 4)
    values[50] = 1e9
    assert not any(followed(values))


def test_falls_are_ignored_if_only_rises_count() -> None:
    better = [value - (1.0 if n >= 100 else 0.0) for n, value in enumerate(noise(200, 5, spread=0.1))]
    assert any(followed(better))
    assert not any(followed(better, ChangeLimits(0.1, 0.3, rises_only=True)))


def test_a_change_below_the_limit_is_ignored() -> None:
    assert not any(followed([0.0] * 50 + [0.25] * 100))
    assert any(followed([0.0] * 50 + [0.35] * 100))


def test_a_change_that_lasts_a_day_becomes_the_usual_level() -> None:
    changes = followed([0.0] * 50 + [1.0] * (DAY + 50) + [0.0] * 50)
    flagged = [number for number, change in enumerate(changes) if change]
    assert changes[50 + int(ADOPTED_S / STEP_S) + LEARNED + 5] is None
    # going back to what it was is then a change
    assert flagged[-1] > 50 + DAY + 50


def test_a_clock_that_is_set_back_by_years_neither_hides_nor_ends_a_change() -> None:
    level = ChangeDetector(LIMITS)
    for number in range(100):
        at_s = NOW_S + number * STEP_S - (1e9 if number >= 70 else 0.0)
        level.add(1.0 if number >= 50 else 0.0, at_s)
        assert bool(level.change) == (number >= 60) or 50 <= number < 60
    for number in range(100, 120):
        level.add(0.0, NOW_S + number * STEP_S - 1e9)
    assert level.change is None


def test_a_detector_continues_after_a_restart() -> None:
    values = [value + (1.0 if n >= 60 else 0.0) for n, value in enumerate(noise(90, 6, spread=0.1))]
    for stop in (5, 40, 63, 80):
        level = ChangeDetector(LIMITS)
        for number, value in enumerate(values):
            if number == stop:
                level = ChangeDetector.resumed(LIMITS, json.loads(json.dumps(level.learned())))
            level.add(value, NOW_S + number * STEP_S)
        assert level.change == followed(values)[-1]


@pytest.mark.parametrize(
    "wrong", [None, [], {"usual": float("nan")}, {"variance": -1.0}, {"sums": [1.0]}, {"seen": "x"}]
)
def test_a_state_that_is_not_valid_is_refused(wrong: dict[str, object] | None) -> None:
    document = ChangeDetector(LIMITS).learned() | wrong if isinstance(wrong, dict) else wrong
    with pytest.raises(ValueError, match="ChangeDetector"):
        ChangeDetector.resumed(LIMITS, document)
