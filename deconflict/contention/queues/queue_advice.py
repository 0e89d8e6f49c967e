"""Advice for queues: slots that cost least in total, worked out anew only when it matters."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from math import inf

from deconflict.advice.async_answers import ANSWER_AFTER_S, PendingAnswer, Submit, answer_at_once
from deconflict.advice.burden import Burden
from deconflict.advice.priorities import USUAL
from deconflict.advisory import Recommendation
from deconflict.contention.queues.queue_forecast import Request, Row, Turns
from deconflict.contention.queues.slot_scheduling import Queue, advise_slots
from deconflict.contention.robots.place_geometry import CHANGEOVER_S, Geometry, Passage
from deconflict.contention.robots.robot_view import Seen
from deconflict.contention.waiting.deadlocks import Link
from deconflict.contention.waiting.detours import Refuge, back_out, detour
from ingest.measures.measures import Measures

AGAIN_S = 10.0
"""Advice is worked out anew when who waits has changed, or after this time."""
MOST_SOLVED = 2
"""Groups of places in one look; the others keep what was advised, or wait for the next look."""

EFFORT = 0.1
"""Of the solver's deterministic time for one group, unless the site says otherwise."""

NO_ORDER = Recommendation(
    cost_s=0.0,
    bound_s=0.0,
    proven_optimal=False,
    note="no order of waiting ends it: one of them has to go elsewhere first",
)

Signature = tuple[tuple[str, frozenset[str], frozenset[str]], ...]
"""Of each place of a group: who waits for it, who has it."""


@dataclass(slots=True)
class _Question:
    """About one group of places, or one ring in a lane."""

    advice: Recommendation | None = None
    """The newest answer that was given."""
    signature: Signature = ()
    asked_s: float = -inf
    answer: PendingAnswer | None = None
    """Yet to be given."""
    late: bool = False
    """Not there when its time had come."""
    wanted_s: float = -inf


def advising_alone(geometry: Geometry) -> "Advising":
    """Advice where nothing is known of earlier burdens, at the usual effort."""
    return Advising(geometry, Burden(), EFFORT, answer_at_once, lambda _: USUAL, Measures())


class Advising:
    """What is advised for each group of interchangeable places, and for each ring.

    A look asks, and the next one gives the answer: a live engine lets a thread work it out, and never waits for it.
    """

    def __init__(
        self,
        geometry: Geometry,
        account: Burden,
        effort: float,
        submit: Submit,
        priority: Callable[[str], float],
        measures: Measures,
    ) -> None:
        """`priority` says by UUID what a second of a robot's waiting counts."""
        self._geometry, self._account, self._effort = geometry, account, effort
        self._submit, self._measures = submit, measures
        self.priority = priority
        self._questions: dict[tuple[str, ...], _Question] = {}
        self._detours: dict[tuple[Link, ...], Recommendation] = {}
        self._before: dict[tuple[Link, ...], Recommendation] = {}
        """The detours of the look before."""
        self._solved = 0

    def begin(self, now_s: float) -> None:
        """A look begins; what nobody has wanted to know for a while is forgotten."""
        self._solved = 0
        self._before, self._detours = self._detours, {}
        self._questions = {key: one for key, one in self._questions.items() if now_s - one.wanted_s < AGAIN_S}

    def slots(
        self, place: str, turns: Mapping[str, Turns], robots: Mapping[str, Seen], now_s: float
    ) -> Recommendation | None:
        """The slots advised for everybody who waits for `place` or for one that can stand in for it."""
        group, longest = self._geometry.group(place), turns[place].longest

        def queues() -> list[Queue]:
            return [
                self._queue(one, turns[one].at_height_of(longest) if one in turns else None, robots) for one in group
            ]

        return self._told(tuple(group), queues, now_s)

    def way_out(
        self, ring: Sequence[Link], robots: Mapping[str, Seen], refuges: Sequence[Refuge], now_s: float
    ) -> Recommendation | None:
        """What ends a ring: in a lane that not all have entered, one after the other; else one goes elsewhere first."""
        lane = ring[0].where
        passages = [robots[link.waiter].passages.get(lane) for link in ring]
        inside = [one is not None and one.enter_s <= now_s for one in passages]
        if {link.where for link in ring} != {lane} or None in passages:
            return self._elsewhere(ring, robots, refuges, now_s)
        if all(inside):
            return self._back_out(ring, robots, now_s)
        requests = [
            Request(
                robot=link.waiter,
                vendor=robots[link.waiter].vendor,
                arrival_s=one.enter_s,
                service_s=self._left_s(one, lane, robots[link.waiter].length_m, now_s),
                priority=self.priority(link.waiter),
                inside=has,
            )
            for link, one, has in zip(ring, passages, inside, strict=True)
            if one
        ]
        waiters, queue = tuple(link.waiter for link in ring), Queue(lane, 1, tuple(requests), CHANGEOVER_S)
        return self._told((lane, *waiters), lambda: [queue], now_s)

    def _back_out(self, ring: Sequence[Link], robots: Mapping[str, Seen], now_s: float) -> Recommendation:
        lane = ring[0].where
        advice, robot, back_m = back_out(ring, robots, self._geometry.lane_m(lane), now_s, self.priority)
        note = f"{robots[robot].name} should back out of {self._geometry.label(lane)}, {back_m:.0f} m"
        return advice.model_copy(update={"note": note})

    def _elsewhere(
        self, ring: Sequence[Link], robots: Mapping[str, Seen], refuges: Sequence[Refuge], now_s: float
    ) -> Recommendation:
        key = tuple(replace(link, from_s=0.0) for link in ring)
        advice = detour(ring, robots, refuges, now_s, self.priority, self._before.get(key))
        if advice is None:
            return NO_ORDER
        self._detours[key] = advice
        return advice

    def _queue(self, place: str, turns: Turns | None, robots: Mapping[str, Seen]) -> Queue:
        requests = tuple(self._request(row, robots) for row in turns.rows) if turns else ()
        return Queue(place, self._geometry.capacity(place), requests, self._geometry.changeover_s(place))

    def _request(self, row: Row, robots: Mapping[str, Seen]) -> Request:
        vendor, priority = robots[row.robot].vendor, self.priority(row.robot)
        return Request(row.robot, vendor, row.arrival_s, row.service_s, priority, inside=not row.coming)

    def _told(self, key: tuple[str, ...], queues: Callable[[], Sequence[Queue]], now_s: float) -> Recommendation | None:
        """The newest answer to a question; asks it again when who waits has changed, or after a while."""
        one = self._questions.setdefault(key, _Question())
        one.wanted_s = now_s
        if one.answer and now_s - one.asked_s >= ANSWER_AFTER_S:
            self._take(one, one.answer)
        if one.answer is None and self._solved < MOST_SOLVED:
            self._ask(one, queues(), now_s)
        return one.advice

    def _ask(self, one: _Question, queues: Sequence[Queue], now_s: float) -> None:
        signature = tuple(map(_signature, queues))
        if signature == one.signature and now_s - one.asked_s < AGAIN_S:
            return
        self._solved += 1
        burdens_s, standing = dict(self._account.burdens_s), one.advice
        work = partial(advise_slots, queues, now_s, burdens_s=burdens_s, standing=standing, effort=self._effort)
        one.answer, one.asked_s, one.signature, one.late = self._submit(work), now_s, signature, False

    def _take(self, one: _Question, answer: PendingAnswer) -> None:
        """An answer that is still worked out when its time has come is counted, and taken later."""
        if answer.done():
            one.advice, one.answer = answer.result(), None
        elif not one.late:
            one.late = True
            self._measures.count("deconflict_advice_late_total")

    def _left_s(self, one: Passage, lane: str, length_m: float, now_s: float) -> float:
        """Until all of its length is out."""
        way_m = self._geometry.lane_m(lane) + length_m
        return max(one.through_s(way_m) - max(now_s - one.enter_s, 0.0), 0.0)


def _signature(queue: Queue) -> tuple[str, frozenset[str], frozenset[str]]:
    waiting, inside = (frozenset(one.robot for one in queue.requests if one.inside is has) for has in (False, True))
    return queue.resource, waiting, inside
