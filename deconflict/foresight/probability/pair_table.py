"""Pairs of robots under watch: how near each pair is and was, and how likely it is to meet.

A pair is known by one number, its two slots. Rows stay in order of it, so that a pass finds yesterday's rows by search,
never pair by pair.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

from deconflict.foresight.probability.censoring import STAYED, part_of
from deconflict.foresight.rollout.rollout import ROLLED
from ingest.batch import Bools, Floats, Ints
from ingest.kernels import kernel

SLOT_BITS = 24
SLOTS = (1 << SLOT_BITS) - 1
FEATURES = 9 + ROLLED
"""1; the log odds of the largest share of the error distribution that lies within the clearance, at any moment of the
horizon and in its first fifth, over the times at which a waiting robot may start; how long the pair would need if it
went straight for each other, in horizons and at most 1; 1 where either stands: it is seen, and gone around; 1 where
both do; and the share of the horizon times how surely one of the two, and each of them, comes into conflict with
another robot before: one that has stopped for somebody else does not come here; what came of it when all robots near
were driven on together, see `rollout.ROLLED`; and the log odds of coming within the clearance, as learned apart."""
CONTACT_FEATURES = 5
"""The first of them tell how likely the envelopes come within the clearance."""
PREEMPTED, DRIVEN, TOUCHING = slice(6, 8), slice(8, 8 + ROLLED), FEATURES - 1
"""Those of other robots that come first, of driving on together, and of contact."""
REMEMBERED_S = 25.0
CROWDED_M, LEAST_SHARE = 1.5, 0.01
"""Robots that come so near, or meet so likely by their forecasts, are driven on together."""
SETTLED_S = 10.0
"""Two of which one gave way to the other so lately are seen to by themselves."""
PREEMPTED_S = 0.3
"""A robot whose other conflict comes so much earlier is rather stopped by that one."""

PAIR = np.dtype(
    [
        ("code", np.int64),  # of the two slots
        ("seen", np.float64, (FEATURES,)),  # features as last looked at
        ("share", np.float64),  # of the error distribution within the clearance, at most in the horizon
        ("probability", np.float64),  # that the two get in each other's way in the horizon
        ("contact_probability", np.float64),  # that their envelopes come within the clearance
        ("lower", np.float64),  # ends of the interval that holds the probability with 90 %
        ("upper", np.float64),
        ("deciding", np.float64),  # what alerts are decided by; above the probability where evidence is thin
        ("near_s", np.float64),  # when the forecasts are nearest within the horizon
        ("near_m", np.float64),  # how near they are then
        ("now_m", np.float64),  # separation at the last look
        ("contact_s", np.float64),  # when the forecasts first come within the clearance, inf where they do not
        ("started_s", np.float64),  # when the last encounter began, -inf before the first
        ("below_s", np.float64),  # when the pair was last seen within the clearance
        ("yielded_s", np.float64),  # when one last began to give way to the other, -inf before the first
        ("yield_end_s", np.float64),  # when it went on; inf while it has not
        ("doubted_s", np.float64),  # the same of an interaction that may be an order of their fleet
        ("asked_s", np.float64),  # when the pair was last a candidate
        ("watched", np.bool_),  # whether it is a candidate now
        ("inside", np.bool_),  # within the clearance, or not yet drawn apart from it
        ("gives_way", np.bool_),  # one gives way to the other now
        ("gave_way_s", np.float64),  # when one last gave way to the other, or stood and had to wait for it
        ("still", np.bool_),  # both stay where they stand, or one gave way lately: nothing to alert of
    ],
    align=True,
)
"""Of a pair of robots."""

Pairs = NDArray[Any]
"""(p,) of `PAIR`, ascending by `code`."""

_PAIRS, _INTS, _BOOLS = numba.from_dtype(PAIR)[::1], numba.int64[::1], numba.boolean[::1]
_CODES = numba.types.Array(numba.int64, 1, "A", readonly=True)


def codes(a: Ints, b: Ints) -> Ints:
    """One number for each pair of slots."""
    return (a << SLOT_BITS) | b


def slots_of(code: Ints) -> tuple[Ints, Ints]:
    """The two slots of each number."""
    return code >> SLOT_BITS, code & SLOTS


def of_robots(code: Ints, slots: Ints) -> Bools:
    """(n,) whether each pair has a robot of `slots`."""
    a, b = slots_of(code)
    theirs: Bools = np.isin(a, slots) | np.isin(b, slots)
    return theirs


@kernel(
    numba.types.UniTuple(numba.int64, 2)(  # type: ignore[no-untyped-call]
        _PAIRS, *[_INTS] * 2, _BOOLS, *[numba.float64] * 2, _PAIRS, _BOOLS, *[_INTS] * 2
    )
)
def _look_again(
    before: Pairs,
    asked: Ints,
    ascending: Ints,
    told: Bools,
    now_s: float,
    since_s: float,
    pairs: Pairs,
    fresh: Bools,
    rows: Ints,
    due: Ints,
) -> tuple[int, int]:
    """Set what `again` gives, of codes `asked` whose order is `ascending`; how many pairs there are, and are due."""
    old, after, n, dues = 0, 0, 0, 0
    while old < len(before) or after < len(asked):
        is_old = after == len(asked) or (old < len(before) and before[old].code <= asked[ascending[after]])
        one, is_asked = before[old].code if is_old else asked[ascending[after]], False
        while after < len(asked) and asked[ascending[after]] == one:
            rows[ascending[after]], is_asked = n, True
            after += 1
        is_known = is_old and before[old].asked_s >= since_s
        if is_known:
            pairs[n] = before[old]
        old += is_old
        if not (is_known or is_asked):
            continue
        pair = pairs[n]
        if not is_known:
            pair.code, pair.started_s, pair.below_s = one, -np.inf, -np.inf
            pair.yielded_s, pair.yield_end_s, pair.doubted_s, pair.contact_s = -np.inf, -np.inf, -np.inf, np.inf
            pair.gave_way_s = -np.inf
        fresh[n] = told[one >> SLOT_BITS] or told[one & SLOTS]
        pair.watched = is_asked or (pair.watched and not fresh[n])
        if pair.watched:
            pair.asked_s = now_s
            if fresh[n] or pair.near_s == 0.0:
                due[dues] = n
                dues += 1
        n += 1
    return n, dues


class SelectedPairs(NamedTuple):
    """The pairs at a new look."""

    pairs: Pairs
    fresh: Bools
    """(p,) whether either robot has reported since the last look."""
    rows: Ints
    """Of each code that was asked for."""
    due: Ints
    """Rows of the pairs that must be looked at."""


def again(before: Pairs, code: Ints, told: Bools, now_s: float) -> SelectedPairs:
    """The pairs of the last look and those of `code` (n,), at a new one; `told` (slots,) are robots that reported.

    Those of `code` are watched; of the others no fresh ones are, and only candidates of the last `REMEMBERED_S` are
    kept. What is not kept or is new counts as never looked at. Watched pairs are due that are fresh or new.
    """
    most = len(before) + len(code)
    pairs, fresh, due = np.zeros(most, PAIR), np.empty(most, np.bool_), np.empty(most, np.int64)
    rows = np.empty(len(code), np.int64)
    n, dues = _look_again(before, code, np.argsort(code), told, now_s, now_s - REMEMBERED_S, pairs, fresh, rows, due)
    return SelectedPairs(pairs[:n], fresh[:n], rows, due[:dues])


@kernel(_INTS(_PAIRS, numba.float64[:, ::1], numba.float64))
def open_rows(pairs: Pairs, seen: Floats, since_s: float) -> Ints:
    """The rows of the pairs under watch that are in no encounter, of which neither gives way to the other, and both
    robots were `seen` (slots, 5) since then."""
    rows, n = np.empty(len(pairs), np.int64), 0
    for row, pair in enumerate(pairs):
        heard_s = min(seen[pair.code >> SLOT_BITS, 0], seen[pair.code & SLOTS, 0])
        if pair.watched and not pair.inside and not pair.gives_way and heard_s > since_s:
            rows[n] = row
            n += 1
    return rows[:n].copy()


@kernel(
    numba.types.Tuple((_INTS, _INTS))(_PAIRS, _INTS, numba.float64)  # type: ignore[no-untyped-call]
)
def shown(pairs: Pairs, first: Ints, likely: float) -> tuple[Ints, Ints]:
    """The rows `first`, and then those of other pairs under watch that are at least so `likely`; the codes of these."""
    is_first, code, n = np.zeros(len(pairs), np.bool_), np.empty(len(pairs), np.int64), len(first)
    rows = np.empty(n + len(pairs), np.int64)
    for at, row in enumerate(first):
        rows[at], is_first[row] = row, True
    for row, pair in enumerate(pairs):
        if pair.watched and pair.deciding >= likely and not is_first[row]:
            code[n - len(first)], rows[n] = pair.code, row
            n += 1
    return rows[:n].copy(), code[: n - len(first)].copy()


@kernel(numba.void(_PAIRS, *[_BOOLS] * 2, _INTS, *[numba.float64] * 3))
def preempt(
    pairs: Pairs, stands: Bools, stays: Bools, waits_for: Ints, now_s: float, scale_s: float, settled_s: float
) -> None:
    """Set the features of the pairs under watch that hang on other pairs: how surely each robot comes into conflict
    with another one before; and which pairs are `still`: both stay where they stand, or one gave way to the other in
    the last `settled_s`. Who `stands`, who `stays`, and for whom a robot that stands has to wait, are by slot."""
    slots = len(stands)
    first_s, second_s, first = np.full(slots, np.inf), np.full(slots, np.inf), np.full(slots, -1)
    for row, pair in enumerate(pairs):
        if not pair.watched:
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
        pair.seen[6] = pair.share / (1.0 + np.exp(min(max(sooner_s / scale_s, -50.0), 50.0)))
        pair.seen[7] = pair.share / (1.0 + np.exp(min(max(later_s / scale_s, -50.0), 50.0)))
        both = stands[a] and stands[b]
        if pair.gives_way or waits_for[a] == b or waits_for[b] == a:
            pair.gave_way_s = now_s
        pair.seen[5] = 1.0 if both else 0.0
        pair.still = (stays[a] and stays[b]) or now_s - pair.gave_way_s <= settled_s


def crowded(pairs: Pairs, absence: Floats) -> Bools:
    """(p,) whether the robots of each pair are to be driven on together: they come near, and are probably there, by
    their `absence` (slots,)."""
    near: Bools = pairs["watched"] & ((pairs["near_m"] <= CROWDED_M) | (pairs["share"] > LEAST_SHARE))
    a, b = slots_of(pairs["code"])
    return near & (np.maximum(absence[a], absence[b]) < 0.5)


@dataclass(slots=True, eq=False)
class Question:
    """What was asked of the pairs at one whole second, and not yet known."""

    t_s: float
    code: Ints
    """Ascending."""
    seen: Floats


@dataclass(frozen=True, slots=True, eq=False)
class CensoredOutcomes:
    """What became of pairs within the horizon. Arrays are (p,)."""

    part: Ints
    """Of the horizon, in which they met, or one of them was last heard or began to wait as advised; `STAYED` where
    none of it happened."""
    met: Bools
    left: Bools
    """One was last heard, or began to wait as advised, before they had met."""


@kernel(
    numba.types.Tuple((_INTS, *[numba.float64[::1], _BOOLS] * 2))(  # type: ignore[no-untyped-call]
        _PAIRS, _CODES, numba.float64[::1], *[numba.float64] * 2
    )
)
def _ended(
    pairs: Pairs, asked: Ints, until_s: Floats, asked_s: float, horizon_s: float
) -> tuple[Ints, Floats, Bools, Floats, Bools]:
    """What became of pairs `asked` (n,), ascending, within the horizon: the rows of those of which it is known; when
    the two got in each other's way, or one was last heard or went its own way (`until_s`, by slot), and whether they
    did; and the same of coming within the clearance.

    Left out are pairs that were at it when asked, and those of one vendor of which it is not known whether an order of
    their fleet explains what they did.
    """
    kept, n, row = np.empty(len(asked), np.int64), 0, 0
    ended_s, met, touched_s, touched = (
        np.empty(len(asked)),
        np.empty(len(asked), np.bool_),
        np.empty(len(asked)),
        np.empty(len(asked), np.bool_),
    )
    for at, code in enumerate(asked):
        while row < len(pairs) and pairs[row].code < code:
            row += 1
        started_s = below_s = yielded_s = yield_end_s = doubted_s = -np.inf
        if row < len(pairs) and pairs[row].code == code:
            pair = pairs[row]
            started_s, below_s, doubted_s = pair.started_s, pair.below_s, pair.doubted_s
            yielded_s, yield_end_s = pair.yielded_s, pair.yield_end_s
        last_s = min(until_s[code >> SLOT_BITS], until_s[code & SLOTS])
        until_end_s = min(asked_s + horizon_s, last_s)
        was_inside = not (started_s > asked_s or below_s < asked_s)
        if was_inside or yielded_s <= asked_s < yield_end_s or last_s == -np.inf:
            continue
        touched[n] = asked_s < started_s <= until_end_s
        yielded = asked_s < yielded_s <= until_end_s
        if asked_s < doubted_s <= until_end_s and not (touched[n] or yielded):
            continue
        kept[n], met[n] = at, touched[n] or yielded
        touched_s[n] = ended_s[n] = started_s if touched[n] else last_s
        if yielded:
            ended_s[n] = min(ended_s[n], yielded_s)
        n += 1
    return kept[:n].copy(), ended_s[:n].copy(), met[:n].copy(), touched_s[:n].copy(), touched[:n].copy()


class AnsweredQuestion(NamedTuple):
    """What became of the pairs of one question."""

    asked_s: float
    code: Ints
    """(p,)"""
    seen: Floats
    """(p, FEATURES)"""
    interacted: CensoredOutcomes
    """Whether they got in each other's way."""
    touched: CensoredOutcomes
    """Whether they came within the clearance."""


@dataclass(slots=True, eq=False)
class OpenQuestions:
    """Asks at each whole second whether pairs will meet within the horizon, and tells when that is known."""

    horizon_s: float
    waits_s: float = 6.0
    """For reports that come late, and until it shows that a robot gave way."""
    open: list[Question] = field(default_factory=list)
    _settled: list[AnsweredQuestion] = field(default_factory=list)
    """What is known before the time of its question is over."""

    def ask(self, t_s: float, code: Ints, seen: Floats) -> None:
        """Of pairs `code` (p,) of which these are the features (p, FEATURES)."""
        self.open.append(Question(t_s, code, seen))

    def settle(
        self, slots: Ints, pairs: Pairs, own_until_s: Callable[[float], Floats], *, were_there: bool = True
    ) -> None:
        """Answer now what is open of robots of `slots`, which others may have from now on; `own_until_s` is that of
        `known`.

        Where they `were_there`, nobody knows what would have come of a pair that has not met by now. Where they were
        not, since they were heard last, the two did not get in each other's way.
        """
        for question in self.open:
            rows = of_robots(question.code, slots)
            if rows.any():
                settled = Question(question.t_s, question.code[rows], question.seen[rows])
                self._settled.append(self._answered(settled, pairs, own_until_s(question.t_s), were_there))
                question.code, question.seen = question.code[~rows], question.seen[~rows]

    def known(self, now_s: float, pairs: Pairs, own_until_s: Callable[[float], Floats]) -> list[AnsweredQuestion]:
        """Questions whose time is over, and what became of their pairs.

        `own_until_s` tells, for the time of a question, by slot until when each robot was heard and went its own way;
        -inf where it did not when asked. Pairs of such are left out, and those that were in an encounter then, as
        reports have shown since.
        """
        answered, self._settled = self._settled, []
        while self.open and self.open[0].t_s + self.horizon_s + self.waits_s <= now_s:
            question = self.open.pop(0)
            answered.append(self._answered(question, pairs, own_until_s(question.t_s)))
        return answered

    def _answered(self, question: Question, pairs: Pairs, until_s: Floats, were_there: bool = True) -> AnsweredQuestion:
        """What became of the pairs of a question; `until_s` is by slot, as `own_until_s` tells it. See `settle`."""
        asked_s = question.t_s
        kept, ended_s, met, touched_s, touched = _ended(pairs, question.code, until_s, asked_s, self.horizon_s)
        ended_s = ended_s if were_there else np.where(met, ended_s, np.inf)
        fates = (self._fates(ended_s - asked_s, met), self._fates(touched_s - asked_s, touched))
        return AnsweredQuestion(asked_s, question.code[kept], question.seen[kept], *fates)

    def _fates(self, after_s: Floats, met: Bools) -> CensoredOutcomes:
        ended = part_of(after_s, self.horizon_s)
        part = np.where(met, np.minimum(ended, STAYED - 1), ended)
        return CensoredOutcomes(part, met, ~met & (part < STAYED))
