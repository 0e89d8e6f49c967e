"""When holds are asked for and when the answer is given: at event times, so that a replay gives the same advice.

The desk asks for each connected group of conflicts ahead, and gives the answer at the first step at least
`ANSWER_AFTER_S` later, however soon it was worked out; a live engine lets a thread do that, and never waits for it.
What is asked is bounded, so that answers are there in time. Holds begin at that time: until then robots go on as
forecast.
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import partial
from heapq import heapify, heappop
from operator import itemgetter

from deconflict.advice.async_answers import ANSWER_AFTER_S, Answer, Submit, at_once
from deconflict.advice.burden import Account
from deconflict.advice.conflict_groups import Group, Groups, Pairs
from deconflict.advice.delay_windows import Near, Window
from deconflict.advice.hold_planner import advise_holds
from deconflict.advisory import ConflictAdvisory, Recommendation
from deconflict.settings.site import Site
from ingest.batch import Pair
from ingest.measures.measures import Measures

AGAIN_S = 3.0
"""A conflict is asked of again after this time, with its group; a new one at once."""
NEAR_M, MOST_NEAR = 20.0, 30
"""Robots so near to one of a group are heeded, the nearest first."""
GROWS_S = 1.5
"""Advice waits for a group of conflicts to be complete for no longer than this."""
PAIRS_PER_S, MOST_PAIRS = 20.0, 60.0
"""Conflicts in the questions of a second of event time, on average and at once; the soonest go first, others wait.
People can follow no more, and a crowded floor would have the thread that works answers out fall ever further behind."""

Around = Callable[[set[str]], Near]
"""The robots of a group that are on the floor, and those near to one of them."""


@dataclass(slots=True)
class Asked:
    """One group's question."""

    at_s: float
    answer: Answer | None
    since_s: float
    """When the first question was asked that this one goes on from."""
    late: bool = False
    """Not there when its time had come."""


class Desk:
    """Questions under way."""

    def __init__(self, site: Site, account: Account, measures: Measures, submit: Submit = at_once) -> None:
        self._conflict, self._settings, self._submit = site.conflict, site.advice, submit
        self._account, self._measures = account, measures
        self._groups = Groups()
        self._asked: dict[Pairs, Asked] = {}
        self._asked_s: dict[Pair, float] = {}
        """When each conflict was last asked of."""
        self._allowed, self._filled_s = MOST_PAIRS, 0.0

    def step(
        self,
        now_s: float,
        conflicts: Mapping[Pair, ConflictAdvisory],
        changed: Iterable[Pair],
        around: Around,
    ) -> list[tuple[Pair, Recommendation]]:
        """The advice that is due, by pair; asks for what is ahead of the open `conflicts`, of which none but those
        `changed` are others than in the last step."""
        told = self._given(now_s)
        self._groups.step(now_s + ANSWER_AFTER_S, conflicts, changed)
        self._asked = {pairs: one for pairs, one in self._asked.items() if one.answer or pairs in self._groups.all}
        self._asked_s = {pair: at_s for pair, at_s in self._asked_s.items() if now_s - at_s < AGAIN_S}
        self._allowed = min(self._allowed + (now_s - self._filled_s) * PAIRS_PER_S, MOST_PAIRS)
        self._filled_s = now_s
        at_rest = self._at_rest()
        waiting = len(self._groups.all) - len(at_rest)
        if waiting and self._allowed > 0:
            heapify(soonest := [group for pairs, group in self._groups.all.items() if pairs not in at_rest])
            while soonest and self._allowed > 0:
                self._ask(heappop(soonest), now_s, around)
            waiting = len(soonest)
        self._measures.level("deconflict_advice_waiting", {(): waiting})
        return told

    def _ask(self, group: Group, now_s: float, around: Around) -> None:
        self._allowed -= len(group.pairs)
        robots = _robots(group.pairs)
        goes_on = [
            one.since_s for other, one in self._asked.items() if one.answer and not robots.isdisjoint(_robots(other))
        ]
        answer = self._submit(self._question(group.pairs, group.standing, now_s, around))
        self._asked[group.pairs] = Asked(now_s, answer, min([now_s, *goes_on]))
        self._asked_s |= dict.fromkeys(group.pairs, now_s)

    def _given(self, now_s: float) -> list[tuple[Pair, Recommendation]]:
        """The answers whose time has come, by pair, but for those to groups that have grown and will soon have a better
        one. An answer that is still worked out then comes late, and nobody waits for it."""
        told: list[tuple[Pair, Recommendation]] = []
        due = [item for item in self._asked.items() if item[1].answer and now_s >= item[1].at_s + ANSWER_AFTER_S]
        for pairs, one in sorted(due, key=itemgetter(0)):
            if now_s - one.since_s < GROWS_S and self._has_grown(pairs, one):
                one.answer = None
            elif one.answer and one.answer.done():
                told += [(pair, one.answer.result()) for pair in pairs]
                one.answer = None
            elif not one.late:
                one.late = True
                self._measures.count("deconflict_advice_late_total")
        return told

    def _has_grown(self, pairs: Pairs, one: Asked) -> bool:
        robots = _robots(pairs)
        newer = (other for other, new in self._asked.items() if new.at_s > one.at_s)
        return any(not robots.isdisjoint(_robots(other)) for other in newer)

    def _at_rest(self) -> set[Pairs]:
        """The groups that are not asked of now: one is pending, or was asked of lately with every conflict that is
        still in it, as one that is over changes no advice."""
        pending = {pairs for pairs, one in self._asked.items() if one.answer and pairs in self._groups.all}
        lately = {group.pairs for pair in self._asked_s if (group := self._groups.of(pair))}
        return pending | {pairs for pairs in lately if all(map(self._asked_s.__contains__, pairs))}

    def _question(
        self, pairs: Pairs, standing: Recommendation | None, now_s: float, around: Around
    ) -> Callable[[], Recommendation]:
        near = around(_robots(pairs))
        there = set(near.uuids)
        window = Window(
            now_s + ANSWER_AFTER_S,
            self._conflict.horizon_s,
            self._conflict.clearance_m,
            self._settings.longest_hold_s,
        )
        return partial(
            advise_holds,
            near,
            [pair for pair in pairs if there.issuperset(pair)],
            window,
            burdens_s=dict(self._account.burdens_s),
            standing=standing,
            effort=self._settings.effort,
            switch_s=self._settings.switch_s,
        )


def _robots(pairs: Pairs) -> set[str]:
    return {robot for pair in pairs for robot in pair}
