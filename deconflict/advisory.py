"""The advisory as published: one encounter of two robots, from raised to cleared."""

from datetime import datetime
from enum import StrEnum
from typing import Literal

from pydantic import BaseModel, ConfigDict, Field


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


class Location(BaseModel):
    """A place on a floor."""

    model_config = ConfigDict(frozen=True, allow_inf_nan=False)

    datum: str = Field(description="UUID of the planar datum whose frame x and y are in")
    x: float = Field(description="metres")
    y: float = Field(description="metres")


class Advisory(BaseModel):
    """One revision of an advisory. It advises; it is not safety rated and moves no robot."""

    model_config = ConfigDict(frozen=True, allow_inf_nan=False)

    id: str = Field(description="the same from raised to cleared, through every revision and restart")
    revision: int = Field(ge=1, description="1 when raised, one more with each change")
    seq: int = Field(default=0, ge=0, description="number of this revision in the stream; 0 before it is stored")
    state: AdvisoryState
    kind: Literal["conflict"] = "conflict"
    severity: Severity
    encounter: int = Field(ge=1, description="ordinal of this encounter of this pair")
    encounter_class: EncounterClass
    robots: tuple[str, str] = Field(description="UUIDs, in ascending order")
    names: tuple[str, str] = Field(description="what a person calls the robots, in the same order")
    vendors: tuple[str, str]
    basis: tuple[str, str] = Field(description="what each forecast rests on: path, velocity, ...")
    raised_at: datetime
    updated_at: datetime = Field(description="when this revision was decided")
    cleared_at: datetime | None = None
    cleared_because: str | None = Field(default=None, description="why it was cleared, in words")
    predicted_at: datetime = Field(description="when the envelopes first come within the clearance")
    time_to_conflict_s: float = Field(ge=0, description="from updated_at to predicted_at")
    clearance_m: float = Field(ge=0)
    min_separation_m: float = Field(ge=0, description="smallest distance of the envelopes; 0 where they overlap")
    closing_speed_mps: float = Field(description="at predicted_at; negative where they draw apart")
    location: Location = Field(description="where the envelopes first come within the clearance")
    summary: str = Field(description="one sentence for a person")
    safety_rated: Literal[False] = False
