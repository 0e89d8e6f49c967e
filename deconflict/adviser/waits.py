"""Requests to wait before a stretch that another robot comes out of, where the two could not pass each other."""

from collections.abc import Callable, Collection
from dataclasses import dataclass, replace

import numpy as np

from deconflict.adviser.asked import Following, Option
from deconflict.adviser.oncoming import REACH_M, Oncoming, oncoming
from deconflict.adviser.request import Request
from deconflict.adviser.standoffs import HEARD_WITHIN_S, Standing
from deconflict.adviser.ways import before_m
from deconflict.contention.robots.lookahead import STEP_S, STEPS
from deconflict.contention.robots.robot_table import RobotTable
from ingest.batch import Floats

AHEAD_M = 8.0
"""A robot is asked to wait when the place is no farther ahead."""
WAITS_S = 30.0
ROOM_TO_PASS = 0.5
"""Where robots more likely than this can go around each other, nobody waits."""
PAUSE_S = 10.0
"""A robot that has declined, or has waited, is not asked again for so long because of the same robot."""
LEAVES_M = 1.5
"""A robot whose body and way are no nearer to a stretch has left it."""
GONE_S = 3.0
"""So long after that, a robot that has not said that it is done is told that it need not wait."""
NewRequest = Callable[[Option, tuple[float, float] | None, tuple[str, ...], float], Request]


@dataclass(slots=True)
class _Wait:
    request: Request
    line_m: Floats
    there_s: float
    """When the other was last seen on the line, or on its way there."""


class Waits:
    """Who is asked to wait before a stretch."""

    def __init__(self, following: Following, new: NewRequest, people: Collection[str]) -> None:
        self._following, self._new, self._people = following, new, people
        self._open: dict[str, _Wait] = {}
        """By robot."""
        self._paused_s: dict[tuple[str, str], float] = {}
        """By a robot and the one for which it was asked to wait: until when it is not asked again."""

    def __contains__(self, robot: str) -> bool:
        return robot in self._open

    def answer(self, request_id: str, answer: str, now_s: float) -> None:
        for robot, wait in list(self._open.items()):
            if wait.request.id == request_id and answer != "accepted":
                self._end(robot, now_s)

    def step(self, robots: RobotTable, standing: Standing, busy: Collection[str], now_s: float) -> list[Request]:
        """Requests that are new, or withdrawn. Robots that are `busy` are not asked."""
        changed = self._review(robots, standing, now_s)
        records = robots.records
        heard = records["known"] & (records["floor"] >= 0) & (now_s - records["event_s"] <= HEARD_WITHIN_S)
        for pair in sorted(oncoming(robots, np.flatnonzero(heard)), key=lambda each: each.away_m):
            if not self._chosen(pair, robots, standing, busy, now_s):
                continue
            numbers = robots.column({pair.waits: 1, pair.first: 2})
            slot, other = (int(np.flatnonzero(numbers == number)[0]) for number in (1, 2))
            at = before_m(robots, slot, other, REACH_M, STEPS * STEP_S)
            if at is not None:
                option = Option(pair.waits, "wait_before", pair.first)
                request = self._new(option, at, (pair.first,), now_s + WAITS_S)
                self._open[pair.waits] = _Wait(request, pair.line_m, now_s)
                changed.append(request)
        return changed

    def _chosen(
        self, pair: Oncoming, robots: RobotTable, standing: Standing, busy: Collection[str], now_s: float
    ) -> bool:
        if pair.waits in busy or pair.waits in self._open or pair.away_m > AHEAD_M:
            return False
        if robots[pair.waits].vendor in self._people or now_s < self._paused_s.get((pair.waits, pair.first), 0.0):
            return False
        if self._following.possible("go_around", pair.before_m) > ROOM_TO_PASS:
            return False
        return not self._waits_for(pair.first, pair.waits, standing)

    def _waits_for(self, robot: str, last: str, standing: Standing) -> bool:
        """Whether a robot waits for another, or for one that waits for it."""
        seen: set[str] = set()
        while robot not in seen:
            seen.add(robot)
            wait, stands = self._open.get(robot), standing.waiting.get(robot)
            robot = wait.request.until[0] if wait else stands.other if stands else robot
        return last in seen

    def _review(self, robots: RobotTable, standing: Standing, now_s: float) -> list[Request]:
        """End waits. Returns those that are withdrawn: the other has left, or stands for the one that waits."""
        found = []
        for robot, wait in list(self._open.items()):
            first = wait.request.until[0]
            if robot not in robots or now_s >= wait.request.latest_s:
                self._end(robot, now_s)
                continue
            if first in robots and _is_on(robots, first, wait.line_m):
                wait.there_s = now_s
            stands = standing.waiting.get(first)
            if now_s - wait.there_s >= GONE_S or (stands and stands.other == robot):
                self._end(robot, now_s)
                found.append(replace(wait.request, withdrawn=True))
        return found

    def _end(self, robot: str, now_s: float) -> None:
        request = self._open.pop(robot).request
        self._paused_s = {pair: until_s for pair, until_s in self._paused_s.items() if until_s > now_s}
        self._paused_s[robot, request.until[0]] = now_s + PAUSE_S


def _is_on(robots: RobotTable, robot: str, line_m: Floats) -> bool:
    """Whether a robot or its way is near a line (k, 2)."""
    slots = np.flatnonzero(robots.column({robot: 1}))
    points_m = np.concatenate([[robots.reported_pose(robot)[:2]], robots.ways_m(slots)[0]])
    away_m = np.hypot(*np.moveaxis(points_m[:, None] - line_m, -1, 0))
    return bool((away_m < LEAVES_M).any())
