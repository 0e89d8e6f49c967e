"""Conflicts ahead in groups that share robots, kept from step to step: only those of which a conflict changed or has
begun are made anew."""

from collections.abc import Iterable, Mapping
from datetime import datetime
from heapq import heappop, heappush
from operator import attrgetter
from typing import NamedTuple

from deconflict.advisory import ConflictAdvisory, Recommendation, moment
from ingest.batch import Pair

Pairs = tuple[Pair, ...]


class Group(NamedTuple):
    """Conflicts that share robots."""

    first: datetime
    """When the first of them is predicted."""
    pairs: Pairs
    standing: Recommendation | None
    """The advice that stands in it."""


class Groups:
    """The groups of the conflicts that are ahead."""

    def __init__(self) -> None:
        self.all: dict[Pairs, Group] = {}
        self._of: dict[str, Group] = {}
        """By robot."""
        self._begins: list[tuple[datetime, Pair]] = []
        """A heap of when conflicts begin, and may have begun before they were told of anew."""

    def of(self, pair: Pair) -> Group | None:
        """The group that a conflict is in if it is ahead."""
        return self._of.get(pair[0])

    def step(self, from_s: float, conflicts: Mapping[Pair, ConflictAdvisory], changed: Iterable[Pair]) -> None:
        """Heed those of the open `conflicts` that are predicted for later than `from_s`.

        Those that are not `changed` are as they were in the last step, which was no later.
        """
        from_then, changed = moment(from_s), set(changed)
        stale = changed.copy()
        while self._begins and self._begins[0][0] <= from_then:
            stale.add(heappop(self._begins)[1])
        ahead = []
        for pair in stale | self._taken_apart(stale):
            one = conflicts.get(pair)
            if one and one.predicted_at > from_then:
                ahead.append(one)
                if pair in changed:
                    heappush(self._begins, (one.predicted_at, pair))
        for group in _connected(ahead):
            self.all[group.pairs] = group
            self._of.update((robot, group) for pair in group.pairs for robot in pair)

    def _taken_apart(self, stale: Iterable[Pair]) -> set[Pair]:
        """The conflicts of the groups that have robots of `stale` ones, which are no groups any more."""
        pairs = set[Pair]()
        for robot in {robot for pair in stale for robot in pair}:
            if group := self._of.get(robot):
                del self.all[group.pairs]
                for pair in group.pairs:
                    self._of.pop(pair[0], None)
                    self._of.pop(pair[1], None)
                pairs.update(group.pairs)
        return pairs


def _connected(conflicts: Iterable[ConflictAdvisory]) -> list[Group]:
    """Groups of conflicts that share robots."""
    group_of: dict[str, list[ConflictAdvisory]] = {}
    groups: list[list[ConflictAdvisory]] = []
    for one in conflicts:
        a, b = one.robots
        members = _joined(group_of, group_of.get(a), group_of.get(b))
        if not members:
            groups.append(members)
        members.append(one)
        group_of[a] = group_of[b] = members
    return [_group(members) for members in groups if members]


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
    if len(members) == 1:
        (one,) = members
        return Group(one.predicted_at, (one.robots,), _standing(one))
    members.sort(key=attrgetter("robots"))
    standing = next(filter(None, map(_standing, members)), None)
    return Group(min(one.predicted_at for one in members), tuple(one.robots for one in members), standing)


def _standing(one: ConflictAdvisory) -> Recommendation | None:
    advice = one.recommendation
    return advice if advice and advice.holds else None
