"""Advice for queues and deadlocks: the slots that cost least, worked out again only if that matters."""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from math import inf

from deconflict.advice.deferred_answers import AdviceQuestion, Submit
from deconflict.advice.priorities import Priorities
from deconflict.advice.vendor_burden import Burden
from deconflict.contention.queues.place_group import PlaceQueue
from deconflict.contention.queues.queue_forecast import QueueEntry, QueueForecast, ServiceRequest
from deconflict.contention.queues.slot_scheduling import advise_slots
from deconflict.contention.robots.place_geometry import CHANGEOVER_S, PlaceGeometry, ZonePassage
from deconflict.contention.robots.robot_view import RobotView
from deconflict.contention.waiting.deadlocks import RingLink
from deconflict.contention.waiting.detours import Refuge, back_out, detour
from deconflict.foresight.presence.live_robots import LiveRobots
from deconflict.settings.site import Advice, Site
from deconflict_client.advisory import Recommendation
from ingest.measures.measures import Measures

AGAIN_S = 10.0
"""Advice is worked out again if other robots wait, or after this time."""
MOST_ADVISED = 50
"""Of more robots that wait for a group of places the first have slots advised: the time of an answer grows with their
square."""
MOST_SOLVED = 2
"""Groups of places in one look; the others keep their advice, or wait for the next look."""

NO_ORDER = Recommendation(
    cost_s=0.0,
    bound_s=0.0,
    proven_optimal=False,
    note="no order of waiting ends it: one of them has to go elsewhere first",
)

Signature = tuple[tuple[str, frozenset[str], frozenset[str]], ...]
"""For each place of a group: its id, the robots that wait for it, the robots that have it."""


@dataclass(slots=True)
class _QueueQuestion(AdviceQuestion):
    """The question about one group of places, or about one ring in a lane."""

    advice: Recommendation | None = None
    """The newest answer that was given."""
    signature: Signature = ()
    """What the newest question was about. Another signature needs another answer."""
    wanted_s: float = -inf
    """When a look last wanted the advice."""


def queue_advice(
    site: Site, live: LiveRobots, burden: Burden, submit: Submit, measures: Measures
) -> Callable[[PlaceGeometry], "QueueAdvice"]:
    """Makes the advice of an engine for the places of its site. `live` may change. Can be pickled."""
    priority = partial(_priority, Priorities(site.vendors), live)
    return partial(
        QueueAdvice, burden=burden, settings=site.advice, submit=submit, priority=priority, measures=measures
    )


def _priority(priorities: Priorities, live: LiveRobots, uuid: str) -> float:
    robot = live.robots[uuid]
    return priorities.of(robot.vendor, robot.model, on_foot=uuid in live.on_foot)


class QueueAdvice:
    """The advice for each group of interchangeable places, and for each ring of waiting robots.

    A look asks, and a later one gives the answer: in the live service a thread works it out, and no look waits for it.
    """

    def __init__(
        self,
        geometry: PlaceGeometry,
        burden: Burden,
        settings: Advice,
        submit: Submit,
        priority: Callable[[str], float],
        measures: Measures,
    ) -> None:
        """`priority` gives the weight of a second of a robot's waiting, by UUID."""
        self._geometry, self._burden, self._settings = geometry, burden, settings
        self._submit, self._measures = submit, measures
        self.priority = priority
        self._questions: dict[tuple[str, ...], _QueueQuestion] = {}
        self._detours: dict[tuple[RingLink, ...], Recommendation] = {}
        """The detours of this look."""
        self._detours_before: dict[tuple[RingLink, ...], Recommendation] = {}
        """The detours of the look before."""
        self._solved = 0
        """Questions asked in this look."""

    def begin_look(self, now_s: float) -> None:
        """Begin a look; forget questions that no look has wanted for a while."""
        self._solved = 0
        self._detours_before, self._detours = self._detours, {}
        self._questions = {
            key: question for key, question in self._questions.items() if now_s - question.wanted_s < AGAIN_S
        }

    def slots(
        self, place: str, queues: Mapping[str, QueueForecast], robots: Mapping[str, RobotView], now_s: float
    ) -> Recommendation | None:
        """The slots advised to all robots that wait for `place` or for a place that can stand in for it."""
        group, longest = self._geometry.group(place), queues[place].longest_waiting

        def place_queues() -> list[PlaceQueue]:
            forecasts = [queues[member].at_height_of(longest) if member in queues else None for member in group]
            coming = sorted(entry for each in forecasts if each for entry in each.entries[each.inside :])
            advised = frozenset(entry.robot for entry in coming[:MOST_ADVISED])
            return [self._place_queue(*item, robots, advised) for item in zip(group, forecasts, strict=True)]

        return self._advice(tuple(group), place_queues, now_s)

    def way_out(
        self, ring: Sequence[RingLink], robots: Mapping[str, RobotView], refuges: Sequence[Refuge], now_s: float
    ) -> Recommendation | None:
        """What ends a ring: in a lane that not all have entered, an order of entry; otherwise a detour of one robot."""
        lane = ring[0].where
        passages = [robots[link.waiter].passages.get(lane) for link in ring]
        inside = [robots[link.waiter].is_inside(lane, now_s) for link in ring]
        if {link.where for link in ring} != {lane} or None in passages:
            return self._detour(ring, robots, refuges, now_s)
        waiters = tuple(link.waiter for link in ring)
        if all(inside):
            question = self._questions.setdefault((lane, *waiters), _QueueQuestion())
            question.wanted_s, question.advice = now_s, self._back_out(ring, robots, question.advice, now_s)
            return question.advice
        requests = [
            ServiceRequest(
                robot=link.waiter,
                vendor=robots[link.waiter].vendor,
                arrival_s=passage.enter_s,
                service_s=self._time_left_s(passage, lane, robots[link.waiter].length_m, now_s),
                priority=self.priority(link.waiter),
                inside=is_inside,
            )
            for link, passage, is_inside in zip(ring, passages, inside, strict=True)
            if passage
        ]
        queue = PlaceQueue(lane, 1, tuple(requests), CHANGEOVER_S)
        return self._advice((lane, *waiters), lambda: [queue], now_s)

    def _back_out(
        self, ring: Sequence[RingLink], robots: Mapping[str, RobotView], standing: Recommendation | None, now_s: float
    ) -> Recommendation:
        """Who backs out: the one that should have waited by `standing`, unless another is cheaper by `switch_s`."""
        lane = ring[0].where
        can_back = [link for link in ring if not (robots[link.waiter].pulls_trailers or robots[link.waiter].on_foot)]
        if not can_back:
            return NO_ORDER
        lane_m, switch_s = self._geometry.lane_m(lane), self._settings.switch_s
        advice, robot, back_m = back_out(can_back, robots, lane_m, now_s, self.priority)
        last = max(standing.slots, key=lambda slot: slot.wait_s).robot if standing and standing.slots else None
        if waited := [link for link in can_back if link.waiter == last]:
            kept = back_out(waited, robots, lane_m, now_s, self.priority)
            if kept[0].cost_s <= advice.cost_s + switch_s:
                advice, robot, back_m = kept
        note = f"{robots[robot].name} should back out of {self._geometry.label(lane)}, {back_m:.0f} m"
        return advice.model_copy(update={"note": note})

    def _detour(
        self, ring: Sequence[RingLink], robots: Mapping[str, RobotView], refuges: Sequence[Refuge], now_s: float
    ) -> Recommendation:
        key = tuple(replace(link, from_s=0.0) for link in ring)
        standing, switch_s = self._detours_before.get(key), self._settings.switch_s
        advice = detour(ring, robots, refuges, now_s, self.priority, standing, switch_s)
        if advice is None:
            return NO_ORDER
        self._detours[key] = advice
        return advice

    def _place_queue(
        self, place: str, forecast: QueueForecast | None, robots: Mapping[str, RobotView], advised: Collection[str]
    ) -> PlaceQueue:
        """The robots that are in a place, and those of `advised` that come to it."""
        entries = (
            [entry for entry in forecast.entries if not entry.coming or entry.robot in advised] if forecast else ()
        )
        requests = tuple(self._request(entry, robots) for entry in entries)
        return PlaceQueue(place, self._geometry.capacity(place), requests, self._geometry.changeover_s(place))

    def _request(self, entry: QueueEntry, robots: Mapping[str, RobotView]) -> ServiceRequest:
        vendor, priority = robots[entry.robot].vendor, self.priority(entry.robot)
        return ServiceRequest(entry.robot, vendor, entry.arrival_s, entry.service_s, priority, inside=not entry.coming)

    def _advice(
        self, key: tuple[str, ...], queues: Callable[[], Sequence[PlaceQueue]], now_s: float
    ) -> Recommendation | None:
        """The newest answer to a question; ask it again if other robots wait, or after a while."""
        question = self._questions.setdefault(key, _QueueQuestion())
        question.wanted_s = now_s
        if question.is_due(now_s):
            answer = question.take_answer(self._measures)
            question.advice = answer if isinstance(answer, Recommendation) else question.advice
        if question.answer is None and self._solved < MOST_SOLVED:
            self._ask(question, queues(), now_s)
        return question.advice

    def _ask(self, question: _QueueQuestion, queues: Sequence[PlaceQueue], now_s: float) -> None:
        signature = tuple(map(_signature, queues))
        if signature == question.signature and now_s - question.asked_s < AGAIN_S:
            return
        self._solved += 1
        burdens_s, standing = dict(self._burden.burdens_s), question.advice
        work = partial(advise_slots, queues, now_s, burdens_s=burdens_s, standing=standing, settings=self._settings)
        question.answer, question.asked_s, question.late = self._submit(work), now_s, False
        question.signature = signature

    def _time_left_s(self, passage: ZonePassage, lane: str, length_m: float, now_s: float) -> float:
        """How long until the whole robot is out of the lane."""
        way_m = self._geometry.lane_m(lane) + length_m
        return max(passage.through_s(way_m) - max(now_s - passage.enter_s, 0.0), 0.0)


def _signature(queue: PlaceQueue) -> tuple[str, frozenset[str], frozenset[str]]:
    waiting = frozenset(request.robot for request in queue.requests if not request.inside)
    inside = frozenset(request.robot for request in queue.requests if request.inside)
    return queue.resource, waiting, inside
