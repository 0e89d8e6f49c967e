"""Who comes within the clearance of whom, slab by slab."""

from dataclasses import dataclass

import numpy as np

from deconflict.motion import Bools
from ingest.seam import Floats, Ints


@dataclass(frozen=True, slots=True, eq=False)
class Meetings:
    """Pairs of robots that come within the clearance in one slab. Arrays are (m,); times are since the epoch."""

    a: Ints
    """Slot of the robot with the lower key."""
    b: Ints
    slab: Ints
    contact: Floats
    separation: Floats
    separation_at: Floats

    def __len__(self) -> int:
        return len(self.a)

    @classmethod
    def none(cls) -> "Meetings":
        whole, real = np.empty(0, np.int64), np.empty(0)
        return cls(whole, whole, whole, real, real, real)

    @classmethod
    def joined(cls, parts: list["Meetings"]) -> "Meetings":
        if len(parts) == 1:
            return parts[0]
        return cls(*(np.concatenate([getattr(part, name) for part in parts]) for name in cls.__slots__))

    def take(self, rows: Ints | Bools) -> "Meetings":
        if rows.dtype == np.bool_:
            rows = np.flatnonzero(rows)
        return Meetings(*(getattr(self, name).take(rows) for name in self.__slots__))

    def by_pair(self, ranks: Ints) -> "Meetings":
        """One for each pair, ascending by `ranks` of the slots: its first contact and its smallest separation."""
        if not len(self):
            return self
        pair = ranks[self.a] * (int(ranks.max()) + 1) + ranks[self.b]
        slab = self.slab - self.slab.min()
        order = np.argsort(pair * (int(slab.max()) + 1) + slab)
        pair, m = pair[order], self.take(order)
        new = np.ones(len(m), bool)
        new[1:] = pair[1:] != pair[:-1]
        first = np.flatnonzero(new)
        least = np.minimum.reduceat(m.separation, first)
        nearest = np.flatnonzero(m.separation == np.repeat(least, np.diff(np.append(first, len(m)))))
        nearest = nearest[np.searchsorted(nearest, first)]
        return Meetings(
            m.a[first],
            m.b[first],
            m.slab[first],
            np.minimum.reduceat(m.contact, first),
            least,
            m.separation_at[nearest],
        )
