"""Crowds: many robots of one vendor that report from one place, where their bodies can't all be.

The places of such robots are doubted. A fleet does so that reports (0, 0) until it knows where it is, or an attacker.
"""

from collections import defaultdict
from collections.abc import Iterator, Mapping
from itertools import product
from typing import NamedTuple

import numpy as np

from deconflict.contention.crowds.overlapping_robots import CELL_M, overlapping
from deconflict.foresight.presence.live_robots import LiveRobots
from ingest.batch import Ints

FEWEST = 9
"""Fewer overlapping robots in one heap are no crowd."""
HEARD_S = 10.0
"""A robot that was not heard for longer is in no crowd: silent robots are believed to stand where others may be."""
HELD_S = 5.0
"""A robot is in a crowd until it has not overlapped with it for this long."""

Cell = tuple[int, float, float, float]
"""Vendor, floor, and numbers along x and y."""


class Crowd(NamedTuple):
    """The crowded robots of one vendor on one floor."""

    vendor: str
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
        self._found_s: dict[str, float] = {}
        """By robot, when it was last found in a crowd."""
        self._numbers: dict[str, int] = {}
        self.numbers: Mapping[str, int] = self._numbers
        """By crowded robot, a number of its vendor, from 1 on."""

    def step(self, now_s: float) -> dict[str, bool]:
        """The robots that have come to a crowd (True) or left one since the last step."""
        live, slots = self._live, self._overlapping(now_s)
        for heap in _heaps(live, slots) if len(slots) >= FEWEST else ():
            if len(heap) >= FEWEST:
                self._found_s |= dict.fromkeys((live.uuids[slot] for slot in heap.tolist()), now_s)
        if not self._found_s and not self._numbers:
            return {}
        self._found_s = {
            uuid: at_s for uuid, at_s in self._found_s.items() if now_s - at_s <= HELD_S and uuid in live.robots
        }
        changed = {uuid: uuid in self._found_s for uuid in self._found_s.keys() ^ self._numbers.keys()}
        self._numbers.clear()
        self._numbers.update((uuid, 1 + int(live.vendor[live.robots[uuid].slot])) for uuid in self._found_s)
        return changed

    def _overlapping(self, now_s: float) -> Ints:
        """The slots of overlapping robots. Those that reported are looked at; if some overlap, all that were heard."""
        live, robots = self._live, self._live.take_changed()
        found = robots[overlapping(robots, live.at, live.sizes_m, live.vendor)]
        if len(found) or self._some_overlap:
            heard = np.where((now_s - live.event_s <= HEARD_S)[:, None], live.at, np.nan)
            found = np.flatnonzero(overlapping(np.arange(len(heard)), heard, live.sizes_m, live.vendor))
        self._some_overlap = len(found) > 0
        return found

    def standing(self) -> Iterator[Crowd]:
        """The crowds, by vendor and floor."""
        live = self._live
        slots = np.array([live.robots[uuid].slot for uuid in sorted(self._numbers)], np.int64)
        of = list(zip(live.vendor[slots].tolist(), live.at[slots, 2].tolist(), strict=True))
        for vendor, floor in sorted(set(of)):
            if floor >= 0:
                yield self._crowd(slots[[each == (vendor, floor) for each in of]])

    def _crowd(self, slots: Ints) -> Crowd:
        """The crowd of robots of one vendor and floor."""
        live = self._live
        robots = tuple(live.uuids[slot] for slot in slots.tolist())
        middle_m = live.at[max(_heaps(live, slots), key=len), :2].mean(axis=0)
        return Crowd(live.robots[robots[0]].vendor, live.floors[int(live.at[slots[0], 2])], robots, *middle_m.tolist())


def _heaps(live: LiveRobots, slots: Ints) -> list[Ints]:
    """These robots, heap by heap: those of one vendor and floor whose cells are side by side."""
    cells: defaultdict[Cell, list[int]] = defaultdict(list)
    columns = live.vendor[slots], live.at[slots, 2], *np.floor(live.at[slots, :2] / CELL_M).T
    for slot, vendor, floor, x, y in zip(slots.tolist(), *(column.tolist() for column in columns), strict=True):
        cells[vendor, floor, x, y].append(slot)
    heaps = []
    while cells:
        heap, waiting = list[int](), [next(iter(cells))]
        while waiting:
            vendor, floor, x, y = cell = waiting.pop()
            heap += cells.pop(cell, ())
            beside = ((vendor, floor, x + east, y + north) for east, north in product((-1, 0, 1), repeat=2))
            waiting += [cell for cell in beside if cell in cells]
        heaps.append(np.array(heap, np.int64))
    return heaps
