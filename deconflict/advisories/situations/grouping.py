"""Which open advisories belong to one situation. Pure.

An advisory joins a group on its floor that it fits, first of all one that shares a robot with it. A group has an extent
of at most `MOST_EXTENT_M`; or of at most `NEAR_M`, and at most `MOST_ROBOTS` robots. When a group outgrows this, its
newest advisories split off. Two groups that fit well within the bounds join, and the oldest keeps its id.
"""

from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from math import floor, hypot, inf
from typing import NamedTuple, TypeVar

from deconflict.advisories.words.conflict_wording import new_id
from deconflict_client.advisory import AnyAdvisory

MOST_EXTENT_M, JOINED_EXTENT_M = 10.0, 8.0
"""Largest diagonal of the box around the places of a group's advisories; and when two groups join."""
MOST_ROBOTS, JOINED_ROBOTS = 8, 7
"""Most robots of a group with a larger extent; and when two groups join."""
NEAR_M = 20.0
"""Largest extent of a group of few robots."""
UNBOUNDED = frozenset(("contention", "double_occupancy", "crowd"))
"""Kinds of advisories whose robots do not count: their place bounds them."""
LEAST_OPEN_S = 5.0
"""A situation is open for at least so long, so that a person can read it. Until then its group joins no older one."""
NOWHERE = (0.0, 0.0)
Cell = tuple[str, int, int]
"""A datum and the number of a square of `NEAR_M`."""
Key = TypeVar("Key", str, Cell)


class Box(NamedTuple):
    """A box around places, in metres in the frame of a datum."""

    west_m: float = inf
    south_m: float = inf
    east_m: float = -inf
    north_m: float = -inf

    def including(self, other: "Box") -> "Box":
        return Box(
            min(self.west_m, other.west_m),
            min(self.south_m, other.south_m),
            max(self.east_m, other.east_m),
            max(self.north_m, other.north_m),
        )

    @property
    def extent_m(self) -> float:
        """Length of the diagonal."""
        return hypot(self.east_m - self.west_m, self.north_m - self.south_m)

    def extent_with_m(self, other: "Box") -> float:
        """Length of the diagonal of the box around both. Called most of all, so it makes no box."""
        west_m, south_m, east_m, north_m = self
        other_west_m, other_south_m, other_east_m, other_north_m = other
        width_m = (east_m if east_m > other_east_m else other_east_m) - (
            west_m if west_m < other_west_m else other_west_m
        )
        depth_m = (north_m if north_m > other_north_m else other_north_m) - (
            south_m if south_m < other_south_m else other_south_m
        )
        return hypot(width_m, depth_m)

    def distance_m(self, x_m: float, y_m: float) -> float:
        """From its centre."""
        return hypot((self.west_m + self.east_m) / 2 - x_m, (self.south_m + self.north_m) / 2 - y_m)


class Member(NamedTuple):
    """What grouping needs to know of an open advisory."""

    raised_s: float
    datum: str
    """Empty if the advisory has no place: then it is alone in its group."""
    x_m: float
    y_m: float
    robots: frozenset[str]
    is_bounded: bool
    """Whether its robots count for `MOST_ROBOTS`."""

    @classmethod
    def of(cls, advisory: AnyAdvisory) -> "Member":
        place, is_bounded = advisory.location, advisory.kind not in UNBOUNDED
        datum, x_m, y_m = (place.datum, place.x, place.y) if place else ("", *NOWHERE)
        return cls(advisory.raised_at.timestamp(), datum, x_m, y_m, frozenset(advisory.robots), is_bounded)

    @property
    def box(self) -> Box:
        return Box(self.x_m, self.y_m, self.x_m, self.y_m)


@dataclass(slots=True, eq=False)
class Group:
    """Advisories that belong together."""

    id: str
    began_s: float
    datum: str
    split_from: str | None = None
    """Id of the group from which it split off."""
    opened_s: float | None = None
    """Since when its situation is open; None if it is not."""
    members: dict[str, Member] = field(default_factory=dict)
    """By id of the advisory, in the order in which they came."""
    box: Box = field(default_factory=Box)
    """Around its advisories, or where the last ones were."""
    robots: set[str] = field(default_factory=set)
    """The robots of its advisories, or of the last ones."""
    counted: set[str] = field(default_factory=set)
    """Those that count for `MOST_ROBOTS`."""

    def add(self, advisory_id: str, member: Member) -> None:
        was_empty = not self.members
        self.members[advisory_id] = member
        if was_empty:
            self.update()
        else:
            self._include([member])

    def update(self) -> None:
        """Work out anew what follows from its members."""
        if self.members:
            self.box, self.robots, self.counted = Box(), set(), set()
            self.datum = next(iter(self.members.values())).datum
            self._include(self.members.values())

    def _include(self, members: Iterable[Member]) -> None:
        for member in members:
            self.box = self.box.including(member.box)
            self.robots |= member.robots
            if member.is_bounded:
                self.counted |= member.robots

    def takes(self, other: "Group", most_extent_m: float = MOST_EXTENT_M, most_robots: int = MOST_ROBOTS) -> bool:
        """Whether it and another group are one within these bounds."""
        if not self.datum or self.datum != other.datum:
            return False
        extent_m = self.box.extent_with_m(other.box)
        if extent_m <= most_extent_m:
            return True
        return extent_m <= NEAR_M and len(self.counted | other.counted) <= most_robots

    @property
    def has_outgrown(self) -> bool:
        extent_m, is_large = self.box.extent_m, len(self.counted) > MOST_ROBOTS
        return extent_m > NEAR_M or (extent_m > MOST_EXTENT_M and is_large) or self._is_on_two_floors

    @property
    def _is_on_two_floors(self) -> bool:
        return any(member.datum != self.datum for member in self.members.values())

    @property
    def age_key(self) -> tuple[bool, float, str]:
        """Sorts by age; groups whose situation is open come first."""
        return self.opened_s is None, self.began_s, self.id


class Join(NamedTuple):
    """A group that became part of another one."""

    group: Group
    into: Group


class Grouping:
    """The groups of all open advisories."""

    def __init__(self) -> None:
        self.groups: dict[str, Group] = {}
        """By id."""
        self._group_of: dict[str, Group] = {}
        """By id of the advisory."""
        self._near: defaultdict[Cell, set[str]] = defaultdict(set)
        """By datum and cell of `NEAR_M`, the ids of the groups with a box there."""
        self._with_robot: defaultdict[str, set[str]] = defaultdict(set)
        """By robot, the ids of its groups."""
        self._keys: dict[str, tuple[set[Cell], set[str]]] = {}
        """By id of the group, its cells and robots in the two indices."""
        self._deferred: set[str] = set()
        """Ids of groups that may join others once their situations have been open long enough."""

    def group_of(self, advisory_id: str) -> Group | None:
        return self._group_of.get(advisory_id)

    def restore(self, group: Group) -> None:
        """Continue a group that was known before a restart."""
        group.update()
        self.groups[group.id] = group
        self._group_of.update(dict.fromkeys(group.members, group))
        self._index(group)

    def remove(self, group: Group) -> None:
        """Forget a group. Its advisories are in none from now on."""
        del self.groups[group.id]
        for advisory_id in group.members:
            if self._group_of.get(advisory_id) is group:
                del self._group_of[advisory_id]
        self._unindex(group)
        self._deferred.discard(group.id)

    def update(self, now_s: float, changed: Mapping[str, Member | None]) -> tuple[list[Group], list[Join]]:
        """Take in advisories that changed, by id; None for those that ended. Returns the groups that changed, and the
        groups that joined others."""
        touched = self._change_members(changed)
        for group in [*touched.values()]:
            group.update()
            touched |= {part.id: part for part in self._split(group, now_s)}
            self._index(group)
        for advisory_id, member in changed.items():
            if member is not None and advisory_id not in self._group_of:
                group = self._place(advisory_id, member, now_s)
                touched[group.id] = group
        joins = [*self._join(now_s, touched.keys() | self._deferred)]
        touched |= {join.into.id: join.into for join in joins}
        return [group for group in touched.values() if group.id in self.groups], joins

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

    def _place(self, advisory_id: str, member: Member, now_s: float) -> Group:
        """Put an advisory into the group that it fits best, or into a new one."""
        alone = self._alone(advisory_id, member, now_s)
        fitting = [group for group in self._neighbours(alone) if group.takes(alone)]
        if not fitting:
            self.groups[alone.id] = alone
            self._group_of[advisory_id] = alone
            self._index(alone)
            return alone
        group = min(fitting, key=lambda group: (group.robots.isdisjoint(member.robots), *_rank(group, member)))
        self._add(advisory_id, member, group)
        self._index_member(group, member)
        return group

    def _alone(self, advisory_id: str, member: Member, now_s: float, split_from: str | None = None) -> Group:
        group = Group(new_id(f"situation {split_from} {advisory_id}", now_s), now_s, member.datum, split_from)
        group.add(advisory_id, member)
        return group

    def _add(self, advisory_id: str, member: Member, group: Group) -> None:
        group.add(advisory_id, member)
        self._group_of[advisory_id] = group

    def _split(self, group: Group, now_s: float) -> Iterator[Group]:
        """Let the newest advisories leave a group that has outgrown its bounds; the groups that they make."""
        if not group.has_outgrown:
            return
        members = sorted(group.members.items(), key=lambda item: (item[1].raised_s, item[0]))
        group.members = {}
        parts, split_from = [group], group.id if group.opened_s is not None else group.split_from
        for advisory_id, member in members:
            alone = self._alone(advisory_id, member, now_s, split_from)
            part = group if not group.members else next((part for part in parts if part.takes(alone)), None)
            if part is None:
                parts.append(alone)
                self.groups[alone.id] = self._group_of[advisory_id] = alone
            else:
                self._add(advisory_id, member, part)
        for part in parts[1:]:
            self._index(part)
            yield part

    def _join(self, now_s: float, ids: Iterable[str]) -> Iterator[Join]:
        """Join groups that fit well into another one. A group whose situation was opened lately waits."""
        self._deferred = set()
        for group_id in sorted(ids):
            group = self.groups.get(group_id)
            if group is None or not group.members:
                continue
            others = [
                other
                for other in self._neighbours(group)
                if other.members and other.takes(group, JOINED_EXTENT_M, JOINED_ROBOTS)
            ]
            if not others:
                continue
            other = min(others, key=lambda other: (other.robots.isdisjoint(group.robots), *other.age_key))
            oldest, youngest = sorted((group, other), key=lambda each: each.age_key)
            if youngest.opened_s is not None and now_s - youngest.opened_s < LEAST_OPEN_S:
                self._deferred.add(youngest.id)
            else:
                self._merge(youngest, oldest)
                yield Join(youngest, oldest)

    def _merge(self, youngest: Group, oldest: Group) -> None:
        for advisory_id, member in youngest.members.items():
            self._add(advisory_id, member, oldest)
        self._index(oldest)
        self.remove(youngest)

    def _neighbours(self, group: Group) -> list[Group]:
        """Other groups that may fit with it: near, or with a robot in common. In the order of their ids."""
        cells, robots = _cells(group, margin=1), group.robots
        near = {other_id for cell in cells for other_id in self._near.get(cell, ())}
        linked = {other_id for robot in robots for other_id in self._with_robot.get(robot, ())}
        return [self.groups[other_id] for other_id in sorted((near | linked) - {group.id})]

    def _index(self, group: Group) -> None:
        """Bring the two indices up to date after any change of a group."""
        cells, robots = self._keys.get(group.id, (set(), set()))
        new_cells = _cells(group)
        self._set(group.id, self._near, cells - new_cells, new_cells - cells)
        self._set(group.id, self._with_robot, robots - group.robots, group.robots - robots)
        self._keys[group.id] = new_cells, set(group.robots)

    def _index_member(self, group: Group, member: Member) -> None:
        """Bring them up to date after an advisory has joined a group."""
        cells, robots = self._keys.setdefault(group.id, (set(), set()))
        new_cells = _cells(group)
        self._set(group.id, self._near, cells - new_cells, new_cells - cells)
        self._set(group.id, self._with_robot, (), member.robots - robots)
        robots |= member.robots
        self._keys[group.id] = new_cells, robots

    def _unindex(self, group: Group) -> None:
        cells, robots = self._keys.pop(group.id, (set(), set()))
        self._set(group.id, self._near, cells, ())
        self._set(group.id, self._with_robot, robots, ())

    @staticmethod
    def _set(group_id: str, index: defaultdict[Key, set[str]], removed: Iterable[Key], added: Iterable[Key]) -> None:
        for key in removed:
            index[key].discard(group_id)
            if not index[key]:
                del index[key]
        for key in added:
            index[key].add(group_id)


def _rank(group: Group, member: Member) -> tuple[float, str]:
    """Sorts groups by their distance from an advisory."""
    return group.box.distance_m(member.x_m, member.y_m), group.id


def _cells(group: Group, margin: int = 0) -> set[Cell]:
    """The squares that its box touches, with so many more on each side."""
    west, south, east, north = (floor(bound_m / NEAR_M) for bound_m in group.box)
    xs, ys = (range(low - margin, high + margin + 1) for low, high in ((west, east), (south, north)))
    return {(group.datum, x, y) for x in xs for y in ys}
