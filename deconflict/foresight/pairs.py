"""Pairs of robots under watch, in columns: how near each pair is and was, and how likely it is to meet.

A pair is known by one number, its two slots. Rows stay in order of it, so that a pass finds yesterday's rows by search,
never pair by pair.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, fields
from typing import Self

import numba
import numpy as np

from deconflict.foresight.leaving import STAYED, part_of
from deconflict.motion import Bools
from ingest.compiled import kernel
from ingest.seam import Floats, Ints

SLOT_BITS = 24
SLOTS = (1 << SLOT_BITS) - 1
_TYPES = (numba.int64[::1], numba.float64[:, ::1], *[numba.float64[::1]] * 7, *[numba.boolean[::1]] * 2)
"""Of the columns of `Pairs`."""


def codes(a: Ints, b: Ints) -> Ints:
    """One number for each pair of slots."""
    return (a << SLOT_BITS) | b


def slots_of(code: Ints) -> tuple[Ints, Ints]:
    """The two slots of each number."""
    return code >> SLOT_BITS, code & SLOTS


@kernel(
    numba.types.Tuple((*_TYPES, numba.boolean[::1], numba.int64[::1]))(  # type: ignore[no-untyped-call]
        *[numba.int64[::1]] * 2, numba.boolean[::1], numba.float64, *_TYPES
    )
)
def _again(
    asked: Ints,
    ascending: Ints,
    told: Bools,
    since_s: float,
    code: Ints,
    seen: Floats,
    probability: Floats,
    near_s: Floats,
    near_m: Floats,
    now_m: Floats,
    started_s: Floats,
    below_s: Floats,
    asked_s: Floats,
    watched: Bools,
    inside: Bools,
) -> tuple[Ints, Floats, Floats, Floats, Floats, Floats, Floats, Floats, Floats, Bools, Bools, Bools, Ints]:
    """What `Pairs.again` gives, of codes `asked` whose order is `ascending`."""
    most, before, after, n = len(code) + len(asked), 0, 0, 0
    codes, looks, real = np.empty(most, np.int64), np.zeros((most, seen.shape[1])), np.zeros((7, most))
    flags, rows = np.zeros((3, most), np.bool_), np.empty(len(asked), np.int64)
    while before < len(code) or after < len(asked):
        is_old = after == len(asked) or (before < len(code) and code[before] <= asked[ascending[after]])
        one, is_asked = code[before] if is_old else asked[ascending[after]], False
        while after < len(asked) and asked[ascending[after]] == one:
            rows[ascending[after]], is_asked = n, True
            after += 1
        old, before = before, before + is_old
        is_known = is_old and asked_s[old] >= since_s
        if not (is_known or is_asked):
            continue
        codes[n], real[4, n], real[5, n] = one, -np.inf, -np.inf
        if is_known:
            for feature in range(seen.shape[1]):
                looks[n, feature] = seen[old, feature]
            real[0, n], real[1, n], real[2, n] = probability[old], near_s[old], near_m[old]
            real[3, n], real[4, n], real[5, n] = now_m[old], started_s[old], below_s[old]
            real[6, n], flags[0, n], flags[1, n] = asked_s[old], watched[old], inside[old]
        flags[2, n] = told[one >> SLOT_BITS] or told[one & SLOTS]
        flags[0, n] = is_asked or (flags[0, n] and not flags[2, n])
        n += 1
    some = (real[0, :n], real[1, :n], real[2, :n], real[3, :n], real[4, :n], real[5, :n], real[6, :n])
    return codes[:n], looks[:n], *some, flags[0, :n], flags[1, :n], flags[2, :n], rows


@dataclass(frozen=True, slots=True, eq=False)
class Pairs:
    """p pairs, ascending by `code`. Arrays are (p,) unless said otherwise."""

    code: Ints
    seen: Floats
    """(p, FEATURES) as last looked at."""
    probability: Floats
    near_s: Floats
    """When the forecasts are nearest within the horizon."""
    near_m: Floats
    """How near they are then."""
    now_m: Floats
    """Separation when last looked at, by the newest forecasts."""
    started_s: Floats
    """When the last encounter began; -inf before the first."""
    below_s: Floats
    """When they were last seen within the clearance; -inf before the first."""
    asked_s: Floats
    """When it was last a candidate."""
    watched: Bools
    """Whether it is a candidate now."""
    inside: Bools
    """Within the clearance, or not yet drawn apart from it."""

    def __len__(self) -> int:
        return len(self.code)

    @classmethod
    def none(cls, features: int) -> Self:
        real = np.empty(0)
        return cls(
            np.empty(0, np.int64), np.empty((0, features)), real, real, real, real, real, real, real, real > 0, real > 0
        )

    @property
    def a(self) -> Ints:
        return slots_of(self.code)[0]

    @property
    def b(self) -> Ints:
        return slots_of(self.code)[1]

    def rows(self, code: Ints) -> Ints:
        """The row of each of `code`; -1 where it is not there."""
        if not len(self):
            return np.full(len(code), -1)
        at = np.minimum(np.searchsorted(self.code, code), len(self) - 1)
        return np.where(self.code[at] == code, at, -1)

    def take(self, rows: Ints | Bools) -> "Pairs":
        return Pairs(*(getattr(self, name)[rows] for name in _COLUMNS))

    def again(self, code: Ints, told: Bools, since_s: float) -> "tuple[Pairs, Bools, Ints]":
        """The pairs at a new look, which of them have a robot that is `told` (slots,), and the row of each of `code`.

        Those of `code` are watched; of the others no fresh ones are, and only candidates `since_s` are kept. What is
        not kept or is new counts as never looked at.
        """
        before = (getattr(self, name) for name in _COLUMNS)
        after = _again(code, np.argsort(code), told, since_s, *before)
        return Pairs(*after[:-2]), *after[-2:]


_COLUMNS = tuple(one.name for one in fields(Pairs))


@dataclass(slots=True, eq=False)
class Question:
    """What was asked of the pairs at one whole second, and not yet known."""

    t_s: float
    code: Ints
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
            row = pairs.rows(question.code)
            started_s, below_s = (_at(column, row) for column in (pairs.started_s, pairs.below_s))
            until_s, (a, b) = own_until_s(question.t_s), slots_of(question.code)
            last_s = np.minimum(until_s[a], until_s[b])
            apart = (started_s > question.t_s) | (below_s < question.t_s)
            kept = np.flatnonzero(apart & (last_s > -np.inf))
            question = Question(question.t_s, question.code[kept], question.seen[kept])
            told.append((question, self._fates(question, started_s[kept], last_s[kept])))
        return told

    def _fates(self, question: Question, started_s: Floats, last_s: Floats) -> Fates:
        """Of pairs whose last encounter began at `started_s`, and whose robots both went their own way to `last_s`."""
        until_s = np.minimum(question.t_s + self.horizon_s, last_s)
        met = (started_s > question.t_s) & (started_s <= until_s)
        ended = part_of(np.where(met, started_s, last_s) - question.t_s, self.horizon_s)
        part = np.where(met, np.minimum(ended, STAYED - 1), ended)
        return Fates(part, met, ~met & (part < STAYED))


def _at(times_s: Floats, row: Ints) -> Floats:
    """The times of rows; -inf where there is no row."""
    return np.append(times_s, -np.inf)[row]
