"""Groups of future conflicts that share robots."""

from collections.abc import Iterable, Mapping
from datetime import datetime
from heapq import heappop, heappush
from itertools import chain
from math import inf
from operator import attrgetter
from typing import NamedTuple

from deconflict.advice.expected_loss import expected_loss_s
from deconflict_client.advisory import ConflictAdvisory, Recommendation, moment
from ingest.batch import Pair

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
