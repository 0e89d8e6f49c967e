"""The state of vendors as the API returns it."""

from datetime import datetime
from typing import Literal

from pydantic import BaseModel, Field

from deconflict_client.participant_kinds import ParticipantKind


class ForecastError(BaseModel):
    """Forecast errors at one horizon that 50, 80 and 90 % of cases do not exceed. Old cases count less."""

    horizon_s: int
    p50_m: float
    p80_m: float
    p90_m: float


class Coverage(BaseModel):
    """The share of errors that lay in the band that is meant to hold `share` of them."""

    share: float
    covered: float


class ArrivalError(BaseModel):
    """Errors of arrival times that were announced at most `ahead_up_to_s` ahead, and the share of late arrivals."""

    ahead_up_to_s: float
    p50_s: float
    p90_s: float
    late: float


class Flag(BaseModel):
    """A property of a vendor that has changed from its usual value."""

    what: Literal["forecast", "datum", "clock"]
    since: datetime
    by: float = Field(description="metres; for a clock seconds, positive if it is slow")
    words: str


class NamedOddValue(BaseModel):
    """A place in the messages of a robot or vendor where they deviate from a rule."""

    rule: str
    path: str = Field(description="where it stands in the message")
    value: str = Field(description="the newest, as sent, in JSON; may be cut")
    reading: str = Field(description="how it is read")
    nearest: str = Field("", description="the key that was probably meant, if the standard does not have this one")
    count: int = Field(description="messages that had it")
    last_received: str


class VendorOddValue(NamedOddValue):
    """The same of all robots of a vendor."""

    robots: int = Field(description="robots that sent it")


class UncomparedRobot(BaseModel):
    """A robot that is heard and compared with nobody."""

    uuid: str
    name: str
    reason: str = Field(description="why, and what to send or set")
    fault: str = Field(description="what is wrong, in two words; empty if it only waits or was just heard first")
    placed: bool = Field(description="whether it has a position")


class VendorAdvice(BaseModel):
    """What was asked of a vendor's robots to end standoffs, and what became of it."""

    asked: int = Field(0, description="pieces of advice")
    done: int = 0
    declined: int = 0
    not_begun: int = Field(0, description="not begun in time, or not needed any more")
    refusals: int = Field(0, description="declined though they can, or not begun in time")
    refused_s: float = Field(0.0, description="seconds that others stood because of that, at most 60 s for each")
    unable: int = Field(0, description="declined because they cannot")
    unable_s: float = Field(0.0, description="seconds that others stood because of that, at most 60 s for each")
    yielded_s: float = Field(0.0, description="seconds that its robots needed for what they were asked")
    let_through_s: float = Field(0.0, description="the same of other vendors' robots, for its robots")


class VendorHealth(BaseModel):
    """One vendor. Counts are since the service started. A level is null until it is known."""

    name: str
    robots: int = Field(0, description="its devices: robots, people on foot and driven vehicles")
    participants: dict[ParticipantKind, int] = Field(
        {}, description="how many of these stand for what; empty if all stand for robots"
    )
    silent: int = 0
    languages: list[str] = Field([], description="standards of its messages")
    distrusted: int = Field(
        0, description="robots that move otherwise than they announce: for 10 s on end, and until 30 s after"
    )
    messages: int = 0
    messages_per_s: float | None = Field(None, description="over the last minute, with rejected messages")
    rejected: int = 0
    rejections_by_rule: dict[str, int] = {}
    deviations: int = 0
    deviations_by_rule: dict[str, int] = {}
    odd_values: list[VendorOddValue] = Field([], description="what shows the deviations, as far as it is named")
    not_compared: list[UncomparedRobot] = Field([], description="robots that are compared with nobody; some if many")
    clock_s: float | None = Field(None, description="our time minus the vendor's; negative if its clock is fast")
    delay_s: float | None = Field(None, description="from the time of a pose to its arrival")
    forecast_age_s: float | None = None
    forecast_error: list[ForecastError] = []
    coverage: list[Coverage] = []
    arrivals: list[ArrivalError] = []
    grade: Literal["A", "B", "C", "D", "E"] | None = Field(None, description="how far its forecasts can be trusted")
    grade_words: str = Field("", description="why it has that grade, or none")
    flags: list[Flag] = []
    advice: VendorAdvice = VendorAdvice()


class VendorList(BaseModel):
    """Every vendor that has reported since the service started, by name."""

    vendors: list[VendorHealth]
