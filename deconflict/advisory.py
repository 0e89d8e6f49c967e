"""The advisory as published, from raised to cleared: a conflict, a contention, a deadlock, a blockage or a claim."""

from dataclasses import dataclass
from datetime import UTC, datetime
from enum import StrEnum
from typing import Annotated, Any, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, TypeAdapter

Robot = Annotated[str, Field(description="UUID of a robot")]

BAD_AFTER = 4400
"""Close code of the stream: `after` is not a whole number, 0 or more."""
AFTER_BEYOND_LAST = 4416
"""Close code of the stream: `after` is a number that this store has not given yet."""
STORE_FAILED = 1011
"""Close code of the stream: the stored advisories can't be read."""


class AdvisoryState(StrEnum):
    RAISED = "raised"
    UPDATED = "updated"
    CLEARED = "cleared"


class Severity(StrEnum):
    CAUTION = "caution"
    WARNING = "warning"
    CRITICAL = "critical"


class EncounterClass(StrEnum):
    HEAD_ON = "head_on"
    CROSSING = "crossing"
    FOLLOWING = "following"
    STATIONARY_OBSTACLE = "stationary_obstacle"


class Published(BaseModel):
    """A part of what is published: frozen, and every number is finite."""

    model_config = ConfigDict(frozen=True, allow_inf_nan=False)


class Location(Published):
    """A place on a floor."""

    datum: str = Field(description="UUID of the planar datum whose frame x and y are in")
    x: float = Field(description="metres")
    y: float = Field(description="metres")


class Hold(Published):
    """Let a robot wait where it is before it follows its path as forecast."""

    robot: Robot
    hold_s: float = Field(gt=0)


class Slot(Published):
    """When a robot should have a resource."""

    robot: Robot
    resource: str = Field(description="id of the resource; it may be another one of its group")
    start_at: datetime
    end_at: datetime
    wait_s: float = Field(ge=0, description="from the robot's arrival to the start of its slot")


class Recommendation(Published):
    """What would end it at the least cost. Advice is for a site service to take or leave."""

    holds: tuple[Hold, ...] = ()
    slots: tuple[Slot, ...] = Field(default=(), description="in the order advised")
    cost_s: float = Field(ge=0, description="waiting in all, weighted by priority")
    bound_s: float = Field(ge=0, description="no advice costs less than this")
    first_come_cost_s: float | None = Field(default=None, ge=0, description="what first come, first served would cost")
    expected_saving_s: float = Field(default=0.0, description="against first come, first served, or against a stop")
    proven_optimal: bool
    note: str = Field(default="", description="what else a person should know, such as that no hold works")


class Wait(Published):
    """One robot that waits, or will wait, for another."""

    waiter: Robot
    holder: Robot
    where: str = Field(description='id of the resource or zone, or "path"')
    from_at: datetime


class Acknowledgement(Published):
    """Somebody has taken an advisory up, or says why nothing is done about it."""

    name: str = Field(description="who")
    reason: str = Field(description="what is done about it, or why nothing is")
    at: datetime


class Advisory(Published):
    """What one revision of every kind of advisory says. It advises; it is not safety rated and moves no robot."""

    id: str = Field(description="the same from raised to cleared, through every revision and restart")
    revision: int = Field(ge=1, description="1 when raised, one more with each change")
    seq: int = Field(default=0, ge=0, description="number of this revision in the stream; 0 before it is stored")
    state: AdvisoryState
    severity: Severity
    robots: tuple[Robot, ...] = Field(description="UUIDs, in ascending order")
    names: tuple[str, ...] = Field(description="what a person calls the robots, in the same order")
    vendors: tuple[str, ...] = Field(description="of the robots, in the same order")
    raised_at: datetime
    updated_at: datetime = Field(description="when this revision was decided")
    cleared_at: datetime | None = None
    cleared_because: str | None = Field(default=None, description="why it was cleared, in words")
    predicted_at: datetime = Field(description="when what it warns of begins")
    time_to_conflict_s: float = Field(ge=0, description="from updated_at to predicted_at; 0 where it has begun")
    location: Location | None = Field(description="where it begins; null where no place is known")
    summary: str = Field(description="one sentence for a person")
    recommendation: Recommendation | None = None
    acknowledgement: Acknowledgement | None = Field(default=None, description="the newest there is")
    safety_rated: Literal[False] = False

    def followed(self, **fields: Any) -> Self:
        """The next revision, with these fields changed."""
        return self._next(AdvisoryState.UPDATED, fields)

    def ended(self, now_s: float, because: str) -> Self:
        """The last revision."""
        now = moment(now_s)
        fields = {"updated_at": now, "cleared_at": now, "cleared_because": because, "time_to_conflict_s": 0.0}
        return self._next(AdvisoryState.CLEARED, fields)

    def _next(self, state: AdvisoryState, fields: dict[str, Any]) -> Self:
        return self.model_copy(update={"revision": self.revision + 1, "seq": 0, "state": state, **fields})


class PlacedAdvisory(Advisory):
    """An advisory on something that happens at a place."""

    location: Location = Field(description="where it begins")


class ConflictAdvisory(PlacedAdvisory):
    """One encounter of two robots: their envelopes come within the clearance."""

    kind: Literal["conflict"] = "conflict"
    robots: tuple[Robot, Robot] = Field(description="UUIDs, in ascending order")
    names: tuple[str, str] = Field(description="what a person calls the robots, in the same order")
    vendors: tuple[str, str] = Field(description="of the robots, in the same order")
    encounter: int = Field(ge=1, description="ordinal of this encounter of this pair")
    encounter_class: EncounterClass
    basis: tuple[str, str] = Field(
        description="what each forecast rests on: path, velocity, ...; (distrusted) where it contradicts the motion, "
        "(silent) where the robot is"
    )
    probability: float | None = Field(
        default=None,
        ge=0,
        le=1,
        description="that the two get in each other's way in the horizon: they meet, or one gives way to the other",
    )
    probability_interval: tuple[float, float] | None = Field(
        default=None, description="holds the probability with 90 %; where evidence is thin"
    )
    contact_probability: float | None = Field(
        default=None, ge=0, le=1, description="that the envelopes come within the clearance in the horizon"
    )
    clearance_m: float = Field(ge=0)
    min_separation_m: float = Field(ge=0, description="smallest distance of the envelopes; 0 where they overlap")
    closing_speed_mps: float = Field(description="at predicted_at; negative where they draw apart")


class ContentionAdvisory(PlacedAdvisory):
    """More robots than a resource or zone holds: soon (contention), or now (double occupancy)."""

    kind: Literal["contention", "double_occupancy"]
    resource: str = Field(description="id of the resource or zone")
    resource_name: str
    capacity: int = Field(ge=1)
    demand: int = Field(ge=0, description="robots that want it or have it at predicted_at")
    queue_length: int = Field(ge=0, description="longest queue expected")
    wait_s: float = Field(ge=0, description="longest wait expected")
    resources: tuple[str, ...] = Field(
        default=(), description="ids of all chargers that will be full, the resource among them; empty of one place"
    )
    expected: int = Field(
        default=0, ge=0, description="robots of the demand that have not said that they come, by their batteries"
    )
    probability: float | None = Field(
        default=None, ge=0, le=1, description="that it comes to that, where some are expected by their batteries"
    )


class DeadlockAdvisory(PlacedAdvisory):
    """Robots that wait for each other in a ring, or will."""

    kind: Literal["deadlock"] = "deadlock"
    cycle: tuple[Wait, ...] = Field(min_length=1, description="the evidence; each holder is the next one's waiter")


class BlockageAdvisory(PlacedAdvisory):
    """A robot that stands where others will pass."""

    kind: Literal["blockage"] = "blockage"
    blocker: Robot
    since_at: datetime
    holds_up: tuple[Robot, ...] = Field(description="the robots that it will hold up, soonest first")


class ClaimAdvisory(Advisory):
    """Robots that another vendor reports (foreign claim), or that are reported from two places at once."""

    kind: Literal["foreign_claim", "two_places"]
    robots: tuple[Robot, ...] = Field(description="UUIDs of the first ten of them, in ascending order")
    owner: str = Field(description="the vendor whose robots they are")
    claimant: str = Field(description="the vendor that reports them; the owner where they are in two places")
    claimed: int = Field(ge=1, description="how many robots there are in all, counted up to a thousand")


AnyAdvisory = Annotated[
    ConflictAdvisory | ContentionAdvisory | DeadlockAdvisory | BlockageAdvisory | ClaimAdvisory,
    Field(discriminator="kind"),
]
Kind = Literal["conflict", "contention", "double_occupancy", "deadlock", "blockage", "foreign_claim", "two_places"]

ADVISORY: TypeAdapter[AnyAdvisory] = TypeAdapter(AnyAdvisory)
"""Reads one revision of any kind."""


@dataclass(frozen=True, slots=True)
class Listing:
    """Some advisories, and the position in the stream at that moment."""

    seq: int
    """The newest number in the store."""
    advisories: list[AnyAdvisory]
    """The newest revision of each, newest first."""
    more: bool
    """Whether the limit left some out."""


def moment(t_s: float) -> datetime:
    """The time `t_s`, seconds since the epoch, as a `datetime`."""
    return datetime.fromtimestamp(t_s, UTC)
