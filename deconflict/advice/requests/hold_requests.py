"""When holds are asked for and when the answers are given: at event times, so that a replay gives the same advice.

This asks for each group of future conflicts, and gives the answer in the first pass at least `ANSWER_AFTER_S`
later, even if it was worked out sooner. In the live service a thread works answers out, and a pass never waits for it.
Questions are bounded so that answers are ready in time. Holds begin when the answer is due; until then robots are taken
to follow their forecasts.
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from datetime import datetime
from functools import partial
from heapq import heapify, heappop, heappush
from itertools import chain
from math import inf
from operator import attrgetter, itemgetter
from typing import NamedTuple

from deconflict.advice.conflict_advice import advise_conflicts
from deconflict.advice.deferred_answers import (
    ANSWER_AFTER_S,
    AdviceQuestion,
    Answer,
    PairAdvice,
    Submit,
    answer_at_once,
)
from deconflict.advice.expected_loss import expected_loss_s
from deconflict.advice.holds.hold_windows import HoldWindow, NearbyRobots
from deconflict.advice.vendor_burden import Burden
from deconflict.settings.site import Site
from deconflict_client.advisory import ConflictAdvisory, Recommendation, moment
from ingest.batch import Pair
from ingest.measures.measures import Measures

Pairs = tuple[Pair, ...]
MOST_ASKED = 60
"""Advice is asked for so many conflicts of a group at once. A group of more is of robots that can't be where they
report to be, or a knot that is solved from its soonest conflicts on."""


class ConflictGroup(NamedTuple):
    """Conflicts that share robots, directly or through others."""

    first: datetime
    """When the first of them is predicted."""
    pairs: Pairs
    standing: tuple[tuple[Pair, Recommendation], ...]
    """The advice that its conflicts have now."""
    losses_s: tuple[float, ...]
    """What each of them is expected to cost."""
    asked: Pairs
    """The soonest of its conflicts, at most `MOST_ASKED`."""


class ConflictGroups:
    """The groups of all future conflicts. Groups without a changed conflict are kept from pass to pass."""

    def __init__(self) -> None:
        self.all: dict[Pairs, ConflictGroup] = {}
        self._of_robot: dict[str, ConflictGroup] = {}
        self._open: dict[Pair, ConflictAdvisory] = {}
        """The newest revision of each open conflict."""
        self._begins: list[tuple[datetime, Pair]] = []
        """A heap: for each revision of a conflict, the time for which it was predicted then."""
        self._from_s = -inf
        """The last time from which conflicts were in the future."""

    def group_of(self, pair: Pair) -> ConflictGroup | None:
        """The group of a conflict; None if the conflict is not in the future."""
        return self._of_robot.get(pair[0])

    def update(self, from_s: float, changed: Mapping[Pair, ConflictAdvisory | None]) -> None:
        """Take in conflicts that changed, None for one that has ended. Groups are of those that are predicted for later
        than `from_s`."""
        if from_s < self._from_s:  # the clock has gone back
            changed = {**self._open, **changed}
        self._from_s, from_then = from_s, moment(from_s)
        for pair, advisory in changed.items():
            self._open.pop(pair, None)
            if advisory:
                self._open[pair] = advisory
                heappush(self._begins, (advisory.predicted_at, pair))
        touched = changed.keys() | self._take_begun(from_then)
        pairs = touched.union(*(group.pairs for group in self._take_groups(touched)))
        conflicts = [self._open[pair] for pair in sorted(pairs) if pair in self._open]
        for group in _connected(advisory for advisory in conflicts if advisory.predicted_at > from_then):
            self.all[group.pairs] = group
            self._of_robot |= {robot: group for pair in group.pairs for robot in pair}

    def _take_begun(self, from_then: datetime) -> set[Pair]:
        """The pairs with a predicted time that is in the future no more."""
        begun = set()
        while self._begins and self._begins[0][0] <= from_then:
            begun.add(heappop(self._begins)[1])
        return begun

    def _take_groups(self, changed: Iterable[Pair]) -> list[ConflictGroup]:
        """Remove the groups with a robot of these pairs."""
        found = (self._of_robot.get(robot) for pair in changed for robot in pair)
        groups = {id(group): group for group in found if group}  # the hash of all pairs would take long
        for group in groups.values():
            del self.all[group.pairs]
            for robot in chain.from_iterable(group.pairs):
                self._of_robot.pop(robot, None)
        return list(groups.values())


def _connected(conflicts: Iterable[ConflictAdvisory]) -> list[ConflictGroup]:
    """Groups of conflicts that share robots."""
    members_of: dict[str, list[ConflictAdvisory]] = {}
    groups: list[list[ConflictAdvisory]] = []
    for advisory in conflicts:
        a, b = advisory.robots
        members = _merged(members_of, members_of.get(a), members_of.get(b))
        if not members:
            groups.append(members)
        members.append(advisory)
        members_of[a] = members_of[b] = members
    return [_group(members) for members in groups if members]


def _merged(
    members_of: dict[str, list[ConflictAdvisory]],
    a: list[ConflictAdvisory] | None,
    b: list[ConflictAdvisory] | None,
) -> list[ConflictAdvisory]:
    """The members of two groups, in the larger one's list; the smaller one's list is emptied."""
    if a is None or b is None or a is b:
        return a or b or []
    larger, smaller = (a, b) if len(a) >= len(b) else (b, a)
    larger += smaller
    members_of.update((robot, larger) for advisory in smaller for robot in advisory.robots)
    smaller.clear()
    return larger


def _group(members: list[ConflictAdvisory]) -> ConflictGroup:
    members.sort(key=attrgetter("robots"))
    first = min(advisory.predicted_at for advisory in members)
    losses_s = tuple(map(expected_loss_s, members))
    pairs = tuple(advisory.robots for advisory in members)
    soonest = sorted(members, key=attrgetter("predicted_at"))[:MOST_ASKED]
    asked = pairs if len(pairs) <= MOST_ASKED else tuple(sorted(advisory.robots for advisory in soonest))
    return ConflictGroup(first, pairs, _standing(members), losses_s, asked)


def _standing(members: list[ConflictAdvisory]) -> tuple[tuple[Pair, Recommendation], ...]:
    return tuple((advisory.robots, advisory.recommendation) for advisory in members if advisory.recommendation)


AGAIN_S = 3.0
"""A conflict is asked about again after this time, with its group; a new one at once."""
NEAR_M, MOST_NEAR = 20.0, 30
"""A plan heeds other robots within this distance of one of the group, at most this many, the nearest first."""
GROWS_S = 1.5
"""Advice waits no longer than this for a group of conflicts to stop growing."""
PAIRS_PER_S, MOST_PAIRS = 20.0, 60.0
"""Conflicts in the questions of one second of event time, on average and at most; the soonest are asked about first.
People can follow no more, and on a crowded floor the thread that works answers out would fall behind ever further."""

EASY_PAIRS = 8
"""A group of more conflicts counts as more than it has: its plan takes long, about as the square of their number."""

FindNearby = Callable[[set[str]], NearbyRobots]
"""The robots of a group that are on the floor, and those near to one of them."""


@dataclass(slots=True)
class HoldQuestion(AdviceQuestion):
    """The question for one group."""

    since_s: float = inf
    """When the first of the questions was asked that this one continues."""


class HoldRequests:
    """The questions about holds that are under way."""

    def __init__(self, site: Site, burden: Burden, measures: Measures, submit: Submit = answer_at_once) -> None:
        self._conflict, self._settings, self._submit = site.conflict, site.advice, submit
        self._burden, self._measures = burden, measures
        self._groups = ConflictGroups()
        self._questions: dict[Pairs, HoldQuestion] = {}
        self._asked_s: dict[Pair, float] = {}
        """When each conflict was last asked about."""
        self._allowed, self._filled_s = MOST_PAIRS, 0.0
        """A token bucket: how many conflicts may be asked about, and when it was last filled."""

    def step(
        self,
        now_s: float,
        changed: Mapping[Pair, ConflictAdvisory | None],
        find_nearby: FindNearby,
    ) -> list[tuple[Pair, Recommendation]]:
        """The advice that is due, by pair; then take in the conflicts that `changed`, None for one that has ended, and
        ask about those that are open."""
        due = self._due_answers(now_s)
        self._groups.update(now_s + ANSWER_AFTER_S, changed)
        self._questions = {
            pairs: question
            for pairs, question in self._questions.items()
            if question.answer or pairs in self._groups.all
        }
        self._asked_s = {pair: at_s for pair, at_s in self._asked_s.items() if now_s - at_s < AGAIN_S}
        self._allowed = min(self._allowed + (now_s - self._filled_s) * PAIRS_PER_S, MOST_PAIRS)
        self._filled_s = now_s
        resting = self._resting()
        waiting = len(self._groups.all) - len(resting)
        if waiting and self._allowed > 0:
            heapify(soonest := [group for pairs, group in self._groups.all.items() if pairs not in resting])
            while soonest and self._allowed > 0:
                self._ask(heappop(soonest), now_s, find_nearby)
            waiting = len(soonest)
        self._measures.level("deconflict_advice_waiting", {(): waiting})
        return due

    def _ask(self, group: ConflictGroup, now_s: float, find_nearby: FindNearby) -> None:
        self._allowed -= max(len(group.asked), len(group.asked) ** 2 / EASY_PAIRS)
        robots = _robots(group.pairs)
        continued = [
            question.since_s
            for pairs, question in self._questions.items()
            if question.answer and not robots.isdisjoint(_robots(pairs))
        ]
        answer = self._submit(self._question(group, now_s, find_nearby))
        self._questions[group.pairs] = HoldQuestion(now_s, answer, since_s=min([now_s, *continued]))
        self._asked_s |= dict.fromkeys(group.pairs, now_s)

    def _due_answers(self, now_s: float) -> list[tuple[Pair, Recommendation]]:
        """The answers that are due, by pair.

        An answer for a group that has grown is dropped: a better one comes soon. An answer that is not ready comes
        late, and nobody waits for it.
        """
        advice: list[tuple[Pair, Recommendation]] = []
        due = [(pairs, question) for pairs, question in self._questions.items() if question.is_due(now_s)]
        for pairs, question in sorted(due, key=itemgetter(0)):
            if now_s - question.since_s < GROWS_S and self._has_grown(pairs, question):
                question.answer = None
            elif answer := question.take_answer(self._measures):
                given = answer if isinstance(answer, PairAdvice) else dict.fromkeys(pairs, answer)
                advice += [(pair, given[pair]) for pair in pairs if pair in given]
        return advice

    def _has_grown(self, pairs: Pairs, question: HoldQuestion) -> bool:
        robots = _robots(pairs)
        newer = (other for other, new in self._questions.items() if new.asked_s > question.asked_s)
        return any(not robots.isdisjoint(_robots(other)) for other in newer)

    def _resting(self) -> set[Pairs]:
        """The groups not to ask about now: their answer is pending, or each of their conflicts was asked about lately.

        A conflict that has left a group changes no advice.
        """
        pending = {
            pairs for pairs, question in self._questions.items() if question.answer and pairs in self._groups.all
        }
        found = (self._groups.group_of(pair) for pair in self._asked_s)
        lately = {id(group): group.pairs for group in found if group}
        return pending | {pairs for pairs in lately.values() if all(map(self._asked_s.__contains__, pairs))}

    def _question(self, group: ConflictGroup, now_s: float, find_nearby: FindNearby) -> Callable[[], Answer]:
        near = find_nearby(_robots(group.asked))
        present = set(near.uuids)
        window = HoldWindow(
            now_s + ANSWER_AFTER_S,
            self._conflict.horizon_s,
            self._conflict.clearance_m,
            self._settings.longest_hold_s,
        )
        return partial(
            advise_conflicts,
            near,
            [pair for pair in group.asked if present.issuperset(pair)],
            window,
            burdens_s=dict(self._burden.burdens_s),
            standing=dict(group.standing),
            losses_s=dict(zip(group.pairs, group.losses_s, strict=True)),
            settings=self._settings,
        )


def _robots(pairs: Pairs) -> set[str]:
    return {robot for pair in pairs for robot in pair}
