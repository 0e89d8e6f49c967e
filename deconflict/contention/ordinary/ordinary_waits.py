"""Which blockages and queues are published, and which are somebody's ordinary work and only counted.

A blockage is published

- if a robot of another vendor than the blocker's waits for it for `least_wait_s` or longer, so far and as expected;
- if a robot of the blocker's own vendor has waited for it for `least_wait_s`, and the blocker has stood for longer than
  `fleet_wait_s` and longer than nine in ten blockages of one fleet last at this place and hour;
- as long as it is found, once it is published.

What needs a person is nobody's ordinary work: from a blocker that is silent, switched off or driven by hand, nothing is
learned, and a robot of any vendor counts as one of another vendor.

A queue is ordinary if all robots at its place and all that wait for it are of one vendor, and none waits longer than
`fleet_wait_s`, or than nine in ten such waits last at this place and hour. Once published, it is published as long as a
robot waits long.
"""

from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass, field, replace
from math import floor
from typing import Literal

from deconflict.contention.ordinary.usual_durations import UsualDurations
from deconflict.contention.queues.queue_forecast import QueueForecast
from deconflict.contention.robots.robot_view import RobotView
from deconflict.contention.waiting.blockages import Blockage
from deconflict.contention.waiting.standing_reasons import needs_person
from deconflict.settings.shared_places import ContentionSettings
from ingest.measures.measures import Measures

ENDS_S = 3.0
"""What was not found for this long has ended."""


def count_ordinary_waits(
    measures: Measures, kind: Literal["blockage", "contention"], waited_s: Collection[float] = ()
) -> None:
    """Count waits by the kind of advisory that they would have had. Without waits, the metrics appear with 0."""
    measures.count("deconflict_ordinary_waits_total", kind, by=len(waited_s))
    measures.count("deconflict_ordinary_wait_seconds_total", kind, by=sum(waited_s))


CELL_M = 4.0
"""Places are square cells with sides of this length."""
MOST_USUAL_BLOCKAGE_S = 600.0
"""A robot that has stood longer than this in the way is never usual."""
THERE_S = 0.5
"""A robot that is there within this time waits."""


@dataclass(slots=True)
class _WatchedBlockage:
    """What is remembered of a blockage until it has ended."""

    place: str
    since_s: float
    found_s: float
    """When it was found last."""
    is_of_fleet: bool = True
    """Whether it has held up no robot of another vendor."""
    is_ordinary: bool = True
    """Whether it needs no person."""
    is_published: bool = False
    waits: dict[str, tuple[float, float]] = field(default_factory=dict)
    """From when until when each robot has waited for it."""

    def add_waits(self, blocked: Blockage, now_s: float) -> None:
        """Add the robots that have come to the blocker. One that creeps behind it waits, too."""
        for robot, from_s in zip(blocked.holds_up, blocked.from_s, strict=True):
            if from_s < now_s + THERE_S:
                began_s = self.waits[robot][0] if robot in self.waits else min(from_s, now_s)
                self.waits[robot] = (began_s, now_s)

    def with_waits_so_far(self, blocked: Blockage) -> Blockage:
        """What a look has found, with the waits that earlier looks have seen begin."""
        waits = zip(blocked.holds_up, blocked.from_s, strict=True)
        from_s = tuple(min(at_s, self.waits.get(robot, (at_s, at_s))[0]) for robot, at_s in waits)
        return replace(blocked, from_s=from_s)


class OrdinaryBlockages:
    """Every blockage that was found lately, and how long blockages usually last."""

    def __init__(self, settings: ContentionSettings, quiet_after_s: float, measures: Measures) -> None:
        self._settings, self._quiet_after_s, self._measures = settings, quiet_after_s, measures
        self._of_fleet = UsualDurations(settings.fleet_wait_s)
        self._of_vendors = UsualDurations(settings.fleet_wait_s)
        """How long blockages last that hold up robots of the blocker's vendor alone, and robots of another one."""
        self._watched: dict[str, _WatchedBlockage] = {}
        """By blocker."""
        count_ordinary_waits(measures, "blockage")

    @property
    def usual_durations(self) -> dict[str, UsualDurations]:
        """By name, what is learned."""
        return {"blockages_of_fleet": self._of_fleet, "blockages_of_vendors": self._of_vendors}

    def publishable(
        self,
        found: Iterable[Blockage],
        robots: Mapping[str, RobotView],
        is_published: Callable[[str], bool],
        now_s: float,
    ) -> list[Blockage]:
        """Those of a look that should be published. `is_published` says it of a blocker's blockage."""
        kept = []
        for blocked in found:
            watched = self._watch(blocked, robots, now_s)
            if is_published(blocked.blocker) or self._is_unusual(blocked, watched, robots, now_s):
                watched.is_published = True
                kept.append(blocked)
        self._forget_ended(now_s)
        return kept

    def left_s(self, blocked: Blockage, robots: Mapping[str, RobotView], now_s: float) -> float:
        """How much longer the blocker is expected to stand."""
        durations = self._of_vendors if _others_wait_from_s(blocked, robots) else self._of_fleet
        return durations.left_s(_cell(robots[blocked.blocker]), now_s - blocked.since_s, now_s)

    def _is_unusual(
        self, blocked: Blockage, watched: _WatchedBlockage, robots: Mapping[str, RobotView], now_s: float
    ) -> bool:
        stood_s, settings = now_s - blocked.since_s, self._settings
        if stood_s < settings.stand_s:
            return False
        blocked = watched.with_waits_so_far(blocked)
        others_from_s = _others_wait_from_s(blocked, robots) if watched.is_ordinary else list(blocked.from_s)
        if others_from_s:
            until_s = now_s + self.left_s(blocked, robots, now_s)
            if until_s - min(others_from_s) >= settings.least_wait_s:
                return True
        if stood_s < settings.fleet_wait_s or now_s - min(blocked.from_s) < settings.least_wait_s:
            return False
        return stood_s > min(self._of_fleet.usual_s(watched.place, now_s), MOST_USUAL_BLOCKAGE_S)

    def _watch(self, blocked: Blockage, robots: Mapping[str, RobotView], now_s: float) -> _WatchedBlockage:
        """Remember what a look has found."""
        blocker = robots[blocked.blocker]
        watched = self._watched.get(blocked.blocker)
        if watched is None or watched.since_s != blocked.since_s:
            if watched:
                self._end(watched)
            watched = self._watched[blocked.blocker] = _WatchedBlockage(_cell(blocker), blocked.since_s, now_s)
        watched.found_s = now_s
        watched.is_of_fleet &= not _others_wait_from_s(blocked, robots)
        watched.is_ordinary = not needs_person(blocker, self._quiet_after_s, now_s)
        watched.add_waits(blocked, now_s)
        return watched

    def _forget_ended(self, now_s: float) -> None:
        for blocker in [uuid for uuid, watched in self._watched.items() if now_s - watched.found_s > ENDS_S]:
            self._end(self._watched.pop(blocker))

    def _end(self, watched: _WatchedBlockage) -> None:
        """Learn from a blockage that has ended; count it if it was not published."""
        if watched.is_ordinary:
            durations = self._of_fleet if watched.is_of_fleet else self._of_vendors
            durations.add(watched.place, watched.found_s - watched.since_s, watched.found_s)
        if not watched.is_published:
            waited_s = [to_s - from_s for from_s, to_s in watched.waits.values()]
            count_ordinary_waits(self._measures, "blockage", waited_s)


def _others_wait_from_s(blocked: Blockage, robots: Mapping[str, RobotView]) -> list[float]:
    """Since when robots of other vendors than the blocker's wait, or from when they will."""
    vendor = robots[blocked.blocker].vendor
    waits = zip(blocked.holds_up, blocked.from_s, strict=True)
    return [from_s for robot, from_s in waits if robots[robot].vendor != vendor]


def _cell(robot: RobotView) -> str:
    """The place where a robot stands."""
    return f"{robot.datum} {floor(robot.x_m / CELL_M)} {floor(robot.y_m / CELL_M)}"


MOST_USUAL_WAIT_S = 1800.0
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
        usual_s = min(self.usual_durations.usual_s(place, now_s), MOST_USUAL_WAIT_S)
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
