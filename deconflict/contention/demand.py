"""Demand for one resource, or for a group of like ones, served in the order of arrival: who waits, and how long."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from heapq import heapify, heappop, heappush

CHANGEOVER_S = 4.0
"""From when a robot sets out from a resource, or is out of a lane, until the next one can be there."""


@dataclass(frozen=True, slots=True)
class Request:
    """One robot that has a resource or will want it. Times are seconds since the epoch."""

    robot: str
    vendor: str
    arrival_s: float
    """When it comes; of one inside, when it came."""
    arrival_spread_s: float
    """Half the width of the middle 80 % of when it may come."""
    service_s: float
    """How long it keeps the resource; of one inside, how much longer from now on."""
    priority: float = 1.0
    """What a second of its waiting counts."""
    inside: bool = False
    """It has the resource already, and keeps it until its service ends."""


@dataclass(frozen=True, slots=True)
class Turn:
    """One robot's turn at a resource."""

    request: Request
    start_s: float
    end_s: float

    @property
    def wait_s(self) -> float:
        return 0.0 if self.request.inside else max(self.start_s - self.request.arrival_s, 0.0)


def first_come(requests: Iterable[Request], capacity: int, now_s: float, changeover_s: float = 0.0) -> list[Turn]:
    """Turns in the order served: those inside first, then by arrival, the robot's UUID settling ties.

    Those inside beyond the capacity keep their turns; nobody else begins until fewer than `capacity` are left, nor
    within `changeover_s` of the turn before.
    """
    ordered = sorted(requests, key=lambda one: (not one.inside, one.arrival_s, one.robot))
    turns = [Turn(one, one.arrival_s, now_s + one.service_s) for one in ordered if one.inside]
    ends = [turn.end_s + changeover_s for turn in turns]
    ends += [now_s] * (capacity - len(ends))
    heapify(ends)
    while len(ends) > capacity:
        heappop(ends)
    for one in ordered[len(turns) :]:
        start_s = max(heappop(ends), one.arrival_s)
        turns.append(Turn(one, start_s, start_s + one.service_s))
        heappush(ends, start_s + one.service_s + changeover_s)
    return turns


def longest_queue(turns: Sequence[Turn]) -> int:
    """The most robots that wait at one time."""
    waits = [(turn.request.arrival_s, turn.start_s) for turn in turns if turn.wait_s > 0]
    return max((sum(start <= arrival < end for start, end in waits) for arrival, _ in waits), default=0)


def free_at_s(turns: Sequence[Turn], capacity: int, now_s: float) -> float:
    """When a robot that came now, behind all that are inside, would find a place free."""
    ends = sorted((turn.end_s for turn in turns if turn.request.inside), reverse=True)
    return max(ends[capacity - 1], now_s) if len(ends) >= capacity else now_s
