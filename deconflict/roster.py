"""The robots on a floor: a slot for each, and what their newest forecasts say, in arrays."""

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ingest.seam import Floats, Forecasts, Ints

MOST_WASTE = 3
"""Knots are packed anew when so many times those in use are held."""
FEWEST_KNOTS = 10_000
_COLUMNS = ("t_s", "x_m", "y_m", "yaw_rad", "floor")


class Roster:
    """Keys and forecasts by slot. A robot keeps its slot until it leaves; another may then have it."""

    def __init__(self) -> None:
        self.slots: dict[str, int] = {}
        self.keys: list[str] = []
        """By slot; "" for a free one."""
        self.half: Floats = np.zeros((2, 0))
        """(2, slots) half length and half width."""
        self.height: Floats = np.zeros((2, 0))
        """(2, slots) bottom and top."""
        self.appears: Floats = np.zeros(0)
        """(slots,) time of the first knot."""
        self._free: list[int] = []
        self._first: Ints = np.zeros(0, np.int64)
        self._count: Ints = np.zeros(0, np.int64)
        self._knots: dict[str, NDArray[Any]] = {name: getattr(Forecasts.empty(), name) for name in _COLUMNS}
        self._used = 0
        self._ranks: Ints | None = None

    def __len__(self) -> int:
        """Slots, free ones included."""
        return len(self.keys)

    def put(self, keys: Sequence[str], forecasts: Forecasts) -> Ints:
        """Replace the forecasts of `keys`, which are all different; their slots."""
        slots = np.fromiter((self._slot(key) for key in keys), np.int64, len(keys))
        self._grow()
        self.half[:, slots] = forecasts.length_m / 2, forecasts.width_m / 2
        self.height[:, slots] = forecasts.bottom_m, forecasts.top_m
        self.appears[slots] = forecasts.t_s[forecasts.start[:-1]]
        self._count[slots] = np.diff(forecasts.start)
        self._first[slots] = self._used + forecasts.start[:-1]
        self._append(forecasts)
        if self._used > MOST_WASTE * max(int(self._count.sum()), FEWEST_KNOTS):
            self._pack()
        return slots

    def discard(self, keys: Iterable[str]) -> list[int]:
        """Take robots off the floor; the slots that they leave."""
        left = [self.slots.pop(key) for key in keys if key in self.slots]
        for slot in left:
            self.keys[slot] = ""
            self._count[slot] = 0
        self._free += left
        if left:
            self._ranks = None
        return left

    def forecasts(self, slots: Ints) -> Forecasts:
        """The forecasts of `slots`, in that order."""
        counts = self._count[slots]
        start = np.concatenate([[0], np.cumsum(counts)])
        knots = np.repeat(self._first[slots] - start[:-1], counts) + np.arange(start[-1])
        columns = {name: column[knots] for name, column in self._knots.items()}
        length_m, width_m = 2 * self.half[:, slots]
        return Forecasts(
            start=start,
            **columns,
            length_m=length_m,
            width_m=width_m,
            bottom_m=self.height[0, slots],
            top_m=self.height[1, slots],
        )

    def present(self, slots: Ints) -> Ints:
        """Those of `slots` that a robot has."""
        there: Ints = slots[self._count[slots] > 0]
        return there

    def ranks(self) -> Ints:
        """(slots,) the place of each slot's key among all, in order."""
        if self._ranks is None:
            self._ranks = np.zeros(len(self), np.int64)
            by_key = np.fromiter((self.slots[key] for key in sorted(self.slots)), np.int64, len(self.slots))
            self._ranks[by_key] = np.arange(len(by_key))
        return self._ranks

    def _slot(self, key: str) -> int:
        slot = self.slots.get(key)
        if slot is None:
            self._ranks = None
            if self._free:
                slot = self._free.pop()
                self.keys[slot] = key
            else:
                slot = len(self.keys)
                self.keys.append(key)
            self.slots[key] = slot
        return slot

    def _grow(self) -> None:
        spare = len(self) - len(self.appears)
        if spare > 0:
            self.half = np.pad(self.half, ((0, 0), (0, spare)))
            self.height = np.pad(self.height, ((0, 0), (0, spare)))
            self.appears = np.pad(self.appears, (0, spare))
            self._first, self._count = np.pad(self._first, (0, spare)), np.pad(self._count, (0, spare))

    def _append(self, forecasts: Forecasts) -> None:
        start, self._used = self._used, self._used + len(forecasts.t_s)
        for name, column in self._knots.items():
            if len(column) < self._used:
                self._knots[name] = np.pad(column, (0, 2 * self._used - len(column)))
            self._knots[name][start : self._used] = getattr(forecasts, name)

    def _pack(self) -> None:
        """Leave out the knots of forecasts that were replaced."""
        slots = np.flatnonzero(self._count)
        kept = self.forecasts(slots)
        self._first[slots], self._used = kept.start[:-1], 0
        self._knots = {name: getattr(kept, name)[:0] for name in _COLUMNS}
        self._append(kept)
