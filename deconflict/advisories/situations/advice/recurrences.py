"""Deadlocks and blockages that come back to a place, and whether they end by themselves there. Pure.

What comes back within `PAUSE_S` has never been away.
"""

from collections import deque
from collections.abc import Collection
from dataclasses import dataclass
from math import hypot
from typing import NamedTuple

from deconflict_client.advisory import AdvisoryState, AnyAdvisory, BlockageAdvisory, ConflictAdvisory, DeadlockAdvisory

WITHIN_S = 600.0
"""Earlier times count if they ended within this time."""
OFTEN = 3
"""From this time on, the present one included, what ended by itself is taken to do so again."""
NEAR_M = 5.0
"""What is nearer is at the same place."""
PAUSE_S = 15.0
BY_ITSELF_S = 30.0
"""What ended sooner each time ended by itself: no person had walked there."""
LONGER_SHARE, LONGER_S = 1.5, 5.0
"""It is taken to end by itself again until it lasts so many times as long, and so many seconds more."""
MOST_TIMES, MOST_PLACES = 9, 1000
"""Earlier times that are remembered of some vendors on a floor; and of how many sets of vendors and floors."""

Party = tuple[str, str, frozenset[str]]
"""A kind of advisory, a datum, and the vendors."""


@dataclass(slots=True)
class _Time:
    """One time that something was there."""

    x_m: float
    y_m: float
    from_s: float
    until_s: float


class Recurrence(NamedTuple):
    """How often something has been there lately."""

    times: int
    """The present time included."""
    longest_s: float
    """The longest of the earlier times."""
    is_short: bool
    """Whether it ended by itself often enough, and may do so again."""


class Recurrences:
    """The deadlocks and blockages of the last minutes, by vendors and place."""

    def __init__(self) -> None:
        self._times: dict[Party, deque[_Time]] = {}
        self._began_s: dict[str, float] = {}
        """By id of each open advisory on what has begun."""

    def take(self, revision: AnyAdvisory) -> None:
        """Remember when it began and ended."""
        if not isinstance(revision, DeadlockAdvisory | BlockageAdvisory):
            return
        now_s = revision.updated_at.timestamp()
        if revision.state is AdvisoryState.CLEARED:
            self._end(revision, self._began_s.pop(revision.id, min(revision.predicted_at.timestamp(), now_s)), now_s)
        elif not revision.time_to_conflict_s:
            self._began_s.setdefault(revision.id, now_s)

    def _end(self, advisory: DeadlockAdvisory | BlockageAdvisory, from_s: float, until_s: float) -> None:
        times = self._times.pop(_party(advisory), deque(maxlen=MOST_TIMES))
        self._times[_party(advisory)] = times
        last = next((time for time in reversed(times) if _is_near(time, advisory)), None)
        if last and from_s - last.until_s < PAUSE_S:
            last.until_s = until_s
        else:
            times.append(_Time(advisory.location.x, advisory.location.y, from_s, until_s))
        if len(self._times) > MOST_PLACES:
            del self._times[next(iter(self._times))]

    def of(self, advisories: Collection[AnyAdvisory], now_s: float) -> dict[str, Recurrence]:
        """Those of some open advisories that recur, by id; a conflict, if all its robots are in one of the others."""
        found = [(advisory, each) for advisory in advisories if (each := self._recurrence(advisory, now_s))]
        recurring = {advisory.id: recurrence for advisory, recurrence in found}
        for other, recurrence in found:
            robots = set(other.robots)
            within = [
                each for each in advisories if isinstance(each, ConflictAdvisory) and robots.issuperset(each.robots)
            ]
            recurring |= dict.fromkeys([conflict.id for conflict in within], recurrence)
        return recurring

    def _recurrence(self, advisory: AnyAdvisory, now_s: float) -> Recurrence | None:
        if not isinstance(advisory, DeadlockAdvisory | BlockageAdvisory):
            return None
        began_s = self._began_s.get(advisory.id, now_s)
        times = [
            time
            for time in self._times.get(_party(advisory), ())
            if _is_near(time, advisory) and now_s - time.until_s < WITHIN_S
        ]
        if times and began_s - times[-1].until_s < PAUSE_S:
            began_s = times.pop().from_s
        if not times:
            return None
        longest_s = max(time.until_s - time.from_s for time in times)
        is_often = len(times) + 1 >= OFTEN
        is_short = is_often and longest_s <= BY_ITSELF_S and now_s - began_s < LONGER_SHARE * longest_s + LONGER_S
        return Recurrence(len(times) + 1, longest_s, is_short)


def _party(advisory: DeadlockAdvisory | BlockageAdvisory) -> Party:
    """The vendors of a ring; of a blockage, that of the robot in the way."""
    vendor_of = dict(zip(advisory.robots, advisory.vendors, strict=True))
    robots = [advisory.blocker] if isinstance(advisory, BlockageAdvisory) else vendor_of
    return advisory.kind, advisory.location.datum, frozenset(vendor_of[robot] for robot in robots)


def _is_near(time: _Time, advisory: DeadlockAdvisory | BlockageAdvisory) -> bool:
    return hypot(time.x_m - advisory.location.x, time.y_m - advisory.location.y) < NEAR_M
