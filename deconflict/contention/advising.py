"""Advice for queues: slots that cost least in total, worked out anew only when it matters."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial

from deconflict.advice.account import Account, Solve, solve
from deconflict.advice.priorities import USUAL
from deconflict.advice.slots import Queue, advise_slots
from deconflict.advisory import Recommendation
from deconflict.contention.deadlocks import Link
from deconflict.contention.demand import CHANGEOVER_S, Request, Turn
from deconflict.contention.detours import Refuge, detour
from deconflict.contention.geometry import Geometry, Passage
from deconflict.contention.robots import Seen

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


@dataclass(frozen=True, slots=True)
class _Advised:
    signature: Signature
    at_s: float
    advice: Recommendation


def advising_alone(geometry: Geometry) -> "Advising":
    """Advice where nothing is known of earlier burdens, at the usual effort."""
    return Advising(geometry, Account(), EFFORT, solve, lambda _: USUAL)


class Advising:
    """What was advised for each group of interchangeable places, by its first place."""

    def __init__(
        self,
        geometry: Geometry,
        account: Account,
        effort: float,
        solve: Solve,
        priority: Callable[[str], float],
    ) -> None:
        """`priority` says by UUID what a second of a robot's waiting counts."""
        self._geometry, self._account, self._effort, self._solve = geometry, account, effort, solve
        self.priority = priority
        self._advised: dict[str, _Advised] = {}
        self._rings: dict[Signature, _Advised] = {}
        self._solved = 0

    def begin(self, contended: Sequence[str]) -> None:
        """A look begins, with these places contended; what was advised for others is forgotten."""
        self._solved = 0
        kept = {self._group(place)[0] for place in contended}
        self._advised = {place: one for place, one in self._advised.items() if place in kept}

    def slots(self, place: str, turns: Mapping[str, Sequence[Turn]], now_s: float) -> Recommendation | None:
        """The slots advised for everybody who waits for `place` or for one that can stand in for it."""
        group = self._group(place)
        requests = {one: [turn.request for turn in turns.get(one, ())] for one in group}
        signature = tuple((one, _robots(requests[one], False), _robots(requests[one], True)) for one in group)
        before = self._advised.get(group[0])
        if before and before.signature == signature and now_s - before.at_s < AGAIN_S:
            return before.advice
        if self._solved == MOST_SOLVED:
            return before.advice if before else None
        self._solved += 1
        queues = [
            Queue(one, self._geometry.capacity(one), tuple(requests[one]), self._geometry.changeover_s(one))
            for one in group
        ]
        advice = self._advise(queues, now_s, before.advice if before else None)
        self._advised[group[0]] = _Advised(signature, now_s, advice)
        return advice

    def way_out(
        self, ring: Sequence[Link], robots: Mapping[str, Seen], refuges: Sequence[Refuge], now_s: float
    ) -> Recommendation:
        """What ends a ring: in a lane that not all have entered, one after the other; else one goes elsewhere first."""
        lane = ring[0].where
        passages = [robots[link.waiter].passages.get(lane) for link in ring]
        inside = [one is not None and one.enter_s <= now_s for one in passages]
        if {link.where for link in ring} != {lane} or None in passages or all(inside):
            return self._elsewhere(ring, robots, refuges, now_s)
        has_it = frozenset(link.waiter for link, has in zip(ring, inside, strict=True) if has)
        signature = ((lane, frozenset(link.waiter for link in ring), has_it),)
        before = self._rings.get(signature)
        if before and now_s - before.at_s < AGAIN_S:
            return before.advice
        requests = [
            Request(
                robot=link.waiter,
                vendor=robots[link.waiter].vendor,
                arrival_s=one.enter_s,
                arrival_spread_s=0.0,
                service_s=self._left_s(one, lane, robots[link.waiter].length_m, now_s),
                priority=self.priority(link.waiter),
                inside=has,
            )
            for link, one, has in zip(ring, passages, inside, strict=True)
            if one
        ]
        advice = self._advise([Queue(lane, 1, tuple(requests), CHANGEOVER_S)], now_s, None)
        self._keep(signature, now_s, advice)
        return advice

    def _elsewhere(
        self, ring: Sequence[Link], robots: Mapping[str, Seen], refuges: Sequence[Refuge], now_s: float
    ) -> Recommendation:
        signature = tuple((link.where, frozenset((link.waiter,)), frozenset((link.holder,))) for link in ring)
        before = self._rings.get(signature)
        advice = detour(ring, robots, refuges, now_s, self.priority, before.advice if before else None)
        if advice is None:
            return NO_ORDER
        self._keep(signature, now_s, advice)
        return advice

    def _keep(self, ring: Signature, now_s: float, advice: Recommendation) -> None:
        self._rings = {key: one for key, one in self._rings.items() if now_s - one.at_s < AGAIN_S}
        self._rings[ring] = _Advised(ring, now_s, advice)

    def _advise(self, queues: Sequence[Queue], now_s: float, standing: Recommendation | None) -> Recommendation:
        burdens_s = dict(self._account.burdens_s)
        work = partial(advise_slots, queues, now_s, burdens_s=burdens_s, standing=standing, effort=self._effort)
        return self._solve(work)

    def _left_s(self, one: Passage, lane: str, length_m: float, now_s: float) -> float:
        """Until all of its length is out."""
        way_m = self._geometry.lane_m(lane) + length_m
        return max(one.through_s(way_m) - max(now_s - one.enter_s, 0.0), 0.0)

    def _group(self, place: str) -> list[str]:
        """The places that can stand in for one another, in the order of the site file."""
        found = self._geometry.resources.get(place)
        if found is None or not found.group:
            return [place]
        return [one.id for one in self._geometry.resources.values() if one.group == found.group]


def _robots(requests: Sequence[Request], inside: bool) -> frozenset[str]:
    return frozenset(one.robot for one in requests if one.inside is inside)
