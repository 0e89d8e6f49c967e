"""Demand for what robots share, served in the order of arrival: who waits, and how long."""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import accumulate, chain, pairwise

import numba
import numpy as np

from deconflict.contention.geometry import Geometry
from deconflict.motion import Bools
from ingest.compiled import kernel
from ingest.seam import Floats, Ints

_FLOATS, _INTS, _BOOLS = (
    numba.types.Array(kind, 1, "C", readonly=True) for kind in (numba.float64, numba.int64, numba.boolean)
)

Row = tuple[bool, float, str, float, float]
"""One robot that has a place or will want it, so that rows sort as they are served: whether it is yet to come; when it
comes, or came; its UUID; how long it keeps the place, or how much longer from now on; and half the width of the middle
80 % of when it may come. Times are seconds since the epoch."""


@dataclass(frozen=True, slots=True)
class Request:
    """One robot that has a resource or will want it, as advice weighs it. Times are seconds since the epoch."""

    robot: str
    vendor: str
    arrival_s: float
    """When it comes; of one inside, when it came."""
    service_s: float
    """How long it keeps the resource; of one inside, how much longer from now on."""
    priority: float = 1.0
    """What a second of its waiting counts."""
    inside: bool = False
    """It has the resource already, and keeps it until its service ends."""


@dataclass(slots=True, eq=False)
class Turns:
    """Everybody's turn at one place, in the order served: those inside first, then by arrival, then by UUID."""

    rows: list[Row]
    inside: int
    """How many: the first rows are theirs."""
    begin_s: list[float]
    """Of those inside, when they came."""
    end_s: list[float]
    longest_s: float
    """The longest wait."""
    queue: int
    """The most robots that wait at one time."""

    @property
    def waiting(self) -> list[Row]:
        """Those that find the place taken."""
        first = self.inside
        return [row for row, begin_s in zip(self.rows[first:], self.begin_s[first:], strict=True) if begin_s > row[1]]

    def there(self, at_s: float) -> list[str]:
        """Who has come by then, and not left."""
        turns = zip(self.rows, self.end_s, strict=True)
        return [robot for (_, arrival_s, robot, _, _), end_s in turns if arrival_s <= at_s < end_s]

    def free_s(self, capacity: int, now_s: float) -> float:
        """When a robot that came now, behind all that are inside, would find a place free."""
        ends = sorted(self.end_s[: self.inside], reverse=True)
        return max(ends[capacity - 1], now_s) if len(ends) >= capacity else now_s


def first_come(wanted: Mapping[str, list[Row]], geometry: Geometry, now_s: float) -> dict[str, Turns]:
    """Turns at every place that somebody has or wants, in the order of the places' ids.

    Those inside beyond the capacity keep their turns; nobody else begins until fewer than `capacity` are left, nor
    within the place's changeover of the turn before.
    """
    places = sorted(wanted)
    rows = [sorted(wanted[place]) for place in places]
    start = list(accumulate(map(len, rows), initial=0))
    coming, arrival_s, _, service_s, _ = zip(*chain.from_iterable(rows), strict=True) if rows else ((),) * 5
    begin, end, longest_s, counts = _served(
        np.array(start, np.int64),
        np.array(coming, np.bool_),
        np.array(arrival_s, np.float64),
        np.array(service_s, np.float64),
        np.array([geometry.capacity(place) for place in places], np.int64),
        np.array([geometry.changeover_s(place) for place in places], np.float64),
        now_s,
    )
    begin_s, end_s = begin.tolist(), end.tolist()
    each = zip(places, rows, pairwise(start), longest_s.tolist(), *counts.tolist(), strict=True)
    return {
        place: Turns(told, inside, begin_s[a:b], end_s[a:b], wait_s, queue)
        for place, told, (a, b), wait_s, inside, queue in each
    }


@kernel(
    numba.types.Tuple((*[numba.float64[::1]] * 3, numba.int64[:, ::1]))(  # type: ignore[no-untyped-call]
        _INTS, _BOOLS, _FLOATS, _FLOATS, _INTS, _FLOATS, numba.float64
    )
)
def _served(
    start: Ints,
    coming: Bools,
    arrival_s: Floats,
    service_s: Floats,
    capacity: Ints,
    changeover_s: Floats,
    now_s: float,
) -> tuple[Floats, Floats, Floats, Ints]:
    """When each turn begins and ends; at each place the longest wait, how many are inside and most wait at a time."""
    begin_s, end_s = np.empty(len(arrival_s)), np.empty(len(arrival_s))
    longest_s, counts = np.zeros(len(capacity)), np.zeros((2, len(capacity)), np.int64)
    for place in range(len(capacity)):
        first, last = start[place], start[place + 1]
        free_s = np.full(min(capacity[place], last - first), now_s)
        outside = first
        while outside < last and not coming[outside]:
            begin_s[outside], end_s[outside] = arrival_s[outside], now_s + service_s[outside]
            soonest = np.argmin(free_s)
            free_s[soonest] = max(free_s[soonest], end_s[outside] + changeover_s[place])
            outside += 1
        counts[0, place] = outside - first
        waiting, served = 0, outside
        for row in range(outside, last):
            soonest = np.argmin(free_s)
            begin_s[row] = max(free_s[soonest], arrival_s[row])
            end_s[row] = begin_s[row] + service_s[row]
            free_s[soonest] = end_s[row] + changeover_s[place]
            if begin_s[row] > arrival_s[row]:
                waiting += 1
                while begin_s[served] <= arrival_s[row]:
                    waiting -= begin_s[served] > arrival_s[served]
                    served += 1
                longest_s[place] = max(longest_s[place], begin_s[row] - arrival_s[row])
                counts[1, place] = max(counts[1, place], waiting)
    return begin_s, end_s, longest_s, counts
