"""Usual durations by place and part of the day: learned, completed from wider groups, bounded, kept."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from deconflict.contention.ordinary import usual_durations
from deconflict.contention.ordinary.usual_durations import BINS, DAY_S, PARTS, UsualDurations
from deconflict.runtime.learned_state import UnreadableError, packed, unpacked

NOW_S = 1_790_000_000.0 // DAY_S * DAY_S
"""A midnight."""


def learned(*lasted_s: float, place: str = "gate", now_s: float = NOW_S) -> UsualDurations:
    durations = UsualDurations(30.0)
    for duration_s in lasted_s:
        durations.add(place, duration_s, now_s)
    return durations


def test_where_nothing_is_known_the_prior_holds() -> None:
    assert UsualDurations(30.0).usual_s("gate", NOW_S) == pytest.approx(30, rel=0.02)


def test_what_has_lasted_long_lasts_long_by_the_prior() -> None:
    left_s = [UsualDurations(30.0).left_s("gate", elapsed_s, NOW_S) for elapsed_s in (6.0, 60.0, 600.0, 9000.0)]
    assert left_s == pytest.approx([9.3, 63, 603, 9000], rel=0.15)


def test_long_durations_become_usual_where_they_are_frequent() -> None:
    durations = learned(*[300.0] * 20)
    assert durations.usual_s("gate", NOW_S) == pytest.approx(300, rel=0.25)
    assert durations.left_s("gate", 60.0, NOW_S) == pytest.approx(240, rel=0.25)


def test_one_long_duration_among_many_short_ones_is_not_usual() -> None:
    assert learned(*[8.0] * 30, 3000.0).usual_s("gate", NOW_S) < 30


def test_what_is_usual_at_night_is_not_usual_at_noon() -> None:
    durations = learned(*[300.0] * 20)
    for _ in range(200):
        durations.add("gate", 5.0, NOW_S + DAY_S / 2)
    assert durations.usual_s("gate", NOW_S + DAY_S) > 200
    assert durations.usual_s("gate", NOW_S + 1.5 * DAY_S) < 20


def test_what_is_usual_at_one_place_is_not_usual_at_another() -> None:
    durations = learned(*[300.0] * 20)
    for place in range(20):
        for _ in range(20):
            durations.add(f"aisle {place}", 5.0, NOW_S)
    assert durations.usual_s("aisle 3", NOW_S) < 30
    assert durations.usual_s("gate", NOW_S) > 200


def test_old_durations_fade_back_to_the_prior() -> None:
    durations = learned(*[300.0] * 20)
    assert durations.usual_s("gate", NOW_S + 365 * DAY_S) == pytest.approx(30, rel=0.05)


def test_it_continues_over_a_restart() -> None:
    durations, later = learned(*[300.0] * 20), UsualDurations(30.0)
    later.resume(unpacked(packed({"usual": durations.learned()}))["usual"])
    for elapsed_s in (1.0, 50.0, 500.0):
        assert later.left_s("gate", elapsed_s, NOW_S) == durations.left_s("gate", elapsed_s, NOW_S)
    assert later.usual_s("aisle", NOW_S) == durations.usual_s("aisle", NOW_S)


@pytest.mark.parametrize(
    "change",
    [
        {"places": None},
        {"places": ["gate", "aisle"]},
        {"at_s": np.zeros(1)},
        {"counts": np.zeros((2, PARTS, BINS + 1))},
        {"counts": np.full((2, PARTS, BINS), -1.0)},
        {"counts": np.full((2, PARTS, BINS), np.nan)},
    ],
    ids=str,
)
def test_another_layout_is_refused(change: dict[str, Any]) -> None:
    with pytest.raises(UnreadableError):
        UsualDurations(30.0).resume(learned(5.0).learned() | change)


@given(st.lists(st.tuples(st.integers(0, 30), st.floats(0, 1e6), st.floats(0, 1e7)), max_size=60))
def test_whatever_is_learned_stays_bounded_and_gives_times(durations: list[tuple[int, float, float]]) -> None:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(usual_durations, "MOST_PLACES", 10)
        usual, later = UsualDurations(30.0), UsualDurations(30.0)
        for place, lasted_s, at_s in durations:
            usual.add(f"cell {place}", lasted_s, NOW_S + at_s)
            assert 0 < usual.usual_s(f"cell {place}", NOW_S + at_s) <= 7600
            assert 0 <= usual.left_s(f"cell {place}", lasted_s, NOW_S + at_s) <= max(lasted_s, 7600)
        assert len(usual) <= 10
        assert usual.dropped >= len({place for place, *_ in durations}) - 10
        later.resume(usual.learned())
        assert len(later) == len(usual)
