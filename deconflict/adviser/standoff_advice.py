"""Advice that ends standoffs: who yields to whom, and how."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from itertools import count
from math import dist, hypot, pi, remainder

from deconflict.adviser.asked import Asked, Following, Option, Request, Verb
from deconflict.adviser.ground.goals import Goals
from deconflict.adviser.standoffs import Standing, Waiting, standing
from deconflict.adviser.ways import WAITING
from deconflict.adviser.worth import ExpectedSaving, Worth
from deconflict.contention.robots.robot_table import RobotTable
from deconflict.contention.waiting.free_crossings import Crossing
from deconflict.runtime.learned_state import Learner
from deconflict.settings.site import Site
from deconflict.sweep.pair_choice import NO_CROWDS
from deconflict_client.advisory.robot_advice import YIELDED
from ingest.batch import Batch
from ingest.measures.measures import Measures

STANDS_S = 4.0
"""A robot that has stood in the way for so long stands about as long again."""
LONG_S = 12.0
"""A robot that has stood in the way for so long is left by another way, or backwards."""
RELIEF_S = 4.0
"""After this time those are asked that stand behind robots that stand for each other, if these can do nothing."""
OWN_STANDS_S = 8.0
"""Robots of one vendor that have stood for each other for so long are not sorted out by their vendor."""
BEGINS_S = 5.0
"""A robot that has agreed has set out by then. Else another is asked."""
MOVED_M = 0.15
"""A robot that is so far from where it was asked has set out."""
TURNED_RAD = 0.2
"""The same for a robot that has turned so far."""
ROLLS_S = 1.0
"""A robot that still rolls when it is asked comes to rest within its speed times this."""
PASSED_M = 3.0
"""A robot that is so far from where it was asked has passed the other, or has backed out."""
FAR_M = 1.0
"""A robot that stands again before it has come so far did not get round the other, which is asked next."""
LATEST_S = 20.0
"""How long a request is open; twice as long for robots that make room and wait."""
MAKING_ROOM: tuple[Verb, ...] = ("step_aside", "back_out")
VERBS: tuple[Verb, ...] = ("go_around", "go_first", "step_aside", "other_way", "back_out")
"""Those that are asked of a robot that yields, or goes first; the cheapest first."""
RING_VERBS: tuple[Verb, ...] = ("go_around", "step_aside", "other_way", "back_out")
LEAVING: tuple[Verb, ...] = ("go_around", "other_way", "back_out")
"""What a robot can do that stands behind one which only stands in its way; that one can step aside."""
MAY_MOVE = frozenset(("idle", "navigating", WAITING))
"""States in which a robot that stands in the way is held by nothing else that it reports."""
ARRIVED_M = 0.5
"""A robot that is so near to the place has stepped aside."""
LIKELY = 0.3
"""What robots do less likely is asked last."""
PROBABLE = 0.85
"""Where robots have shown that they can go around each other so probably, they are asked before they stand."""
AWAY: tuple[Verb, ...] = ("other_way", "back_out")
"""These are asked of the robot with fewest behind it, then of the one that was not asked for longest: the same robot
asked again and again would never arrive. Of the others the robot yields that came last."""


class StandoffAdvice:
    """The requests that end standoffs, and what came of them."""

    def __init__(
        self,
        site: Site,
        measures: Measures,
        numbers: Iterator[int] | None = None,
        crowds: Mapping[str, int] = NO_CROWDS,
    ) -> None:
        """`site` says what vendors can do, and onto which ground nobody is sent. `numbers` are ids to give. `crowds`
        has the robots that are in a crowd at each look."""
        self._measures, self._numbers = measures, count(1) if numbers is None else numbers
        self._crowds = crowds
        self._open: dict[str, Asked] = {}
        """By robot."""
        self.asked: dict[str, Asked] = {}
        """The open requests, by id. What a robot waits for has the ids of both."""
        self._following = Following(
            {vendor.name: vendor.verbs for vendor in site.vendors if "verbs" in vendor.model_fields_set}
        )
        self._goals = Goals(site)
        self._worth = Worth()
        self._waiting: dict[str, str] = {}
        """By robot that is asked to wait, the robot that goes first."""
        self.standing = Standing({}, [])
        """Who stands for whom, by the last step."""

    @property
    def learners(self) -> dict[str, Learner]:
        """What is worth keeping over a restart: how long standoffs and requests last, who yielded, who follows, and
        where bodies were."""
        return {"standoffs": self._worth, "requests": self._following, "ground": self._goals.seen}

    @property
    def crossings(self) -> list[Crossing]:
        """Where robots stand for each other before a free crossing, with the robot that has agreed to go first."""
        agreed = {uuid for uuid, asked in self._open.items() if asked.request.verb == "go_first" and asked.is_agreed}
        return [
            replace(crossing, goes_first=next((uuid for uuid in crossing.robots if uuid in agreed), None))
            for crossing in self.standing.crossings
        ]

    def receive(self, batch: Batch, robots: RobotTable) -> None:
        """Robots were updated."""
        self._goals.forget([*batch.gone, *(uuid for uuid in batch.robots if uuid in self._crowds)])
        self._following.forget(batch.gone)
        self._goals.receive(robots, (uuid for uuid in batch.robots if uuid in robots and uuid not in self._crowds))

    def answer(self, request_id: str, answer: str, why: str, robots: RobotTable, now_s: float) -> None:
        """What a robot answered to a request.

        Ignored are an unknown id, because the request has ended, and a second answer that is not "done". If a robot
        declines to wait, the other is not to go first either.
        """
        asked = self.asked.get(request_id)
        if asked is None or asked.request.robot not in robots:
            return
        if asked.request.id != request_id:
            asked.answer = "declined" if answer == "declined" else asked.answer
        elif not asked.answer or answer == "done":
            asked.answer = answer
            self._following.answer(asked, robots[asked.request.robot].vendor, answer, why, now_s)

    def end_all(self) -> list[Request]:
        """End all requests. Returns them as withdrawn."""
        return [request for asked in list(self._open.values()) for request in self._end(asked, asked.request)]

    def step(self, robots: RobotTable, now_s: float) -> list[Request]:
        """Requests that are new, or withdrawn."""
        self.standing = standing(robots, now_s, self._following.usually(RING_VERBS[0]) >= PROBABLE, self._crowds)
        self._observe_standing(now_s)
        self._goals.begin_step()
        changed = [request for asked in list(self._open.values()) for request in self._reviewed(asked, robots, now_s)]
        rings = sorted(self.standing.rings, key=self._goals.turn)
        standers = [each for each in self.standing.waiting.values() if each.robot not in self.standing.in_rings]
        for is_later in (False, True):
            for ring in rings:
                if self._goals.come_later(ring) is is_later:
                    changed += self._for_ring(ring, robots, now_s)
            for stander in standers:
                if self._goals.come_later((stander.robot,)) is is_later:
                    changed += self._for_stander(stander, robots, now_s)
        for crossing in self.standing.crossings:
            changed += self._for_crossing(crossing, robots, now_s)
        return changed

    def _observe_standing(self, now_s: float) -> None:
        """Learn how long robots stand for each other if nobody follows advice, once they have stood for long."""
        open_requests = (asked.request for asked in self._open.values() if asked.answer != "declined")
        followed = {uuid for request in open_requests for uuid in (request.robot, request.other) if uuid}
        standing = self.standing
        since_s = {
            "ring": {
                frozenset(ring): max(standing.waiting[robot].since_s for robot in ring) for ring in standing.rings
            },
            "stander": {
                frozenset((each.robot, each.other)): each.both_since_s
                for each in standing.waiting.values()
                if each.robot not in standing.in_rings
            },
            "crossing": {frozenset(crossing.robots): crossing.since_s for crossing in standing.crossings},
        }
        for kind, groups in since_s.items():
            long = {group for group, begun_s in groups.items() if begun_s <= now_s - STANDS_S}
            self._worth.observe(kind, long, followed, now_s)

    def _reviewed(self, asked: Asked, robots: RobotTable, now_s: float) -> Iterator[Request]:
        """Update what came of an open request. Yields what is withdrawn."""
        robot = asked.request.robot
        if robot in self._crowds:
            yield from self._end(asked, asked.request)
            return
        if robot not in robots or now_s >= asked.request.latest_s:
            ended = self._end(asked)
            yield from ended if now_s < asked.request.latest_s else ()
            return
        x_m, y_m, yaw_rad = robots.reported_pose(robot)
        moved_m = hypot(x_m - asked.from_m[0], y_m - asked.from_m[1])
        has_turned = abs(remainder(yaw_rad - asked.from_rad, 2 * pi)) > TURNED_RAD
        has_moved = moved_m > MOVED_M + asked.rolls_m
        if asked.begun_s is None and asked.answer != "declined" and (has_moved or has_turned):
            asked.begun_s = now_s
            self._following.follow(robot)
        if asked.begun_s is not None or asked.answer == "done":
            yield from self._follow_up(asked, moved_m, robots, now_s)
            return
        is_late = now_s - asked.asked_s >= (BEGINS_S if asked.answer else self._following.waits_s())
        is_in_way = asked.request.verb == "step_aside" and self.standing.behind(robot) > 0
        stands = asked.request.verb == "go_first" or is_in_way or robot in self.standing.waiting
        is_over = is_late and stands if asked.answer else is_late or not stands
        if asked.answer == "declined" or is_over:
            yield from self._end(asked, asked.request)

    def _end(self, asked: Asked, *withdrawn: Request) -> list[Request]:
        """A request is open no longer. Returns what is withdrawn: of a robot that goes first also the other's wait."""
        del self._open[asked.request.robot], self.asked[asked.request.id]
        if asked.waits:
            del self._waiting[asked.waits.robot], self.asked[asked.waits.id]
        return [replace(request, withdrawn=True) for request in (*withdrawn, asked.waits) if request]

    def _follow_up(self, asked: Asked, moved_m: float, robots: RobotTable, now_s: float) -> list[Request]:
        """End a request that is done, or whose robot stands for somebody again. Returns what is withdrawn."""
        request, takes_s = asked.request, max(now_s - asked.asked_s, 0.0)
        is_aside = _is_aside(request, robots)
        is_done = asked.answer == "done" or (
            _has_passed(asked, robots) if request.verb == "step_aside" else moved_m >= PASSED_M
        )
        if is_done and asked.begun_s is not None and request.other in robots:
            yields = Option(request.robot, request.verb, request.other or "").yields
            vendors = robots[yields[0]].vendor, robots[yields[1]].vendor
            self._worth.add_yield(request.verb, *vendors, takes_s, now_s)
            self._measures.count(YIELDED, *vendors, by=takes_s)
        if is_done:
            return self._end(asked)
        waiting, rested_s = self.standing.waiting.get(request.robot), now_s - robots.rests_since_s(request.robot)
        stands_again = rested_s >= STANDS_S if request.verb == "go_first" else waiting and not waiting.speed_mps
        if takes_s < STANDS_S or is_aside or not stands_again:
            return []
        if moved_m < FAR_M:
            self._following.stop(request, now_s)
        return self._end(asked, request)

    def _for_ring(self, ring: tuple[str, ...], robots: RobotTable, now_s: float) -> Iterator[Request]:
        waiting = [self.standing.waiting[robot] for robot in ring]
        stood_s = now_s - max(each.since_s for each in waiting)
        if not self._open.keys() & set(ring):
            verbs = RING_VERBS[:1] if any(each.speed_mps for each in waiting) else RING_VERBS
            options = [Option(each.robot, verb, each.other) for each in waiting for verb in verbs]
            asked = list(self._ask_best("ring", stood_s, options, robots, now_s))
            if not asked and stood_s >= RELIEF_S:
                asked = list(self._ask_best("ring", stood_s, self._relief(waiting), robots, now_s))
            yield from asked

    def _for_stander(self, waiting: Waiting, robots: RobotTable, now_s: float) -> Iterator[Request]:
        if (stood_s := now_s - waiting.both_since_s) >= STANDS_S:
            verbs = LEAVING if stood_s >= LONG_S else LEAVING[:1]
            options, other = [Option(waiting.robot, verb, waiting.other) for verb in verbs], robots[waiting.other]
            if other.state in MAY_MOVE and other.here is None:
                options.append(Option(waiting.other, "step_aside", waiting.robot))
            yield from self._ask_best("stander", stood_s, options, robots, now_s)

    def _relief(self, waiting: list[Waiting]) -> Iterator[Option]:
        """What the last robots behind those of a ring could do, so that these have room behind them."""
        ring = {each.robot for each in waiting}
        for each in waiting:
            for last in self.standing.last_behind(each.robot, ring):
                yield Option(last, "other_way", self.standing.waiting[last].other)
                yield Option(last, "back_out", each.other)

    def _for_crossing(self, crossing: Crossing, robots: RobotTable, now_s: float) -> Iterator[Request]:
        """One of two that wait for each other goes first; the other waits before its way until that has passed."""
        a, b = crossing.robots
        options: list[Option] = [Option(a, "go_first", b), Option(b, "go_first", a)]
        for first in self._ask_best("crossing", now_s - crossing.since_s, options, robots, now_s):
            yield first
            other = b if first.robot == a else a
            if not self._following.can(robots[other].vendor, "wait_before", now_s):
                continue
            before_m = crossing.before_m[crossing.robots.index(other)]
            wait = self._new(Option(other, "wait_before", first.robot), before_m, (first.robot,), first.latest_s)
            self._open[first.robot].waits = wait
            self.asked[wait.id], self._waiting[other] = self._open[first.robot], first.robot
            yield wait

    def _ask_best(
        self, kind: str, stood_s: float, options: Iterable[Option], robots: RobotTable, now_s: float
    ) -> Iterator[Request]:
        """Ask for the first option that saves something. The robots have stood for `stood_s`."""
        if kind != "crossing" and self._goals.is_spent(option.robot for option in options):
            return
        found = []
        for option in options:
            vendor, (yielding, other) = robots[option.robot].vendor, (robots[uuid].vendor for uuid in option.yields)
            is_on_foot = robots[option.robot].on_foot or robots[option.yields[0]].on_foot
            is_asked = any(uuid in asked for uuid in option.yields for asked in (self._open, self._waiting))
            is_own = yielding == other and stood_s < OWN_STANDS_S
            if is_own or is_on_foot or is_asked:
                continue
            if self._following.may_be_asked(option, vendor, now_s):
                behind = self.standing.behind(option.robot), self.standing.behind(option.other)
                works = self._following.likely(option.robot)
                works *= self._following.possible(option.verb, robots.reported_pose(option.robot)[:2])
                saving = self._worth.saving(kind, option.verb, works, stood_s, behind)
                is_fair = not self._worth.yields_too_much(yielding, other, now_s)
                came_s = robots.rests_since_s(option.yields[0])
                last_asked_s = self._following.asked_s(option.robot)
                order = (-behind[0], -last_asked_s) if option.verb in AWAY else (0, came_s)
                rank = works >= LIKELY, is_fair, -VERBS.index(option.verb), order
                found.append((rank, saving, option))
        for _, saving, option in sorted(found, reverse=True):
            if saving.mean_s > 0 and (request := self._request(option, saving, robots, now_s)):
                yield request
                return

    def _request(self, option: Option, saving: ExpectedSaving, robots: RobotTable, now_s: float) -> Request | None:
        """Ask for an option. None if there is no place for it."""
        waiting = self.standing.waiting.get(option.robot)
        goal = self._goals.find(option, waiting.way_rad if waiting else 0.0, robots, now_s)
        if goal is None:
            return None
        latest_s = now_s + (2 * LATEST_S if option.verb in MAKING_ROOM else LATEST_S)
        until = () if option.verb == "go_first" else (option.other,)
        request = replace(
            self._new(option, goal.at_m, until, latest_s),
            side=goal.side,
            beside=goal.beside_m,
            saving_s=saving.mean_s,
            saving_interval_s=saving.interval_s,
        )
        x_m, y_m, yaw_rad = robots.reported_pose(option.robot)
        rolls_m = waiting.speed_mps * ROLLS_S if waiting else 0.0
        self._open[option.robot] = self.asked[request.id] = Asked(
            request, now_s, (x_m, y_m), yaw_rad, rolls_m, robots.reported_pose(option.other)[:2]
        )
        self._following.ask(option.robot, now_s)
        return request

    def _new(self, option: Option, at: tuple[float, float] | None, until: tuple[str, ...], latest_s: float) -> Request:
        return Request(str(next(self._numbers)), option.robot, option.verb, at, option.other, until, latest_s)


def _is_aside(request: Request, robots: RobotTable) -> bool:
    """Whether a robot has stepped aside to its place."""
    at = request.at if request.verb == "step_aside" else None
    return at is not None and dist(robots.reported_pose(request.robot)[:2], at) <= ARRIVED_M


def _has_passed(asked: Asked, robots: RobotTable) -> bool:
    """Whether a robot has stepped aside, and the other has driven on since, or has left."""
    other = asked.request.other or ""
    return _is_aside(asked.request, robots) and (
        other not in robots or dist(robots.reported_pose(other)[:2], asked.other_from_m) >= PASSED_M
    )
