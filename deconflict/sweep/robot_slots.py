"""Slots of robots: the row of each robot in arrays that are kept over many batches."""

from bisect import bisect_left
from collections.abc import Collection, Iterable, Mapping, Sequence
from itertools import repeat
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ingest.batch import Ints


def lengthened(column: NDArray[Any], more: int, axis: int = 0) -> NDArray[Any]:
    """The array with `more` slots of zeros appended; `axis` is that of the slots."""
    shape = list(column.shape)
    shape[axis] = more
    return np.concatenate([column, np.zeros(shape, column.dtype)], axis)


def lengthen(table: object, names: Iterable[str], more: int, axis: int = 0) -> None:
    """Append `more` slots of zeros to each of these arrays of a table; `axis` is that of the slots."""
    for name in names:
        setattr(table, name, lengthened(getattr(table, name), more, axis))


class RobotSlots:
    """A robot keeps its slot until it leaves. The next new robot gets the slot that was freed last.

    Several tables may have columns by the same slots. Each asks for the slots of the robots that it is given, and
    blanks its columns when it forgets a robot. Whoever gives them the batches frees the slots after all have forgotten.
    """

    def __init__(self) -> None:
        self.by_uuid: dict[str, int] = {}
        self.uuids: list[str] = []
        """By slot; "" for a free slot."""
        self._free: list[int] = []
        self._ascending: list[str] = []
        """The UUIDs in ascending order."""
        self._slots_ascending: Ints = np.zeros(0, np.int64)
        """Their slots."""
        self._ranks: Ints | None = None
        """See `ranks`; None if robots came or left since."""

    def __len__(self) -> int:
        """Slots, free ones included."""
        return len(self.uuids)

    def find(self, uuids: Collection[str]) -> Ints:
        """(n,) the slot of each robot; -1 for a robot that has none."""
        return np.fromiter(map(self.by_uuid.get, uuids, repeat(-1)), np.int64, len(uuids))

    def names(self, slots: Ints) -> list[str]:
        """The UUIDs of robots, in that order."""
        return [self.uuids[slot] for slot in slots.tolist()]

    def ranks(self) -> Ints:
        """(slots,) the place of each robot's UUID among all UUIDs in ascending order; 0 for a free slot."""
        if self._ranks is None:
            self._ranks = np.zeros(len(self), np.int64)
            self._ranks[self._slots_ascending] = np.arange(len(self._slots_ascending))
        return self._ranks

    def column(self, numbers: Mapping[str, int]) -> Ints:
        """(slots,) the number of each robot; 0 for a robot that is not in `numbers`, and for a free slot."""
        column, slots = np.zeros(len(self), np.int64), self.find(numbers)
        column[slots[slots >= 0]] = np.fromiter(numbers.values(), np.int64, len(numbers))[slots >= 0]
        return column

    def assign(self, uuids: Sequence[str]) -> tuple[Ints, list[int]]:
        """(n,) the slot of each robot, and the rows of the robots that had none. A robot may stand in `uuids` twice."""
        slots = self.find(uuids)
        new = np.flatnonzero(slots < 0).tolist()
        for row in new:
            slots[row] = self._new_slot(uuids[row])
        if new:
            self._add_to_ranks(sorted({uuids[row] for row in new}))
        return slots, new

    def release(self, uuids: Iterable[str]) -> Ints:
        """(n,) the slots that robots leave. Robots that have none are ignored."""
        ranks, slots = self.ranks(), [self.by_uuid.pop(uuid) for uuid in uuids if uuid in self.by_uuid]
        for slot in slots:
            self.uuids[slot] = ""
        self._free += slots
        if slots:
            self._remove_from_ranks(np.sort(ranks[slots]))
        return np.array(slots, np.int64)

    def _new_slot(self, uuid: str) -> int:
        if uuid in self.by_uuid:
            return self.by_uuid[uuid]
        if self._free:
            slot = self._free.pop()
            self.uuids[slot] = uuid
        else:
            slot = len(self.uuids)
            self.uuids.append(uuid)
        self.by_uuid[uuid] = slot
        return slot

    def _add_to_ranks(self, uuids: Sequence[str]) -> None:
        """Add new robots, in ascending order. One that comes or leaves costs no sorting of all the others."""
        places = [bisect_left(self._ascending, uuid) for uuid in uuids]
        self._slots_ascending = np.insert(self._slots_ascending, places, self.find(uuids))
        for more, (place, uuid) in enumerate(zip(places, uuids, strict=True)):
            self._ascending.insert(place + more, uuid)
        self._ranks = None

    def _remove_from_ranks(self, places: Ints) -> None:
        self._slots_ascending = np.delete(self._slots_ascending, places)
        for place in places[::-1].tolist():
            del self._ascending[place]
        self._ranks = None
