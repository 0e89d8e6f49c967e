"""Rows of robots in arrays of their newest reports. Such arrays hold thousands of bytes for each row."""

from collections.abc import Iterable
from heapq import heapify, heappop, heappush
from typing import Any

import numpy as np
from numpy.typing import NDArray

from deconflict.sweep.robot_slots import lengthened
from ingest.batch import Ints

FEWEST_ROWS = 64


def with_rows(table: object, names: Iterable[str], rows: int) -> dict[str, NDArray[Any]]:
    """These arrays of a table, longer with zeros, or shorter, so that they have so many rows; as copies."""
    columns = {name: getattr(table, name) for name in names}
    return {
        name: column[:rows].copy() if rows < len(column) else lengthened(column, rows - len(column))
        for name, column in columns.items()
    }


class HistoryRows:
    """Gives a robot that reports the first free row, by its slot. A robot that rests gives its row back and keeps its
    slot. When most rows are free, those behind the last one in use are dropped."""

    def __init__(self) -> None:
        self.of_slot: Ints = np.zeros(0, np.int64)
        """(slots,) the row of each robot; -1 for a robot that has none."""
        self.slots: Ints = np.zeros(0, np.int64)
        """(rows,) the slot of the robot of each row; -1 for a free row."""
        self._free: list[int] = []
        """A heap."""

    def __len__(self) -> int:
        """Rows, free ones included."""
        return len(self.slots)

    def grow(self, slots: int) -> None:
        """Make room for this many slots."""
        more = max(slots - len(self.of_slot), 0)
        self.of_slot = np.concatenate([self.of_slot, np.full(more, -1)])

    def assign(self, slots: Ints) -> Ints:
        """(n,) the rows of robots, which get one if they have none. The arrays need as many rows as this has then."""
        for slot in slots[self.of_slot[slots] < 0].tolist():
            if not self._free:
                self._add_rows()
            row = heappop(self._free)
            self.of_slot[slot], self.slots[row] = row, slot
        return self.of_slot[slots]

    def release(self, slots: Ints) -> Ints:
        """(m,) the rows that robots give back; a robot may have none."""
        rows = self.of_slot[slots]
        rows = rows[rows >= 0]
        self.of_slot[slots], self.slots[rows] = -1, -1
        for row in rows.tolist():
            heappush(self._free, row)
        if len(self) > max(2 * (len(self) - len(self._free)), FEWEST_ROWS):
            self._drop_last()
        return rows

    def _add_rows(self) -> None:
        rows, more = len(self), len(self) // 8 + 16
        self.slots = np.concatenate([self.slots, np.full(more, -1)])
        self._free += range(rows, rows + more)
        heapify(self._free)

    def _drop_last(self) -> None:
        used = np.flatnonzero(self.slots >= 0)
        rows = int(used[-1]) + 1 if len(used) else 0
        self.slots = self.slots[:rows].copy()
        self._free = [row for row in self._free if row < rows]
        heapify(self._free)
