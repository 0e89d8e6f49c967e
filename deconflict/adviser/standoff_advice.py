"""Advice that ends standoffs: one of the robots goes around the other."""

from collections.abc import Iterator
from math import hypot

from deconflict.adviser.asked import BEGINS_WITHIN_S, MOVED_M, Asked, Following
from deconflict.adviser.request import Request
from deconflict.adviser.standoffs import Standing, Waiting, standing
from deconflict.contention.robots.robot_table import RobotTable

RING_S = 0.8
"""Robots that have stood for each other for so long rarely move on by themselves."""
STANDS_S = 4.0
"""A robot that has stood in the way for so long stands about as long again."""
LATEST_S = 20.0
PAUSE_S = 4.0


class StandoffAdvice:
    """The requests that end standoffs, and what came of them."""

    def __init__(self) -> None:
        self._open: dict[str, Asked] = {}
        """By robot."""
        self._by_id: dict[str, Asked] = {}
        self._following: dict[str, Following] = {}
        self._made = 0
        self.standing = Standing({}, [])
        self.note = {}

    def answer(self, request_id: str, answer: str, why: str) -> None:
        asked = self._by_id.get(request_id)
        if asked is None:
            return
        asked.answer, asked.why = answer, why
        following = self._follows(asked.request.robot)
        if answer == "declined":
            following.declined_s[asked.request.verb, asked.request.other] = asked.asked_s

    def step(self, robots: RobotTable, now_s: float) -> list[Request]:
        """Requests that are new, or withdrawn."""
        self.standing = standing(robots, now_s)
        changed = list(self._reviewed(robots, now_s))
        for ring in self.standing.rings:
            changed += self._for_ring(ring, robots, now_s)
        for waiting in self.standing.waiting.values():
            changed += self._for_stander(waiting, robots, now_s)
        return changed

    def _follows(self, robot: str) -> Following:
        return self._following.setdefault(robot, Following())

    def _reviewed(self, robots: RobotTable, now_s: float) -> Iterator[Request]:
        """Update the open requests. Yields those that are withdrawn."""
        for robot, asked in list(self._open.items()):
            if robot not in robots or now_s >= asked.request.latest_s or asked.answer == "done":
                self._end(robot)
                continue
            if asked.begun_s is None:
                view = robots[robot]
                if hypot(view.x_m - asked.from_m[0], view.y_m - asked.from_m[1]) > MOVED_M and robot not in self.standing.waiting:
                    asked.begun_s = now_s
                    self._follows(robot).followed += 1
                elif asked.answer == "declined" or now_s - asked.asked_s >= BEGINS_WITHIN_S:
                    yield self._withdrawn(robot)
            elif robot not in self.standing.waiting and now_s - asked.begun_s > PAUSE_S:
                self._end(robot)
            elif robot in self.standing.waiting and now_s-asked.begun_s>2:
                self._end(robot)

    def _withdrawn(self, robot: str) -> Request:
        request = self._end(robot).request
        return Request(request.id, request.robot, request.verb, request.at, request.other, request.until, request.latest_s, True)

    def _end(self, robot: str) -> Asked:
        asked = self._open.pop(robot)
        asked.ended = True
        return asked

    def _for_ring(self, ring: tuple[str, ...], robots: RobotTable, now_s: float) -> Iterator[Request]:
        waiting = [self.standing.waiting[robot] for robot in ring]
        if len({robots[robot].vendor for robot in ring}) == 1:
            return
        if now_s - max(each.since_s for each in waiting) < RING_S or self._open.keys() & set(ring):
            return
        able = [each for each in waiting if robots[each.robot].vendor != robots[each.other].vendor]
        if able:
            yield self._ask(min(able, key=lambda each: (-self._follows(each.robot).likely, each.since_s)), robots, now_s)
            self.note['ring'] = self.note.get('ring',0)+1

    def _for_stander(self, waiting: Waiting, robots: RobotTable, now_s: float) -> Iterator[Request]:
        both = {waiting.robot, waiting.other}
        if robots[waiting.robot].vendor == robots[waiting.other].vendor or self._open.keys() & both:
            return
        if now_s - waiting.both_since_s >= STANDS_S:
            self.note['stander'] = self.note.get('stander',0)+1
            yield self._ask(waiting, robots, now_s)

    def _ask(self, waiting: Waiting, robots: RobotTable, now_s: float) -> Request:
        self._made += 1
        request = Request(
            str(self._made), waiting.robot, "go_around", None, waiting.other, (waiting.other,), now_s + LATEST_S
        )
        view = robots[waiting.robot]
        asked = Asked(request, now_s, (view.x_m, view.y_m))
        self._open[waiting.robot] = self._by_id[request.id] = asked
        self._follows(waiting.robot).asked += 1
        return request
