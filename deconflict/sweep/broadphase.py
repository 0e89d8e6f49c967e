"""The broad phase: which robots may come near each other in which slab, by boxes that they sweep.

A slab is one second. Boxes of one second are short, so that they exclude far more pairs than a box of the whole horizon
would.

The file is long because it holds compiled functions: two ways to find overlapping boxes (one by one, and by grid
cells), the sweep of a robot's boxes, and the order of the pairs. They call each other once for each box.
"""

from math import cos, floor, sin
from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

from deconflict.sweep.geometry.heights import heights_overlap
from deconflict.sweep.geometry.knots import KNOT, ROBOT, Knots, Robots
from ingest.batch import Bools, Floats, Ints
from ingest.kernels import BOOL, BOOLS, FLOAT, FLOATS, INT, INTS, inner, kernel

ABSENT = -1
"""The floor of a box that is absent."""
MIXED = -2
"""The floor of a box in which the robot changes floor. It is compared with boxes of all floors."""
FEW = 20
"""Up to this many changed robots are compared with all others one by one. For more, boxes are sorted into cells."""
FEW_PAIRS = 20_000
"""More changed robots are also compared one by one if that makes no more pairs than this: cells would cost more."""
ROOMY = 1.5
"""Side of a cell, as a multiple of the 90 % quantile of the boxes' sides. Longer boxes are called wide, and cost
more."""
NARROWEST_M = 1e-3
"""Smallest side of a cell."""

MOST_FOUND = 256
"""A box that changed is paired with at most so many others of a slab, those of lower slots first. Far fewer bodies have
room beside it."""
EVERY = 1 << 40
"""No limit."""
MOST_CROWDED = 4
"""The same for pairs of which one is in a crowd. Pairs of two that are in a crowd are left out."""

_SIDES = [(side, np.float64) for side in ("west", "east", "south", "north")]
BOX = np.dtype(
    [
        ("slab", np.int64),
        ("floor", np.int64),  # or ABSENT or MIXED
        ("knot", np.int64),  # which of the robot's knots holds at the begin of the slab, or when the robot appears
        *_SIDES,  # metres
    ],
    align=True,
)
"""The area that a robot covers in a slab."""

REACH = np.dtype(_SIDES, align=True)
"""A box around all boxes of a robot, or a little more. If the robot has no boxes, its lower sides are above the
upper."""
NOWHERE = (np.inf, -np.inf, np.inf, -np.inf)

PAIR = np.dtype(
    [
        ("ring", np.int32),  # ring row of the slab, see `SweptBoxes`
        ("a", np.int32),  # slot of one robot
        ("b", np.int32),  # slot of the other robot
    ],
    align=True,
)
"""Two boxes of one slab that overlap."""

Pairs = NDArray[Any]
"""Of `PAIR`."""
Row = NDArray[Any]
"""(slots,) of `BOX`: the boxes of one slab."""
Cells = tuple[Ints, Ints, Row]
"""Where each cell starts, the slots cell by cell, and their boxes in the same order."""
SortedBoxes = tuple[Cells, tuple[Ints, Row], tuple[Ints, Row]]
"""Boxes of a row: narrow ones in cells; the slots of wide ones that changed, and their boxes; and of those that did
not."""

Reaches = NDArray[Any]
"""(slots,) of `REACH`."""

_BOX, _KNOT, _ROBOT, _PAIR, _REACH = (numba.from_dtype(dtype) for dtype in (BOX, KNOT, ROBOT, PAIR, REACH))
_REACHES = _REACH[::1]


@inner
def _is_wide(box: Any, share: float) -> bool:
    """Whether a box may reach beyond the cells next to that of its centre, or is on several floors."""
    return bool(box.floor == MIXED or max(box.east - box.west, box.north - box.south) * share > 1.0)


@inner
def _sorted(row: Row, is_in: Bools, is_changed: Bools, share: float) -> SortedBoxes:
    """Sort the boxes of a row that are in into cells by their centres, and wide ones.

    `share` is cells a metre. Cells repeat after a power of two along x and y, so that a far box costs no memory.
    """
    across = 4
    while across * across < len(row):
        across *= 2
    start, cell = np.zeros(across * across + 1, np.int64), np.full(len(row), -1)
    wide, wides, still, stills = np.empty(len(row), np.int64), 0, np.empty(len(row), np.int64), 0
    for slot in range(len(row)):
        box = row[slot]
        if box.floor == ABSENT or not is_in[slot]:
            continue
        if not _is_wide(box, share):
            x, y = floor((box.west + box.east) / 2 * share), floor((box.south + box.north) / 2 * share)
            cell[slot] = (y & (across - 1)) * across + (x & (across - 1))
            start[cell[slot] + 1] += 1
        elif is_changed[slot]:
            wide[wides] = slot
            wides += 1
        else:
            still[stills] = slot
            stills += 1
    for at in range(across * across):
        start[at + 1] += start[at]
    slots, placed = np.empty(start[-1], np.int64), start[:-1].copy()
    for slot in range(len(row)):
        if cell[slot] >= 0:
            slots[placed[cell[slot]]] = slot
            placed[cell[slot]] += 1
    wide, still = wide[:wides], still[:stills]
    return (start, slots, row[slots]), (wide, row[wide]), (still, row[still])


@inner
def _near(box: Any, other: Any) -> bool:
    """Whether two boxes, or two reaches, overlap in the plane."""
    return bool(
        (box.west <= other.east) & (other.west <= box.east) & (box.south <= other.north) & (other.south <= box.north)
    )


@inner
def _overlap(a: Any, b: Any) -> bool:
    """Whether box `a`, which is not absent, overlaps box `b` in the plane, in its slab and on its floor."""
    near = _near(a, b) & (a.slab == b.slab)
    return bool(near and b.floor != ABSENT and (a.floor == b.floor or min(a.floor, b.floor) == MIXED))


@inner
def _add_overlaps(
    box: Any,
    slot: int,
    own: int,
    others: Ints,
    boxes: Row,
    begin: int,
    end: int,
    asking: Bools,
    found: Pairs,
    n: int,
    most: int,
) -> int:
    """Add to `found` the pairs of `slot` with those of `others[begin:end]` whose boxes overlap its `box`, until `found`
    holds `most` pairs. Those before its `own` place only if they are not `asking`: a pair of two that are is added
    once. Returns how many pairs `found` holds.

    `boxes` are those of `others`. `own` is the place of `slot` among `others`; -1 if all are added, and their number if
    none that is `asking`.
    """
    for at in range(begin, end):
        if n == most:
            return n
        is_new = at > own or (at < own and not asking[others[at]])
        if is_new and _overlap(box, boxes[at]):
            found[n].a, found[n].b = slot, others[at]
            n += 1
    return n


@inner
def _add_overlaps_in_cells(
    box: Any,
    slot: int,
    own: int,
    cells: Cells,
    first: int,
    share: float,
    asking: Bools,
    found: Pairs,
    n: int,
    most: int,
) -> int:
    """The same with all boxes of the cells into which `slot` may reach, from place `first` on."""
    start, slots, boxes = cells
    across = int(np.sqrt(len(start)))
    last = across - 1
    west, east = floor(box.west * share - 0.5), floor(box.east * share + 0.5)
    south, north = floor(box.south * share - 0.5), floor(box.north * share + 0.5)
    low, high = west & last, min(east, west + last) & last
    for y in range(south, min(north, south + last) + 1):
        line = (y & last) * across
        begin, end = max(start[line + low], first), start[line + high + 1]
        if low > high:
            n = _add_overlaps(box, slot, own, slots, boxes, begin, start[line + across], asking, found, n, most)
            begin = max(start[line], first)
        n = _add_overlaps(box, slot, own, slots, boxes, begin, end, asking, found, n, most)
    return n


@inner
def _with_room(found: Pairs, needed: int) -> Pairs:
    """`found`, or a longer copy if it has less than `needed` rows."""
    return found if needed <= len(found) else np.concatenate((found, np.empty(needed, PAIR)))


@inner
def _add_overlaps_of(
    box: Any,
    slot: int,
    own: int,
    others: SortedBoxes,
    first: int,
    first_wide: int,
    share: float,
    asking: Bools,
    found: Pairs,
    n: int,
    most: int,
) -> int:
    """The same with `others`: those of cells from place `first` on, wide ones that changed from `first_wide` on, and
    wide ones that did not. `own` is the place of `slot` among the narrow ones."""
    cells, (wide, wide_boxes), (still, still_boxes) = others
    n = _add_overlaps(box, slot, -1, still, still_boxes, 0, len(still), asking, found, n, most)
    n = _add_overlaps_in_cells(box, slot, own, cells, first, share, asking, found, n, most)
    return _add_overlaps(box, slot, -1, wide, wide_boxes, first_wide, len(wide), asking, found, n, most)


@kernel(_PAIR[::1](_BOX[:, ::1], INTS, *[BOOLS] * 3, INT, FLOAT))
def _pairs_by_cells(
    boxes: NDArray[Any],
    rings: Ints,
    is_changed: Bools,
    is_crowded: Bools,
    is_cut: Bools,
    most_found: int,
    share: float,
) -> Pairs:
    """Find the pairs by cells: a narrow box that changed is compared with the cells around it, a wide one with all
    cells that it covers. Boxes of crowds are in cells of their own: they are not compared with each other.

    Boxes are compared cell by cell, so that the boxes of one comparison are still in the processor's cache for the
    next. If all robots changed, each is compared only with those after it.
    """
    found, n, is_alone, some_crowded = np.empty(1 << 14, PAIR), 0, ~is_crowded, is_crowded.any()
    for ring in rings:
        row, before = boxes[ring], n
        alone = _sorted(row, is_alone, is_changed, share)
        crowd = _sorted(row if some_crowded else row[:0], is_crowded, is_changed, share)
        (_, slots, _), (wide, _), _ = alone
        asking = np.flatnonzero(is_changed[slots])
        first = 1 if len(asking) == len(slots) else 0
        for at in range(len(asking) + len(wide)):
            wide_own = at - len(asking)
            own = -1 if wide_own >= 0 else asking[at]
            slot = wide[wide_own] if wide_own >= 0 else slots[own]
            begin, begin_wide = (0, wide_own + 1) if wide_own >= 0 else (first * (own + 1), len(wide))
            found = _with_room(found, n + min(most_found, len(row)) + MOST_CROWDED)
            box, most = row[slot], n + most_found
            n = _add_overlaps_of(box, slot, own, alone, begin, begin_wide, share, is_changed, found, n, most)
            is_cut[slot] |= n == most
            n = _add_overlaps_of(box, slot, -1, crowd, 0, 0, share, is_changed, found, n, n + MOST_CROWDED)
        (_, crowd_slots, _), (crowd_wide, _), _ = crowd
        for slot in np.concatenate((crowd_slots[is_changed[crowd_slots]], crowd_wide)):
            found, most = _with_room(found, n + MOST_CROWDED), n + MOST_CROWDED
            others = len(slots), alone, 0, len(wide)
            n = _add_overlaps_of(row[slot], slot, *others, share, is_changed, found, n, most)
        for at in range(before, n):
            found[at].ring = ring
    return found[:n].copy()


@kernel(_PAIR[::1](_BOX[:, ::1], _REACHES, INTS, INTS, *[BOOLS] * 3, INT))
def _pairs_one_by_one(
    boxes: NDArray[Any],
    reaches: Reaches,
    rings: Ints,
    changed: Ints,
    is_changed: Bools,
    is_crowded: Bools,
    is_cut: Bools,
    most_found: int,
) -> Pairs:
    """Find the pairs without cells: a few changed robots against all others, slab by slab if their reaches overlap."""
    found, n = np.empty(1024, PAIR), 0
    for slot in changed:
        others, crowded = 0, 0
        for other in range(len(reaches)):
            if other == slot or not _near(reaches[slot], reaches[other]):
                continue
            mixed = is_crowded[other] or is_crowded[slot]
            if mixed and ((is_crowded[slot] and is_crowded[other]) or crowded == MOST_CROWDED):
                continue
            asks_itself = is_crowded[slot] if mixed else other < slot
            if is_changed[other] and asks_itself:
                continue
            if not mixed and others == most_found:
                is_cut[slot] = True
                continue
            found, before = _with_room(found, n + len(rings)), n
            for ring in rings:
                box = boxes[ring, slot]
                if box.floor != ABSENT and _overlap(box, boxes[ring, other]):
                    found[n].ring, found[n].a, found[n].b = ring, slot, other
                    n += 1
            if n > before:
                crowded, others = crowded + mixed, others + (not mixed)
    return found[:n].copy()


@inner
def _sorted_by_rank(slots: Ints, ranks: Ints, rows: Ints) -> Ints:
    """`rows` in the order of the ranks of `slots[rows]` (stable)."""
    place, ordered = np.zeros(len(ranks) + 1, np.int64), np.empty_like(rows)
    for slot in slots:
        place[ranks[slot] + 1] += 1
    for rank in range(len(ranks)):
        place[rank + 1] += place[rank]
    for row in rows:
        rank = ranks[slots[row]]
        ordered[place[rank]] = row
        place[rank] += 1
    return ordered


_heights_overlap = inner(heights_overlap)


@inner
def _at_one_height(robot: Any, other: Any) -> bool:
    return bool(_heights_overlap(robot.bottom, robot.top, other.bottom, other.top))


@kernel(_PAIR[::1](_PAIR[::1], INTS, _ROBOT[::1], *[BOOLS] * 2))
def sorted_pairs(pairs: Pairs, ranks: Ints, robots: Robots, is_crowded: Bools, is_dormant: Bools) -> Pairs:
    """The pairs of which no robot passes above the other, the one of lower rank first, ascending by both ranks
    (stable). Pairs of two bodies of one train are left out, of two that are both `is_crowded` (slots,), and of two that
    are both dormant."""
    level, n = np.empty_like(pairs), 0
    for pair in pairs:
        a, b = (pair.a, pair.b) if ranks[pair.a] < ranks[pair.b] else (pair.b, pair.a)
        is_train = robots[a].train != 0 and robots[a].train == robots[b].train
        is_idle = (is_crowded[a] and is_crowded[b]) or (is_dormant[a] and is_dormant[b])
        if _at_one_height(robots[a], robots[b]) and not is_idle and not is_train:
            level[n].ring, level[n].a, level[n].b = pair.ring, a, b
            n += 1
    level = level[:n]
    a, b = level["a"].copy(), level["b"].copy()
    return level[_sorted_by_rank(a, ranks, _sorted_by_rank(b, ranks, np.arange(n)))]


@inner
def _extent(robot: Any, knot: Any) -> tuple[float, float]:
    """How far a robot extends along x and y from its centre, after a knot; a turning robot counts as its circle."""
    if knot.turn != 0.0:
        return robot.radius, robot.radius
    c, s = abs(cos(knot.yaw)), abs(sin(knot.yaw))
    return c * robot.half_length + s * robot.half_width, s * robot.half_length + c * robot.half_width


@inner
def _cover_robot(
    boxes: NDArray[Any],
    reaches: Reaches,
    slot: int,
    robot: Any,
    knots: Knots,
    first_slab: int,
    slabs: int,
    grow_m: float,
) -> None:
    """Set the boxes of one robot, and extend its reach by them. A robot without knots has no boxes."""
    k, end, reach = robot.first, robot.first + robot.count, reaches[slot]
    extent_of, along_x, along_y = -1, 0.0, 0.0
    for slab in range(first_slab, first_slab + slabs):
        box = boxes[slab % len(boxes), slot]
        box.slab, box.floor = slab, ABSENT
        while k + 1 < end and knots[k + 1].t - slab <= 0.0:
            k += 1
        box.knot = k - robot.first
        on, begin = k, max(knots[k].t - slab, 0.0) if k < end else 1.0
        while begin < 1.0 and on < end:
            knot = knots[on]
            until = min(knots[on + 1].t - slab, 1.0) if on + 1 < end else 1.0
            if knot.floor >= 0:
                if box.floor == ABSENT:
                    box.floor = knot.floor
                    box.west, box.east, box.south, box.north = np.inf, -np.inf, np.inf, -np.inf
                elif box.floor != knot.floor:
                    box.floor = MIXED
                if on != extent_of:
                    extent_of, (along_x, along_y) = on, _extent(robot, knot)
                since = slab - knot.t
                for t in (begin, until):
                    x, y = knot.x + knot.vx * (since + t), knot.y + knot.vy * (since + t)
                    box.west, box.east = min(box.west, x - along_x - grow_m), max(box.east, x + along_x + grow_m)
                    box.south, box.north = min(box.south, y - along_y - grow_m), max(box.north, y + along_y + grow_m)
            begin, on = until, on + 1
        if box.floor != ABSENT:
            reach.west, reach.east = min(reach.west, box.west), max(reach.east, box.east)
            reach.south, reach.north = min(reach.south, box.south), max(reach.north, box.north)


@inner
def _reach_nothing(reaches: Reaches, slot: int) -> None:
    reaches[slot].west = reaches[slot].south = np.inf
    reaches[slot].east = reaches[slot].north = -np.inf


@kernel(numba.void(_BOX[:, ::1], _REACHES, INTS, _ROBOT[::1], _KNOT[::1], *[INT] * 2, FLOAT, BOOL))
def _cover(
    boxes: NDArray[Any],
    reaches: Reaches,
    slots: Ints,
    robots: Robots,
    knots: Knots,
    first_slab: int,
    slabs: int,
    grow_m: float,
    anew: bool,
) -> None:
    for slot in slots:
        if anew:
            _reach_nothing(reaches, slot)
            for ring in range(len(boxes)):
                boxes[ring, slot].floor = ABSENT
        _cover_robot(boxes, reaches, slot, robots[slot], knots, first_slab, slabs, grow_m)


@inner
def _last_slabs(robots: int, a: Ints, b: Ints, until_s: Floats) -> Ints:
    """(robots,) the last slab for which each robot is in a pair; a slab before all others if it is in no pair."""
    last = np.full(robots, -(1 << 62))
    for pair in range(len(a)):
        until = floor(until_s[pair])
        last[a[pair]], last[b[pair]] = max(last[a[pair]], until), max(last[b[pair]], until)
    return last


@kernel((_ROBOT[::1], _KNOT[::1], INTS, INTS, FLOAT, FLOATS, FLOAT))
def boxes_of_pairs(
    robots: Robots, knots: Knots, a: Ints, b: Ints, now_s: float, until_s: Floats, grow_m: float
) -> tuple[NDArray[Any], Pairs, Ints]:
    """The boxes of `robots` from `now_s` on, by slab; those of the pairs of slots `a` (p,) and `b` (p,) that overlap by
    `until_s` (p,), pair by pair in the order of time; and the row of each one's pair."""
    first_slab, last = floor(now_s), _last_slabs(len(robots), a, b, until_s)
    slabs = max(last.max() - first_slab + 1, 0) if len(last) else 0
    boxes, reaches = np.empty((slabs, len(robots)), BOX), np.empty(len(robots), REACH)
    for slot in range(len(robots)):
        _reach_nothing(reaches, slot)
        _cover_robot(boxes, reaches, slot, robots[slot], knots, first_slab, last[slot] - first_slab + 1, grow_m)
    found, pair_of, n = np.empty(1024, PAIR), np.empty(1024, np.int64), 0
    for pair in range(len(a)):
        if not _near(reaches[a[pair]], reaches[b[pair]]) or not _at_one_height(robots[a[pair]], robots[b[pair]]):
            continue
        if n + len(boxes) > len(found):
            found, pair_of = np.concatenate((found, np.empty_like(found))), np.concatenate((pair_of, pair_of))
        for slab in range(first_slab, floor(until_s[pair]) + 1):
            ring = slab % len(boxes)
            box = boxes[ring, a[pair]]
            if box.floor != ABSENT and _overlap(box, boxes[ring, b[pair]]):
                found[n].ring, found[n].a, found[n].b, pair_of[n] = ring, a[pair], b[pair], pair
                n += 1
    return boxes, found[:n].copy(), pair_of[:n].copy()


def _cell_side(boxes: NDArray[Any], rings: Ints) -> float:
    """The side of a cell, by the 90 % quantile of the sides of a sample of boxes. No kernel: it is quick as it is."""
    sample = boxes[rings, :: 1 + boxes.shape[1] // 100]
    present = sample[sample["floor"] != ABSENT]
    if len(present) == 0:
        return NARROWEST_M
    longest = np.maximum(present["east"] - present["west"], present["north"] - present["south"])
    most = len(longest) * 9 // 10
    return float(max(ROOMY * np.partition(longest, most)[most], NARROWEST_M))


class SweptBoxes:
    """The swept boxes of robots by slab. Slab k of absolute time is in ring row k modulo the number of rows."""

    def __init__(self, slabs: int) -> None:
        self.by_ring: NDArray[Any] = np.zeros((slabs, 0), BOX)
        """(slabs, slots) of `BOX`. A row may also hold boxes of older slabs that are not replaced yet."""
        self.reaches: Reaches = np.zeros(0, REACH)

    def grow(self, slots: int) -> None:
        """Make room for this many slots."""
        before, reaches = self.by_ring, self.reaches
        if slots > len(reaches):
            self.by_ring, self.reaches = np.zeros((len(before), slots), BOX), np.empty(slots, REACH)
            self.by_ring[:, : len(reaches)], self.reaches[: len(reaches)] = before, reaches
            self.clear(np.arange(len(reaches), slots))

    def clear(self, slots: Ints) -> None:
        """Forget the boxes of `slots`."""
        self.by_ring["floor"][:, slots] = ABSENT
        self.reaches[slots] = NOWHERE

    def cover(
        self,
        slots: Ints,
        robots: Robots,
        knots: Knots,
        first_slab: int,
        slabs: int,
        grow_m: float,
        *,
        anew: bool = False,
    ) -> None:
        """Set the boxes of `slots` for `slabs` slabs from `first_slab` on, grown by `grow_m` to each side. If `anew`,
        their boxes of other slabs are dropped."""
        _cover(self.by_ring, self.reaches, slots, robots, knots, first_slab, slabs, grow_m, anew)

    def overlapping_pairs(
        self, changed: Ints, rings: Ints, is_crowded: Bools, is_cut: Bools, most_found: int = MOST_FOUND
    ) -> Pairs:
        """Each pair of overlapping boxes of one slab in the ring rows `rings`, of which at least one is of a `changed`
        slot, once; but no pairs of two slots that are `is_crowded` (slots,), and no more of one box than `most_found`
        and `MOST_CROWDED`. Sets `is_cut` (slots,) of those that have more."""
        is_changed = np.zeros(len(self.reaches), bool)
        is_changed[changed] = True
        marks = is_changed, is_crowded, is_cut, most_found
        if len(changed) <= FEW or len(changed) * len(is_changed) <= FEW_PAIRS:
            return _pairs_one_by_one(self.by_ring, self.reaches, rings, changed, *marks)
        return _pairs_by_cells(self.by_ring, rings, *marks, 1.0 / _cell_side(self.by_ring, rings))
