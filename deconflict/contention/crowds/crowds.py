"""Crowds: many robots that report from one place, where their bodies can't all be.

The places of such robots are doubted. A fleet does so that reports (0, 0) until it knows where it is, or an attacker.
Robots are compared with those of their vendor; then with those of their source, since a source can invent vendors; then
with all. Who overlaps with those of their vendor makes nobody else overlap, and so on: these are doubted already.
"""

from collections import defaultdict
from collections.abc import Iterator, Mapping
from itertools import product
from math import floor, hypot, pi
from typing import NamedTuple

import numpy as np

from deconflict.foresight.presence.live_robots import LiveRobot, LiveRobots
from deconflict.sweep.geometry.knots import FARTHEST_M
from deconflict.sweep.pair_choice import LATER_S
from ingest.batch import Bools, Floats, Ints
from ingest.kernels import BOOLS, FLOATS, INTS, MATRIX, inner, kernel

COVERED = 2.0
"""A robot overlaps with others if the bodies with their centres in the circle around it, its own included, would cover
that circle so many times. Robots that stand side by side stay below, as they can't overlap."""
CELL_M = 2.0
"""Side of a cell. Robots are compared with those in the cells around them."""
SMALLEST_M = 0.25
"""Shortest side of a body. A shorter one counts as this long: no robots are so small that more of them have room."""
MOST_COMPARED = 200
"""A robot is compared with at most so many others, so that many above each other cost no more."""


@inner
def _cell(x_m: float, y_m: float) -> tuple[int, int]:
    return floor(x_m / CELL_M), floor(y_m / CELL_M)


@inner
def _place(x: int, y: int, on_floor: int, group: int, places: int) -> int:
    """The place of a cell of one floor and group among a power of two of places, which others may share."""
    return (x * 73_856_093 ^ y * 19_349_663 ^ on_floor * 83_492_791 ^ group * 50_331_653) & (places - 1)


@inner
def _is_located(at: Floats) -> bool:
    """Whether a robot is on a floor. Comparisons with nan are false."""
    return bool(at[2] >= 0.0 and abs(at[0]) <= FARTHEST_M and abs(at[1]) <= FARTHEST_M)


@inner
def _overlaps(slot: int, at: Floats, sizes_m: Floats, group: Ints, came_s: Floats, last: Ints, before: Ints) -> bool:
    """Whether the bodies near a robot cover the circle around it `COVERED` times; a larger body counts as its circle.

    The robots of a place are `last` (places,), then the one `before` (slots,) that, and so on to -1.
    """
    x_m, y_m, on_floor, bottom_m, top_m = at[slot]
    radius_m = hypot(sizes_m[slot, 0], sizes_m[slot, 1]) / 2
    circle_m2, area_m2, compared = pi * radius_m * radius_m, 0.0, 0
    (west, south), (east, north) = _cell(x_m - radius_m, y_m - radius_m), _cell(x_m + radius_m, y_m + radius_m)
    for x in range(west, east + 1):
        for y in range(south, north + 1):
            other = last[_place(x, y, int(on_floor), group[slot], len(last))]
            while other >= 0 and compared < MOST_COMPARED:
                other_x_m, other_y_m, other_floor, other_bottom_m, other_top_m = at[other]
                is_beside = group[other] == group[slot] and other_floor == on_floor
                is_beside = is_beside and _cell(other_x_m, other_y_m) == (x, y)
                is_beside = is_beside and came_s[other] <= came_s[slot] + LATER_S
                is_beside = is_beside and bottom_m <= other_top_m and other_bottom_m <= top_m
                compared += is_beside
                if is_beside and hypot(other_x_m - x_m, other_y_m - y_m) <= radius_m:
                    area_m2 += min(sizes_m[other, 0] * sizes_m[other, 1], circle_m2)
                if area_m2 > COVERED * circle_m2:
                    return True
                other = before[other]
    return False


@kernel(BOOLS(INTS, *[MATRIX] * 2, INTS, FLOATS))
def overlapping(robots: Ints, at: Floats, sizes_m: Floats, group: Ints, came_s: Floats) -> Bools:
    """(n,) which of the slots `robots` (n,) overlap with others of their group, on their floor and at their height.

    `at` (slots, 5) is x_m, y_m, floor, bottom_m and top_m; nan for a free slot. `sizes_m` (slots, 2) is length and
    width, `group` (slots,) a number, `came_s` (slots,) when each robot came to the floor.
    """
    sizes_m, places = np.maximum(sizes_m, SMALLEST_M), 4
    while places < 2 * len(at):
        places *= 2
    last, before, overlaps = np.full(places, -1), np.empty(len(at), np.int64), np.zeros(len(robots), np.bool_)
    for slot in range(len(at)):
        if _is_located(at[slot]):
            x, y = _cell(at[slot, 0], at[slot, 1])
            place = _place(x, y, int(at[slot, 2]), group[slot], places)
            before[slot], last[place] = last[place], slot
    for row, slot in enumerate(robots):
        overlaps[row] = _is_located(at[slot]) and _overlaps(slot, at, sizes_m, group, came_s, last, before)
    return overlaps


FEWEST = 9
"""Fewer overlapping robots in one heap are no crowd."""
HEARD_S = 10.0
"""A robot that was not heard for longer comes to no crowd: silent robots are believed to stand where others may be. One
that is in a crowd when it falls silent stays in it."""
HELD_S = 5.0
"""A robot is in a crowd until it has not overlapped with it for this long."""

MOST_LABELS = 3
"""If the robots of one heap had more labels, they get one: makers can be invented, and a person goes to one place."""
SEVERAL = "several vendors at several addresses"

NONE, OF_VENDOR, OF_SOURCE, OF_ALL = range(4)
"""With whom a robot overlaps: nobody, those of its vendor, those of its source, or others."""

Cell = tuple[float, float, float, float]
"""Floor, side, and numbers along x and y."""


class Crowd(NamedTuple):
    """The crowded robots of one vendor, of several vendors of one source, or of several sources, on one floor."""

    label: str
    """The vendor; or that they are several, and where they send from."""
    datum: str
    robots: tuple[str, ...]
    """In ascending order."""
    x_m: float
    """The middle of the largest heap, by their newest reports."""
    y_m: float


class Crowds:
    """The crowded robots of an engine. Pure: `step` takes the time."""

    def __init__(self, live: LiveRobots) -> None:
        self._live = live
        self._some_overlap = False
        """Whether any robot overlapped at the last step."""
        self._label_numbers: dict[str, int] = {}
        """By label, its number from 1 on."""
        self._joined: set[int] = set()
        """The numbers of labels that were given instead of too many."""
        self._numbers: dict[str, int] = {}
        self.numbers: Mapping[str, int] = self._numbers
        """By crowded robot, the number of its label."""
        self._crowded_s: dict[str, float] = {}
        """By crowded robot, when it was last found in its crowd."""

    def step(self, now_s: float) -> dict[str, bool]:
        """The robots that have come to a crowd (True) or left one since the last step."""
        self._keep_those_begun_anew()
        live, (slots, kind) = self._live, self._overlapping(now_s)
        for heap in _heaps(live, slots) if len(slots) >= FEWEST else ():
            if len(heap) >= FEWEST:
                live.crowd[heap], live.crowded_s[heap] = self._heap_labels(heap, kind[heap]), now_s
        live.crowd[now_s - live.crowded_s > HELD_S] = 0
        crowded = np.flatnonzero(live.crowd)
        uuids = live.slots.names(crowded)
        numbers = dict(zip(uuids, live.crowd[crowded].tolist(), strict=True))
        self._crowded_s = dict(zip(uuids, live.crowded_s[crowded].tolist(), strict=True))
        changed = numbers.keys() ^ self._numbers.keys()
        if numbers != self._numbers:
            self._numbers.clear()
            self._numbers.update(numbers)
        return {uuid: uuid in numbers for uuid in changed}

    def _keep_those_begun_anew(self) -> None:
        """A robot that has begun anew since the last step, as one that was moved by hand, is still in its crowd."""
        live, crowd = self._live, self._live.crowd.tolist()
        for uuid, number in self._numbers.items():
            if (robot := live.robots.get(uuid)) and not crowd[robot.slot]:
                live.crowd[robot.slot], live.crowded_s[robot.slot] = number, self._crowded_s[uuid]

    def _overlapping(self, now_s: float) -> tuple[Ints, Ints]:
        """The slots of overlapping robots, and (slots,) with whom each overlaps, see `OF_VENDOR`.

        Those that reported are looked at; if some overlap, all that were heard, or fell silent in a crowd.
        """
        live, changed = self._live, self._live.take_changed()
        if self._some_overlap or len(self._overlap(changed, live.at)[0]):
            is_placed = (now_s - live.event_s <= HEARD_S) | (live.crowd > 0)
            found = self._overlap(np.flatnonzero(is_placed), np.where(is_placed[:, None], live.at, np.nan))
        else:
            found = np.zeros(0, np.int64), np.zeros(0, np.int64)
        self._some_overlap = len(found[0]) > 0
        return found

    def _overlap(self, slots: Ints, at: Floats) -> tuple[Ints, Ints]:
        """The slots of those of `slots` that overlap at places `at` (slots, 5), and (slots,) with whom."""
        live, kind = self._live, np.full(len(at), NONE)
        for number, group in ((OF_VENDOR, live.vendor), (OF_SOURCE, live.source), (OF_ALL, np.zeros_like(live.vendor))):
            found = slots[overlapping(slots, at, live.sizes_m, group, live.came_s)]
            kind[found] = number
            if len(found):
                at = at.copy()
                at[found] = np.nan
        return slots[kind[slots] != NONE], kind

    def _heap_labels(self, heap: Ints, kind: Ints) -> Ints:
        """(n,) the numbers of the labels of the robots of one heap (n,); `kind` (n,) is with whom each overlaps."""
        live = self._live
        group = np.select([kind == OF_VENDOR, kind == OF_SOURCE], [live.vendor[heap], live.source[heap]], 0)
        _, rows, label_of = np.unique(4 * group + kind, return_index=True, return_inverse=True)
        robots = [live.robots[uuid] for uuid in live.slots.names(heap[rows])]
        labels = list(map(_label, robots, kind[rows].tolist()))
        before = self._joined_before(heap) if len(labels) > 1 else None
        if len(labels) <= (1 if before else MOST_LABELS):
            return np.array(list(map(self._number, labels)))[label_of]
        is_of_one_source = before != self._number(SEVERAL) and bool((live.source[heap] == live.source[heap[0]]).all())
        joined = self._number(_several_at(robots[0].source) if is_of_one_source else SEVERAL)
        self._joined.add(joined)
        return np.full(len(heap), joined)

    def _joined_before(self, heap: Ints) -> int | None:
        """The label that the robots of a heap got at the last step because they had too many, if all that had any had
        it. It stays while they have several, so that few robots that come and go do not begin advisories anew."""
        before = set(self._live.crowd[heap].tolist()) - {0}
        return before.pop() if len(before) == 1 and before <= self._joined else None

    def _number(self, label: str) -> int:
        return self._label_numbers.setdefault(label, len(self._label_numbers) + 1)

    def standing(self) -> Iterator[Crowd]:
        """The crowds, by label and floor."""
        live, labels = self._live, list(self._label_numbers)
        slots = defaultdict[tuple[str, float], list[int]](list)
        for uuid in sorted(self._numbers):
            slot = live.robots[uuid].slot
            slots[labels[self._numbers[uuid] - 1], float(live.at[slot, 2])].append(slot)
        for label, level in sorted(slots):
            if level >= 0:
                yield self._crowd(label, np.array(slots[label, level]))

    def _crowd(self, label: str, slots: Ints) -> Crowd:
        """The crowd of robots of one label and floor."""
        live = self._live
        robots = tuple(live.slots.names(slots))
        middle_m = live.at[max(_heaps(live, slots), key=len), :2].mean(axis=0)
        return Crowd(label, live.floors[int(live.at[slots[0], 2])], robots, *middle_m.tolist())


def _label(robot: LiveRobot, kind: int) -> str:
    if kind == OF_VENDOR:
        return robot.vendor
    return _several_at(robot.source) if kind == OF_SOURCE else SEVERAL


def _several_at(source: str) -> str:
    return f"several vendors at {source}"


def _heaps(live: LiveRobots, slots: Ints) -> list[Ints]:
    """These robots, heap by heap: those of one floor, and of one size within a factor of two, whose cells are side by
    side."""
    if not len(slots):
        return []
    radius_m = np.hypot(*live.sizes_m[slots].T) / 2
    side_m = CELL_M * 2.0 ** np.ceil(np.log2(np.maximum(radius_m / CELL_M, 1.0)))
    at = np.column_stack([live.at[slots, 2], side_m, *np.floor(live.at[slots, :2].T / side_m)])
    order = np.lexsort(at.T)
    begins = np.flatnonzero(np.diff(at[order], axis=0, prepend=np.nan).any(axis=1))
    of_cell = np.split(slots[order], begins[1:])
    cells: dict[Cell, Ints] = dict(zip(map(tuple, at[order[begins]].tolist()), of_cell, strict=True))
    heaps = []
    while cells:
        heap, waiting = list[Ints](), [next(iter(cells))]
        while waiting:
            floor, side, x, y = cell = waiting.pop()
            heap += [cells.pop(cell)] if cell in cells else []
            beside = ((floor, side, x + east, y + north) for east, north in product((-1, 0, 1), repeat=2))
            waiting += [cell for cell in beside if cell in cells]
        heaps.append(np.concatenate(heap))
    return heaps
