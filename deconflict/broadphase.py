"""Which robots may come near each other in which slab: swept boxes, and pairs of those that overlap.

One-second slabs prune far better than one box for the whole horizon: a robot's box stays short.
"""

from dataclasses import dataclass

import numpy as np

from deconflict.motion import Segments
from ingest.seam import Floats, Ints

ABSENT = -1
"""Floor of a box that is not there."""
MIXED = -2
"""Floor of a box in which the robot changes floor; it may meet anything."""
FEW = 24
"""Up to so many changed robots are held against all others one by one; more are sorted into bands."""
MARGIN_M = 1e-3
"""Covers the rounding of sort keys."""


@dataclass(frozen=True, slots=True, eq=False)
class Boxes:
    """The swept boxes of n robots in s slabs. Arrays are (s, n); slab k of absolute time is row k modulo s."""

    slab: Ints
    """Which slab each box is of: a row holds some not yet replaced."""
    floor: Ints
    x0: Floats
    x1: Floats
    y0: Floats
    y1: Floats
    first: Ints
    """Its segments are `first` to `first + count - 1` of the pool."""
    count: Ints

    @classmethod
    def none(cls, slabs: int, robots: int) -> "Boxes":
        def whole(value: int) -> Ints:
            return np.full((slabs, robots), value, np.int64)

        def real() -> Floats:
            return np.zeros((slabs, robots))

        return cls(whole(-1), whole(ABSENT), real(), real(), real(), real(), whole(0), whole(0))

    def put(self, rows: Ints, segments: Segments, half: Floats, grow_m: float, offset: int) -> None:
        """Replace the boxes of robots `rows` by those of their segments, which start at `offset` of the pool.

        `segments.robot` counts along `rows`; `half` (2, rows) are half sides. Boxes are grown by `grow_m`.
        """
        self.floor[:, rows] = ABSENT
        s = segments
        if not len(s):
            return
        new = np.ones(len(s), bool)
        new[1:] = (s.robot[1:] != s.robot[:-1]) | (s.slab[1:] != s.slab[:-1])
        first = np.flatnonzero(new)
        at = s.slab[first] % len(self.slab), rows[s.robot[first]]
        span = s.t1 - s.t0
        x_end, y_end = s.x + s.vx * span, s.y + s.vy * span
        reach_x, reach_y = _reach(s, half, grow_m)
        low, high = np.minimum.reduceat(s.floor, first), np.maximum.reduceat(s.floor, first)
        self.slab[at] = s.slab[first]
        self.floor[at] = np.where(low == high, low, MIXED)
        self.x0[at] = np.minimum.reduceat(np.minimum(s.x, x_end) - reach_x, first)
        self.x1[at] = np.maximum.reduceat(np.maximum(s.x, x_end) + reach_x, first)
        self.y0[at] = np.minimum.reduceat(np.minimum(s.y, y_end) - reach_y, first)
        self.y1[at] = np.maximum.reduceat(np.maximum(s.y, y_end) + reach_y, first)
        self.first[at] = first + offset
        self.count[at] = np.diff(np.append(first, len(s)))

    def pairs(self, changed: Ints) -> tuple[Ints, Ints, Ints]:
        """Ring row, and rows of two robots, the lower first, whose boxes overlap; at least one is `changed`.

        Cost grows with what changed where few did, else with what exists.
        """
        if len(changed) <= FEW:
            ring, a, b = self._against_all(changed)
        else:
            ring, a, b = self._in_bands(changed)
        n = self.slab.shape[1]
        low, high = np.minimum(a, b), np.maximum(a, b)
        once = np.unique((ring * n + low) * n + high)
        return once // n // n, once // n % n, once % n

    def _against_all(self, changed: Ints) -> tuple[Ints, Ints, Ints]:
        found: list[tuple[Ints, Ints, Ints]] = [(_NONE, _NONE, _NONE)]
        for ring in range(len(self.slab)):
            slab, floor = self.slab[ring], self.floor[ring]
            x0, x1, y0, y1 = self.x0[ring], self.x1[ring], self.y0[ring], self.y1[ring]
            for row in changed[floor[changed] != ABSENT].tolist():
                near = (x0 <= x1[row]) & (x1 >= x0[row]) & (y0 <= y1[row]) & (y1 >= y0[row])
                others = np.flatnonzero(near)
                near_floor = floor[others]
                same = (near_floor == floor[row]) | (near_floor == MIXED) | (floor[row] == MIXED)
                same &= (near_floor != ABSENT) & (slab[others] == slab[row]) & (others != row)
                met = others[same]
                found.append((np.full(len(met), ring), np.full(len(met), row), met))
        return (
            np.concatenate([one[0] for one in found]),
            np.concatenate([one[1] for one in found]),
            np.concatenate([one[2] for one in found]),
        )

    def _in_bands(self, changed: Ints) -> tuple[Ints, Ints, Ints]:
        is_changed = np.zeros(self.slab.shape[1], bool)
        is_changed[changed] = True
        ring, robot = np.nonzero(self.floor != ABSENT)
        floor = self.floor[ring, robot]
        x0, x1, y0, y1 = (each[ring, robot] for each in (self.x0, self.x1, self.y0, self.y1))
        a, b = _overlapping(self.slab[ring, robot], floor, x0, x1, y0, y1)
        kept = is_changed[robot[a]] | is_changed[robot[b]]
        a, b = a[kept], b[kept]
        mixed = np.unique(robot[floor == MIXED])
        more = self._against_all(mixed)
        kept = is_changed[more[1]] | is_changed[more[2]]
        return (
            np.concatenate([ring[a], more[0][kept]]),
            np.concatenate([robot[a], more[1][kept]]),
            np.concatenate([robot[b], more[2][kept]]),
        )


_NONE = np.empty(0, np.int64)


def _reach(s: Segments, half: Floats, grow_m: float) -> tuple[Floats, Floats]:
    """How far a robot reaches from its centre along x and y: its own extent, or its circle where it turns."""
    half_l, half_w = half[0, s.robot], half[1, s.robot]
    c, n = np.abs(np.cos(s.yaw)), np.abs(np.sin(s.yaw))
    turning, radius = s.turn != 0, np.hypot(half_l, half_w)
    reach_x = np.where(turning, radius, c * half_l + n * half_w)
    reach_y = np.where(turning, radius, n * half_l + c * half_w)
    return reach_x + grow_m, reach_y + grow_m


def _overlapping(slab: Ints, floor: Ints, x0: Floats, x1: Floats, y0: Floats, y1: Floats) -> tuple[Ints, Ints]:
    """Pairs of boxes of one slab and floor that overlap.

    Boxes are sorted by slab, floor and band of y, then by x; each is held against those that begin before it ends.
    A pair that shares several bands counts in the first of them.
    """
    if not len(x0):
        return _NONE, _NONE
    height = max(float(np.percentile(y1 - y0, 90)), 1e-3)
    low, high = np.floor(y0 / height).astype(np.int64), np.floor(y1 / height).astype(np.int64)
    bands = high - low + 1
    box = np.repeat(np.arange(len(x0)), bands)
    band = low[box] + _counting(bands)
    lane = _ranked(slab[box], floor[box], band)
    span, west = float(x1.max() - x0.min()) + 1.0, x0.min()
    begin = lane * span + (x0[box] - west)
    order = np.argsort(begin, kind="stable")
    begin, box, band, lane = begin[order], box[order], band[order], lane[order]
    end = np.minimum(lane * span + (x1[box] - west) + MARGIN_M, (lane + 1) * span - 0.5)
    reach = np.maximum(np.searchsorted(begin, end, "right") - np.arange(len(box)) - 1, 0)
    a = np.repeat(np.arange(len(box)), reach)
    b = a + 1 + _counting(reach)
    i, j = box[a], box[b]
    kept = (y0[i] <= y1[j]) & (y1[i] >= y0[j]) & (band[a] == np.maximum(low[i], low[j]))
    return i[kept], j[kept]


def _counting(lengths: Ints) -> Ints:
    """0, 1, ... up to each length in turn."""
    counting: Ints = np.arange(int(lengths.sum())) - np.repeat(np.cumsum(lengths) - lengths, lengths)
    return counting


def _ranked(slab: Ints, floor: Ints, band: Ints) -> Ints:
    """A number for each combination, without gaps."""
    order = np.lexsort((band, floor, slab))
    new = np.zeros(len(order), np.int64)
    for column in (slab[order], floor[order], band[order]):
        new[1:] |= column[1:] != column[:-1]
    ranks = np.empty(len(order), np.int64)
    ranks[order] = np.cumsum(new)
    return ranks
