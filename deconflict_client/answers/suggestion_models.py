"""What to change on the floor, as `GET /suggestions` returns it."""

from typing import Literal

from pydantic import BaseModel, Field

SuggestionKind = Literal["dock", "one_way", "priority", "vendor", "clearance"]


class PairShare(BaseModel):
    """What robots of one vendor lose to those of another one."""

    vendor: str
    by: str
    lost_s_per_hour: float


class SuggestionEvidence(BaseModel):
    """The losses that a suggestion is derived from, per hour of the span."""

    lost_s_per_hour: float = Field(description="of the kinds that the change concerns")
    share: float = Field(description="of all lost time")
    losses: int = Field(description="how many losses, or parts of long ones")
    hours: float = Field(description="length of what was observed")
    from_s: float = Field(
        0.0, description="the losses are from then, seconds since the epoch; in a log, from its start"
    )
    until_s: float = Field(0.0, description="to then")
    pairs: list[PairShare] = Field([], description="the largest, at most three")


class Saving(BaseModel):
    """What a change would save."""

    low_s_per_hour: float
    high_s_per_hour: float
    by: Literal["rule", "model"] = Field(
        "rule", description="rule: a share of what is lost; model: the interval of `deconflict whatif`"
    )


class Suggestion(BaseModel):
    """What to change. docs/suggestions.md has the rules, and how often they were right."""

    kind: SuggestionKind
    place: str = Field("", description="zone, resource or area of the site file; empty if it concerns the floor")
    vendor: str = Field("", description="whose robots it concerns; empty if all")
    text: str = Field(description="the suggestion for people")
    evidence: SuggestionEvidence
    saving: Saving | None = Field(description="null if it saves no time by itself")
    check: str = Field(description="the command that simulates the change; empty if no simulation answers it")


LossCause = Literal[
    "narrow_lane",
    "opposed_one_way",
    "few_resources",
    "unordered_crossing",
    "standing_robot",
    "mixed",
]
ChangeKind = Literal["dock", "one_way", "widen", "order", "priority"]


class TriedChange(BaseModel):
    """A change of one place, and what it would save."""

    kind: ChangeKind
    subject: str = Field(description="the place that is changed, or the vendor that goes first")
    change: str = Field(description="what is changed, for people")
    check: str = Field(description="the command that simulates it")
    saving: Saving | None = Field(description="on the whole floor; null if the simulation has no answer")
    note: str = Field("", description="why there is no answer; empty if there is one")

    @property
    def pays(self) -> bool:
        return self.saving is not None and self.saving.low_s_per_hour > 0


class WorstPlace(BaseModel):
    """A place where robots lose the most time: why, what was tried, and what pays."""

    floor: str
    place: str = Field(description="zone, resource or area of the site file; empty outside all")
    x_m: float = Field(description="where most is lost in it, in the frame of the floor")
    y_m: float
    cause: LossCause
    evidence: SuggestionEvidence
    kinds: dict[str, float] = Field(description="seconds lost an hour, by kind of loss")
    turned: list[str] = Field([], description="vendors whose robots drive an aisle the other way than the rest")
    tried: list[TriedChange] = Field([], description="by simulation; empty if nobody has simulated it")
    best: TriedChange | None = Field(None, description="what pays the most; null if nothing is known to pay")
    since_s: float = Field(description="this stands since then, seconds since the epoch; in a log, from its start")
    text: str = Field("", description="all of it for people")


class SuggestionList(BaseModel):
    """The worst places, and suggestions for the floor, the largest expected saving first; at most five of each."""

    from_s: float
    until_s: float
    hours: float = Field(description="length of what was observed in it")
    suggestions: list[Suggestion]
    places: list[WorstPlace] = Field([], description="the five places where most is lost, the worst first")
    none_because: str = Field("", description="why there is no suggestion; empty if there is one")
