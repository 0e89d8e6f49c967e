"""Situations as published: open advisories that have one subject, as one thing for a person to look at."""

import operator
from collections.abc import Iterable
from dataclasses import dataclass
from datetime import datetime
from typing import Annotated, Generic, Literal, TypeGuard, TypeVar

from pydantic import Field, TypeAdapter, computed_field

from deconflict_client.advisory import (
    ADVISORY_KINDS,
    Action,
    Advisory,
    AnyAdvisory,
    Published,
    Robot,
    Severity,
    SituationKind,
)
from deconflict_client.advisory.robot_advice import RobotAdvice

BAD_AFTER = 4400
"""Close code of the stream: `after` is not a whole number, 0 or more."""
BAD_KINDS = 4422
"""Close code of the stream: `kinds` names something else than kinds."""
POSITION_LOST = 4416
"""Close code of the stream: not all that follows `after` is known here. What is open has to be read again."""
STORE_FAILED = 1011
"""Close code of the stream: the stored advisories can't be read."""

PeopleWaitFor = Literal["robots", "other_advice"]
"""What people wait for before they are asked."""
FAR_S, COST_STEP_S = 90.0, 15.0
"""What begins later is far ahead. Costs are compared in steps, so that situations do not change places for a second."""
MOST_ACTIONS, MOST_ADVISORIES, MOST_CORNERS, MOST_ROBOTS = 3, 40, 32, 20


class SituationAdvice(Published):
    """What to do about a situation. It names robots of the situation only."""

    actions: tuple[Action, ...] = Field(min_length=1, max_length=MOST_ACTIONS, description="the first to do first")
    for_people: bool = Field(default=True, description="whether people have time for it; else only programs do")
    text: str = Field(description="the actions as one sentence")
    since_at: datetime = Field(description="since when it is advised")
    changed_because: str = Field(
        default="",
        description="why it replaces other advice, or which robots were asked before people; empty if it is the first",
    )


class Situation(Advisory):
    """Open advisories that have one subject. Raised, updated and cleared like an advisory."""

    kind: Literal["situation"] = "situation"
    situation_kind: SituationKind = Field(description="what is going on")
    robots: tuple[Robot, ...] = Field(
        max_length=MOST_ROBOTS, description="UUIDs of the first twenty robots, in ascending order"
    )
    recommendation: None = Field(default=None, exclude=True)
    situation_id: None = Field(default=None, exclude=True)
    culprit: Robot | None = Field(
        default=None,
        description="UUID of the robot that stands or is silent in the way of the others; null if none is",
    )
    advice: SituationAdvice | None = Field(default=None, description="one thing to do; null if nothing helps any more")
    people_wait_for: PeopleWaitFor | None = Field(
        default=None,
        exclude_if=operator.not_,
        description="why people are not asked yet for what they could do: its robots were asked, or people were asked "
        "for something else less than a minute ago; absent if they are asked, or can do nothing",
    )
    subject_place: str = Field(
        default="", description="what it is about if its robots change: a resource, a crowd or a claim; else empty"
    )
    subject_robots: tuple[Robot, ...] = Field(
        default=(),
        max_length=MOST_ROBOTS,
        description="UUIDs of the robots that it is about, in ascending order; empty if it is about a place",
    )
    subject_is_ring: bool = Field(
        default=False, description="whether it is about robots that wait, or will wait, for each other in a ring"
    )
    outline: tuple[tuple[float, float], ...] = Field(
        max_length=MOST_CORNERS, description="corners of its area, in metres in the frame of the location's datum"
    )
    since_at: datetime = Field(description="when its first advisory was raised")
    ends: str = Field(description="how it ends if nobody does anything, for people")
    cost_s: float = Field(ge=0, description="seconds that its robots are expected to lose if nobody does anything")
    preventable_s: float | None = Field(
        ge=0, description="time left until the next loss that a person can still prevent; null if there is none"
    )
    advisories: tuple[str, ...] = Field(
        max_length=MOST_ADVISORIES, description="ids of its open advisories, oldest first, at most 40"
    )
    more_advisories: int = Field(default=0, ge=0, description="open advisories left out")
    split_from: str | None = Field(default=None, description="id of the situation that its advisories left")
    joined_into: str | None = Field(
        default=None, description="of earlier releases: id of the situation that it became part of"
    )

    @property
    def is_far(self) -> bool:
        """Whether it begins long after this revision."""
        return (self.predicted_at - self.updated_at).total_seconds() > FAR_S

    @computed_field(  # type: ignore[prop-decorator]
        description="its place among situations: of two, the one with lesser numbers, from the first on, comes first"
    )
    @property
    def order(self) -> tuple[int, ...]:
        """What is over last; the most severe first; of these what is between a person on foot and a vehicle; what is
        far ahead after the rest; then what can still be prevented; then what costs most; then what begins first."""
        severity = (Severity.CRITICAL, Severity.WARNING, Severity.CAUTION).index(self.severity)
        on_foot = [kind == "person" for kind in self.participants]
        is_mixed, is_lost = any(on_foot) and not all(on_foot), self.preventable_s is None
        ranks = not self.advisories, severity, not is_mixed, self.is_far, is_lost
        return (*map(int, ranks), -round(self.cost_s / COST_STEP_S), round(self.predicted_at.timestamp()))


AnyRevision = Annotated[AnyAdvisory | Situation | RobotAdvice, Field(discriminator="kind")]
"""What is stored and streamed: a revision of an advisory of any kind, of a situation, or of advice."""

REVISION: TypeAdapter[AnyRevision] = TypeAdapter(AnyRevision)
"""Reads one revision of an advisory, a situation or advice."""


Revision = TypeVar("Revision", bound=Advisory)


@dataclass(frozen=True, slots=True)
class Listing(Generic[Revision]):
    """Some advisories or situations, and the position in the stream at that moment."""

    seq: int
    """The newest number in the store."""
    advisories: list[Revision]
    """The newest revision of each, newest first."""
    more: bool
    """Whether the limit left some out."""


def most_urgent_first(situations: Iterable[Situation]) -> list[Situation]:
    """Situations in their order, as the API lists those that are open and the page shows them."""
    return sorted(situations, key=lambda situation: (situation.order, situation.id))


def chosen_kinds(choices: Iterable[str]) -> frozenset[str]:
    """The kinds of revisions that a receiver asks for by `KindChoice`."""
    kinds = frozenset[str](choices)
    return kinds - {"advisory"} | ADVISORY_KINDS if "advisory" in kinds else kinds


def is_advisory(revision: AnyRevision) -> TypeGuard[AnyAdvisory]:
    """Whether a revision is of an advisory, and not of a situation or of advice."""
    return not isinstance(revision, Situation | RobotAdvice)


def advisories_of(revisions: Iterable[AnyRevision]) -> list[AnyAdvisory]:
    """The revisions of advisories."""
    return [revision for revision in revisions if is_advisory(revision)]


def situations_of(revisions: Iterable[AnyRevision]) -> list[Situation]:
    """The revisions of situations."""
    return [revision for revision in revisions if isinstance(revision, Situation)]


def advice_of(revisions: Iterable[AnyRevision]) -> list[RobotAdvice]:
    """The revisions of advice."""
    return [revision for revision in revisions if isinstance(revision, RobotAdvice)]
