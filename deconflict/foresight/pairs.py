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

from deconflict.foresight.leaving import STAYED, part_of
from deconflict.motion import Bools
from ingest.compiled import kernel
from ingest.seam import Floats, Ints

SLOT_BITS = 24
SLOTS = (1 << SLOT_BITS) - 1
FEATURES = 5
"""1; the log odds of the largest share of the error distribution that lies within the clearance, at any moment of the
horizon and in its first fifth; how long the pair would need if it went straight for each other, in horizons and at most
1; and 1 where either stands: it is seen, and gone around."""
REMEMBERED_S = 15.0

PAIR = np.dtype(
    [("code", np.int64), ("seen", np.float64, (FEATURES,))]
    + [(name, np.float64) for name in ("probability", "near_s", "near_m", "now_m", "started_s", "below_s", "asked_s")]
    + [("watched", np.bool_), ("inside", np.bool_)],
    align=True,
)
"""Of a pair: its features as last looked at; when the forecasts are nearest within the horizon, how near they are then,
and at the last look; when its last encounter began and when it was last seen within the clearance, -inf before the
first; when it was last a candidate, and whether it is one now; whether it is within the clearance, or not yet drawn
apart from it."""

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
        fresh[n] = told[one >> SLOT_BITS] or told[one & SLOTS]
        pair.watched = is_asked or (pair.watched and not fresh[n])
        if pair.watched:
            pair.asked_s = now_s
            if fresh[n] or pair.near_s == 0.0:
                due[dues] = n
                dues += 1
        n += 1
    return n, dues


class Again(NamedTuple):
    """The pairs at a new look."""

    pairs: Pairs
    fresh: Bools
    """(p,) whether either robot has reported since the last look."""
    rows: Ints
    """Of each code that was asked for."""
    due: Ints
    """Rows of the pairs that must be looked at."""


def again(before: Pairs, code: Ints, told: Bools, now_s: float) -> Again:
    """The pairs of the last look and those of `code` (n,), at a new one; `told` (slots,) are robots that reported.

    Those of `code` are watched; of the others no fresh ones are, and only candidates of the last `REMEMBERED_S` are
    kept. What is not kept or is new counts as never looked at. Watched pairs are due that are fresh or new.
    """
    most = len(before) + len(code)
    pairs, fresh, due = np.zeros(most, PAIR), np.empty(most, np.bool_), np.empty(most, np.int64)
    rows = np.empty(len(code), np.int64)
    n, dues = _look_again(before, code, np.argsort(code), told, now_s, now_s - REMEMBERED_S, pairs, fresh, rows, due)
    return Again(pairs[:n], fresh[:n], rows, due[:dues])


@kernel(_INTS(_PAIRS, numba.float64[:, ::1], numba.float64))
def open_rows(pairs: Pairs, seen: Floats, since_s: float) -> Ints:
    """The rows of the pairs under watch that are not in an encounter, and of which both robots were `seen` (slots, 5)
    since then."""
    rows, n = np.empty(len(pairs), np.int64), 0
    for row, pair in enumerate(pairs):
        heard_s = min(seen[pair.code >> SLOT_BITS, 0], seen[pair.code & SLOTS, 0])
        if pair.watched and not pair.inside and heard_s > since_s:
            rows[n] = row
            n += 1
    return rows[:n].copy()


@kernel(
    numba.types.Tuple((_INTS, *[numba.float64[::1]] * 4, _BOOLS))(  # type: ignore[no-untyped-call]
        _PAIRS, _BOOLS, _INTS, numba.float64
    )
)
def shown(pairs: Pairs, fresh: Bools, first: Ints, likely: float) -> tuple[Ints, Floats, Floats, Floats, Floats, Bools]:
    """The codes of the pairs under watch that are at least so `likely`, without those of the rows `first`. Of these and
    then of them: the probability, when they are nearest and how near then and now, and which are `fresh`, (n,) each."""
    is_first, code, n = np.zeros(len(pairs), np.bool_), np.empty(len(pairs), np.int64), len(first)
    rows = np.empty(n + len(pairs), np.int64)
    for at, row in enumerate(first):
        rows[at], is_first[row] = row, True
    for row, pair in enumerate(pairs):
        if pair.watched and pair.probability >= likely and not is_first[row]:
            code[n - len(first)], rows[n] = pair.code, row
            n += 1
    probability, near_s, near_m, now_m = np.empty(n), np.empty(n), np.empty(n), np.empty(n)
    is_fresh = np.empty(n, np.bool_)
    for at in range(n):
        pair = pairs[rows[at]]
        probability[at], near_s[at], near_m[at], now_m[at] = pair.probability, pair.near_s, pair.near_m, pair.now_m
        is_fresh[at] = fresh[rows[at]]
    return code[: n - len(first)].copy(), probability, near_s, near_m, now_m, is_fresh


@dataclass(slots=True, eq=False)
class Question:
    """What was asked of the pairs at one whole second, and not yet known."""

    t_s: float
    code: Ints
    """Ascending."""
    seen: Floats


@dataclass(frozen=True, slots=True, eq=False)
class Fates:
    """What became of pairs within the horizon. Arrays are (p,)."""

    part: Ints
    """Of the horizon, in which they met, or one of them was last heard or began to wait as advised; `STAYED` where
    none of it happened."""
    met: Bools
    left: Bools
    """One was last heard, or began to wait as advised, before they had met."""


@kernel(
    numba.types.Tuple((_INTS, numba.float64[::1], _BOOLS))(  # type: ignore[no-untyped-call]
        _PAIRS, _CODES, numba.float64[::1], *[numba.float64] * 2
    )
)
def _ended(pairs: Pairs, asked: Ints, until_s: Floats, asked_s: float, horizon_s: float) -> tuple[Ints, Floats, Bools]:
    """What became of pairs `asked` (n,), ascending, within the horizon: the rows of those of which it is known, when
    they met or one of them was last heard or went its own way (`until_s`, by slot), and whether they met."""
    kept, ended_s, met, n, row = (
        np.empty(len(asked), np.int64),
        np.empty(len(asked)),
        np.empty(len(asked), np.bool_),
        0,
        0,
    )
    for at, code in enumerate(asked):
        while row < len(pairs) and pairs[row].code < code:
            row += 1
        started_s = below_s = -np.inf
        if row < len(pairs) and pairs[row].code == code:
            started_s, below_s = pairs[row].started_s, pairs[row].below_s
        last_s = min(until_s[code >> SLOT_BITS], until_s[code & SLOTS])
        was_inside = not (started_s > asked_s or below_s < asked_s)
        if was_inside or last_s == -np.inf:
            continue
        kept[n], met[n] = at, asked_s < started_s <= min(asked_s + horizon_s, last_s)
        ended_s[n] = started_s if met[n] else last_s
        n += 1
    return kept[:n].copy(), ended_s[:n].copy(), met[:n].copy()


@dataclass(slots=True, eq=False)
class Outcomes:
    """Asks at each whole second whether pairs will meet within the horizon, and tells when that is known."""

    horizon_s: float
    waits_s: float = 2.0
    """For reports that come late."""
    open: list[Question] = field(default_factory=list)

    def ask(self, t_s: float, code: Ints, seen: Floats) -> None:
        """Of pairs `code` (p,) of which these are the features (p, FEATURES)."""
        self.open.append(Question(t_s, code, seen))

    def known(self, now_s: float, pairs: Pairs, own_until_s: Callable[[float], Floats]) -> list[tuple[Question, Fates]]:
        """Questions whose time is over, and what became of their pairs.

        `own_until_s` tells, for the time of a question, by slot until when each robot was heard and went its own way;
        -inf where it did not when asked. Pairs of such are left out, and those that were in an encounter then, as
        reports have shown since.
        """
        told = []
        while self.open and self.open[0].t_s + self.horizon_s + self.waits_s <= now_s:
            question = self.open.pop(0)
            asked_s, until_s = question.t_s, own_until_s(question.t_s)
            kept, ended_s, met = _ended(pairs, question.code, until_s, asked_s, self.horizon_s)
            ended = part_of(ended_s - asked_s, self.horizon_s)
            part = np.where(met, np.minimum(ended, STAYED - 1), ended)
            known = Question(asked_s, question.code[kept], question.seen[kept])
            told.append((known, Fates(part, met, ~met & (part < STAYED))))
        return told
