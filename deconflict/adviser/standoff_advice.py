"""Advice that ends standoffs: who yields to whom, and how."""

from collections.abc import Iterable, Iterator
from dataclasses import replace
from math import hypot

from deconflict.adviser.asked import Asked, Following, Option
from deconflict.adviser.request import Request, Verb
from deconflict.adviser.standoffs import Standing, standing
from deconflict.adviser.tracks import Tracks, other_bodies
from deconflict.adviser.ways import wanted_ways
from deconflict.adviser.worth import Worth
from deconflict.contention.robots.robot_table import RobotTable
from ingest.batch import Batch

RING_S = 0.8
"""Robots that have stood for each other for so long rarely move on by themselves."""
STANDS_S = 4.0
"""A robot that has stood in the way for so long stands about as long again."""
MOVED_M = 0.15
"""A robot that is so far from where it was asked has set out."""
PASSED_M = 3.0
"""A robot that is so far from where it was asked has passed the other, or has backed out."""
LATEST_S = 20.0
VERBS: tuple[Verb, ...] = ("go_around", "back_out")


class StandoffAdvice:
    """The requests that end standoffs, and what came of them."""

    def __init__(self, people: Iterable[str] = ()) -> None:
        """`people` are vendors whose participants are people. Nothing is asked of them."""
        self._people = frozenset(people)
        self._open: dict[str, Asked] = {}
        """By robot."""
        self._asked: dict[str, Asked] = {}
        """By id of the request."""
        self._following, self._worth, self._tracks = Following(), Worth(), Tracks()
        self._made = 0
        self._standing = Standing({}, [])

    def receive(self, batch: Batch, robots: RobotTable) -> None:
        """Robots were updated."""
        self._tracks.forget(batch.gone)
        self._tracks.observe(robots, batch.robots)

    def answer(self, request_id: str, answer: str, why: str, robots: RobotTable, now_s: float) -> None:
        """What a robot answered to a request. An unknown id is ignored: the request has ended."""
        asked = self._asked.get(request_id)
        if asked is None or asked.request.robot not in robots:
            return
        asked.answer, request = answer, asked.request
        option = Option(request.robot, request.verb, request.other or "")
        self._following.answer(option, robots[request.robot].vendor, answer, why, now_s)

    def step(self, robots: RobotTable, now_s: float) -> list[Request]:
        """Requests that are new, or withdrawn."""
        self._standing = standing(robots, now_s)
        changed = [withdrawn for robot in list(self._open) if (withdrawn := self._reviewed(robot, robots, now_s))]
        for ring in self._standing.rings:
            changed += self._for_ring(ring, robots, now_s)
        for waiting in self._standing.waiting.values():
            is_in_ring = waiting.robot in self._standing.in_rings
            if not is_in_ring and now_s - waiting.both_since_s >= STANDS_S:
                changed += self._ask_best("stander", [Option(waiting.robot, "go_around", waiting.other)], robots, now_s)
        return changed

    def _reviewed(self, robot: str, robots: RobotTable, now_s: float) -> Request | None:
        """Update what came of an open request. Returns it if it is withdrawn."""
        asked = self._open[robot]
        if robot not in robots or now_s >= asked.request.latest_s:
            del self._open[robot]
            return None
        x_m, y_m, _ = robots.reported_pose(robot)
        moved_m = hypot(x_m - asked.from_m[0], y_m - asked.from_m[1])
        if asked.begun_s is None and moved_m > MOVED_M and asked.answer != "declined":
            asked.begun_s = now_s
            self._following.follow(robot)
        if asked.begun_s is not None:
            self._follow_up(asked, moved_m, robots, now_s)
            return None
        is_late = now_s - asked.asked_s >= (self._following.waits_s() if not asked.answer else 2 * LATEST_S)
        if asked.answer == "declined" or is_late or robot not in self._standing.waiting:
            del self._open[robot]
            return replace(asked.request, withdrawn=True)
        return None

    def _follow_up(self, asked: Asked, moved_m: float, robots: RobotTable, now_s: float) -> None:
        """End a request that is done, or whose robot stands for somebody again."""
        request, takes_s = asked.request, now_s - asked.asked_s
        is_done = moved_m >= PASSED_M or asked.answer == "done"
        if is_done and request.other in robots:
            vendors = robots[request.robot].vendor, robots[request.other].vendor
            self._worth.add_yield(request.verb, *vendors, takes_s)
        if is_done or (takes_s >= STANDS_S and request.robot in self._standing.waiting):
            del self._open[request.robot]

    def _for_ring(self, ring: tuple[str, ...], robots: RobotTable, now_s: float) -> Iterator[Request]:
        waiting = [self._standing.waiting[robot] for robot in ring]
        if now_s - max(each.since_s for each in waiting) >= RING_S and not self._open.keys() & set(ring):
            options = [Option(each.robot, verb, each.other) for each in waiting for verb in VERBS]
            yield from self._ask_best("ring", options, robots, now_s)

    def _ask_best(self, kind: str, options: list[Option], robots: RobotTable, now_s: float) -> Iterator[Request]:
        """Ask for the option that saves most, if any saves something."""
        found = []
        for option in options:
            vendor, other = robots[option.robot].vendor, robots[option.other].vendor
            is_asked = option.robot in self._open or option.other in self._open
            if vendor == other or vendor in self._people or is_asked:
                continue
            if self._following.may_be_asked(option, vendor, now_s):
                behind = self._standing.behind(option.robot), self._standing.behind(option.other)
                saving_s = self._worth.saving_s(kind, option.verb, *behind) * self._following.likely(option.robot)
                is_fair = not self._worth.yields_too_much(vendor, other)
                found.append((is_fair, saving_s, -self._following.asked_s(option.robot), option))
        for _, saving_s, _, option in sorted(found, reverse=True):
            if saving_s > 0 and (request := self._request(option, robots, now_s)):
                yield request
                return

    def _request(self, option: Option, robots: RobotTable, now_s: float) -> Request | None:
        """Ask for an option. None if there is no place for it."""
        at = self._refuge_m(option, robots) if option.verb == "back_out" else None
        if option.verb == "back_out" and at is None:
            return None
        self._made += 1
        latest_s = now_s + (LATEST_S if option.verb == "go_around" else 2 * LATEST_S)
        request = Request(str(self._made), *option[:2], at, option.other, (option.other,), latest_s)
        x_m, y_m, _ = robots.reported_pose(option.robot)
        self._open[option.robot] = self._asked[request.id] = Asked(request, now_s, (x_m, y_m))
        self._following.ask(option.robot, now_s)
        return request

    def _refuge_m(self, option: Option, robots: RobotTable) -> tuple[float, float] | None:
        passing = wanted_ways(robots, robots.slots_of([option.other]))
        return self._tracks.refuge_m(robots, option.robot, passing, other_bodies(robots, option[::2]))
