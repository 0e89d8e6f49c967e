"""The table of watched pairs of robots: how near each pair is and was, and how likely it is to meet.

A pair has one number, its code, made of the slots of its two robots. Rows are ascending by code, so that a pass finds
the rows of the last pass by a merge and not pair by pair.

The file is long because of its record and its compiled functions: `PAIR` has one comment for each field, and
`_select_pairs` merges the old and the new table in one loop.
"""

from typing import Any, NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

from deconflict.foresight.rollout.rollout import ROLLED
from ingest.batch import Bools, Floats, Ints
from ingest.kernels import BOOLS, FLOAT, INTS, MATRIX, inner, kernel

SLOT_BITS = 24
SLOTS = (1 << SLOT_BITS) - 1

FEATURES = 9 + ROLLED
"""Features of a pair, in this order:

0. 1, for the constant of the model.
1. Log odds of the largest share of the error distribution within the clearance, at any moment of the horizon. The
   share is averaged over the times at which a waiting robot may start.
2. The same in the first fifth of the horizon.
3. How long the two would need if they drove straight at each other, in horizons, at most 1.
4. 1 if either robot stands: others see it and drive around it.
5. 1 if both robots stand.
6. The share of feature 1, times how surely one of the two comes into conflict with a third robot before: a robot that
   has stopped for a third one does not reach the second.
7. The same for both of the two.
8. The result of driving all robots on together, see `rollout.ROLLED`.
9. Log odds of coming within the clearance, which a model of its own learns.
"""
CONTACT_FEATURES = 5
"""The first features, up to this number, predict whether the envelopes come within the clearance."""
PREEMPTED, DRIVEN, TOUCHING = slice(6, 8), slice(8, 8 + ROLLED), FEATURES - 1
"""Places of the features of third robots, of driving on together, and of contact."""
REMEMBERED_S = 25.0
"""A pair that is no candidate for longer is dropped from the table."""
REMEMBERED, BRIEFLY_S = 7, 1.0
"""If the table has more pairs than this for each slot, those that never met are remembered for so long only: robots
that drive through each other have ever other pairs."""
ROLLOUT_M, ROLLOUT_SHARE = 1.5, 0.01
"""Robots are driven on together if they come this near, or if their share of feature 1 is larger than this."""
SETTLED_S = 10.0
"""A pair of which one robot gave way to the other this recently needs no alert: the robots handle it."""
PREEMPTED_S = 0.3
"""If a robot has another conflict that comes earlier by this, that one is likely to stop it."""

PAIR = np.dtype(
    [
        ("code", np.int64),  # of the two slots
        ("features", np.float64, (FEATURES,)),  # at the last look
        ("share", np.float64),  # of the error distribution within the clearance, its maximum over the horizon
        ("probability", np.float64),  # that the two get in each other's way within the horizon
        ("contact_probability", np.float64),  # that their envelopes come within the clearance
        ("lower", np.float64),  # lower end of the 90 % interval of the probability
        ("upper", np.float64),  # upper end of it
        ("deciding", np.float64),  # alerts are decided by this; above the probability if evidence is thin
        ("near_s", np.float64),  # when the forecasts are nearest within the horizon; 0 before the first look
        ("near_m", np.float64),  # separation at that time
        ("late_s", np.float64, (2,)),  # how much later than its forecast says each one starts if they come near so
        ("now_m", np.float64),  # separation at the last look
        ("contact_s", np.float64),  # when the forecasts first come within the clearance, inf if they do not
        ("started_s", np.float64),  # when the last encounter began, -inf before the first
        ("last_within_s", np.float64),  # when the pair was last seen within the clearance
        ("yielded_s", np.float64),  # when one robot last began to give way to the other, -inf before the first time
        ("yield_end_s", np.float64),  # when that robot drove on, inf while it waits
        ("uncertain_s", np.float64),  # when one last gave way, if it may have followed an order of its own fleet
        ("candidate_s", np.float64),  # when the pair was last a candidate
        ("watched", np.bool_),  # whether it is a candidate now
        ("in_encounter", np.bool_),  # within the clearance, or not yet apart again
        ("gives_way", np.bool_),  # one robot gives way to the other now
        ("gave_way_s", np.float64),  # when one last gave way to the other, or stood and had to wait for it
        ("still", np.bool_),  # both stay where they stand, or one gave way lately: no alert is needed
    ],
    align=True,
)
"""One watched pair."""

Pairs = NDArray[Any]
"""(p,) of `PAIR`, ascending by `code`."""


def row_of(pairs: Pairs, code: int) -> int | None:
    """The row of a code; None if the table has none."""
    row = int(np.searchsorted(pairs["code"], code))
    return row if row < len(pairs) and pairs["code"][row] == code else None


_PAIRS = numba.from_dtype(PAIR)[::1]


def codes(a: Ints, b: Ints) -> Ints:
    """One number for each pair of slots."""
    return (a << SLOT_BITS) | b


def slots_of(code: Ints) -> tuple[Ints, Ints]:
    """The two slots of each code."""
    return code >> SLOT_BITS, code & SLOTS


def has_robot_of(code: Ints, slots: Ints) -> Bools:
    """(n,) whether each pair has a robot of `slots`."""
    a, b = slots_of(code)
    is_chosen = np.zeros(max(int(column.max(initial=-1)) for column in (a, b, slots)) + 1, np.bool_)
    is_chosen[slots] = True
    return is_chosen[a] | is_chosen[b]


@inner
def _has_history(pair: Any) -> bool:
    """Whether the two met, or one gave way to the other, lately: learning asks for that later."""
    met = pair.started_s > -np.inf or pair.last_within_s > -np.inf or pair.in_encounter
    gave_way = pair.gives_way or pair.gave_way_s > -np.inf
    return bool(met or gave_way or pair.yielded_s > -np.inf or pair.uncertain_s > -np.inf)


@kernel((_PAIRS, *[INTS] * 2, *[BOOLS] * 2, *[FLOAT] * 3, _PAIRS, BOOLS, *[INTS] * 2))
def _select_pairs(
    before: Pairs,
    candidates: Ints,
    ascending: Ints,
    has_news: Bools,
    is_dormant: Bools,
    now_s: float,
    since_s: float,
    brief_since_s: float,
    pairs: Pairs,
    fresh: Bools,
    rows: Ints,
    due: Ints,
) -> tuple[int, int]:
    """Merge the table `before` with the codes `candidates`, whose order is `ascending`, into the arrays of
    `SelectedPairs`. Returns how many pairs there are and how many are due."""
    old, new, n, n_due = 0, 0, 0, 0
    while old < len(before) or new < len(candidates):
        is_old = new == len(candidates) or (old < len(before) and before[old].code <= candidates[ascending[new]])
        code, is_candidate = before[old].code if is_old else candidates[ascending[new]], False
        while new < len(candidates) and candidates[ascending[new]] == code:
            rows[ascending[new]], is_candidate = n, True
            new += 1
        known_since_s = since_s if _has_history(before[min(old, len(before) - 1)]) else brief_since_s
        is_known = is_old and before[old].candidate_s >= known_since_s
        if is_known:
            pairs[n] = before[old]
        old += is_old
        if not (is_known or is_candidate):
            continue
        pair = pairs[n]
        if not is_known:
            pair.code, pair.started_s, pair.last_within_s = code, -np.inf, -np.inf
            pair.yielded_s, pair.yield_end_s, pair.uncertain_s, pair.contact_s = -np.inf, -np.inf, -np.inf, np.inf
            pair.gave_way_s = -np.inf
        fresh[n] = has_news[code >> SLOT_BITS] or has_news[code & SLOTS]
        is_idle = is_dormant[code >> SLOT_BITS] and is_dormant[code & SLOTS]
        pair.watched = is_candidate or (pair.watched and not fresh[n] and not is_idle)
        if pair.watched:
            pair.candidate_s = now_s
            if fresh[n] or pair.near_s == 0.0:
                due[n_due] = n
                n_due += 1
        n += 1
    return n, n_due


class SelectedPairs(NamedTuple):
    """The pairs of a new look."""

    pairs: Pairs
    fresh: Bools
    """(p,) whether either robot has reported since the last look."""
    rows: Ints
    """(n,) the row of each candidate."""
    due: Ints
    """Rows of the pairs that must be measured again."""


def select_pairs(before: Pairs, candidates: Ints, has_news: Bools, is_dormant: Bools, now_s: float) -> SelectedPairs:
    """The table for a new look, from that of the last look and the codes `candidates` (n,), which may repeat.

    `has_news` (slots,) marks the robots that have reported since the last look. All candidates are watched. Of the
    other pairs those stay watched of which neither robot has reported, and not both are dormant. A pair is dropped if
    it was no candidate for `REMEMBERED_S`. A watched pair is due if it is fresh or new.
    """
    most = len(before) + len(candidates)
    pairs, fresh, due = np.zeros(most, PAIR), np.empty(most, np.bool_), np.empty(most, np.int64)
    brief_s = REMEMBERED_S if len(before) <= REMEMBERED * len(has_news) else BRIEFLY_S
    times_s = now_s, now_s - REMEMBERED_S, now_s - brief_s
    rows = np.empty(len(candidates), np.int64)
    order = np.argsort(candidates)
    marks = has_news, is_dormant
    n, n_due = _select_pairs(before, candidates, order, *marks, *times_s, pairs, fresh, rows, due)
    return SelectedPairs(pairs[:n], fresh[:n], rows, due[:n_due])


@kernel(INTS(_PAIRS, MATRIX, FLOAT))
def open_rows(pairs: Pairs, newest: Floats, since_s: float) -> Ints:
    """The rows of the watched pairs that are in no encounter, of which neither robot gives way to the other, and of
    which both robots have reported after `since_s`. `newest` (slots, 5) are the newest reports."""
    rows, n = np.empty(len(pairs), np.int64), 0
    for row, pair in enumerate(pairs):
        heard_s = min(newest[pair.code >> SLOT_BITS, 0], newest[pair.code & SLOTS, 0])
        if pair.watched and not pair.in_encounter and not pair.gives_way and heard_s > since_s:
            rows[n] = row
            n += 1
    return rows[:n].copy()


@kernel((_PAIRS, INTS, FLOAT))
def rows_to_report(pairs: Pairs, first: Ints, likely: float) -> tuple[Ints, Ints]:
    """The rows `first`, then those of the other watched pairs whose `deciding` is at least `likely`; and the codes of
    these other pairs."""
    is_first, code, n = np.zeros(len(pairs), np.bool_), np.empty(len(pairs), np.int64), len(first)
    rows = np.empty(n + len(pairs), np.int64)
    for at, row in enumerate(first):
        rows[at], is_first[row] = row, True
    for row, pair in enumerate(pairs):
        if pair.watched and pair.deciding >= likely and not is_first[row]:
            code[n - len(first)], rows[n] = pair.code, row
            n += 1
    return rows[:n].copy(), code[: n - len(first)].copy()


@kernel(numba.void(_PAIRS, *[BOOLS] * 2, INTS, BOOLS, *[FLOAT] * 3))
def set_preemption(
    pairs: Pairs,
    stands: Bools,
    stays: Bools,
    waits_for: Ints,
    is_crowded: Bools,
    now_s: float,
    scale_s: float,
    settled_s: float,
) -> None:
    """Set the features of watched pairs that depend on third robots, whether both robots stand, and `still`.

    By slot are `stands`, `stays` and `waits_for`: whether a robot stands, whether it is expected to stay, and the slot
    of the robot that a standing robot has to wait for. A robot that `is_crowded` stops no other one.
    """
    slots = len(stands)
    first_s, second_s, first = np.full(slots, np.inf), np.full(slots, np.inf), np.full(slots, -1)
    for row, pair in enumerate(pairs):
        if not pair.watched or is_crowded[pair.code >> SLOT_BITS] or is_crowded[pair.code & SLOTS]:
            continue
        for slot in (pair.code >> SLOT_BITS, pair.code & SLOTS):
            if pair.contact_s < first_s[slot]:
                second_s[slot], first_s[slot], first[slot] = first_s[slot], pair.contact_s, row
            elif pair.contact_s < second_s[slot]:
                second_s[slot] = pair.contact_s
    for row, pair in enumerate(pairs):
        if not pair.watched:
            continue
        a, b = pair.code >> SLOT_BITS, pair.code & SLOTS
        other_a_s = second_s[a] if first[a] == row else first_s[a]
        other_b_s = second_s[b] if first[b] == row else first_s[b]
        own_s = min(pair.contact_s, pair.near_s)
        sooner_s, later_s = min(other_a_s, other_b_s) - own_s, max(other_a_s, other_b_s) - own_s
        pair.features[6] = pair.share / (1.0 + np.exp(min(max(sooner_s / scale_s, -50.0), 50.0)))
        pair.features[7] = pair.share / (1.0 + np.exp(min(max(later_s / scale_s, -50.0), 50.0)))
        both = stands[a] and stands[b]
        if pair.gives_way or waits_for[a] == b or waits_for[b] == a:
            pair.gave_way_s = now_s
        pair.features[5] = 1.0 if both else 0.0
        pair.still = (stays[a] and stays[b]) or now_s - pair.gave_way_s <= settled_s


def needs_rollout(pairs: Pairs, absence: Floats, is_crowded: Bools) -> Bools:
    """(p,) whether the robots of each pair are to be driven on together: they come near, both are probably present, and
    neither `is_crowded` (slots,). `absence` (slots,) is the probability that a robot is absent."""
    near: Bools = pairs["watched"] & ((pairs["near_m"] <= ROLLOUT_M) | (pairs["share"] > ROLLOUT_SHARE))
    a, b = slots_of(pairs["code"])
    return near & (np.maximum(absence[a], absence[b]) < 0.5) & ~(is_crowded[a] | is_crowded[b])
