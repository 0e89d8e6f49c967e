"""Which pairs come within the clearance, slab by slab, in a table that is kept from pass to pass."""

from math import inf
from typing import Any, NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

from deconflict.sweep.broadphase import BOX, PAIR, Pairs
from deconflict.sweep.narrowphase import CONTACT, Contacts
from ingest.batch import Bools, Floats, Ints
from ingest.kernels import BOOLS, FLOAT, INT, INTS, inner, kernel

CONTACT_INTERVAL = np.dtype(
    [
        ("a", np.int64),  # slot of the robot with the lower key
        ("b", np.int64),  # slot of the other robot
        ("slab", np.int64),
        ("contact", np.float64),  # first time within the clearance in the slab, since the epoch
        ("separation", np.float64),  # smallest separation in the slab
        ("separation_at", np.float64),  # when that is, since the epoch
    ],
    align=True,
)
"""Two robots that come within the clearance in one slab."""

ContactIntervals = NDArray[Any]
"""Of `CONTACT_INTERVAL`, ascending by the keys and the slab."""

_BOX, _PAIR, _CONTACT, _INTERVAL = (numba.from_dtype(dtype) for dtype in (BOX, PAIR, CONTACT, CONTACT_INTERVAL))
_INTERVALS = _INTERVAL[::1]


class PairConflicts(NamedTuple):
    """c pairs that come within the clearance, ascending by keys, and the work of the pass."""

    pairs: tuple[tuple[str, str], ...]
    contact_s: Floats
    """(c,) first time within the clearance, to a millimetre and never late; `now_s` if the two are within it then."""
    separation_m: Floats
    """(c,) smallest distance of the envelopes over the horizon, to a millimetre; 0 if they overlap."""
    separation_at_s: Floats
    """(c,) a time at which that is reached."""
    start_separation_m: Floats
    """(c,) distance at `now_s`, or when the later of the two appears; inf if they are on different floors."""
    fresh: Bools
    """(c,) whether either robot's forecast is new since the last pass."""
    box_pairs: int
    """Pairs of boxes that the broad phase left."""
    segment_pairs: int
    """Pairs of segments of forecasts in these boxes."""
    advanced_pairs: int
    """Those of them whose circles come near enough for advancement."""
    fcl_calls: int
    """Calls of FCL."""
    left_out: int
    """Pairs that the budget left out, see `pair_choice`."""


@kernel(_INTERVALS(_PAIR[::1], _CONTACT[::1], _BOX[:, ::1]))
def intervals_of(pairs: Pairs, contacts: Contacts, boxes: NDArray[Any]) -> ContactIntervals:
    """The intervals of those of sorted `pairs` that have a contact; `contacts` has one row for each pair."""
    found, n = np.empty(len(pairs), CONTACT_INTERVAL), 0
    for row in range(len(pairs)):
        pair, contact = pairs[row], contacts[row]
        if contact.contact < inf:
            slab, interval = boxes[pair.ring, pair.a].slab, found[n]
            interval.a, interval.b, interval.slab = pair.a, pair.b, slab
            interval.contact, interval.separation = slab + contact.contact, contact.separation
            interval.separation_at = slab + contact.separation_at
            n += 1
    return found[:n].copy()


@kernel(_INTERVALS(_INTERVALS, BOOLS, INT))
def still_valid(intervals: ContactIntervals, is_changed: Bools, first_slab: int) -> ContactIntervals:
    """The intervals that are not over, of robots that did not change."""
    found, n = np.empty_like(intervals), 0
    for interval in intervals:
        if interval.slab >= first_slab and not is_changed[interval.a] and not is_changed[interval.b]:
            found[n] = interval
            n += 1
    return found[:n].copy()


@inner
def _is_before(interval: Any, other: Any, ranks: Ints) -> bool:
    if interval.a != other.a:
        return bool(ranks[interval.a] < ranks[other.a])
    if interval.b != other.b:
        return bool(ranks[interval.b] < ranks[other.b])
    return bool(interval.slab < other.slab)


@kernel(_INTERVALS(_INTERVALS, _INTERVALS, INTS))
def merged(first: ContactIntervals, second: ContactIntervals, ranks: Ints) -> ContactIntervals:
    """Both tables in one. They have no interval in common. `ranks` (slots,) are those of the keys."""
    both, i, j = np.empty(len(first) + len(second), CONTACT_INTERVAL), 0, 0
    for at in range(len(both)):
        if j == len(second) or (i < len(first) and _is_before(first[i], second[j], ranks)):
            both[at] = first[i]
            i += 1
        else:
            both[at] = second[j]
            j += 1
    return both


@inner
def _is_outside(interval: Any, begin_s: float, end_s: float) -> bool:
    """Whether the time of the smallest separation is outside a span."""
    return bool(interval.separation_at < begin_s or interval.separation_at > end_s)


@kernel((_INTERVALS, FLOAT, FLOAT, INT, _PAIR[::1]))
def in_span(
    intervals: ContactIntervals, begin_s: float, end_s: float, rings: int, cut_pairs: Pairs
) -> tuple[ContactIntervals, Ints]:
    """The intervals that begin by `end_s`, and the rows of those that an edge of the span cuts. The pairs of these are
    written to the first rows of `cut_pairs`, which has as many rows as `intervals`."""
    found, cut, n, n_cut = np.empty_like(intervals), np.empty(len(intervals), np.int64), 0, 0
    for interval in intervals:
        if interval.contact <= end_s and interval.slab <= end_s:
            if interval.contact < begin_s or _is_outside(interval, begin_s, end_s):
                pair = cut_pairs[n_cut]
                cut[n_cut], pair.ring, pair.a, pair.b = n, interval.slab % rings, interval.a, interval.b
                n_cut += 1
            found[n] = interval
            n += 1
    return found[:n].copy(), cut[:n_cut].copy()


@kernel(_INTERVALS(_INTERVALS, INTS, _CONTACT[::1], FLOAT, FLOAT))
def with_contacts(
    intervals: ContactIntervals, cut: Ints, contacts: Contacts, begin_s: float, end_s: float
) -> ContactIntervals:
    """The intervals of a span. The rows `cut` get their contact and separation within the span from `contacts`; those
    without a contact there are left out."""
    for at in range(len(cut)):
        interval, contact = intervals[cut[at]], contacts[at]
        if contact.contact < inf and _is_outside(interval, begin_s, end_s):
            interval.separation = contact.separation
            interval.separation_at = interval.slab + contact.separation_at
        if interval.contact < begin_s:
            interval.contact = interval.slab + contact.contact
    return intervals[intervals["contact"] < inf]


@kernel((_INTERVALS, BOOLS, FLOAT))
def by_pair(
    intervals: ContactIntervals, is_new: Bools, now_s: float
) -> tuple[Ints, Ints, Floats, Floats, Floats, Bools]:
    """One row for each of p pairs, in the same order. (p,) each are its slots `a` and `b`; its first contact, `now_s`
    at the earliest; its smallest separation, and when that is first reached; and whether either robot `is_new`
    (slots,)."""
    most, n = len(intervals), 0
    a, b, contact_s = np.empty(most, np.int64), np.empty(most, np.int64), np.empty(most)
    separation_m, separation_at_s, fresh = np.empty(most), np.empty(most), np.empty(most, np.bool_)
    for interval in intervals:
        if n == 0 or interval.a != a[n - 1] or interval.b != b[n - 1]:
            a[n], b[n], contact_s[n] = interval.a, interval.b, max(interval.contact, now_s)
            separation_m[n], separation_at_s[n] = interval.separation, interval.separation_at
            fresh[n] = is_new[interval.a] or is_new[interval.b]
            n += 1
        elif interval.separation < separation_m[n - 1]:
            separation_m[n - 1], separation_at_s[n - 1] = interval.separation, interval.separation_at
    slots = (a[:n].copy(), b[:n].copy())
    return *slots, contact_s[:n].copy(), separation_m[:n].copy(), separation_at_s[:n].copy(), fresh[:n].copy()
