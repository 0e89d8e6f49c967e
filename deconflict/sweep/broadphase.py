"""Which robots may come near each other in which slab: swept boxes, and pairs of those that overlap.

One-second slabs prune far better than one box for the whole horizon: a robot's box stays short.
"""

from math import cos, floor, sin
from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

from deconflict.sweep.geometry.knots import KNOT, ROBOT, Knots, Robots
from ingest.batch import Bools, Floats, Ints
from ingest.kernels import inner, kernel

ABSENT = -1
"""Floor of a box that is not there."""
MIXED = -2
"""Floor of a box in which the robot changes floor; it may meet anything."""
FEW = 20
"""Up to so many changed robots are held against all others one by one; for more the boxes are sorted into cells."""
FEW_PAIRS = 20_000
"""So are more, where they and all others make up no more pairs than this: cells for so few cost more than they save."""
ROOMY = 1.5
"""Side of a cell, as a multiple of what nine in ten boxes stay below. Longer boxes are wide, and cost more."""
NARROWEST_M = 1e-3
"""Of a cell."""

_SIDES = [(side, np.float64) for side in ("west", "east", "south", "north")]
BOX = np.dtype([("slab", np.int64), ("floor", np.int64), ("knot", np.int64), *_SIDES], align=True)
"""What a robot covers in a slab, and which of its knots holds when it begins or the robot appears."""

REACH = np.dtype(_SIDES, align=True)
"""All that a robot covers, or a little more; inside out where it is nowhere."""
NOWHERE = (np.inf, -np.inf, np.inf, -np.inf)

PAIR = np.dtype([(name, np.int32) for name in ("ring", "a", "b")], align=True)

Pairs = NDArray[Any]
"""Of `PAIR`: boxes that overlap."""
Row = NDArray[Any]
"""Of `BOX`: the boxes of one slab, by slot."""
Cells = tuple[Ints, Ints, Row]
"""Where each cell starts, the slots cell by cell, and their boxes."""

Reaches = NDArray[Any]
"""Of `REACH`, by slot."""

_BOX, _KNOT, _ROBOT, _PAIR, _REACH = (numba.from_dtype(one) for one in (BOX, KNOT, ROBOT, PAIR, REACH))
_INTS, _REACHES = numba.int64[::1], _REACH[::1]


@inner
def _is_wide(box: Any, share: float) -> bool:
    """Whether a box may reach further than into the cells next to that of its centre, or is on several floors."""
    return bool(box.floor == MIXED or max(box.east - box.west, box.north - box.south) * share > 1.0)


@inner
def _cells(row: Row, is_changed: Bools, share: float) -> tuple[Ints, Ints, Ints, Ints]:
    """The boxes of a row by the cell of their centre: where each cell's slots start, the slots, and the wide ones.

    `share` is cells a metre. Cells repeat after a power of two along x and y, so a box far away costs no room. Of the
    wide ones, those that changed and those that did not.
    """
    across = 4
    while across * across < len(row):
        across *= 2
    start, cell = np.zeros(across * across + 1, np.int64), np.full(len(row), -1)
    wide, wides, still, stills = np.empty(len(row), np.int64), 0, np.empty(len(row), np.int64), 0
    for slot in range(len(row)):
        box = row[slot]
        if box.floor == ABSENT:
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
    return start, slots, wide[:wides], still[:stills]


@inner
def _near(one: Any, other: Any) -> bool:
    """Whether two boxes, or reaches, share room."""
    return bool(
        (one.west <= other.east) & (other.west <= one.east) & (one.south <= other.north) & (other.south <= one.north)
    )


@inner
def _overlap(a: Any, b: Any) -> bool:
    """Whether a box that is there shares room, slab and floor with another."""
    near = _near(a, b) & (a.slab == b.slab)
    return bool(near and b.floor != ABSENT and (a.floor == b.floor or min(a.floor, b.floor) == MIXED))


@inner
def _held_against(
    box: Any, slot: int, own: int, others: Ints, theirs: Row, begin: int, end: int, asking: Bools, found: Pairs, n: int
) -> int:
    """Add the pairs of `slot` with those of `others[begin:end]` that its box overlaps; two that ask count once.

    `theirs` are the boxes of `others`; `own` is the place of `slot` among them, -1 if it has none.
    """
    for at in range(begin, end):
        if _overlap(box, theirs[at]) and (at > own or (at < own and not asking[others[at]])):
            found[n].a, found[n].b = slot, others[at]
            n += 1
    return n


@inner
def _held_against_cells(
    box: Any,
    slot: int,
    own: int,
    cells: Cells,
    first: int,
    share: float,
    asking: Bools,
    found: Pairs,
    n: int,
) -> int:
    """The same with all boxes of the cells that `slot` may reach into, in the places from `first` on."""
    start, slots, theirs = cells
    across = int(np.sqrt(len(start)))
    last = across - 1
    west, east = floor(box.west * share - 0.5), floor(box.east * share + 0.5)
    south, north = floor(box.south * share - 0.5), floor(box.north * share + 0.5)
    low, high = west & last, min(east, west + last) & last
    for y in range(south, min(north, south + last) + 1):
        line = (y & last) * across
        begin, end = max(start[line + low], first), start[line + high + 1]
        if low > high:
            n = _held_against(box, slot, own, slots, theirs, begin, start[line + across], asking, found, n)
            begin = max(start[line], first)
        n = _held_against(box, slot, own, slots, theirs, begin, end, asking, found, n)
    return n


@inner
def _asking(slots: Ints, is_changed: Bools) -> Ints:
    """The places of those that changed."""
    return np.flatnonzero(is_changed[slots])


@inner
def _with_room(found: Pairs, needed: int) -> Pairs:
    return found if needed <= len(found) else np.concatenate((found, np.empty(needed, PAIR)))


@kernel(_PAIR[::1](_BOX[:, ::1], numba.int64[::1], numba.boolean[::1], numba.float64))
def _in_cells(boxes: NDArray[Any], rings: Ints, is_changed: Bools, share: float) -> Pairs:
    """Narrow boxes that changed look into the cells around them, wide ones into all cells that they cover.

    They are gone through cell by cell, so that what one looks at was just looked at by the one before; where all ask,
    each looks at those after it only.
    """
    found, n = np.empty(1 << 14, PAIR), 0
    for ring in rings:
        row, before = boxes[ring], n
        start, slots, wide, still = _cells(row, is_changed, share)
        theirs, theirs_wide, theirs_still = row[slots], row[wide], row[still]
        cells = (start, slots, theirs)
        asking = _asking(slots, is_changed)
        for own in asking:
            slot, box, first = slots[own], theirs[own], own + 1 if len(asking) == len(slots) else 0
            found = _with_room(found, n + len(row))
            n = _held_against(box, slot, -1, still, theirs_still, 0, len(still), is_changed, found, n)
            n = _held_against_cells(box, slot, own, cells, first, share, is_changed, found, n)
        for own in range(len(wide)):
            slot, box = wide[own], theirs_wide[own]
            found = _with_room(found, n + len(row))
            n = _held_against(box, slot, -1, still, theirs_still, 0, len(still), is_changed, found, n)
            n = _held_against_cells(box, slot, -1, cells, 0, share, is_changed, found, n)
            n = _held_against(box, slot, own, wide, theirs_wide, own + 1, len(wide), is_changed, found, n)
        for at in range(before, n):
            found[at].ring = ring
    return found[:n].copy()


@kernel(_PAIR[::1](_BOX[:, ::1], _REACHES, numba.int64[::1], numba.int64[::1], numba.boolean[::1]))
def _one_by_one(boxes: NDArray[Any], reaches: Reaches, rings: Ints, changed: Ints, is_changed: Bools) -> Pairs:
    """The few that changed against all, without cells: slab by slab only where what they cover in all overlaps."""
    found, n = np.empty(1024, PAIR), 0
    for slot in changed:
        for other in range(len(reaches)):
            if not _near(reaches[slot], reaches[other]) or other == slot or (other < slot and is_changed[other]):
                continue
            found = _with_room(found, n + len(rings))
            for ring in rings:
                one = boxes[ring, slot]
                if one.floor != ABSENT and _overlap(one, boxes[ring, other]):
                    found[n].ring, found[n].a, found[n].b = ring, slot, other
                    n += 1
    return found[:n].copy()


@inner
def _by_rank(slots: Ints, ranks: Ints, rows: Ints) -> Ints:
    """`rows` in the order of the ranks of `slots[rows]`; those of one rank stay in the order they are in."""
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


@inner
def _beside(one: Any, other: Any) -> bool:
    """Whether neither is above the other."""
    return bool(one.bottom <= other.top and other.bottom <= one.top)


@kernel(_PAIR[::1](_PAIR[::1], numba.int64[::1], _ROBOT[::1]))
def in_order(pairs: Pairs, ranks: Ints, robots: Robots) -> Pairs:
    """The pairs that are not above one another, the robot of the lower rank first, ascending by both ranks.

    Those of the same two robots stay in the order they are in.
    """
    beside, n = np.empty_like(pairs), 0
    for pair in pairs:
        a, b = (pair.a, pair.b) if ranks[pair.a] < ranks[pair.b] else (pair.b, pair.a)
        if _beside(robots[a], robots[b]):
            beside[n].ring, beside[n].a, beside[n].b = pair.ring, a, b
            n += 1
    beside = beside[:n]
    a, b = beside["a"].copy(), beside["b"].copy()
    return beside[_by_rank(a, ranks, _by_rank(b, ranks, np.arange(n)))]


@inner
def _extent(robot: Any, knot: Any) -> tuple[float, float]:
    """How far a robot extends along x and y from its centre, from a knot on; a turning one counts as its circle."""
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
    """The boxes of one robot, to which its reach extends; a robot without knots has none."""
    k, end, reach = robot.first, robot.first + robot.count, reaches[slot]
    of, along_x, along_y = -1, 0.0, 0.0
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
                if on != of:
                    of, (along_x, along_y) = on, _extent(robot, knot)
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


@kernel(
    numba.void(
        _BOX[:, ::1],
        _REACHES,
        numba.int64[::1],
        _ROBOT[::1],
        _KNOT[::1],
        *[numba.int64] * 2,
        numba.float64,
        numba.boolean,
    )
)
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
    """(robots,) until which slab each is in a pair that is asked of; before all others where it is in none."""
    last = np.full(robots, -(1 << 62))
    for pair in range(len(a)):
        until = floor(until_s[pair])
        last[a[pair]], last[b[pair]] = max(last[a[pair]], until), max(last[b[pair]], until)
    return last


@kernel(
    numba.types.Tuple((_BOX[:, ::1], _PAIR[::1], _INTS))(  # type: ignore[no-untyped-call]
        _ROBOT[::1], _KNOT[::1], _INTS, _INTS, numba.float64, numba.float64[::1], numba.float64
    )
)
def of_chosen(
    robots: Robots, knots: Knots, a: Ints, b: Ints, now_s: float, until_s: Floats, grow_m: float
) -> tuple[NDArray[Any], Pairs, Ints]:
    """The boxes of `robots` from `now_s` on, by slab; of the pairs of slots `a` (p,) and `b` (p,), those that overlap
    by `until_s` (p,), pair by pair and in the order of time; and of which pair they are."""
    first_slab, last = floor(now_s), _last_slabs(len(robots), a, b, until_s)
    slabs = max(last.max() - first_slab + 1, 0) if len(last) else 0
    boxes, reaches = np.empty((slabs, len(robots)), BOX), np.empty(len(robots), REACH)
    for slot in range(len(robots)):
        _reach_nothing(reaches, slot)
        _cover_robot(boxes, reaches, slot, robots[slot], knots, first_slab, last[slot] - first_slab + 1, grow_m)
    found, pair_of, n = np.empty(1024, PAIR), np.empty(1024, np.int64), 0
    for pair in range(len(a)):
        if not _near(reaches[a[pair]], reaches[b[pair]]) or not _beside(robots[a[pair]], robots[b[pair]]):
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


@kernel(numba.float64(_BOX[:, ::1], numba.int64[::1]))
def _side(boxes: NDArray[Any], rings: Ints) -> float:
    """Of a cell: what nine in ten boxes fit well into, by a sample."""
    step, n = 1 + boxes.shape[1] // 100, 0
    longest = np.empty(len(rings) * (1 + boxes.shape[1] // step))
    for ring in rings:
        for slot in range(0, boxes.shape[1], step):
            box = boxes[ring, slot]
            if box.floor != ABSENT:
                longest[n] = max(box.east - box.west, box.north - box.south)
                n += 1
    if n == 0:
        return NARROWEST_M
    most = n * 9 // 10
    return float(max(ROOMY * np.partition(longest[:n], most)[most], NARROWEST_M))


class Boxes:
    """The swept boxes of robots by slab; slab k of absolute time is ring row k modulo their number."""

    def __init__(self, slabs: int) -> None:
        self.all: NDArray[Any] = np.zeros((slabs, 0), BOX)
        """(slabs, slots): a row holds some of older slabs that are not yet replaced."""
        self.reaches: Reaches = np.zeros(0, REACH)

    def grow(self, slots: int) -> None:
        """Make room for so many slots."""
        before, reaches = self.all, self.reaches
        if slots > len(reaches):
            self.all, self.reaches = np.zeros((len(before), slots), BOX), np.empty(slots, REACH)
            self.all[:, : len(reaches)], self.reaches[: len(reaches)] = before, reaches
            self.clear(np.arange(len(reaches), slots))

    def clear(self, slots: Ints) -> None:
        """Forget the boxes of `slots`."""
        self.all["floor"][:, slots] = ABSENT
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
        """Set the boxes of `slots` for `slabs` slabs from `first_slab` on, grown by `grow_m` to each side; where it is
        done `anew`, those of other slabs are forgotten."""
        _cover(self.all, self.reaches, slots, robots, knots, first_slab, slabs, grow_m, anew)

    def pairs(self, changed: Ints, rings: Ints) -> Pairs:
        """Each pair of boxes of one slab that overlap, in ring rows `rings`, at least one of them `changed`'s; once."""
        is_changed = np.zeros(len(self.reaches), bool)
        is_changed[changed] = True
        if len(changed) <= FEW or len(changed) * len(is_changed) <= FEW_PAIRS:
            return _one_by_one(self.all, self.reaches, rings, changed, is_changed)
        return _in_cells(self.all, rings, is_changed, 1.0 / _side(self.all, rings))
