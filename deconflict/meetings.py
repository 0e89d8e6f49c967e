"""Who comes within the clearance of whom, slab by slab."""

from dataclasses import dataclass

import numba
import numpy as np
from numpy.typing import NDArray

from deconflict.motion import Bools
from ingest.compiled import kernel
from ingest.seam import Floats, Ints


@dataclass(frozen=True, slots=True, eq=False)
class Meetings:
    """Pairs of robots that come within the clearance in one slab, ascending by their keys and the slab.

    Arrays are (m,); times are since the epoch.
    """

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
    def joined(cls, parts: list["Meetings"], ranks: Ints) -> "Meetings":
        """All of `parts`, which have none in common."""
        parts = [part for part in parts if len(part)] or parts[:1]
        if len(parts) == 1:
            return parts[0]
        every = cls(*(np.concatenate([getattr(part, name) for part in parts]) for name in cls.__slots__))
        slab = every.slab - every.slab.min()
        place = codes(every, ranks) * (int(slab.max()) + 1) + slab
        return every.take(np.argsort(place, kind="stable"))

    def take(self, rows: Ints | Bools) -> "Meetings":
        if rows.dtype == np.bool_:
            rows = np.flatnonzero(rows)
        return Meetings(*(getattr(self, name).take(rows) for name in self.__slots__))

    def by_pair(self) -> "Meetings":
        """One for each pair, in the same order: its first contact and its smallest separation."""
        first, nearest = _first_and_nearest(self.a, self.b, self.separation)
        return Meetings(
            self.a[first],
            self.b[first],
            self.slab[first],
            self.contact[first],
            self.separation[nearest],
            self.separation_at[nearest],
        )


def codes(meetings: Meetings, ranks: Ints) -> Ints:
    """(m,) a number for each pair, ascending as meetings are."""
    code: Ints = ranks[meetings.a] * len(ranks) + ranks[meetings.b]
    return code


@kernel(numba.types.UniTuple(numba.int64[::1], 2)(numba.int64[::1], numba.int64[::1], numba.float64[::1]))  # type: ignore[no-untyped-call]
def _first_and_nearest(a: Ints, b: Ints, separation: Floats) -> tuple[Ints, Ints]:
    """Of each run of rows of one pair, the first and the first of the smallest separation."""
    first, nearest, runs = np.empty(len(a), np.int64), np.empty(len(a), np.int64), 0
    for row in range(len(a)):
        if row == 0 or a[row] != a[row - 1] or b[row] != b[row - 1]:
            first[runs] = nearest[runs] = row
            runs += 1
        elif separation[row] < separation[nearest[runs - 1]]:
            nearest[runs - 1] = row
    return first[:runs].copy(), nearest[:runs].copy()


class Names:
    """The keys of listed pairs, kept from pass to pass: most pairs are listed again."""

    def __init__(self) -> None:
        self._ranks: Ints = np.zeros(0, np.int64)
        self._codes: Ints = np.zeros(0, np.int64)
        self._names: NDArray[np.object_] = np.zeros(0, object)

    def of(self, meetings: Meetings, keys: NDArray[np.object_], ranks: Ints) -> tuple[tuple[str, str], ...]:
        """The two keys of each of `meetings`, one for each pair; `keys` and `ranks` are by slot.

        What is kept holds for as long as `ranks` is the same array.
        """
        listed = codes(meetings, ranks)
        if self._ranks is not ranks:
            self._ranks, self._codes = ranks, self._codes[:0]
        at = np.searchsorted(self._codes, listed)
        known = at < len(self._codes)
        known[known] = self._codes[at[known]] == listed[known]
        names = np.empty(len(listed), object)
        names[known] = self._names[at[known]]
        a, b = keys[meetings.a[~known]].tolist(), keys[meetings.b[~known]].tolist()
        names[~known] = np.fromiter(zip(a, b, strict=True), object, len(a))
        self._codes, self._names = listed, names
        return tuple(names.tolist())
