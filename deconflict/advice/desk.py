"""When holds are asked for and when the answer is given: at event times, so that a replay gives the same advice.

The desk asks for each connected group of conflicts ahead, and gives the answer at the first step at least
`ANSWER_AFTER_S` later, however soon it was worked out; a live engine lets a thread do that, and never waits for it.
What is asked is bounded, so that answers are there in time. Holds begin at that time: until then robots go on as
forecast.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import partial
from operator import attrgetter, itemgetter
from typing import NamedTuple

from deconflict.advice.account import Account
from deconflict.advice.answers import ANSWER_AFTER_S, Answer, Submit, at_once
from deconflict.advice.delays import Mover, Pair, Window
from deconflict.advice.holds import advise_holds
from deconflict.advisory import ConflictAdvisory, Recommendation
from deconflict.site import Site
from ingest.measures import Measures

AGAIN_S = 3.0
"""A conflict is asked of again after this time, with its group; a new one at once."""
NEAR_M, MOST_NEAR = 20.0, 30
"""Robots so near to one of a group are heeded, the nearest first."""
GROWS_S = 1.5
"""Advice waits for a group of conflicts to be complete for no longer than this."""
PAIRS_PER_S, MOST_PAIRS = 20.0, 60.0
"""Conflicts in the questions of a second of event time, on average and at once; the soonest go first, others wait.
People can follow no more, and a crowded floor would have the thread that works answers out fall ever further behind."""
CHANGED_S = 1.0
"""A hold that differs by less is the same advice."""

Pairs = tuple[Pair, ...]


MoversAround = Callable[[set[str]], list[Mover]]
"""The robots of a group and those near to one of them, as swept, in ascending order."""


@dataclass(slots=True)
class Asked:
    """One group's question."""

    at_s: float
    answer: Answer | None
    since_s: float
    """When the first question was asked that this one goes on from."""
    late: bool = False
    """Not there when its time had come."""


class Group(NamedTuple):
    """Conflicts that share robots."""

    first: datetime
    """When the first of them is predicted."""
    pairs: Pairs
    standing: Recommendation | None
    """The advice that stands in it."""


class Desk:
    """Questions under way."""

    def __init__(self, site: Site, account: Account, measures: Measures, submit: Submit = at_once) -> None:
        self._conflict, self._settings, self._submit = site.conflict, site.advice, submit
        self._account, self._measures = account, measures
        self._asked: dict[Pairs, Asked] = {}
        self._asked_s: dict[Pair, float] = {}
        """When each conflict was last asked of."""
        self._allowed, self._filled_s = MOST_PAIRS, 0.0

    def step(
        self, now_s: float, conflicts: Sequence[ConflictAdvisory], movers_around: MoversAround
    ) -> list[tuple[Pair, Recommendation]]:
        """The advice that is due, by pair; asks for what is open and ahead."""
        told = self._given(now_s)
        from_then = datetime.fromtimestamp(now_s + ANSWER_AFTER_S, UTC)
        groups = _connected([one for one in conflicts if one.predicted_at > from_then])
        self._asked = {pairs: one for pairs, one in self._asked.items() if one.answer or pairs in groups}
        self._asked_s = {pair: at_s for pair, at_s in self._asked_s.items() if now_s - at_s < AGAIN_S}
        due = [group for group in groups.values() if self._is_asked(group)]
        self._allowed = min(self._allowed + (now_s - self._filled_s) * PAIRS_PER_S, MOST_PAIRS)
        self._filled_s = now_s
        while due and self._allowed > 0:
            group = due.pop(0)
            self._allowed -= len(group.pairs)
            goes_on = [one.since_s for other, one in self._asked.items() if _goes_on(other, one, group.pairs)]
            answer = self._submit(self._question(group.pairs, group.standing, now_s, movers_around))
            self._asked[group.pairs] = Asked(now_s, answer, min([now_s, *goes_on]))
            self._asked_s |= dict.fromkeys(group.pairs, now_s)
        self._measures.level("deconflict_advice_waiting", {(): len(due)})
        return told

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
        return any(_goes_on(pairs, one, other) for other, new in self._asked.items() if new.at_s > one.at_s)

    def _is_asked(self, group: Group) -> bool:
        """Whether there is a conflict in a group that was not asked of lately: one that is over changes no advice."""
        before = self._asked.get(group.pairs)
        pending = before is not None and before.answer is not None
        return not pending and not self._asked_s.keys() >= set(group.pairs)

    def _question(
        self, pairs: Pairs, standing: Recommendation | None, now_s: float, movers_around: MoversAround
    ) -> Callable[[], Recommendation]:
        movers = movers_around({robot for pair in pairs for robot in pair})
        there = {one.robot for one in movers}
        window = Window(
            now_s + ANSWER_AFTER_S,
            self._conflict.horizon_s,
            self._conflict.clearance_m,
            self._settings.longest_hold_s,
        )
        return partial(
            advise_holds,
            movers,
            [pair for pair in pairs if there.issuperset(pair)],
            window,
            burdens_s=dict(self._account.burdens_s),
            standing=standing,
            effort=self._settings.effort,
            switch_s=self._settings.switch_s,
        )


def differs(before: Recommendation | None, after: Recommendation) -> bool:
    """Whether a site service would do otherwise."""
    if before is None:
        return True
    held, hold = ({one.robot: one.hold_s for one in each.holds} for each in (before, after))
    if held.keys() != hold.keys() or before.note != after.note:
        return True
    return any(abs(held[robot] - hold[robot]) > CHANGED_S for robot in held)


def advised(summary: str, advice: Recommendation | None, robots: Sequence[str], names: Sequence[str]) -> str:
    """The summary of an advisory with what is advised to its own robots."""
    if advice is None:
        return summary
    called = dict(zip(robots, names, strict=True))
    told = [f"{called[one.robot]} should wait {one.hold_s:g} s" for one in advice.holds if one.robot in called]
    return "; ".join([summary, *(told or ([advice.note] if advice.note else []))])


def _connected(conflicts: Iterable[ConflictAdvisory]) -> dict[Pairs, Group]:
    """Groups of conflicts that share robots, the soonest first."""
    group_of: dict[str, list[ConflictAdvisory]] = {}
    groups: list[list[ConflictAdvisory]] = []
    for one in conflicts:
        a, b = one.robots
        members = _joined(group_of, group_of.get(a), group_of.get(b))
        if not members:
            groups.append(members)
        members.append(one)
        group_of[a] = group_of[b] = members
    found = sorted((_group(members) for members in groups if members), key=itemgetter(0, 1))
    return {group.pairs: group for group in found}


def _joined(
    group_of: dict[str, list[ConflictAdvisory]],
    one: list[ConflictAdvisory] | None,
    other: list[ConflictAdvisory] | None,
) -> list[ConflictAdvisory]:
    """The members of two groups, in the larger one's list; the other's is left empty."""
    if one is None or other is None or one is other:
        return one or other or []
    joined, emptied = (one, other) if len(one) >= len(other) else (other, one)
    joined += emptied
    group_of.update((robot, joined) for each in emptied for robot in each.robots)
    emptied.clear()
    return joined


def _group(members: list[ConflictAdvisory]) -> Group:
    if len(members) > 1:
        members.sort(key=attrgetter("robots"))
    standing = next((one.recommendation for one in members if one.recommendation and one.recommendation.holds), None)
    return Group(min(one.predicted_at for one in members), tuple(one.robots for one in members), standing)


def _goes_on(before: Pairs, asked: Asked, after: Pairs) -> bool:
    """Whether a question that is not answered yet is of a group that shares robots with another one."""
    return asked.answer is not None and not {robot for pair in before for robot in pair}.isdisjoint(
        robot for pair in after for robot in pair
    )
