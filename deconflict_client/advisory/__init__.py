"""Advisories as published, from raised to cleared: conflicts, contentions, deadlocks, blockages, claims and crowds."""

import operator
from datetime import UTC, datetime
from enum import StrEnum
from typing import Annotated, Any, Literal, Self, get_args

from pydantic import BaseModel, ConfigDict, Field, TypeAdapter

from deconflict_client.advisory.cleared_code import ClearedCode as ClearedCode
from deconflict_client.participant_kinds import ParticipantKind

Robot = Annotated[str, Field(description="UUID of a robot")]


AdviceAnswer = Literal["accepted", "declined", "done"]
"""What a robot, or its vendor for it, answers to what is asked of it."""


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
    """Base of the published models: frozen, and every number is finite."""

    model_config = ConfigDict(frozen=True, allow_inf_nan=False)


class Location(Published):
    """A place on a floor."""

    datum: str = Field(description="UUID of the planar datum; x and y are in its frame")
    x: float = Field(description="metres")
    y: float = Field(description="metres")


class NamedPlace(Published):
    """A resource, zone or area of the site."""

    id: str | None = Field(default=None, description="id of the resource or zone; null for an area, which has none")
    name: str


class Hold(Published):
    """A robot waits at its place before it follows its forecast path."""

    robot: Robot
    hold_s: float = Field(gt=0)


class Slot(Published):
    """When a robot should have a resource."""

    robot: Robot
    resource: str = Field(description="id of the resource, which may be another of its group")
    start_at: datetime
    end_at: datetime
    wait_s: float = Field(ge=0, description="time from the robot's arrival to the start of its slot")


ActionKind = Literal["wait", "slow_down", "take_another_route", "back_out", "go_first", "look"]


class Action(Published):
    """What one robot should do, or what a person should look at."""

    robot: Robot
    name: str = Field(description="name of the robot for people")
    action: ActionKind
    seconds: float | None = Field(
        default=None,
        gt=0,
        description="how long to wait, or to keep the lower speed; null if it waits for the one that goes first",
    )
    speed_mps: float | None = Field(default=None, gt=0, description="the speed to slow down to")
    where: str = Field(default="", description="where to go or to look, for people; empty if it is the robot's place")
    resource: str | None = Field(default=None, description="id of the resource or zone that `where` names")
    start_at: datetime | None = Field(default=None, description="when the robot should be there")
    end_at: datetime | None = Field(default=None, description="until when it may stay there")
    reason: str = Field(default="", description="why, for people; empty if the advisory says it")
    task: str = Field(default="", description="what a person looks for and does there; only of `look`")
    text: str = Field(
        default="",
        exclude_if=operator.not_,
        description="the action as a sentence; only in a situation's advice, where `go_first` has none",
    )


class Recommendation(Published):
    """The advice that resolves the advisory at the least cost. A site service may follow it or not."""

    holds: tuple[Hold, ...] = Field(default=(), description="at most 20, those of the advisory's own robots first")
    slots: tuple[Slot, ...] = Field(default=(), description="in the advised order, at most 16")
    actions: tuple[Action, ...] = Field(
        default=(), description="what people can have done, the first to do first, at most three"
    )
    cost_s: float = Field(ge=0, description="sum of the waits, weighted by priority")
    bound_s: float = Field(ge=0, description="lower bound: no advice costs less")
    first_come_cost_s: float | None = Field(default=None, ge=0, description="cost of first come, first served")
    expected_saving_s: float = Field(default=0.0, description="compared with first come, first served, or with a stop")
    proven_optimal: bool
    note: str = Field(default="", description="further information for a person, such as that no hold helps")
    given_at: datetime | None = Field(
        default=None, description="from when holds and actions count; null for slots, which have times of their own"
    )
    changed_because: str = Field(default="", description="why it takes the place of earlier advice; empty if none did")
    more_holds: int = Field(default=0, exclude_if=operator.not_, description="holds left out; absent if none is")
    more_slots: int = Field(default=0, exclude_if=operator.not_, description="slots left out; absent if none is")


class Wait(Published):
    """A robot that waits, or will wait, for another."""

    waiter: Robot
    holder: Robot
    where: str = Field(description='id of the resource or zone, or "path"')
    from_at: datetime


class Acknowledgement(Published):
    """Who has acknowledged an advisory, and what is done about it or why nothing is."""

    name: str = Field(description="name of the person")
    reason: str = Field(description="what is done about it, or why nothing is")
    at: datetime
    summary: str = Field(default="", description="the headline that was acknowledged; later ones may differ")
    answer: AdviceAnswer | None = Field(
        default=None, exclude_if=operator.not_, description="what a vendor answers to advice; absent elsewhere"
    )


class Advisory(Published):
    """One revision of an advisory of any kind. It only advises: it is not safety rated and moves no robot."""

    id: str = Field(description="the same in every revision from raised to cleared, also after restarts")
    revision: int = Field(ge=1, description="1 when raised, then one more with each change")
    seq: int = Field(default=0, ge=0, description="number of this revision in the stream; 0 before it is stored")
    state: AdvisoryState
    severity: Severity
    robots: tuple[Robot, ...] = Field(description="UUIDs, in ascending order, at most 20")
    names: tuple[str, ...] = Field(description="names of the robots for people, in the same order")
    vendors: tuple[str, ...] = Field(description="vendors of the robots, in the same order")
    participants: tuple[ParticipantKind, ...] = Field(default=(), description="what each is; empty in older releases")
    raised_at: datetime
    updated_at: datetime = Field(description="time at which this revision was decided")
    cleared_at: datetime | None = None
    cleared_because: str | None = Field(default=None, description="why it was cleared, as text")
    cleared_code: ClearedCode | None = Field(default=None, description="the same for programs")
    predicted_at: datetime = Field(description="when the predicted event begins")
    time_to_conflict_s: float = Field(ge=0, description="from updated_at to predicted_at; 0 if the event has begun")
    location: Location | None = Field(description="place where the event begins; null if it is not known")
    places: tuple[NamedPlace, ...] = Field(
        default=(),
        exclude_if=operator.not_,
        description="of a conflict or situation: the places that its headline names, which it is at or near",
    )
    summary: str = Field(description="one sentence for a person: the headline with its time, and the advice")
    headline: str = Field(default="", description="what happens, without time and advice; empty in older releases")
    recommendation: Recommendation | None = Field(default=None, description="null once it is cleared")
    advised_wait_s: dict[str, float] = Field(
        default_factory=dict,
        exclude_if=operator.not_,
        description="by vendor, how long its robots were advised to wait; only once it is cleared, absent if none was",
    )
    acknowledgement: Acknowledgement | None = Field(default=None, description="the newest acknowledgement")
    situation_id: str | None = Field(
        default=None, description="id of the open situation that it was part of until this revision; null if of none"
    )
    more_robots: int = Field(
        default=0, exclude_if=operator.not_, description="robots left out, of every list; absent if none is"
    )
    safety_rated: Literal[False] = False

    def time_left_s(self, now_s: float) -> float:
        """Until the predicted event begins; 0 if it has begun."""
        return max(self.predicted_at.timestamp() - now_s, 0.0)

    def next_revision(self, **fields: Any) -> Self:
        """The next revision, with these fields changed."""
        return self._next(AdvisoryState.UPDATED, fields)

    def cleared_revision(self, now_s: float, code: ClearedCode, because: str | None = None) -> Self:
        """The last revision: nothing is left to do, so it has no advice. `because` says more than the code does."""
        now, why = moment(now_s), {"cleared_code": code, "cleared_because": because or code.because}
        fields = {"updated_at": now, "cleared_at": now, "time_to_conflict_s": 0.0, **why}
        advised = {"recommendation": None, "advised_wait_s": self._waits_by_vendor()}
        return self._next(AdvisoryState.CLEARED, fields | advised)

    def _waits_by_vendor(self) -> dict[str, float]:
        """By vendor, the seconds of the holds and waits of its robots in the advice."""
        advice, vendor_of = self.recommendation, dict(zip(self.robots, self.vendors, strict=True))
        holds = [(hold.robot, hold.hold_s) for hold in advice.holds] if advice else []
        slots = [(slot.robot, slot.wait_s) for slot in advice.slots] if advice else []
        waits_s: dict[str, float] = {}
        for robot, wait_s in holds + slots:
            if robot in vendor_of and wait_s > 0:
                waits_s[vendor_of[robot]] = waits_s.get(vendor_of[robot], 0.0) + wait_s
        return waits_s

    def _next(self, state: AdvisoryState, fields: dict[str, Any]) -> Self:
        return self.model_copy(update={"revision": self.revision + 1, "seq": 0, "state": state, **fields})


class PlacedAdvisory(Advisory):
    """An advisory on an event at a place."""

    location: Location = Field(description="place where the event begins")


class ConflictAdvisory(PlacedAdvisory):
    """A predicted encounter of two robots: their envelopes come within the clearance."""

    kind: Literal["conflict"] = "conflict"
    robots: tuple[Robot, Robot] = Field(description="UUIDs, in ascending order")
    names: tuple[str, str] = Field(description="names of the robots for people, in the same order")
    vendors: tuple[str, str] = Field(description="vendors of the robots, in the same order")
    encounter: int = Field(ge=1, description="number of this encounter among those of this pair")
    encounter_class: EncounterClass
    basis: tuple[str, str] = Field(
        description="basis of each forecast: path, velocity, ...; with (distrusted) if it contradicts the motion, "
        "with (silent) if the robot is silent"
    )
    probability: float | None = Field(
        default=None,
        ge=0,
        le=1,
        description="probability that the two get in each other's way in the horizon: they meet, or one gives way",
    )
    probability_interval: tuple[float, float] | None = Field(
        default=None, description="90 % interval of the probability; null if there is enough evidence"
    )
    contact_probability: float | None = Field(
        default=None, ge=0, le=1, description="probability that the envelopes come within the clearance in the horizon"
    )
    clearance_m: float = Field(ge=0)
    min_separation_m: float = Field(ge=0, description="smallest distance of the envelopes; 0 if they overlap")
    closing_speed_mps: float = Field(description="at predicted_at; negative if they move apart")
    event: str = Field(default="", description="the summary without the advice; empty in older releases")

    def cleared_revision(self, now_s: float, code: ClearedCode, because: str | None = None) -> Self:
        """The last revision. Its summary ends before the advice."""
        cleared = super().cleared_revision(now_s, code, because)
        return cleared.model_copy(update={"summary": self.event or self.summary})


class ContentionAdvisory(PlacedAdvisory):
    """More robots than a resource or zone can hold, soon (contention) or now (double occupancy)."""

    kind: Literal["contention", "double_occupancy"]
    resource: str = Field(description="id of the resource or zone")
    resource_name: str
    capacity: int = Field(ge=1)
    demand: int = Field(ge=0, description="robots that need it or occupy it at predicted_at")
    queue_length: int = Field(ge=0, description="longest expected queue")
    wait_s: float = Field(ge=0, description="longest expected wait")
    resources: tuple[str, ...] = Field(
        default=(),
        description="ids of all chargers that will be full, with the resource, at most 20; empty for one place",
    )
    expected: int = Field(
        default=0, ge=0, description="robots of the demand that are expected only because of their batteries"
    )
    probability: float | None = Field(
        default=None,
        ge=0,
        le=1,
        description="probability of the event; only if some robots are expected by their batteries",
    )


class DeadlockAdvisory(PlacedAdvisory):
    """Robots that wait, or will wait, for each other in a ring."""

    kind: Literal["deadlock"] = "deadlock"
    cycle: tuple[Wait, ...] = Field(
        min_length=1,
        description="the ring of waits, at most the first 20; the holder of each is the waiter of the next",
    )


class BlockageAdvisory(PlacedAdvisory):
    """A robot that stands in the way of others."""

    kind: Literal["blockage"] = "blockage"
    blocker: Robot
    since_at: datetime
    holds_up: tuple[Robot, ...] = Field(description="the robots that it will delay, soonest first, at most 19")


class ClaimAdvisory(Advisory):
    """Robots that another vendor reports (foreign claim), or that are reported at two places at once."""

    kind: Literal["foreign_claim", "two_places"]
    robots: tuple[Robot, ...] = Field(description="UUIDs of the first ten robots, in ascending order")
    owner: str = Field(description="the vendor whose robots they are")
    claimant: str = Field(description="the vendor that reports them; the owner if they are at two places")
    claimed: int = Field(ge=1, description="number of robots in all, at most a thousand")


class CrowdAdvisory(PlacedAdvisory):
    """Many robots that report from one place of a floor, where their bodies can't all be."""

    kind: Literal["crowd"] = "crowd"
    robots: tuple[Robot, ...] = Field(description="UUIDs of the first ten robots, in ascending order")
    vendor: str = Field(description='the vendor whose robots they are, or "several vendors at" where they send from')
    crowded: int = Field(ge=1, description="number of robots in all")


AnyAdvisory = Annotated[
    ConflictAdvisory | ContentionAdvisory | DeadlockAdvisory | BlockageAdvisory | ClaimAdvisory | CrowdAdvisory,
    Field(discriminator="kind"),
]
Kind = Literal[
    "conflict", "contention", "double_occupancy", "deadlock", "blockage", "foreign_claim", "two_places", "crowd"
]
RevisionKind = Literal[Kind, "situation", "advice"]
KindChoice = Literal[RevisionKind, "advisory"]
"""What a receiver of revisions may ask for: "advisory" stands for every kind of advisory."""
SituationKind = Literal[
    "meeting", "head_on", "knot", "queue", "crowd", "blocked_aisle", "obstacle", "silent_robot", "deadlock", "identity"
]
SITUATION = "situation"
ADVISORY_KINDS = frozenset[str](get_args(Kind))
ADVICE = "advice"
EVERY_KIND = ADVISORY_KINDS | {SITUATION, ADVICE}

ADVISORY: TypeAdapter[AnyAdvisory] = TypeAdapter(AnyAdvisory)
"""Reads one revision of any kind."""


def moment(t_s: float) -> datetime:
    """The time `t_s`, seconds since the epoch, as a `datetime`."""
    return datetime.fromtimestamp(t_s, UTC)
