import numpy as np
import pytest

from deconflict.foresight.probability.censoring import STAYED
from deconflict.foresight.probability.pair_table import (
    FEATURES,
    PAIR,
    REMEMBERED_S,
    AnsweredQuestion,
    CensoredOutcomes,
    OpenQuestions,
    Pairs,
    again,
    codes,
    open_rows,
    preempt,
    shown,
    slots_of,
)

NOW_S = 1_790_000_000.0


def pairs(*slots: tuple[int, int]) -> Pairs:
    a, b = np.array(slots, np.int64).T
    return again(np.zeros(0, PAIR), codes(a, b), np.zeros(10, bool), NOW_S).pairs


def slots(every: Pairs) -> list[tuple[int, int]]:
    a, b = slots_of(every["code"])
    return list(zip(a.tolist(), b.tolist(), strict=True))


def test_pairs_are_in_the_order_of_their_slots() -> None:
    assert slots(pairs((5, 2), (1, 9), (1, 3))) == [(1, 3), (1, 9), (5, 2)]


def test_new_pairs_take_their_place_and_the_others_stay_as_they_were() -> None:
    before = pairs((1, 2), (7, 8))
    before["probability"] = (0.3, 0.8)
    before["seen"] = [[1.0], [2.0]]
    after, _, rows, _ = again(before, codes(np.array([3, 1, 3]), np.array([4, 2, 4])), np.zeros(10, bool), NOW_S)
    assert slots(after) == [(1, 2), (3, 4), (7, 8)]
    assert after["probability"].tolist() == [0.3, 0.0, 0.8]
    assert after["seen"][:, -1].tolist() == [1.0, 0.0, 2.0]
    assert rows.tolist() == [1, 0, 1]


def test_pairs_of_robots_that_report_are_watched_only_where_they_are_asked_for_again() -> None:
    before = pairs((1, 2), (3, 4), (5, 6), (5, 7))
    before["near_s"] = NOW_S
    told = np.isin(np.arange(10), [4, 5])
    after, fresh, _, due = again(before, codes(np.array([5]), np.array([7])), told, NOW_S)
    assert fresh.tolist() == [False, True, True, True]
    assert after["watched"].tolist() == [True, False, False, True]
    assert due.tolist() == [3]


def some(n: int = 60) -> Pairs:
    """Of robots 0 to 9, alike in nothing."""
    rng = np.random.default_rng(9)
    found = np.zeros(n, PAIR)
    found["code"] = np.sort(codes(rng.integers(0, 10, n), rng.integers(0, 10, n)))
    for name in ("probability", "deciding", "near_s", "near_m", "now_m"):
        found[name] = rng.uniform(size=n)
    found["watched"], found["inside"], found["gives_way"] = rng.uniform(size=(3, n)) < 0.4
    return found


def test_pairs_are_open_while_both_robots_are_heard_and_not_in_an_encounter() -> None:
    every, seen = some(), np.zeros((10, 5))
    seen[:, 0] = NOW_S - np.arange(10)
    a, b = slots_of(every["code"])
    heard = (seen[a, 0] > NOW_S - 6) & (seen[b, 0] > NOW_S - 6)
    expected = np.flatnonzero(every["watched"] & ~every["inside"] & ~every["gives_way"] & heard)
    assert 0 < len(expected) < len(every)
    assert open_rows(every, seen, NOW_S - 6).tolist() == expected.tolist()


def test_pairs_are_shown_that_were_asked_for_and_then_others_that_are_likely() -> None:
    every, first = some(), np.array([7, 3, 30])
    others = np.flatnonzero(every["watched"] & (every["deciding"] >= 0.4))
    others = others[~np.isin(others, first)]
    assert np.isin(first, np.flatnonzero(every["deciding"] >= 0.4)).any()
    rows, code = shown(every, first, 0.4)
    assert code.tolist() == every["code"][others].tolist()
    assert rows.tolist() == [*first.tolist(), *others.tolist()]


def test_new_pairs_are_due_whether_or_not_their_robots_report() -> None:
    before = pairs((1, 2))
    before["near_s"] = NOW_S
    asked = codes(np.array([1, 3]), np.array([2, 4]))
    assert again(before, asked, np.zeros(10, bool), NOW_S).due.tolist() == [1]


def test_pairs_that_were_no_candidates_for_long_are_forgotten() -> None:
    before = pairs((1, 2), (3, 4), (5, 6))
    before["probability"], before["asked_s"] = 0.5, NOW_S - REMEMBERED_S - np.array([1, 1, 0])
    before["watched"] = False
    after = again(before, codes(np.array([3]), np.array([4])), np.zeros(10, bool), NOW_S).pairs
    assert slots(after) == [(3, 4), (5, 6)]
    assert after["probability"].tolist() == [0.0, 0.5]
    assert after["asked_s"].tolist() == [NOW_S, NOW_S - REMEMBERED_S]


def outcome(
    *, started_s: list[float], below_s: list[float], heard_s: list[float], **columns: list[float]
) -> tuple[AnsweredQuestion, CensoredOutcomes]:
    """Of pairs (0, 1), (0, 2) ... asked at `NOW_S`."""
    every = pairs(*((0, n + 1) for n in range(len(started_s))))
    every["started_s"], every["below_s"] = NOW_S + np.array(started_s), NOW_S + np.array(below_s)
    for name, after_s in columns.items():
        every[name] = NOW_S + np.array(after_s)
    outcomes = OpenQuestions(horizon_s=10.0)
    outcomes.ask(NOW_S, every["code"], every["seen"])
    heard = NOW_S + np.array(heard_s)
    assert outcomes.known(NOW_S + 15, every, lambda _: heard) == []
    (known,) = outcomes.known(NOW_S + 16, every, lambda _: heard)
    return known, known.interacted


def test_an_outcome_is_known_once_the_horizon_is_over() -> None:
    # the first met before one left, of the second one left, the third stayed apart
    never = [-np.inf] * 2
    question, fates = outcome(started_s=[4.5, *never], below_s=[5.0, *never], heard_s=[12, 5.5, 6.5, 12])
    assert (question.asked_s, len(question.code)) == (NOW_S, 3)
    assert fates.met.tolist() == [True, False, False]
    assert fates.left.tolist() == [False, True, False]
    assert fates.part.tolist() == [4, 6, STAYED]


def test_an_encounter_after_the_horizon_is_none_in_it() -> None:
    _, fates = outcome(started_s=[10.5], below_s=[10.8], heard_s=[13, 13])
    assert (fates.met.tolist(), fates.left.tolist(), fates.part.tolist()) == ([False], [False], [STAYED])


def test_a_pair_that_was_together_when_asked_is_not_judged() -> None:
    question, _ = outcome(started_s=[-0.5, -5.0], below_s=[0.4, -3.0], heard_s=[12, 12, 12])
    assert question.code.tolist() == codes(np.array([0]), np.array([2])).tolist()


def test_a_pair_of_which_one_gave_way_got_in_each_others_way_without_touching() -> None:
    never, heard_s = [-np.inf], [20.0, 20.0]
    known, fates = outcome(started_s=never, below_s=never, heard_s=heard_s, yielded_s=[4.5], yield_end_s=[np.inf])
    assert (fates.met.tolist(), fates.part.tolist(), known.touched.met.tolist()) == ([True], [4], [False])


def test_a_pair_that_was_giving_way_when_asked_is_not_judged() -> None:
    never, heard_s = [-np.inf], [20.0, 20.0]
    known, _ = outcome(started_s=never, below_s=never, heard_s=heard_s, yielded_s=[-4.5], yield_end_s=[2.0])
    assert len(known.code) == 0


def test_what_may_be_an_order_of_their_fleet_is_not_judged() -> None:
    never, heard_s = [-np.inf], [20.0, 20.0]
    known, _ = outcome(started_s=never, below_s=never, heard_s=heard_s, doubted_s=[4.0])
    assert len(known.code) == 0


def test_robots_that_another_one_stops_first_are_marked() -> None:
    every = pairs((0, 1), (0, 2), (3, 4))
    every["near_s"] = every["contact_s"] = NOW_S + np.array([2.0, 6.0, 5.0])
    every["share"] = 1.0
    every["gave_way_s"] = -np.inf
    stands, waits_for = np.array([False, False, True, True, True]), np.full(5, -1)
    preempt(every, stands, stands, waits_for, NOW_S, 0.3, 10.0)
    assert every["seen"][:, 6] == pytest.approx([0.0, 1.0, 0.0], abs=0.01)
    assert every["seen"][:, 7] == pytest.approx([0.0, 0.0, 0.0], abs=0.01)
    assert every["still"].tolist() == [False, False, True]


def test_robots_that_stand_and_may_set_out_are_not_still() -> None:
    """One of them may be about to drive into the other."""
    every, standing = pairs((0, 1)), np.ones(2, bool)
    every["gave_way_s"] = -np.inf
    preempt(every, standing, np.array([True, False]), np.full(2, -1), NOW_S, 0.3, 10.0)
    assert every["still"].tolist() == [False]
    assert every["seen"][0, 5] == 1.0


def test_two_of_which_one_had_to_wait_for_the_other_are_still_for_a_while() -> None:
    every = pairs((0, 1), (2, 3))
    every["gave_way_s"] = -np.inf
    nobody, moving = np.full(4, -1), np.zeros(4, bool)
    preempt(every, moving, moving, np.array([-1, 0, -1, -1]), NOW_S, 0.3, 10.0)
    assert every["still"].tolist() == [True, False]
    preempt(every, moving, moving, nobody, NOW_S + 9.0, 0.3, 10.0)
    assert every["still"].tolist() == [True, False]
    preempt(every, moving, moving, nobody, NOW_S + 11.0, 0.3, 10.0)
    assert every["still"].tolist() == [False, False]


def test_what_became_of_pairs_is_the_same_pair_by_pair() -> None:
    """Those that are no longer under watch did not meet."""
    rng, n = np.random.default_rng(6), 300
    every = pairs(*((int(a), int(b)) for a, b in rng.integers(0, 10, (n, 2))))
    every["started_s"], every["below_s"] = NOW_S + rng.uniform(-5, 15, (2, len(every)))
    every["started_s"][::4] = every["below_s"][::4] = -np.inf
    asked = np.unique(np.concatenate([every["code"][::2], codes(*rng.integers(0, 10, (2, 20)))]))
    until_s = NOW_S + rng.uniform(-1, 15, 10)
    until_s[3] = -np.inf
    outcomes = OpenQuestions(horizon_s=10.0)
    outcomes.ask(NOW_S, asked, np.zeros((len(asked), FEATURES)))
    (question,) = outcomes.known(NOW_S + 16, every, lambda _: until_s)
    fates = question.interacted
    found = {int(one["code"]): (one["started_s"], one["below_s"]) for one in every}
    expected = []
    for code in asked.tolist():
        started_s, below_s = found.get(code, (-np.inf, -np.inf))
        a, b = slots_of(code)
        last_s = min(until_s[a], until_s[b])
        if last_s > -np.inf and (started_s > NOW_S or below_s < NOW_S):
            met = NOW_S < started_s <= min(NOW_S + 10, last_s)
            part = int(min(max((started_s if met else last_s) - NOW_S, 0), STAYED - met))
            expected.append((code, met, part, not met and part < STAYED))
    told = (question.code.tolist(), fates.met.tolist(), fates.part.tolist(), fates.left.tolist())
    assert list(zip(*told, strict=True)) == expected
    assert 5 < fates.met.sum() < len(expected) < len(asked)


@pytest.mark.parametrize("were_there", [True, False])
def test_pairs_of_a_robot_that_was_driven_through_are_kept_apart_and_of_one_that_left_nothing_is_known(
    were_there: bool,
) -> None:
    # robot 0 was heard until 3 s; with 1 it met at 2 s, with 2 it did not; 2 and 3 go on
    every = pairs((0, 1), (0, 2), (2, 3))
    every["started_s"][0], every["below_s"][0] = NOW_S + 2.0, NOW_S + 2.5
    outcomes, heard = OpenQuestions(horizon_s=10.0), NOW_S + np.array([3.0, 6.0, 6.0, 6.0])
    outcomes.ask(NOW_S, every["code"], every["seen"])
    outcomes.settle(np.array([0]), every, lambda _: heard, were_there=were_there)
    (known,) = outcomes.known(NOW_S + 7, every, lambda _: heard)
    assert slots_of(known.code)[1].tolist() == [1, 2]
    assert known.interacted.met.tolist() == known.touched.met.tolist() == [True, False]
    assert known.interacted.part.tolist() == [2, 3 if were_there else STAYED]
    assert known.interacted.left.tolist() == [False, were_there]
    # by contact it counts as it always did
    assert known.touched.left.tolist() == [False, True]
    # another robot has the slot by the time that the others are known
    (known,) = outcomes.known(NOW_S + 16, every, lambda _: heard + 10.0)
    assert slots_of(known.code)[0].tolist() == [2]
