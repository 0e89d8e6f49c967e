"""Which blockages are published, and which are somebody's ordinary work and only counted.

A blockage is published

- if a robot of another vendor than the blocker's waits for it for `least_wait_s` or longer, so far and as expected;
- if a robot of the blocker's own vendor has waited for it for `least_wait_s`, and the blocker has stood for longer than
  `fleet_wait_s` and longer than nine in ten blockages of one fleet last at this place and hour;
- as long as it is found, once it is published.

What needs a person is nobody's ordinary work: from a blocker that is silent, switched off or driven by hand, nothing is
learned, and a robot of any vendor counts as one of another vendor.
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from math import floor

from deconflict.contention.ordinary.ordinary_waits import ENDS_S, count_ordinary_waits
from deconflict.contention.ordinary.usual_durations import UsualDurations
from deconflict.contention.robots.robot_view import RobotView
from deconflict.contention.waiting.blockages import Blockage
from deconflict.contention.waiting.standing_reasons import needs_person
from deconflict.settings.shared_places import ContentionSettings
from ingest.measures.measures import Measures

CELL_M = 4.0
"""Places are square cells with sides of this length."""
MOST_USUAL_S = 600.0
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
        return stood_s > min(self._of_fleet.usual_s(watched.place, now_s), MOST_USUAL_S)

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
