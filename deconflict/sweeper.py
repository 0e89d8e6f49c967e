"""A floor that is swept again and again: only robots that changed are, against all others."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from math import floor

import numpy as np

from deconflict import motion
from deconflict.advance import TOLERANCE_M, first_contacts
from deconflict.broadphase import ABSENT, Boxes, Pairs, counting, swept_boxes
from deconflict.exact import Decider
from deconflict.meetings import Meetings
from deconflict.motion import Bools, Segments
from deconflict.relative import Relative, relative
from deconflict.roster import Roster
from deconflict.separation import smallest
from ingest.seam import Floats, Forecasts, Ints

AHEAD = 1
"""Slabs cut beyond the horizon, so that a robot that reports every second is cut once for each report."""
MOST_WASTE = 3
"""The pool is packed anew when it holds so many times the segments that are in use."""
FEWEST_SEGMENTS = 10_000
BLOCK = 1 << 15
"""Pairs of boxes looked at together: memory stays bounded however crowded a floor is."""


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


class Pool:
    """Segments of all robots with their swept boxes, appended as they are cut; `robot` are slots."""

    def __init__(self) -> None:
        self.used = 0
        self.all = motion.segments(Forecasts.empty(), 0, 1)
        self.sides: Floats = np.zeros((4, 0))
        """(4, n) west, east, south, north."""

    def append(self, more: Segments, sides: Floats) -> int:
        """Where the appended ones start."""
        start, self.used = self.used, self.used + len(more)
        spare = max(self.used, 2 * len(self.all)) - len(self.all)
        if self.used > len(self.all):
            self.all = Segments(*(np.pad(getattr(self.all, name), (0, spare)) for name in Segments.__slots__))
            self.sides = np.pad(self.sides, ((0, 0), (0, spare)))
        for name in Segments.__slots__:
            getattr(self.all, name)[start : self.used] = getattr(more, name)
        self.sides[:, start : self.used] = sides
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
        self._roster = Roster()
        self._touched: set[int] = set()
        """Slots whose robot changed or left since the last pass."""
        self._told: set[int] = set()
        """Slots whose forecast is new since the last pass."""
        self._covered: Ints = np.zeros(0, np.int64)
        """(slots,) the last slab for which a robot is cut."""
        self._pool, self._boxes = Pool(), Boxes(self._slabs)
        self._meetings = Meetings.none()
        self._box_pairs = self._segment_pairs = 0

    def update(self, keys: Sequence[str], forecasts: Forecasts) -> tuple[tuple[str, str], ...]:
        """Replace the forecasts of `keys`, one row each; key and reason of those that can't be swept.

        A robot whose new forecast is invalid is off the floor until its next one: its old forecast is no longer what
        it says. Of a key that is there twice the later row counts.
        """
        wrong = motion.faults(forecasts)
        newest = {key: row for row, key in enumerate(keys)}
        self.discard(key for key, row in newest.items() if row in wrong)
        good = {key: row for key, row in newest.items() if row not in wrong}
        if len(good) < len(keys):
            forecasts = forecasts.take(list(good.values()))
        if good:
            slots = self._roster.put(list(good), forecasts).tolist()
            self._touched.update(slots)
            self._told.update(slots)
        return tuple((keys[row], reason) for row, reason in sorted(wrong.items()))

    def discard(self, keys: Iterable[str]) -> None:
        """Take robots off the floor."""
        left = self._roster.discard(keys)
        self._touched.update(left)
        self._told.difference_update(left)

    def step(self, now_s: float) -> PairConflicts:
        """The conflicts in [`now_s`, `now_s` + horizon]."""
        self._box_pairs, self._segment_pairs, decider = 0, 0, Decider(self._clearance_m, TOLERANCE_M)
        first_slab, last_slab = floor(now_s), floor(now_s + self._horizon_s)
        changed, told = self._taken_in(first_slab)
        self._keep(changed, first_slab)
        pairs = [self._cut_anew(changed, first_slab), *self._cut_further(first_slab, last_slab)]
        blocks = self._blocks(self._oriented(Pairs.joined(pairs)))
        self._meetings = Meetings.joined([self._meetings, *(self._meet(block, decider) for block in blocks)])
        found = self._within(now_s, now_s + self._horizon_s, decider).by_pair(self._roster.ranks())
        return self._listed(found, now_s, told, decider)

    def _taken_in(self, first_slab: int) -> tuple[Ints, Ints]:
        """The slots to cut anew and those with a new forecast, ascending."""
        slots = len(self._roster)
        self._covered = np.pad(self._covered, (0, slots - len(self._covered)))
        self._boxes.grow(slots)
        went_back = np.flatnonzero(self._covered - self._slabs >= first_slab).tolist()
        changed = np.array(sorted(self._touched.union(went_back)), np.int64)
        told = np.array(sorted(self._told), np.int64)
        self._touched, self._told = set(), set()
        return changed, told

    def _keep(self, changed: Ints, first_slab: int) -> None:
        """Forget the meetings that are over, and those of robots that changed."""
        is_changed = np.zeros(len(self._roster), bool)
        is_changed[changed] = True
        m = self._meetings
        kept = (m.slab >= first_slab) & ~is_changed[m.a] & ~is_changed[m.b]
        if not kept.all():
            self._meetings = m.take(kept)

    def _cut_anew(self, changed: Ints, first_slab: int) -> Pairs:
        """Cut the robots of `changed` for all slabs from `first_slab` on; the pairs of boxes to look at."""
        rings = np.arange(self._slabs)
        self._boxes.clear(changed, rings)
        present = self._roster.present(changed)
        if not len(present):
            return Pairs.joined([])
        self._cut(present, first_slab, self._slabs)
        return self._boxes.pairs(present, rings)

    def _cut_further(self, first_slab: int, last_slab: int) -> list[Pairs]:
        """Cut robots without news for the slabs that have come into view; the pairs of boxes to look at."""
        behind = self._roster.present(np.flatnonzero(self._covered < last_slab))
        found = []
        for covered in np.unique(self._covered[behind]).tolist():
            rows = behind[self._covered[behind] == covered]
            begin = max(covered + 1, first_slab)
            slabs = np.arange(begin, first_slab + self._slabs)
            self._boxes.clear(rows, slabs % self._slabs)
            self._cut(rows, begin, len(slabs))
            found.append(self._boxes.pairs(rows, slabs % self._slabs))
        return found

    def _cut(self, slots: Ints, first_slab: int, slabs: int) -> None:
        if self._pool.used > MOST_WASTE * max(int(self._boxes.count.sum()), FEWEST_SEGMENTS):
            self._pack()
        self._covered[slots] = first_slab + slabs - 1
        cut = motion.segments(self._roster.forecasts(slots), first_slab, slabs)
        placed = Segments(slots[cut.robot], *(getattr(cut, name) for name in Segments.__slots__[1:]))
        sides = swept_boxes(placed, self._roster.half, self._clearance_m / 2 + TOLERANCE_M)
        self._boxes.put(placed, sides, self._pool.append(placed, sides))

    def _pack(self) -> None:
        """Drop the segments that nothing points to any more."""
        ring, slot = np.nonzero(self._boxes.floor != ABSENT)
        counts = self._boxes.count[ring, slot]
        kept = np.repeat(self._boxes.first[ring, slot], counts) + counting(counts)
        before, self._pool = self._pool, Pool()
        self._pool.append(before.all.take(kept), before.sides.take(kept, 1))
        self._boxes.first[ring, slot] = np.cumsum(counts) - counts

    def _oriented(self, pairs: Pairs) -> Pairs:
        """The pairs that are not above one another, the robot with the lower key first."""
        bottom, top = self._roster.height
        pairs = pairs.take((bottom[pairs.a] <= top[pairs.b]) & (bottom[pairs.b] <= top[pairs.a]))
        ranks = self._roster.ranks()
        swapped = ranks[pairs.a] > ranks[pairs.b]
        return Pairs(pairs.ring, np.where(swapped, pairs.b, pairs.a), np.where(swapped, pairs.a, pairs.b))

    @staticmethod
    def _blocks(pairs: Pairs) -> list[Pairs]:
        return [pairs.take(slice(start, start + BLOCK)) for start in range(0, len(pairs), BLOCK)]

    def _meet(self, pairs: Pairs, decider: Decider) -> Meetings:
        """The meetings of pairs in their slabs."""
        moved, owner = self._moved(pairs)
        contact = self._first(moved, owner, len(pairs), decider)
        hit = np.isfinite(contact)
        separation, at = self._least(moved, owner, hit)
        slab = self._boxes.slab[pairs.ring, pairs.a][hit]
        return Meetings(pairs.a[hit], pairs.b[hit], slab, slab + contact[hit], separation, slab + at)

    def _first(self, moved: Relative, owner: Ints, owners: int, decider: Decider) -> Floats:
        """(owners,) the first contact of each, seconds into the slab; inf for none."""
        contact = np.full(owners, np.inf)
        np.minimum.at(contact, owner, first_contacts(moved, self._clearance_m, decider))
        return contact

    @staticmethod
    def _least(moved: Relative, owner: Ints, chosen: Bools) -> tuple[Floats, Floats]:
        """The smallest separation of each chosen owner, and when, seconds into the slab."""
        rows = np.flatnonzero(chosen[owner])
        return smallest(moved.take(rows), (np.cumsum(chosen) - 1)[owner[rows]], int(chosen.sum()))

    def _moved(self, pairs: Pairs) -> tuple[Relative, Ints]:
        """The pairs of segments that share time, floor and room, and the pair that each belongs to."""
        of_a, of_b, owner = self._segments_of(pairs)
        near = np.flatnonzero(self._share_room(of_a, of_b))
        self._box_pairs += len(pairs)
        self._segment_pairs += len(near)
        return relative(self._pool.all, of_a.take(near), of_b.take(near), self._roster.half), owner.take(near)

    def _segments_of(self, pairs: Pairs) -> tuple[Ints, Ints, Ints]:
        """Each segment of A and each of B that share some time and floor, and the pair that they belong to."""
        count_a, count_b = self._boxes.count[pairs.ring, pairs.a], self._boxes.count[pairs.ring, pairs.b]
        each = count_a * count_b
        owner = np.repeat(np.arange(len(each)), each)
        count_b = count_b.take(owner)
        nth = counting(each)
        nth_a = nth // count_b
        of_a = self._boxes.first[pairs.ring, pairs.a].take(owner) + nth_a
        of_b = self._boxes.first[pairs.ring, pairs.b].take(owner) + (nth - nth_a * count_b)
        s = self._pool.all
        begin, end = np.maximum(s.t0.take(of_a), s.t0.take(of_b)), np.minimum(s.t1.take(of_a), s.t1.take(of_b))
        shared = np.flatnonzero((begin < end) & (s.floor.take(of_a) == s.floor.take(of_b)))
        return of_a.take(shared), of_b.take(shared), owner.take(shared)

    def _share_room(self, of_a: Ints, of_b: Ints) -> Bools:
        """Whether the swept boxes of segments overlap."""
        west, east, south, north = self._pool.sides
        shared: Bools = (west.take(of_a) <= east.take(of_b)) & (west.take(of_b) <= east.take(of_a))
        shared &= (south.take(of_a) <= north.take(of_b)) & (south.take(of_b) <= north.take(of_a))
        return shared

    def _within(self, begin_s: float, end_s: float, decider: Decider) -> Meetings:
        """The meetings of the horizon; what one of its edges cuts off is looked for again in the part inside."""
        m = self._meetings
        m = m.take((m.contact <= end_s) & (m.slab <= end_s))
        begun, elsewhere = m.contact < begin_s, (m.separation_at < begin_s) | (m.separation_at > end_s)
        cut = np.flatnonzero(begun | elsewhere)
        if not len(cut):
            return m
        moved, owner = self._moved(Pairs(m.slab[cut] % self._slabs, m.a[cut], m.b[cut]))
        moved = moved.clipped(*(np.asarray(t - m.slab[cut][owner], np.float64) for t in (begin_s, end_s)))
        lasting = np.flatnonzero(moved.begin <= moved.end)
        moved, owner = moved.take(lasting), owner[lasting]
        asked = np.flatnonzero(begun[cut][owner])
        contact = self._first(moved.take(asked), owner[asked], len(cut), decider)
        m.contact[cut] = np.where(begun[cut], m.slab[cut] + contact, m.contact[cut])
        wanted = elsewhere[cut] & np.isfinite(m.contact[cut])
        separation, at = self._least(moved, owner, wanted)
        rows = cut[wanted]
        m.separation[rows], m.separation_at[rows] = separation, m.slab[rows] + at
        return m.take(np.isfinite(m.contact))

    def _listed(self, m: Meetings, now_s: float, told: Ints, decider: Decider) -> PairConflicts:
        keys = self._roster.keys
        is_told = np.zeros(len(keys), bool)
        is_told[told] = True
        return PairConflicts(
            pairs=tuple(zip(map(keys.__getitem__, m.a.tolist()), map(keys.__getitem__, m.b.tolist()), strict=True)),
            contact_s=np.maximum(m.contact, now_s),
            separation_m=m.separation,
            separation_at_s=m.separation_at,
            start_separation_m=self._start_separation(m.a, m.b, now_s),
            fresh=is_told[m.a] | is_told[m.b],
            box_pairs=self._box_pairs,
            segment_pairs=self._segment_pairs,
            advanced_pairs=decider.asked,
            fcl_calls=decider.calls,
        )

    def _start_separation(self, a: Ints, b: Ints, now_s: float) -> Floats:
        start_s = np.maximum(now_s, np.maximum(self._roster.appears[a], self._roster.appears[b]))
        slab = np.floor(start_s).astype(np.int64)
        into = np.asarray(start_s - slab, np.float64)
        of_a, of_b, owner = self._segments_of(Pairs(slab % self._slabs, a, b))
        moved = relative(self._pool.all, of_a, of_b, self._roster.half)
        here = np.flatnonzero((moved.begin <= into[owner]) & (into[owner] < moved.end))
        moved, owner = moved.take(here), owner[here]
        separation = np.full(len(a), np.inf)
        separation[owner] = moved.gap_at(into[owner]).distance
        return separation
