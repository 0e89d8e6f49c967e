"""Who comes within the clearance of whom, slab by slab."""

from math import inf
from typing import Any, cast

import numba
import numpy as np
from numpy.typing import NDArray

from deconflict.sweep.broadphase import BOX, PAIR, Pairs
from deconflict.sweep.narrowphase import FOUND, Found
from ingest.batch import Bools, Floats, Ints
from ingest.kernels import inner, kernel

CONTACT_INTERVAL = np.dtype(
    [(name, np.int64) for name in ("a", "b", "slab")]
    + [(name, np.float64) for name in ("contact", "separation", "separation_at")],
    align=True,
)
"""Two robots that come within the clearance in a slab, by slot, `a` the one with the lower key; times are since the
epoch."""

ContactIntervals = NDArray[Any]
"""Of `CONTACT_INTERVAL`, ascending by the keys and the slab."""

_BOX, _PAIR, _FOUND, _MEETING = (numba.from_dtype(one) for one in (BOX, PAIR, FOUND, CONTACT_INTERVAL))
_MEETINGS, _INTS, _REAL = _MEETING[::1], numba.int64[::1], numba.float64


@kernel(_MEETINGS(_PAIR[::1], _FOUND[::1], _BOX[:, ::1]))
def met(pairs: Pairs, found: Found, boxes: NDArray[Any]) -> ContactIntervals:
    """The meetings among pairs in order, of which `found` tells what became of them."""
    some, n = np.empty(len(pairs), CONTACT_INTERVAL), 0
    for row in range(len(pairs)):
        pair, what = pairs[row], found[row]
        if what.contact < inf:
            slab, one = boxes[pair.ring, pair.a].slab, some[n]
            one.a, one.b, one.slab = pair.a, pair.b, slab
            one.contact, one.separation = slab + what.contact, what.separation
            one.separation_at = slab + what.separation_at
            n += 1
    return some[:n].copy()


@kernel(_MEETINGS(_MEETINGS, numba.boolean[::1], numba.int64))
def kept(meetings: ContactIntervals, is_changed: Bools, first_slab: int) -> ContactIntervals:
    """Those that are not over, of robots that did not change."""
    some, n = np.empty_like(meetings), 0
    for one in meetings:
        if one.slab >= first_slab and not is_changed[one.a] and not is_changed[one.b]:
            some[n] = one
            n += 1
    return some[:n].copy()


@inner
def _is_before(one: Any, other: Any, ranks: Ints) -> bool:
    if one.a != other.a:
        return bool(ranks[one.a] < ranks[other.a])
    if one.b != other.b:
        return bool(ranks[one.b] < ranks[other.b])
    return bool(one.slab < other.slab)


@kernel(_MEETINGS(_MEETINGS, _MEETINGS, _INTS))
def joined(some: ContactIntervals, others: ContactIntervals, ranks: Ints) -> ContactIntervals:
    """Both, which have none in common; `ranks` are those of the keys, by slot."""
    every, i, j = np.empty(len(some) + len(others), CONTACT_INTERVAL), 0, 0
    for at in range(len(every)):
        if j == len(others) or (i < len(some) and _is_before(some[i], others[j], ranks)):
            every[at] = some[i]
            i += 1
        else:
            every[at] = others[j]
            j += 1
    return every


@inner
def _is_elsewhere(one: Any, begin_s: float, end_s: float) -> bool:
    """Whether the smallest separation is out of a span."""
    return bool(one.separation_at < begin_s or one.separation_at > end_s)


@kernel(numba.types.Tuple((_MEETINGS, _INTS))(_MEETINGS, _REAL, _REAL, numba.int64, _PAIR[::1]))  # type: ignore[no-untyped-call]
def in_span(
    meetings: ContactIntervals, begin_s: float, end_s: float, rings: int, pairs: Pairs
) -> tuple[ContactIntervals, Ints]:
    """The meetings that begin by `end_s`, and which rows of them an edge of the span cuts; `pairs`, of which there is
    one for each meeting, begin with theirs then."""
    some, cut, n, cuts = np.empty_like(meetings), np.empty(len(meetings), np.int64), 0, 0
    for one in meetings:
        if one.contact <= end_s and one.slab <= end_s:
            if one.contact < begin_s or _is_elsewhere(one, begin_s, end_s):
                pair = pairs[cuts]
                cut[cuts], pair.ring, pair.a, pair.b = n, one.slab % rings, one.a, one.b
                cuts += 1
            some[n] = one
            n += 1
    return some[:n].copy(), cut[:cuts].copy()


@kernel(_MEETINGS(_MEETINGS, _INTS, _FOUND[::1], _REAL, _REAL))
def mended(meetings: ContactIntervals, cut: Ints, found: Found, begin_s: float, end_s: float) -> ContactIntervals:
    """The meetings of a span, where `found` tells what becomes of those `cut` in the part inside."""
    for at in range(len(cut)):
        one, what = meetings[cut[at]], found[at]
        if what.contact < inf and _is_elsewhere(one, begin_s, end_s):
            one.separation, one.separation_at = what.separation, one.slab + what.separation_at
        if one.contact < begin_s:
            one.contact = one.slab + what.contact
    return meetings[meetings["contact"] < inf]


@kernel(
    numba.types.Tuple((*[_INTS] * 2, *[_REAL[::1]] * 3, numba.boolean[::1]))(  # type: ignore[no-untyped-call]
        _MEETINGS, numba.boolean[::1], _REAL
    )
)
def by_pair(meetings: ContactIntervals, told: Bools, now_s: float) -> tuple[Ints, Ints, Floats, Floats, Floats, Bools]:
    """Of each of p pairs, in the same order: its slots `a` and `b`; its first contact, at the soonest `now_s`; the
    first of its smallest separations, and when; and whether either robot was `told` of, by slot. Arrays are (p,)."""
    most, n = len(meetings), 0
    a, b, contact_s = np.empty(most, np.int64), np.empty(most, np.int64), np.empty(most)
    separation_m, separation_at_s, fresh = np.empty(most), np.empty(most), np.empty(most, np.bool_)
    for one in meetings:
        if n == 0 or one.a != a[n - 1] or one.b != b[n - 1]:
            a[n], b[n], contact_s[n] = one.a, one.b, max(one.contact, now_s)
            separation_m[n], separation_at_s[n] = one.separation, one.separation_at
            fresh[n] = told[one.a] or told[one.b]
            n += 1
        elif one.separation < separation_m[n - 1]:
            separation_m[n - 1], separation_at_s[n - 1] = one.separation, one.separation_at
    slots = (a[:n].copy(), b[:n].copy())
    return *slots, contact_s[:n].copy(), separation_m[:n].copy(), separation_at_s[:n].copy(), fresh[:n].copy()


@kernel(numba.types.UniTuple(_INTS, 2)(*[_INTS] * 4))  # type: ignore[no-untyped-call]
def _placed(before: Ints, a: Ints, b: Ints, ranks: Ints) -> tuple[Ints, Ints]:
    """Numbers (p,) of pairs in order, which ascend, and the place of each among those of `before`; -1 for none."""
    codes, places, at = np.empty(len(a), np.int64), np.full(len(a), -1), 0
    for row in range(len(a)):
        code = codes[row] = ranks[a[row]] * len(ranks) + ranks[b[row]]
        while at < len(before) and before[at] < code:
            at += 1
        if at < len(before) and before[at] == code:
            places[row] = at
    return codes, places


class PairNames:
    """The keys of listed pairs, kept from pass to pass: most pairs are listed again."""

    def __init__(self) -> None:
        self._ranks: Ints = np.zeros(0, np.int64)
        self._codes: Ints = np.zeros(0, np.int64)
        self._names: list[tuple[str, str] | None] = [None]
        """None at the end, for one that was not listed before."""

    def of(self, a: Ints, b: Ints, keys: NDArray[np.object_], ranks: Ints) -> tuple[tuple[tuple[str, str], ...], Ints]:
        """The two keys of each of p pairs of slots `a` and `b`, in order, and (p,) its place among those listed before,
        -1 for one that was not.

        `keys` and `ranks` are by slot; what is kept holds for as long as `ranks` is the same array.
        """
        if self._ranks is not ranks:
            self._ranks, self._codes, self._names = ranks, self._codes[:0], [None]
        self._codes, before = _placed(self._codes, a, b, ranks)
        names = list(map(self._names.__getitem__, before.tolist()))
        for row in np.flatnonzero(before < 0).tolist():
            names[row] = (keys[a[row]], keys[b[row]])
        self._names = [*names, None]
        return cast(tuple[tuple[str, str], ...], tuple(names)), before
