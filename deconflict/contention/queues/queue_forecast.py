"""Queues at shared places, forecast by first come, first served: who waits, and how long."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import accumulate, chain, compress, pairwise
from math import inf
from typing import NamedTuple, Self

import numpy as np

from deconflict.contention.robots.place_geometry import PlaceGeometry
from deconflict.sweep.geometry.heights import at_one_height, heights_overlap
from ingest.batch import Bools, Floats, Ints
from ingest.kernels import FLOAT, READ_BOOLS, READ_FLOATS, READ_INTS, inner, kernel

MOST_TURNS = 500
"""At one place and height, beyond those that have room: the time that they take grows with their square."""


class QueueEntry(NamedTuple):
    """One robot that has a place or will want it. Entries sort in the order of service. Times are since the epoch."""

    coming: bool
    """Whether it is yet to come."""
    arrival_s: float
    """When it comes, or came."""
    robot: str
    """UUID."""
    service_s: float
    """How long it keeps the place; if it is inside, how much longer from now on."""
    spread_s: float
    """Half the width of the interval that holds its arrival with 80 %."""
    bottom_m: float = -inf
    """The lowest height it reaches."""
    top_m: float = inf
    """The highest height it reaches."""


@dataclass(frozen=True, slots=True)
class ServiceRequest:
    """One robot that has a resource or will want it, as advice weighs it. Times are seconds since the epoch."""

    robot: str
    """UUID."""
    vendor: str
    arrival_s: float
    """When it comes; if it is inside, when it came."""
    service_s: float
    """How long it keeps the resource; if it is inside, how much longer from now on."""
    priority: float = 1.0
    """Weight of a second of its waiting."""
    inside: bool = False
    """Whether it has the resource already, and keeps it until its service ends."""


@dataclass(slots=True, eq=False)
class QueueForecast:
    """The turns at one place, in the order of service: robots inside first, then by arrival, then by UUID."""

    entries: list[QueueEntry]
    inside: int
    """How many robots are inside: the first entries are theirs."""
    begin_s: list[float]
    """When each turn begins; for robots inside, when they came."""
    end_s: list[float]
    """When each turn ends."""
    longest_wait_s: float
    longest_queue: int
    """The most robots that wait at one time."""

    @property
    def waiting(self) -> list[QueueEntry]:
        """The entries of robots that have to wait."""
        turns = zip(self.entries[self.inside :], self.begin_s[self.inside :], strict=True)
        return [entry for entry, begin_s in turns if begin_s > entry.arrival_s]

    @property
    def longest_waiting(self) -> QueueEntry:
        """The entry of the robot that waits longest; of several, the first."""
        turns = zip(self.entries[self.inside :], self.begin_s[self.inside :], strict=True)
        return max(turns, key=lambda turn: turn[1] - turn[0].arrival_s)[0]

    def at_height_of(self, entry: QueueEntry) -> Self:
        """Without the turns of robots that pass above or below a robot."""
        stays = [at_one_height(other, entry) for other in self.entries]
        if all(stays):
            return self
        return replace(
            self,
            entries=list(compress(self.entries, stays)),
            inside=sum(stays[: self.inside]),
            begin_s=list(compress(self.begin_s, stays)),
            end_s=list(compress(self.end_s, stays)),
        )

    def present_at(self, at_s: float) -> list[str]:
        """The robots that have come by `at_s` and not left."""
        turns = zip(self.entries, self.end_s, strict=True)
        return [entry.robot for entry, end_s in turns if entry.arrival_s <= at_s < end_s]

    def free_s(self, capacity: int, now_s: float) -> float:
        """When a robot that came now, behind those inside, would find the place free."""
        ends_s = sorted(self.end_s[: self.inside], reverse=True)
        return max(ends_s[capacity - 1], now_s) if len(ends_s) >= capacity else now_s


def forecast_queues(
    wanted: Mapping[str, list[QueueEntry]], geometry: PlaceGeometry, now_s: float
) -> dict[str, QueueForecast]:
    """The turns at every place that a robot has or wants, by first come, first served, in the order of the ids.

    Robots inside beyond the capacity keep their turns. No other turn begins until fewer than `capacity` robots are
    left, nor within the place's changeover time of the turn before. Robots that pass above or below each other do not
    take each other's room. Of a longer queue the first count, see `MOST_TURNS`.
    """
    places = sorted(wanted)
    by_place = [_with_turns(sorted(wanted[place]), geometry.capacity(place) + MOST_TURNS) for place in places]
    start = list(accumulate(map(len, by_place), initial=0))
    columns = zip(*chain.from_iterable(by_place), strict=True) if by_place else ((),) * len(QueueEntry._fields)
    coming, arrival_s, _, service_s, _, bottom_m, top_m = columns
    begin, end, longest_wait_s, counts = _serve(
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
    rows = zip(places, by_place, pairwise(start), longest_wait_s.tolist(), *counts.tolist(), strict=True)
    return {
        place: QueueForecast(entries, inside, begin_s[a:b], end_s[a:b], wait_s, longest_queue)
        for place, entries, (a, b), wait_s, inside, longest_queue in rows
    }


def _with_turns(entries: list[QueueEntry], most: int) -> list[QueueEntry]:
    """Those of `entries`, in the order of service, beside fewer than `most` earlier ones at their height."""
    if len(entries) <= most:
        return entries
    kept, bottom_m, top_m = list[QueueEntry](), np.empty(len(entries)), np.empty(len(entries))
    for entry in entries:
        earlier = slice(len(kept))
        if np.count_nonzero(heights_overlap(bottom_m[earlier], top_m[earlier], entry.bottom_m, entry.top_m)) < most:
            bottom_m[len(kept)], top_m[len(kept)] = entry.bottom_m, entry.top_m
            kept.append(entry)
    return kept


_heights_overlap = inner(heights_overlap)


@inner
def _free_beside_s(
    row: int, first: int, capacity: int, until_s: Floats, bottom_m: Floats, top_m: Floats, now_s: float
) -> float:
    """When a place is free for `row` beside the rows from `first` to it.

    Robots that pass above or below it take no room from it; the others take it until `until_s`.
    """
    beside_s, count = np.empty(row - first), 0
    for before in range(first, row):
        if _heights_overlap(bottom_m[before], top_m[before], bottom_m[row], top_m[row]):
            beside_s[count] = until_s[before]
            count += 1
    if count < capacity:
        return now_s
    return max(now_s, np.partition(beside_s[:count], count - capacity)[count - capacity])


@kernel((READ_INTS, READ_BOOLS, *[READ_FLOATS] * 4, READ_INTS, READ_FLOATS, FLOAT))
def _serve(
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
    """When each turn begins and ends; by place, the longest wait; by place, how many are inside and the longest queue.

    `start` (places + 1,) are the first rows of each place; columns of robots are (rows,) in the order of service.
    """
    begin_s, end_s, until_s = np.empty(len(arrival_s)), np.empty(len(arrival_s)), np.empty(len(arrival_s))
    longest_s, counts = np.zeros(len(capacity)), np.zeros((2, len(capacity)), np.int64)
    for place in range(len(capacity)):
        first, last = start[place], start[place + 1]
        if first == last:
            continue
        one_height = bottom_m[first:last].max() <= top_m[first:last].min()
        free_s = np.full(min(capacity[place], last - first), now_s)
        for row in range(first, last):
            soonest = np.argmin(free_s)
            free_at_s = free_s[soonest]
            if not one_height:
                free_at_s = _free_beside_s(row, first, len(free_s), until_s, bottom_m, top_m, now_s)
            begin_s[row] = max(free_at_s, arrival_s[row]) if coming[row] else arrival_s[row]
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
