"""What a situation is about: a place, or robots in each other's way. Pure.

A queue, a crowd and a claim are about their place or their vendors, and their robots change. If a robot stands or is
silent in the way of others, the situation is about that robot, whoever comes. All else is about the robots of a
meeting, a knot or a ring, while two of them are in each other's way.
"""

from collections.abc import Iterable
from typing import NamedTuple

from deconflict.advisories.finding_lifecycle import finding_key
from deconflict.advisories.situations.situation_kinds import stands
from deconflict.advisories.words.situation_words import Matter
from deconflict_client.advisory import (
    AnyAdvisory,
    BlockageAdvisory,
    ClaimAdvisory,
    ConflictAdvisory,
    ContentionAdvisory,
    CrowdAdvisory,
)
from deconflict_client.situations import MOST_ROBOTS

NOWHERE = (0.0, 0.0)


class Member(NamedTuple):
    """What grouping needs to know of an open advisory."""

    raised_s: float
    datum: str
    """Empty if the advisory has no place."""
    x_m: float
    y_m: float
    robots: frozenset[str]
    """Those that are the cause of it: of a blockage, the robot that stands."""
    place: str = ""
    """What it is about, if its robots change; else empty."""
    is_conflict: bool = True
    still: frozenset[str] = frozenset()
    """Those that stand, or are silent, in the way."""

    @classmethod
    def of(cls, advisory: AnyAdvisory) -> "Member":
        at = advisory.location
        datum, x_m, y_m = (at.datum, at.x, at.y) if at else ("", *NOWHERE)
        robots = (advisory.blocker,) if isinstance(advisory, BlockageAdvisory) else advisory.robots
        is_conflict, raised_s = isinstance(advisory, ConflictAdvisory), advisory.raised_at.timestamp()
        still = frozenset(robot for robot in robots if _stands(advisory, robot))
        return cls(raised_s, datum, x_m, y_m, frozenset(robots), _place_of(advisory), is_conflict, still)


def _stands(advisory: AnyAdvisory, robot: str) -> bool:
    """Whether a robot stands in it: who blocks an aisle, or is part of a ring, does."""
    return stands(advisory, robot) if isinstance(advisory, ConflictAdvisory) else True


def _place_of(advisory: AnyAdvisory) -> str:
    match advisory:
        case ContentionAdvisory():
            return f"resource {advisory.resource}"
        case CrowdAdvisory() | ClaimAdvisory():
            return finding_key(advisory)
    return ""


class Subject(NamedTuple):
    """A place, or a cause and its robots."""

    place: str = ""
    robots: frozenset[str] = frozenset()
    is_ring: bool = False
    """Whether the cause is that they wait for each other."""
    is_culprit: bool = False
    """Whether the cause is that its robot stands, or is silent, in the way of others."""
    is_begun: bool = True
    """Whether a situation is about it. Before, any of its robots is enough."""

    @classmethod
    def of(cls, matter: Matter) -> "Subject":
        """The subject of a situation that begins."""
        principal = Member.of(matter.principal)
        if principal.place:
            return cls(principal.place)
        robots = {robot for advisory in matter.advisories for robot in Member.of(advisory).robots}
        return cls.of_robots([matter.culprit] if matter.culprit else robots, is_ring=matter.kind == "deadlock")

    @classmethod
    def of_robots(cls, robots: Iterable[str], *, is_ring: bool) -> "Subject":
        """One robot in the way of others, or robots in each other's way."""
        listed = frozenset(sorted(robots)[:MOST_ROBOTS])
        return cls("", listed, is_ring, is_culprit=len(listed) == 1)

    @classmethod
    def of_members(cls, members: Iterable[Member]) -> "Subject":
        """What advisories may come to be about whose situation has not begun."""
        found = list(members)
        place = next((member.place for member in found if member.place), "")
        robots = frozenset[str]().union(*(member.robots for member in found))
        return cls(place) if place else cls(robots=robots, is_begun=False)

    def has(self, member: Member) -> bool:
        """Whether an advisory is about it."""
        if self.place or member.place:
            return self.place == member.place
        if self.is_culprit:
            return self.robots <= member.still
        return len(self.robots & member.robots) > self.is_begun

    def concerns(self, member: Member) -> bool:
        """Whether its sentence tells of an advisory: it is about it, or a conflict of one of its robots."""
        is_shared = member.is_conflict and not self.is_ring and not self.robots.isdisjoint(member.robots)
        return self.has(member) or is_shared
