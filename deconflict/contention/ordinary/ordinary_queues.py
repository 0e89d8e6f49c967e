"""Which queues of one vendor's robots are its ordinary work, and only counted.

A queue is ordinary if all robots at its place and all that wait for it are of one vendor, and none waits longer than
`fleet_wait_s`, or than nine in ten such waits last at this place and hour. Once published, it is published as long as a
robot waits long.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from deconflict.contention.ordinary.ordinary_waits import ENDS_S, count_ordinary_waits
from deconflict.contention.ordinary.usual_durations import UsualDurations
from deconflict.contention.queues.queue_forecast import QueueForecast
from deconflict.contention.robots.robot_view import RobotView
from ingest.measures.measures import Measures

MOST_USUAL_S = 1800.0
"""A longer wait is never usual."""
NEAR_S = 5.0
"""A robot that stands although it could be there within this time waits for the place."""


@dataclass(slots=True)
class _QueueWait:
    """A robot that waits for a place."""

    since_s: float
    seen_s: float
    is_of_fleet: bool
    """Whether all robots of the queue were of one vendor so far."""
    is_published: bool = False


class OrdinaryQueues:
    """Every robot that waits for a place, and how long robots usually wait there."""

    def __init__(self, fleet_wait_s: float, measures: Measures) -> None:
        self._fleet_wait_s, self._measures = fleet_wait_s, measures
        self._waits: dict[tuple[str, str], _QueueWait] = {}
        """By place and robot."""
        self.usual_durations = UsualDurations(fleet_wait_s)
        """How long waits in queues of one fleet last."""
        count_ordinary_waits(measures, "contention")

    def is_ordinary(self, place: str, queue: QueueForecast, robots: Mapping[str, RobotView], now_s: float) -> bool:
        """Whether a queue needs no advisory, however long it is."""
        if not _is_of_fleet(queue, robots):
            return False
        usual_s = min(self.usual_durations.usual_s(place, now_s), MOST_USUAL_S)
        return queue.longest_wait_s <= max(self._fleet_wait_s, usual_s)

    def add_look(
        self,
        queues: Mapping[str, QueueForecast],
        published: Iterable[str],
        robots: Mapping[str, RobotView],
        now_s: float,
    ) -> None:
        """Add who waits now, and learn from waits that have ended. `published` are places with an advisory."""
        published = set(published)
        for place, queue in queues.items():
            waiting = [entry.robot for entry in queue.waiting if entry.arrival_s <= now_s + NEAR_S]
            is_of_fleet = bool(waiting) and _is_of_fleet(queue, robots)
            for robot in waiting:
                if robots[robot].stands:
                    wait = self._waits.setdefault((place, robot), _QueueWait(now_s, now_s, is_of_fleet))
                    wait.seen_s, wait.is_of_fleet = now_s, wait.is_of_fleet and is_of_fleet
                    wait.is_published |= place in published
        for key in [key for key, wait in self._waits.items() if now_s - wait.seen_s > ENDS_S]:
            self._end(key[0], self._waits.pop(key))

    def _end(self, place: str, wait: _QueueWait) -> None:
        """Learn from a wait that has ended; count it if it was not published."""
        lasted_s = wait.seen_s - wait.since_s
        if wait.is_of_fleet:
            self.usual_durations.add(place, lasted_s, wait.seen_s)
        if not wait.is_published and lasted_s > 0:
            count_ordinary_waits(self._measures, "contention", [lasted_s])


def _is_of_fleet(queue: QueueForecast, robots: Mapping[str, RobotView]) -> bool:
    """Whether all robots of a queue are of one vendor."""
    turns = (*queue.entries[: queue.inside], *queue.waiting)
    return len({robots[entry.robot].vendor for entry in turns}) == 1
