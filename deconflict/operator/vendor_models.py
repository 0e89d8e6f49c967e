"""The state of vendors as the API returns it."""

from datetime import datetime
from typing import Literal

from pydantic import BaseModel, Field


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


class VendorHealth(BaseModel):
    """One vendor. Counts are since the service started. A level is null until it is known."""

    name: str
    robots: int = 0
    silent: int = 0
    languages: list[str] = Field([], description="standards of its messages")
    distrusted: int = Field(0, description="robots whose motion contradicts their forecasts")
    messages: int = 0
    messages_per_s: float | None = Field(None, description="over the last minute, with rejected messages")
    rejected: int = 0
    rejections_by_rule: dict[str, int] = {}
    deviations: int = 0
    deviations_by_rule: dict[str, int] = {}
    clock_s: float | None = Field(None, description="our time minus the vendor's; negative if its clock is fast")
    delay_s: float | None = Field(None, description="from the time of a pose to its arrival")
    forecast_age_s: float | None = None
    forecast_error: list[ForecastError] = []
    coverage: list[Coverage] = []
    arrivals: list[ArrivalError] = []
    grade: Literal["A", "B", "C", "D", "E"] | None = Field(None, description="how far its forecasts can be trusted")
    grade_words: str = Field("", description="why it has that grade, or none")
    flags: list[Flag] = []


class VendorList(BaseModel):
    """Every vendor that has reported since the service started, by name."""

    vendors: list[VendorHealth]
