"""Which robots may come near each other in which slab: swept boxes, and pairs of those that overlap.

One-second slabs prune far better than one box for the whole horizon: a robot's box stays short.
"""

from dataclasses import dataclass

import numpy as np

from deconflict.motion import Bools, Segments
from ingest.seam import Floats, Ints

ABSENT = -1
"""Floor of a box that is not there."""
MIXED = -2
"""Floor of a box in which the robot changes floor; it may meet anything."""
FEW = 12
"""Up to so many changed robots are held against all others one by one; more are sorted into bands."""
LONG = 6.0
"""A box so many times as long as most is held against all others one by one."""
MOST_SHARE = 0.4
"""Where a larger share of the boxes changed, all are held against those that follow."""
_NONE = np.empty(0, np.int64)


@dataclass(frozen=True, slots=True, eq=False)
class Pairs:
    """Pairs of boxes that overlap. Arrays are (p,)."""

    ring: Ints
    a: Ints
    b: Ints

    def __len__(self) -> int:
        return len(self.ring)

    @classmethod
    def joined(cls, parts: list["Pairs"]) -> "Pairs":
        return cls(*(np.concatenate([_NONE, *(getattr(part, name) for part in parts)]) for name in cls.__slots__))

    def take(self, rows: Ints | Bools | slice) -> "Pairs":
        return Pairs(self.ring[rows], self.a[rows], self.b[rows])


def swept_boxes(s: Segments, half: Floats, grow_m: float) -> Floats:
    """(4, n) west, east, south and north of what each segment covers, grown by `grow_m`.

    `half` (2, robots) are half sides by `s.robot`. A robot that turns within a segment counts as its circle.
    """
    half_l, half_w = half.take(s.robot, 1)
    c, n = np.abs(np.cos(s.yaw)), np.abs(np.sin(s.yaw))
    turning, radius = s.turn != 0, np.sqrt(half_l * half_l + half_w * half_w)
    reach_x = np.where(turning, radius, c * half_l + n * half_w) + grow_m
    reach_y = np.where(turning, radius, n * half_l + c * half_w) + grow_m
    span = s.t1 - s.t0
    x_end, y_end = s.x + s.vx * span, s.y + s.vy * span
    return np.stack(
        [
            np.minimum(s.x, x_end) - reach_x,
            np.maximum(s.x, x_end) + reach_x,
            np.minimum(s.y, y_end) - reach_y,
            np.maximum(s.y, y_end) + reach_y,
        ]
    )


class Boxes:
    """The swept boxes of robots by slab. Arrays are (s, slots); slab k of absolute time is ring row k modulo s."""

    def __init__(self, slabs: int) -> None:
        self.slab = np.full((slabs, 0), -1, np.int64)
        """Which slab each box is of: a row holds some that are not yet replaced."""
        self.floor = np.full((slabs, 0), ABSENT, np.int64)
        self.sides = np.zeros((4, slabs, 0))
        """West, east, south, north."""
        self.first = np.zeros((slabs, 0), np.int64)
        """Its segments are `first` to `first + count - 1` of the pool."""
        self.count = np.zeros((slabs, 0), np.int64)

    def grow(self, slots: int) -> None:
        """Make room for so many slots."""
        spare = slots - self.slab.shape[1]
        if spare > 0:
            wide = ((0, 0), (0, spare))
            self.slab = np.pad(self.slab, wide, constant_values=-1)
            self.floor = np.pad(self.floor, wide, constant_values=ABSENT)
            self.sides = np.pad(self.sides, ((0, 0), *wide))
            self.first, self.count = np.pad(self.first, wide), np.pad(self.count, wide)

    def clear(self, slots: Ints, rings: Ints) -> None:
        """Forget the boxes of `slots` in ring rows `rings`."""
        self.floor[np.ix_(rings, slots)] = ABSENT
        self.count[np.ix_(rings, slots)] = 0

    def put(self, s: Segments, sides: Floats, offset: int) -> None:
        """Set the boxes of segments, which start at `offset` of the pool; `s.robot` are slots.

        Segments of a robot follow one another in time.
        """
        if not len(s):
            return
        new = np.ones(len(s), bool)
        new[1:] = (s.robot[1:] != s.robot[:-1]) | (s.slab[1:] != s.slab[:-1])
        first = np.flatnonzero(new)
        at = s.slab[first] % len(self.slab), s.robot[first]
        low, high = np.minimum.reduceat(s.floor, first), np.maximum.reduceat(s.floor, first)
        self.slab[at] = s.slab[first]
        self.floor[at] = np.where(low == high, low, MIXED)
        for side, least in enumerate((True, False, True, False)):
            self.sides[side][at] = (np.minimum if least else np.maximum).reduceat(sides[side], first)
        self.first[at] = first + offset
        self.count[at] = np.diff(np.append(first, len(s)))

    def pairs(self, changed: Ints, rings: Ints) -> Pairs:
        """Each pair of boxes of one slab that overlap, in ring rows `rings`, at least one of them `changed`'s; once.

        Cost grows with what changed where few did, else with what exists.
        """
        is_changed = self._marked(changed)
        if len(changed) <= FEW:
            return Pairs.joined([self._against_all(ring, changed, is_changed) for ring in rings.tolist()])
        return Pairs.joined([self._in_row(ring, is_changed) for ring in rings.tolist()])

    def _marked(self, slots: Ints) -> Bools:
        marked = np.zeros(self.slab.shape[1], bool)
        marked[slots] = True
        return marked

    def _against_all(self, ring: int, chosen: Ints, is_chosen: Bools) -> Pairs:
        """Pairs with one of `chosen`; a pair of two chosen ones once."""
        slab, floor = self.slab[ring], self.floor[ring]
        x0, x1, y0, y1 = self.sides[:, ring]
        found: list[Pairs] = []
        for row in chosen[floor[chosen] != ABSENT].tolist():
            near = (x0 <= x1[row]) & (x1 >= x0[row]) & (y0 <= y1[row]) & (y1 >= y0[row])
            others = np.flatnonzero(near)
            theirs = floor[others]
            same = (theirs == floor[row]) | (theirs == MIXED) | (floor[row] == MIXED)
            same &= (theirs != ABSENT) & (slab[others] == slab[row])
            same &= (others > row) | ((others < row) & ~is_chosen[others])
            met = others[same]
            found.append(Pairs(np.full(len(met), ring), np.full(len(met), row), met))
        return Pairs.joined(found)

    def _in_row(self, ring: int, is_changed: Bools) -> Pairs:
        """Pairs of a ring row; the boxes that do not fit in bands are held against all others."""
        there = np.flatnonzero(self.floor[ring] != ABSENT)
        if not is_changed[there].any():
            return Pairs.joined([])
        width, height = (self.sides[k + 1, ring, there] - self.sides[k, ring, there] for k in (0, 2))
        most_x, most_y = _most(width), _most(height)
        odd = (width > LONG * most_x) | (height > LONG * most_y) | (self.floor[ring, there] == MIXED)
        oddities, even = there[odd], there[~odd]
        found = self._against_all(ring, oddities, self._marked(oddities))
        found = found.take(is_changed[found.a] | is_changed[found.b])
        a, b = self._in_bands(ring, even, is_changed[even], max(most_y, 1e-3))
        return Pairs.joined([found, Pairs(np.full(len(a), ring), a, b)])

    def _in_bands(self, ring: int, there: Ints, is_changed: Bools, height_m: float) -> tuple[Ints, Ints]:
        """Overlapping pairs of the boxes of slots `there`, all on one floor each.

        Boxes are sorted by slab, floor and band of y, then by x; each is held against those that begin before it ends.
        A pair that shares several bands counts in the first of them.
        """
        if not len(there):
            return _NONE, _NONE
        x0, x1, y0, y1 = self.sides[:, ring].take(there, 1)
        low = np.floor((y0 - y0.min()) / height_m).astype(np.int64)
        bands = np.floor((y1 - y0.min()) / height_m).astype(np.int64) - low + 1
        box = np.repeat(np.arange(len(there)), bands)
        band = low.take(box) + counting(bands)
        levels = _ranked(self.slab[ring, there], self.floor[ring, there])
        lane = levels.take(box) * (int(band.max()) + 2) + band
        west, wide = x0.min(), float((x1 - x0).max())
        span = float(x1.max() - west) + wide + 2.0
        begin = lane * span + (x0.take(box) - west)
        order = np.argsort(begin)
        begin, box, band, lane = begin.take(order), box.take(order), band.take(order), lane.take(order)
        rounding = 8 * np.spacing(float(begin[-1]))
        everything = is_changed.mean() > MOST_SHARE
        asking = np.arange(len(box)) if everything else np.flatnonzero(is_changed.take(box))
        end = lane.take(asking) * span + (x1.take(box.take(asking)) - west) + rounding
        start = asking + 1 if everything else np.searchsorted(begin, begin.take(asking) - wide - rounding)
        reach = np.maximum(np.searchsorted(begin, end, "right") - start, 0)
        a = np.repeat(asking, reach)
        b = np.repeat(start, reach) + counting(reach)
        i, j = box.take(a), box.take(b)
        met = np.flatnonzero((y0.take(i) <= y1.take(j)) & (y1.take(i) >= y0.take(j)))
        a, i, j = a.take(met), i.take(met), j.take(met)
        kept = (x0.take(i) <= x1.take(j)) & (x1.take(i) >= x0.take(j))
        kept &= band.take(a) == np.maximum(low.take(i), low.take(j))
        if everything:
            kept &= is_changed.take(i) | is_changed.take(j)
        else:
            kept &= (i < j) | ((i != j) & ~is_changed.take(j))
        return there.take(i[kept]), there.take(j[kept])


def _most(lengths: Floats) -> float:
    """What nine in ten of them stay below, by a sample."""
    return float(np.percentile(lengths[:: 1 + len(lengths) // 500], 90))


def counting(lengths: Ints) -> Ints:
    """0, 1, ... up to each length in turn."""
    numbers: Ints = np.arange(int(lengths.sum())) - np.repeat(np.cumsum(lengths) - lengths, lengths)
    return numbers


def _ranked(slab: Ints, floor: Ints) -> Ints:
    """A small number for each combination."""
    if (slab == slab[0]).all() and (floor == floor[0]).all():
        return np.zeros(len(slab), np.int64)
    _, slab = np.unique(slab, return_inverse=True)
    floors, floor = np.unique(floor, return_inverse=True)
    ranks: Ints = slab * len(floors) + floor
    return ranks
