"""Which open advisories belong to one situation: those that have one subject (`subject.py`). Pure.

While a situation is open its subject stays. An advisory joins its group if it is about the subject; a conflict also if
it shares a robot with one that is in it, or is at the same place. What is too far from the others leaves, and so do all
when none is about the subject any more: what goes on is another situation.
"""

from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from math import floor, hypot, inf
from typing import NamedTuple, TypeVar

from deconflict.advisories.situations.subject import Member, Subject
from deconflict.advisories.words.conflict_wording import new_id

NEAR_M = 20.0
"""Largest diagonal of the box around the places of a group's advisories."""
SAME_PLACE_M = 15.0
"""A conflict that shares no robot joins up to this diagonal."""
NOTHING = Subject()
Cell = tuple[str, int, int]
"""A datum and the number of a square of `NEAR_M`."""
Key = TypeVar("Key", str, Cell)


class Box(NamedTuple):
    """A box around places, in metres in the frame of a datum."""

    west_m: float = inf
    south_m: float = inf
    east_m: float = -inf
    north_m: float = -inf

    def including(self, x_m: float, y_m: float) -> "Box":
        return Box(min(self.west_m, x_m), min(self.south_m, y_m), max(self.east_m, x_m), max(self.north_m, y_m))

    @property
    def extent_m(self) -> float:
        """Length of the diagonal."""
        return hypot(self.east_m - self.west_m, self.north_m - self.south_m)

    def distance_m(self, x_m: float, y_m: float) -> float:
        """From its centre."""
        return hypot((self.west_m + self.east_m) / 2 - x_m, (self.south_m + self.north_m) / 2 - y_m)


@dataclass(slots=True, eq=False)
class Group:
    """Advisories that belong together."""

    id: str
    began_s: float
    datum: str
    split_from: str | None = None
    """Id of the open group that it left."""
    subject: Subject = NOTHING
    is_open: bool = False
    """Whether its situation is open: then its subject stays."""
    members: dict[str, Member] = field(default_factory=dict)
    """By id of the advisory, in the order in which they came."""
    box: Box = field(default_factory=Box)
    """Around its advisories, or where the last ones were."""
    robots: set[str] = field(default_factory=set)
    """The robots of its advisories."""

    def open(self, subject: Subject) -> None:
        """Its situation begins."""
        self.subject, self.is_open = subject, True

    def add(self, advisory_id: str, member: Member) -> None:
        if not self.members:
            self.box, self.robots, self.datum = Box(), set(), member.datum
        self.members[advisory_id] = member
        self.box = self.box.including(member.x_m, member.y_m)
        self.robots |= member.robots
        if not self.is_open:
            self.subject = Subject.of_members(self.members.values())

    def takes(self, member: Member) -> bool:
        """Whether an advisory belongs to it."""
        is_about = self.subject.has(member)
        if member.place or (is_about and not self.members):
            return is_about
        if not self.datum or self.datum != member.datum or not self.members:
            return False
        extent_m = self.box.including(member.x_m, member.y_m).extent_m
        if extent_m > NEAR_M:
            return False
        is_near = extent_m <= SAME_PLACE_M or not self.robots.isdisjoint(member.robots)
        return is_about or (member.is_conflict and is_near)

    def rank(self, member: Member) -> tuple[bool, int, bool, float, str]:
        """Sorts the groups that take an advisory: first one that is about the same, and has most of its robots."""
        shared = len(self.subject.robots & member.robots)
        return (
            not self.subject.has(member),
            -shared,
            not self.is_open,
            self.box.distance_m(member.x_m, member.y_m),
            self.id,
        )

    @property
    def age_key(self) -> tuple[bool, float, str]:
        """Sorts by age; groups whose situation is open come first."""
        return not self.is_open, self.began_s, self.id


class Grouping:
    """The groups of all open advisories."""

    def __init__(self) -> None:
        self.groups: dict[str, Group] = {}
        """By id."""
        self._group_of: dict[str, Group] = {}
        """By id of the advisory."""
        self._near: defaultdict[Cell, set[str]] = defaultdict(set)
        """By datum and cell of `NEAR_M`, the ids of the groups with a box there."""
        self._with_name: defaultdict[str, set[str]] = defaultdict(set)
        """By robot, and by place of a subject, the ids of its groups."""
        self._keys: dict[str, tuple[set[Cell], set[str]]] = {}
        """By id of the group, its cells and names in the two indices."""

    def group_of(self, advisory_id: str) -> Group | None:
        return self._group_of.get(advisory_id)

    def restore(self, group: Group) -> None:
        """Continue a group that was known before a restart."""
        self.groups[group.id] = group
        self._group_of.update(dict.fromkeys(group.members, group))
        self._index(group)

    def remove(self, group: Group) -> None:
        """Forget a group. Its advisories are in none from now on."""
        del self.groups[group.id]
        for advisory_id in group.members:
            if self._group_of.get(advisory_id) is group:
                del self._group_of[advisory_id]
        cells, names = self._keys.pop(group.id, (set(), set()))
        _set(group.id, self._near, cells, ())
        _set(group.id, self._with_name, names, ())

    def update(self, now_s: float, changed: Mapping[str, Member | None]) -> list[Group]:
        """Take in advisories that changed, by id; None for those that ended. Returns the groups that changed."""
        touched = self._change_members(changed)
        placed: list[tuple[str, Member, str | None]] = [
            (advisory_id, member, None)
            for advisory_id, member in changed.items()
            if member is not None and advisory_id not in self._group_of
        ]
        for group in [*touched.values()]:
            split_from = group.id if group.is_open else group.split_from
            placed += [(advisory_id, member, split_from) for advisory_id, member in self._leaving(group)]
            self._index(group)
        for advisory_id, member, split_from in placed:
            group = self._place(advisory_id, member, now_s, split_from)
            touched[group.id] = group
        for group in sorted(touched.values(), key=lambda group: group.id):
            if into := self._joinable(group):
                self._merge(group, into)
                touched[into.id] = into
        return [group for group in touched.values() if group.id in self.groups]

    def _change_members(self, changed: Mapping[str, Member | None]) -> dict[str, Group]:
        """Update or remove the members that are known; their groups, by id."""
        touched = {}
        for advisory_id, member in changed.items():
            group = self._group_of.get(advisory_id)
            if group:
                touched[group.id] = group
                if member is None:
                    del group.members[advisory_id], self._group_of[advisory_id]
                else:
                    group.members[advisory_id] = member
        return touched

    def _leaving(self, group: Group) -> Iterator[tuple[str, Member]]:
        """Those that leave a group after a change of its members: what it would not take any more, the newest first."""
        subject = group.subject if group.is_open else None
        members = sorted(
            group.members.items(),
            key=lambda item: (subject is not None and not subject.has(item[1]), item[1].raised_s, item[0]),
        )
        group.members = {}
        for advisory_id, member in members:
            is_first = not group.members and subject is None
            if is_first or group.takes(member):
                group.add(advisory_id, member)
            else:
                del self._group_of[advisory_id]
                yield advisory_id, member

    def _place(self, advisory_id: str, member: Member, now_s: float, split_from: str | None) -> Group:
        """Put an advisory into the group that it fits best, or into a new one."""
        fitting = [group for group in self._neighbours(member) if group.takes(member)]
        if fitting:
            group = min(fitting, key=lambda group: group.rank(member))
        else:
            new = new_id(f"situation {split_from} {advisory_id}", now_s)
            group = self.groups[new] = Group(new, now_s, member.datum, split_from)
        self._add(advisory_id, member, group)
        self._index(group)
        return group

    def _add(self, advisory_id: str, member: Member, group: Group) -> None:
        group.add(advisory_id, member)
        self._group_of[advisory_id] = group

    def _joinable(self, group: Group) -> Group | None:
        """The group that all advisories of one fit into whose situation is not open."""
        if group.is_open or not group.members:
            return None
        first, *others = group.members.values()
        fitting = [
            other
            for other in self._neighbours(first)
            if other is not group and other.takes(first) and all(map(other.takes, others))
        ]
        return min(fitting, key=lambda other: other.age_key, default=None)

    def _merge(self, group: Group, into: Group) -> None:
        members = group.members
        self.remove(group)
        for advisory_id, member in members.items():
            self._add(advisory_id, member, into)
        self._index(into)

    def _neighbours(self, member: Member) -> list[Group]:
        """Groups that may take it: of the same robots or place, and for a conflict those near it. In the order of their
        ids."""
        cells = _cells(member.datum, Box().including(member.x_m, member.y_m), 1) if member.is_conflict else ()
        near = {other for cell in cells for other in self._near.get(cell, ())}
        named = {other for name in (*member.robots, member.place) for other in self._with_name.get(name, ())}
        return [self.groups[other] for other in sorted(near | named)]

    def _index(self, group: Group) -> None:
        """Bring the two indices up to date after any change of a group."""
        cells, names = self._keys.get(group.id, (set(), set()))
        new_cells = _cells(group.datum, group.box)
        new_names = group.robots | group.subject.robots | ({group.subject.place} - {""})
        _set(group.id, self._near, cells - new_cells, new_cells - cells)
        _set(group.id, self._with_name, names - new_names, new_names - names)
        self._keys[group.id] = new_cells, new_names


def _set(group_id: str, index: defaultdict[Key, set[str]], removed: Iterable[Key], added: Iterable[Key]) -> None:
    for key in removed:
        index[key].discard(group_id)
        if not index[key]:
            del index[key]
    for key in added:
        index[key].add(group_id)


def _cells(datum: str, box: Box, margin: int = 0) -> set[Cell]:
    """The squares that a box touches, with so many more on each side."""
    west, south, east, north = (floor(bound_m / NEAR_M) for bound_m in box)
    xs, ys = (range(low - margin, high + margin + 1) for low, high in ((west, east), (south, north)))
    return {(datum, x, y) for x in xs for y in ys}
