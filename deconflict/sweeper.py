"""A floor that is swept again and again: only robots that changed are, against all others."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from math import floor

import numpy as np

from deconflict import motion
from deconflict.advance import TOLERANCE_M, first_contacts
from deconflict.broadphase import ABSENT, Boxes
from deconflict.exact import Decider
from deconflict.motion import Bools, Segments
from deconflict.relative import Relative, relative
from deconflict.separation import smallest
from ingest.seam import Floats, Forecasts, Ints

AHEAD = 2
"""Slabs cut beyond the horizon, so that a robot that reports every second is cut once for each report."""
MOST_WASTE = 3
"""The pool is rebuilt when it holds so many times the segments that are in use."""


@dataclass(frozen=True, slots=True, eq=False)
class PairConflicts:
    """c pairs that come within the clearance, ascending by keys, and what the pass cost."""

    pairs: tuple[tuple[str, str], ...]
    contact_s: Floats
    """(c,) first time within the clearance, to a millimetre and never late; `now_s` where they begin so."""
    separation_m: Floats
    """(c,) smallest distance of the envelopes over the horizon, to a millimetre; 0 where they overlap."""
    separation_at_s: Floats
    """(c,) a time at which it is reached."""
    start_separation_m: Floats
    """(c,) distance at `now_s`, or when the later of the two appears; inf where that is on another floor."""
    fresh: Bools
    """(c,) whether either robot's forecast is new since the last pass."""
    box_pairs: int
    """Pairs of robots and slabs that the broad phase left."""
    segment_pairs: int
    """Pairs of segments that were looked at."""
    advanced_pairs: int
    """Of those, the ones whose circles come near enough for a closer look."""
    fcl_calls: int


@dataclass(frozen=True, slots=True, eq=False)
class Meetings:
    """Pairs of robots that come within the clearance in one slab. Arrays are (m,); times are since the epoch."""

    a: Ints
    """Row of the robot with the lower key."""
    b: Ints
    slab: Ints
    contact: Floats
    separation: Floats
    separation_at: Floats

    @classmethod
    def none(cls) -> "Meetings":
        whole, real = np.empty(0, np.int64), np.empty(0)
        return cls(whole, whole, whole, real, real, real)

    def take(self, rows: Ints | Bools) -> "Meetings":
        return Meetings(*(getattr(self, name)[rows] for name in self.__slots__))

    def joined(self, other: "Meetings") -> "Meetings":
        return Meetings(*(np.concatenate([getattr(self, name), getattr(other, name)]) for name in self.__slots__))


class Pool:
    """Segments of all robots, appended as they are cut."""

    def __init__(self) -> None:
        self.used = 0
        self.all = motion.segments(Forecasts.empty(), 0, 1)

    def append(self, more: Segments) -> int:
        """Where the appended ones start."""
        start, self.used = self.used, self.used + len(more)
        if self.used > len(self.all):
            spare = max(self.used, 2 * len(self.all)) - len(self.all)
            self.all = Segments(
                *(
                    np.concatenate([getattr(self.all, name), np.zeros(spare, getattr(self.all, name).dtype)])
                    for name in Segments.__slots__
                )
            )
        for name in Segments.__slots__:
            getattr(self.all, name)[start : self.used] = getattr(more, name)
        return start


class Sweeper:
    """Keeps meetings by pair and slab of absolute time, so that they hold as the horizon moves on.

    Each pass sweeps the robots that changed, and looks again only at meetings that an edge of the horizon cuts. The
    answer depends on what is on the floor, not on the order or the batches in which it came.
    """

    def __init__(self, *, clearance_m: float, horizon_s: float = 10.0) -> None:
        if not clearance_m >= 0 or not 0 < horizon_s < float("inf"):
            raise ValueError("clearance_m must be at least 0 and horizon_s above 0")
        self._clearance_m, self._horizon_s = clearance_m, horizon_s
        self._slabs = int(np.ceil(horizon_s)) + 1 + AHEAD
        self._forecasts: dict[str, Forecasts] = {}
        self._keys: list[str] = []
        self._rows: dict[str, int] = {}
        self._told: set[str] = set()
        self._regrouped = False
        self._half = self._height = np.empty((2, 0))
        self._covered = self._appears = np.empty(0)
        self._pool, self._boxes = Pool(), Boxes.none(self._slabs, 0)
        self._meetings = Meetings.none()
        self._box_pairs = self._segment_pairs = 0

    def update(self, keys: Sequence[str], forecasts: Forecasts) -> tuple[tuple[str, str], ...]:
        """Replace the forecasts of `keys`, one row each; key and reason of those that can't be swept.

        A robot whose new forecast is invalid is off the floor until its next one: its old forecast is no longer what
        it says.
        """
        wrong = motion.faults(forecasts)
        for row, key in enumerate(keys):
            if row in wrong:
                self.discard([key])
                continue
            self._regrouped |= key not in self._forecasts
            self._forecasts[key] = forecasts.one(row)
            self._told.add(key)
        return tuple((keys[row], reason) for row, reason in sorted(wrong.items()))

    def discard(self, keys: Iterable[str]) -> None:
        """Take robots off the floor."""
        for key in keys:
            if self._forecasts.pop(key, None) is not None:
                self._regrouped = True
            self._told.discard(key)

    def step(self, now_s: float) -> PairConflicts:
        """The conflicts in [`now_s`, `now_s` + horizon]."""
        self._box_pairs, self._segment_pairs, decider = 0, 0, Decider(self._clearance_m, TOLERANCE_M)
        told = self._told
        self._told = set()
        changed = self._regroup() if self._regrouped else np.array(sorted(self._rows[key] for key in told), np.int64)
        first_slab, last_slab = floor(now_s), floor(now_s + self._horizon_s)
        stale = np.flatnonzero((self._covered < last_slab) | (self._covered - self._slabs >= first_slab))
        changed = np.union1d(changed, stale).astype(np.int64)
        if len(changed):
            self._cut(changed, first_slab)
            self._sweep_again(changed, decider)
        self._meetings = self._meetings.take(self._meetings.slab >= first_slab)
        within = self._within(now_s, now_s + self._horizon_s, decider)
        return self._gathered(within, now_s, told, decider)

    def _regroup(self) -> Ints:
        """Number the robots anew by key: their set changed. All of them are swept again."""
        self._regrouped = False
        self._keys = sorted(self._forecasts)
        self._rows = {key: row for row, key in enumerate(self._keys)}
        n = len(self._keys)
        self._half, self._height = np.zeros((2, n)), np.zeros((2, n))
        self._covered, self._appears = np.full(n, -np.inf), np.zeros(n)
        self._pool, self._boxes, self._meetings = Pool(), Boxes.none(self._slabs, n), Meetings.none()
        return np.arange(n)

    def _cut(self, rows: Ints, first_slab: int) -> None:
        """Cut the forecasts of `rows` anew from `first_slab` on."""
        if self._pool.used > MOST_WASTE * max(int(self._boxes.count[self._boxes.floor != ABSENT].sum()), 10_000):
            self._repool()
        forecasts = Forecasts.joined(self._forecasts[self._keys[row]] for row in rows)
        self._half[:, rows] = forecasts.length_m / 2, forecasts.width_m / 2
        self._height[:, rows] = forecasts.bottom_m, forecasts.top_m
        self._covered[rows] = first_slab + self._slabs - 1
        self._appears[rows] = forecasts.t_s[forecasts.start[:-1]]
        cut = motion.segments(forecasts, first_slab, self._slabs)
        placed = Segments(rows[cut.robot], *(getattr(cut, name) for name in Segments.__slots__[1:]))
        offset = self._pool.append(placed)
        self._boxes.put(rows, cut, self._half[:, rows], self._clearance_m / 2 + TOLERANCE_M, offset)

    def _repool(self) -> None:
        """Drop the segments that nothing points to any more."""
        ring, robot = np.nonzero(self._boxes.floor != ABSENT)
        counts = self._boxes.count[ring, robot]
        starts = np.cumsum(counts) - counts
        kept = np.repeat(self._boxes.first[ring, robot] - starts, counts) + np.arange(int(counts.sum()))
        whole, self._pool = self._pool.all, Pool()
        self._pool.append(Segments(*(getattr(whole, name)[kept] for name in Segments.__slots__)))
        self._boxes.first[ring, robot] = starts

    def _sweep_again(self, changed: Ints, decider: Decider) -> None:
        is_changed = np.zeros(len(self._keys), bool)
        is_changed[changed] = True
        kept = ~(is_changed[self._meetings.a] | is_changed[self._meetings.b])
        ring, a, b = self._boxes.pairs(changed)
        tall = (self._height[0, a] <= self._height[1, b]) & (self._height[0, b] <= self._height[1, a])
        ring, a, b = ring[tall], a[tall], b[tall]
        met = self._meet(ring, a, b, None, decider)
        self._meetings = self._meetings.take(kept).joined(met)

    def _meet(self, ring: Ints, a: Ints, b: Ints, times: tuple[float, float] | None, decider: Decider) -> Meetings:
        """The meetings of pairs in their slabs, or in the part of them between `times`."""
        moved, owner = self._segments_of(ring, a, b)
        slab = self._boxes.slab[ring, a]
        if times is not None:
            moved = moved.clipped(*(np.asarray(t - slab[owner], np.float64) for t in times))
            lasting = moved.begin <= moved.end
            moved, owner = moved.take(lasting), owner[lasting]
        self._box_pairs += len(ring)
        self._segment_pairs += len(moved)
        contact = np.full(len(ring), np.inf)
        np.minimum.at(contact, owner, first_contacts(moved, self._clearance_m, decider))
        hit = np.isfinite(contact)
        index = np.cumsum(hit) - 1
        near = hit[owner]
        separation, at = smallest(moved.take(near), index[owner[near]], int(hit.sum()))
        return Meetings(a[hit], b[hit], slab[hit], slab[hit] + contact[hit], separation, slab[hit] + at)

    def _segments_of(self, ring: Ints, a: Ints, b: Ints) -> tuple[Relative, Ints]:
        """Each segment of A against each of B that shares its time and floor, and the pair that it belongs to."""
        count_a, count_b = self._boxes.count[ring, a], self._boxes.count[ring, b]
        each = count_a * count_b
        owner = np.repeat(np.arange(len(ring)), each)
        nth = np.arange(len(owner)) - np.repeat(np.cumsum(each) - each, each)
        of_a = self._boxes.first[ring, a][owner] + nth // count_b[owner]
        of_b = self._boxes.first[ring, b][owner] + nth % count_b[owner]
        s = self._pool.all
        shared = (np.maximum(s.t0[of_a], s.t0[of_b]) < np.minimum(s.t1[of_a], s.t1[of_b])) & (
            s.floor[of_a] == s.floor[of_b]
        )
        of_a, of_b, owner = of_a[shared], of_b[shared], owner[shared]
        return relative(s, of_a, of_b, self._half), owner

    def _within(self, begin_s: float, end_s: float, decider: Decider) -> Meetings:
        """The meetings of the horizon; those that one of its edges cuts are looked at again for the part inside."""
        m = self._meetings
        outside = (m.contact > end_s) | (m.slab > end_s)
        m = m.take(~outside)
        cut = (m.contact < begin_s) | (m.separation_at < begin_s) | (m.separation_at > end_s)
        if not cut.any():
            return m
        ring = m.slab[cut] % self._slabs
        again = self._meet(ring, m.a[cut], m.b[cut], (begin_s, end_s), decider)
        return m.take(~cut).joined(again)

    def _gathered(self, m: Meetings, now_s: float, told: set[str], decider: Decider) -> PairConflicts:
        """One row for each pair: its first contact, its smallest separation."""
        order = np.lexsort((m.slab, m.b, m.a))
        m = m.take(order)
        new = np.ones(len(m.a), bool)
        new[1:] = (m.a[1:] != m.a[:-1]) | (m.b[1:] != m.b[:-1])
        first = np.flatnonzero(new)
        pair = np.cumsum(new) - 1
        nearest = np.lexsort((m.separation_at, m.separation, pair))[first] if len(first) else first
        a, b = m.a[first], m.b[first]
        is_told = np.array([key in told for key in self._keys], bool) if len(told) else np.zeros(len(self._keys), bool)
        return PairConflicts(
            pairs=tuple((self._keys[i], self._keys[j]) for i, j in zip(a.tolist(), b.tolist(), strict=True)),
            contact_s=np.maximum(np.minimum.reduceat(m.contact, first), now_s) if len(first) else m.contact,
            separation_m=m.separation[nearest],
            separation_at_s=m.separation_at[nearest],
            start_separation_m=self._start_separation(a, b, now_s),
            fresh=is_told[a] | is_told[b],
            box_pairs=self._box_pairs,
            segment_pairs=self._segment_pairs,
            advanced_pairs=decider.asked,
            fcl_calls=decider.calls,
        )

    def _start_separation(self, a: Ints, b: Ints, now_s: float) -> Floats:
        start_s = np.maximum(now_s, np.maximum(self._appears[a], self._appears[b]))
        slab = np.floor(start_s).astype(np.int64)
        ring, into = slab % self._slabs, np.asarray(start_s - slab, np.float64)
        moved, owner = self._segments_of(ring, a, b)
        here = (moved.begin <= into[owner]) & (into[owner] < moved.end)
        moved, owner = moved.take(here), owner[here]
        separation = np.full(len(a), np.inf)
        separation[owner] = moved.gap_at(into[owner]).distance
        return separation
