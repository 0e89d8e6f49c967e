import numpy as np
import pytest

from deconflict.foresight.presence.silence_survival import EDGES_S, share_longer, with_case

NOTHING = np.zeros(len(EDGES_S))


def test_by_the_prior_half_of_the_silences_of_five_seconds_end_within_twenty() -> None:
    assert share_longer(NOTHING, 5.0, 5.0) == 1.0
    assert share_longer(NOTHING, 20.0, 5.0) == pytest.approx(0.5)
    assert share_longer(NOTHING, 3600.0, 5.0) > 0.002


def test_silences_that_lasted_long_make_a_long_one_usual() -> None:
    counts = NOTHING
    for lasted_s in (60.0, 70.0, 80.0) * 10:
        counts = with_case(counts, lasted_s)
    assert share_longer(counts, 50.0, 5.0) > 0.85
    assert share_longer(counts, 300.0, 5.0) < 0.05


def test_a_silence_counts_for_the_bin_whose_lower_edge_it_reaches() -> None:
    for lasted_s in (10.0, 20.0, 40.0, 163_840.0):
        assert EDGES_S[with_case(NOTHING, lasted_s).argmax()] == lasted_s


def test_the_share_falls_with_time_and_counts_only_silences_longer_than_the_least() -> None:
    counts = NOTHING
    for lasted_s in (6.0, 12.0, 40.0, 200.0):
        counts = with_case(counts, lasted_s)
    shares = [share_longer(counts, lasted_s, 90.0) for lasted_s in (10.0, 90.0, 120.0, 400.0, 1e6)]
    assert shares[:2] == [1.0, 1.0]
    assert shares == sorted(shares, reverse=True)


def test_old_silences_lose_weight() -> None:
    counts = NOTHING
    for _ in range(1000):
        counts = with_case(counts, 6.0)
    for _ in range(100):
        counts = with_case(counts, 600.0)
    assert counts.sum() <= 101
    assert share_longer(counts, 300.0, 5.0) > 0.5
