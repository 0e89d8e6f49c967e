import numpy as np
import pytest

from deconflict.foresight.probability.pair_table import (
    BRIEFLY_S,
    PAIR,
    REMEMBERED,
    REMEMBERED_S,
    Pairs,
    codes,
    needs_rollout,
    open_rows,
    rows_to_report,
    select_pairs,
    set_preemption,
    slots_of,
)

NOW_S = 1_790_000_000.0


def pairs(*slots: tuple[int, int]) -> Pairs:
    a, b = np.array(slots, np.int64).T
    return select_pairs(np.zeros(0, PAIR), codes(a, b), np.zeros(10, bool), np.zeros(10, bool), NOW_S).pairs


def slots(every: Pairs) -> list[tuple[int, int]]:
    a, b = slots_of(every["code"])
    return list(zip(a.tolist(), b.tolist(), strict=True))


def test_pairs_are_in_the_order_of_their_slots() -> None:
    assert slots(pairs((5, 2), (1, 9), (1, 3))) == [(1, 3), (1, 9), (5, 2)]


def test_new_pairs_are_inserted_and_the_others_keep_their_values() -> None:
    before = pairs((1, 2), (7, 8))
    before["probability"] = (0.3, 0.8)
    before["features"] = [[1.0], [2.0]]
    after, _, rows, _ = select_pairs(
        before, codes(np.array([3, 1, 3]), np.array([4, 2, 4])), np.zeros(10, bool), np.zeros(10, bool), NOW_S
    )
    assert slots(after) == [(1, 2), (3, 4), (7, 8)]
    assert after["probability"].tolist() == [0.3, 0.0, 0.8]
    assert after["features"][:, -1].tolist() == [1.0, 0.0, 2.0]
    assert rows.tolist() == [1, 0, 1]


def test_pairs_of_reporting_robots_stay_watched_only_if_they_are_candidates_again() -> None:
    before = pairs((1, 2), (3, 4), (5, 6), (5, 7))
    before["near_s"] = NOW_S
    has_news = np.isin(np.arange(10), [4, 5])
    after, fresh, _, due = select_pairs(
        before, codes(np.array([5]), np.array([7])), has_news, np.zeros(10, bool), NOW_S
    )
    assert fresh.tolist() == [False, True, True, True]
    assert after["watched"].tolist() == [True, False, False, True]
    assert due.tolist() == [3]


def test_pairs_of_two_dormant_robots_are_not_watched() -> None:
    before, is_dormant = pairs((1, 2), (2, 3), (3, 4)), np.isin(np.arange(10), [1, 2])
    after = select_pairs(before, np.zeros(0, np.int64), np.zeros(10, bool), is_dormant, NOW_S).pairs
    assert after["watched"].tolist() == [False, True, True]


def some(n: int = 60) -> Pairs:
    """Random pairs of the robots 0 to 9."""
    rng = np.random.default_rng(9)
    found = np.zeros(n, PAIR)
    found["code"] = np.sort(codes(rng.integers(0, 10, n), rng.integers(0, 10, n)))
    for name in ("probability", "deciding", "near_s", "near_m", "now_m"):
        found[name] = rng.uniform(size=n)
    found["watched"], found["in_encounter"], found["gives_way"] = rng.uniform(size=(3, n)) < 0.4
    return found


def test_pairs_are_open_while_both_robots_are_heard_and_not_in_an_encounter() -> None:
    every, seen = some(), np.zeros((10, 5))
    seen[:, 0] = NOW_S - np.arange(10)
    a, b = slots_of(every["code"])
    heard = (seen[a, 0] > NOW_S - 6) & (seen[b, 0] > NOW_S - 6)
    expected = np.flatnonzero(every["watched"] & ~every["in_encounter"] & ~every["gives_way"] & heard)
    assert 0 < len(expected) < len(every)
    assert open_rows(every, seen, NOW_S - 6).tolist() == expected.tolist()


def test_requested_pairs_come_first_and_then_other_likely_ones() -> None:
    every, first = some(), np.array([7, 3, 30])
    others = np.flatnonzero(every["watched"] & (every["deciding"] >= 0.4))
    others = others[~np.isin(others, first)]
    assert np.isin(first, np.flatnonzero(every["deciding"] >= 0.4)).any()
    rows, code = rows_to_report(every, first, 0.4)
    assert code.tolist() == every["code"][others].tolist()
    assert rows.tolist() == [*first.tolist(), *others.tolist()]


def test_new_pairs_are_due_whether_or_not_their_robots_report() -> None:
    before = pairs((1, 2))
    before["near_s"] = NOW_S
    asked = codes(np.array([1, 3]), np.array([2, 4]))
    assert select_pairs(before, asked, np.zeros(10, bool), np.zeros(10, bool), NOW_S).due.tolist() == [1]


def test_pairs_that_were_no_candidates_for_long_are_dropped() -> None:
    before = pairs((1, 2), (3, 4), (5, 6))
    before["probability"], before["candidate_s"] = 0.5, NOW_S - REMEMBERED_S - np.array([1, 1, 0])
    before["watched"] = False
    after = select_pairs(
        before, codes(np.array([3]), np.array([4])), np.zeros(10, bool), np.zeros(10, bool), NOW_S
    ).pairs
    assert slots(after) == [(3, 4), (5, 6)]
    assert after["probability"].tolist() == [0.0, 0.5]
    assert after["candidate_s"].tolist() == [NOW_S, NOW_S - REMEMBERED_S]


def test_an_earlier_conflict_with_a_third_robot_sets_the_features() -> None:
    every = pairs((0, 1), (0, 2), (3, 4))
    every["near_s"] = every["contact_s"] = NOW_S + np.array([2.0, 6.0, 5.0])
    every["share"] = 1.0
    every["gave_way_s"] = -np.inf
    stands, waits_for = np.array([False, False, True, True, True]), np.full(5, -1)
    set_preemption(every, stands, stands, waits_for, np.zeros(len(stands), bool), NOW_S, 0.3, 10.0)
    assert every["features"][:, 6] == pytest.approx([0.0, 1.0, 0.0], abs=0.01)
    assert every["features"][:, 7] == pytest.approx([0.0, 0.0, 0.0], abs=0.01)
    assert every["still"].tolist() == [False, False, True]


def test_a_robot_in_a_crowd_stops_no_other_one_and_is_not_driven_on() -> None:
    every, is_crowded, nobody = pairs((0, 1), (0, 2)), np.array([False, True, False]), np.full(3, -1)
    every["near_s"] = every["contact_s"] = NOW_S + np.array([2.0, 6.0])
    every["share"] = 1.0
    for crowded, expected in ((np.zeros(3, bool), 1.0), (is_crowded, 0.0)):
        set_preemption(every, np.zeros(3, bool), np.zeros(3, bool), nobody, crowded, NOW_S, 0.3, 10.0)
        assert every["features"][1, 6] == pytest.approx(expected, abs=0.01)
    assert needs_rollout(every, np.zeros(3), np.zeros(3, bool)).tolist() == [True, True]
    assert needs_rollout(every, np.zeros(3), is_crowded).tolist() == [False, True]


def test_robots_that_stand_and_may_set_out_are_not_still() -> None:
    """One robot may be about to drive into the other."""
    every, standing = pairs((0, 1)), np.ones(2, bool)
    every["gave_way_s"] = -np.inf
    set_preemption(every, standing, np.array([True, False]), np.full(2, -1), np.zeros(2, bool), NOW_S, 0.3, 10.0)
    assert every["still"].tolist() == [False]
    assert every["features"][0, 5] == 1.0


def test_a_pair_stays_still_for_a_while_after_one_waited_for_the_other() -> None:
    every = pairs((0, 1), (2, 3))
    every["gave_way_s"] = -np.inf
    nobody, moving = np.full(4, -1), np.zeros(4, bool)
    set_preemption(every, moving, moving, np.array([-1, 0, -1, -1]), np.zeros(4, bool), NOW_S, 0.3, 10.0)
    assert every["still"].tolist() == [True, False]
    set_preemption(every, moving, moving, nobody, np.zeros(4, bool), NOW_S + 9.0, 0.3, 10.0)
    assert every["still"].tolist() == [True, False]
    set_preemption(every, moving, moving, nobody, np.zeros(4, bool), NOW_S + 11.0, 0.3, 10.0)
    assert every["still"].tolist() == [False, False]


@pytest.mark.parametrize("slots", [40, 12])
def test_of_too_many_pairs_those_that_never_met_are_forgotten_soon(slots: int) -> None:
    """What met stays: a pair that is not in the table counts as one that did not meet."""
    a, b = np.triu_indices(slots, 1)
    before = np.zeros(len(a), PAIR)
    before["code"], before["candidate_s"] = codes(a, b), NOW_S - 2 * BRIEFLY_S
    for name in ("started_s", "last_within_s", "yielded_s", "uncertain_s", "gave_way_s"):
        before[name] = -np.inf
    has_met, none = a % 3 == 0, np.zeros(slots, bool)
    before["started_s"][has_met] = NOW_S - 3.0
    after = select_pairs(before, np.zeros(0, np.int64), none, none, NOW_S).pairs
    are_many = len(a) > REMEMBERED * slots
    is_kept = has_met | (not are_many)
    assert after["code"].tolist() == before["code"][is_kept].tolist()
