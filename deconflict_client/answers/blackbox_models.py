"""Black boxes as `GET /blackboxes` returns them."""

from datetime import datetime

from pydantic import BaseModel, ConfigDict, Field

from deconflict_client.advisory import Location


class AvoidingDelay(BaseModel):
    """A delay of one robot that would have avoided a near miss."""

    robot: str = Field(description="UUID")
    name: str
    later_s: float


class BoxedNearMiss(BaseModel):
    """Two robots that were within the clearance by their own reports."""

    robots: tuple[str, str] = Field(description="UUIDs")
    names: tuple[str, str]
    vendors: tuple[str, str]
    at: datetime = Field(description="when they came within the clearance")
    nearest_at: datetime
    separation_m: float = Field(description="the smallest; 0 if the envelopes overlapped")
    clearance_m: float
    location: Location
    advisory: str | None = Field(description="id of the one that was open then, or cleared in the 10 s before")
    warned_s: float | None = Field(description="how long before it was raised; null without an advisory")
    avoided_by: list[AvoidingDelay] = Field(description="empty if no delay of one robot would have avoided it")
    summary: str = Field(description="one sentence for a person")


class KeptBlackBox(BaseModel):
    """One file of what was received and decided around near misses."""

    model_config = ConfigDict(validate_by_name=True, validate_by_alias=True)

    file: str
    bytes: int
    sha256: str = Field(description="of its last line, which the next box continues from")
    from_at: datetime = Field(alias="from")
    until: datetime
    near_misses: list[BoxedNearMiss]


class BlackBoxList(BaseModel):
    """The black boxes that are kept, newest last: the near misses in each, and what would have avoided them."""

    blackboxes: list[KeptBlackBox]
