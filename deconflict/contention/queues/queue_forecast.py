"""Demand for what robots share, served in the order of arrival: who waits, and how long."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import accumulate, chain, compress, pairwise
from math import inf
from typing import NamedTuple, Self

import numba
import numpy as np

from deconflict.contention.robots.place_geometry import Geometry
from deconflict.sweep.geometry.heights import heights_overlap
from ingest.batch import Bools, Floats, Ints
from ingest.kernels import inner, kernel

_FLOATS, _INTS, _BOOLS = (
    numba.types.Array(kind, 1, "C", readonly=True) for kind in (numba.float64, numba.int64, numba.boolean)
)


class Row(NamedTuple):
    """One robot that has a place or will want it; rows sort as they are served. Times are seconds since the epoch."""

    coming: bool
    """It is yet to come."""
    arrival_s: float
    """When it comes, or came."""
    robot: str
    """UUID."""
    service_s: float
    """How long it keeps the place, or how much longer from now on."""
    spread_s: float
    """Half the width of the middle 80 % of when it may come."""
    bottom_m: float = -inf
    """Heights that it reaches from and to."""
    top_m: float = inf


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

    @property
    def longest(self) -> Row:
        """The first of those that wait longest."""
        turns = zip(self.rows[self.inside :], self.begin_s[self.inside :], strict=True)
        return max(turns, key=lambda turn: turn[1] - turn[0].arrival_s)[0]

    def at_height_of(self, one: Row) -> Self:
        """Without the turns of those that pass above or below a robot."""
        stays = [heights_overlap(row, one) for row in self.rows]
        if all(stays):
            return self
        return replace(
            self,
            rows=list(compress(self.rows, stays)),
            inside=sum(stays[: self.inside]),
            begin_s=list(compress(self.begin_s, stays)),
            end_s=list(compress(self.end_s, stays)),
        )

    def there(self, at_s: float) -> list[str]:
        """Who has come by then, and not left."""
        turns = zip(self.rows, self.end_s, strict=True)
        return [row.robot for row, end_s in turns if row.arrival_s <= at_s < end_s]

    def free_s(self, capacity: int, now_s: float) -> float:
        """When a robot that came now, behind all that are inside, would find a place free."""
        ends = sorted(self.end_s[: self.inside], reverse=True)
        return max(ends[capacity - 1], now_s) if len(ends) >= capacity else now_s


def first_come(wanted: Mapping[str, list[Row]], geometry: Geometry, now_s: float) -> dict[str, Turns]:
    """Turns at every place that somebody has or wants, in the order of the places' ids.

    Those inside beyond the capacity keep their turns; nobody else begins until fewer than `capacity` are left, nor
    within the place's changeover of the turn before. Where one passes above another, neither takes the other any room.
    """
    places = sorted(wanted)
    rows = [sorted(wanted[place]) for place in places]
    start = list(accumulate(map(len, rows), initial=0))
    columns = zip(*chain.from_iterable(rows), strict=True) if rows else ((),) * len(Row._fields)
    coming, arrival_s, _, service_s, _, bottom_m, top_m = columns
    begin, end, longest_s, counts = _served(
        np.array(start, np.int64),
        np.array(coming, np.bool_),
        np.array(arrival_s, np.float64),
        np.array(service_s, np.float64),
        np.array(bottom_m, np.float64),
        np.array(top_m, np.float64),
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


@inner
def _ends_before(row: int, first: int, until_s: Floats, bottom_m: Floats, top_m: Floats, free_s: Floats) -> None:
    """Put off `free_s`, when each room of a place comes free for `row`, by those from `first` on that come before it.

    Those that pass above or below it take it no room; the others keep it until `until_s`.
    """
    for before in range(first, row):
        if bottom_m[before] <= top_m[row] and bottom_m[row] <= top_m[before]:
            soonest = np.argmin(free_s)
            free_s[soonest] = max(free_s[soonest], until_s[before])


@kernel(
    numba.types.Tuple((*[numba.float64[::1]] * 3, numba.int64[:, ::1]))(  # type: ignore[no-untyped-call]
        _INTS, _BOOLS, *[_FLOATS] * 4, _INTS, _FLOATS, numba.float64
    )
)
def _served(
    start: Ints,
    coming: Bools,
    arrival_s: Floats,
    service_s: Floats,
    bottom_m: Floats,
    top_m: Floats,
    capacity: Ints,
    changeover_s: Floats,
    now_s: float,
) -> tuple[Floats, Floats, Floats, Ints]:
    """When each turn begins and ends; at each place the longest wait, how many are inside and most wait at a time."""
    begin_s, end_s, until_s = np.empty(len(arrival_s)), np.empty(len(arrival_s)), np.empty(len(arrival_s))
    longest_s, counts = np.zeros(len(capacity)), np.zeros((2, len(capacity)), np.int64)
    for place in range(len(capacity)):
        first, last = start[place], start[place + 1]
        if first == last:
            continue
        one_height = bottom_m[first:last].max() <= top_m[first:last].min()
        free_s = np.full(min(capacity[place], last - first), now_s)
        for row in range(first, last):
            if not one_height:
                free_s[:] = now_s
                _ends_before(row, first, until_s, bottom_m, top_m, free_s)
            soonest = np.argmin(free_s)
            begin_s[row] = max(free_s[soonest], arrival_s[row]) if coming[row] else arrival_s[row]
            end_s[row] = (begin_s[row] if coming[row] else now_s) + service_s[row]
            until_s[row] = end_s[row] + changeover_s[place]
            free_s[soonest] = max(free_s[soonest], until_s[row])
            counts[0, place] += not coming[row]
            if begin_s[row] > arrival_s[row] and coming[row]:
                longest_s[place] = max(longest_s[place], begin_s[row] - arrival_s[row])
                waiting = 0
                for other in range(first + counts[0, place], row + 1):
                    waiting += begin_s[other] > arrival_s[row]
                counts[1, place] = max(counts[1, place], waiting)
    return begin_s, end_s, longest_s, counts
