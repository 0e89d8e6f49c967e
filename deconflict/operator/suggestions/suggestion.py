"""A suggestion: what to change, why, and what it would save."""

import shlex
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


class SuggestionList(BaseModel):
    """Suggestions, the largest expected saving first; at most five."""

    from_s: float
    until_s: float
    hours: float = Field(description="length of what was observed in it")
    suggestions: list[Suggestion]
    none_because: str = Field("", description="why there is no suggestion; empty if there is one")


def whatif_command(*options: str) -> str:
    """The command that checks a suggestion; LOG and SITE.toml are to be replaced."""
    return shlex.join(["deconflict", "whatif", "LOG", "--site", "SITE.toml", *options])


def minutes(seconds: float) -> str:
    """A length of time for people."""
    return f"{seconds / 60:.0f} min" if seconds >= 120 else f"{seconds:.0f} s"


def minutes_between(low_s: float, high_s: float) -> str:
    if high_s >= 120:
        low, high = f"{low_s / 60:.0f}", f"{high_s / 60:.0f} min"
    else:
        low, high = f"{low_s:.0f}", f"{high_s:.0f} s"
    return f"{low} to {high}"
