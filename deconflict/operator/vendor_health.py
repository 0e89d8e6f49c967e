"""How each vendor does, as the interface and the page show it, from the roles' measures."""

from collections.abc import Iterable, Mapping
from datetime import UTC, datetime
from typing import Any, Literal

from pydantic import BaseModel, Field

from deconflict.foresight.forecast_errors.grades import in_words
from ingest.measures import clock_changes
from ingest.measures.measures import Labels, joined_values

DIGITS = 3
"""Millimetres and milliseconds are as fine as anybody can use."""

Values = Mapping[str, Mapping[Labels, float]]


class ForecastError(BaseModel):
    """How far forecasts were off that far ahead: at most this, in 50, 80 and 90 % of cases; old cases fade."""

    horizon_s: int
    p50_m: float
    p80_m: float
    p90_m: float


class Coverage(BaseModel):
    """What share of errors lay within the band that was to hold `share` of them."""

    share: float
    covered: float


class ArrivalError(BaseModel):
    """How early or late robots came, of arrivals told at most so long ahead, and what share came late."""

    ahead_up_to_s: float
    p50_s: float
    p90_s: float
    late: float


class Flag(BaseModel):
    """What is no longer as it usually was."""

    what: Literal["forecast", "datum", "clock"]
    since: datetime
    by: float = Field(description="metres; seconds for a clock, above 0 where it is slow")
    words: str


class VendorHealth(BaseModel):
    """One vendor. Counts are since the service started; a level is null until there is one."""

    name: str
    robots: int = 0
    silent: int = 0
    distrusted: int = Field(0, description="robots that do other than they say")
    messages: int = 0
    messages_per_s: float | None = Field(None, description="over the last minute, rejected ones too")
    rejected: int = 0
    rejections_by_rule: dict[str, int] = {}
    deviations: int = 0
    deviations_by_rule: dict[str, int] = {}
    clock_s: float | None = Field(None, description="added to its stamps it gives our time; below 0 where it is fast")
    delay_s: float | None = Field(None, description="from a pose being true to its arrival")
    forecast_age_s: float | None = None
    forecast_error: list[ForecastError] = []
    coverage: list[Coverage] = []
    arrivals: list[ArrivalError] = []
    grade: Literal["A", "B", "C", "D", "E"] | None = Field(None, description="how far its forecasts can be trusted")
    grade_words: str = Field("", description="why it has that grade, or none")
    flags: list[Flag] = []


class VendorList(BaseModel):
    """Every vendor that was heard since the service started, by name."""

    vendors: list[VendorHealth]


def vendor_health(documents: Iterable[dict[str, Any]]) -> list[VendorHealth]:
    """By name, from the measures of those roles that answer: what the others know is left out."""
    values = {
        name: {labels: round(value, DIGITS) for labels, value in series.items()}
        for name, series in joined_values(documents).items()
    }
    heard = ("deconflict_robots", "deconflict_messages_total")
    names = {labels[0] for name in heard for labels in values.get(name, ())}
    return [_of(name, _part(values, name)) for name in sorted(names)]


def _part(values: Values, vendor: str) -> Values:
    """The series of one vendor, without its name."""
    return {
        name: {labels[1:]: value for labels, value in series.items() if labels[:1] == (vendor,)}
        for name, series in values.items()
    }


def _of(name: str, values: Values) -> VendorHealth:
    def by(measure: str) -> dict[str, int]:
        return {labels[0]: int(count) for labels, count in sorted(values.get(measure, {}).items())}

    def level(measure: str) -> float | None:
        return values.get(measure, {}).get(())

    robots, messages = by("deconflict_robots"), by("deconflict_messages_total")
    deviations = by("deconflict_deviations_total")
    grade = max(by("deconflict_forecast_grade"), default=None)
    return VendorHealth.model_validate(
        {
            "name": name,
            "robots": sum(robots.values()),
            "silent": robots.get("silent", 0),
            "distrusted": level("deconflict_robots_distrusted") or 0,
            "messages": sum(messages.values()),
            "messages_per_s": level("deconflict_messages_per_second"),
            "rejected": messages.get("rejected", 0),
            "rejections_by_rule": by("deconflict_rejections_total"),
            "deviations": sum(deviations.values()),
            "deviations_by_rule": deviations,
            "clock_s": level("deconflict_clock_offset_seconds"),
            "delay_s": level("deconflict_clock_delay_seconds"),
            "forecast_age_s": level("deconflict_forecast_age_seconds"),
            "forecast_error": _forecast_error(values),
            "coverage": [
                {"share": share, "covered": covered}
                for (share,), covered in sorted(values.get("deconflict_forecast_band_coverage_ratio", {}).items())
            ],
            "arrivals": _arrivals(values),
            "grade": grade,
            "grade_words": in_words(grade),
            "flags": list(_flags(values)),
        }
    )


def _forecast_error(values: Values) -> list[dict[str, float]]:
    told: dict[int, dict[str, float]] = {}
    for (horizon_s, share), metres in values.get("deconflict_forecast_error_metres", {}).items():
        told.setdefault(int(horizon_s), {})[f"p{float(share) * 100:.0f}_m"] = metres
    return [{"horizon_s": horizon_s, **sizes} for horizon_s, sizes in sorted(told.items())]


def _arrivals(values: Values) -> list[dict[str, float]]:
    told: dict[float, dict[str, float]] = {}
    for (ahead_s, share), seconds in values.get("deconflict_arrival_error_seconds", {}).items():
        told.setdefault(float(ahead_s), {})[f"p{float(share) * 100:.0f}_s"] = seconds
    for (ahead_s,), late in values.get("deconflict_arrivals_late_ratio", {}).items():
        told.setdefault(float(ahead_s), {})["late"] = late
    return [{"ahead_up_to_s": ahead_s, **sizes} for ahead_s, sizes in sorted(told.items())]


def _flags(values: Values) -> Iterable[Flag]:
    for (what,), since_s in sorted(values.get(clock_changes.SINCE, {}).items()):
        by = values.get(clock_changes.AMOUNTS[what], {}).get((), 0.0)
        words = {
            "forecast": f"forecasts {by:.1f} m further off than usual",
            "datum": f"positions {by:.1f} m off",
            "clock": f"clocks {abs(by):.1f} s {'slower' if by > 0 else 'faster'} than usual",
        }
        yield Flag.model_validate(
            {"what": what, "since": datetime.fromtimestamp(since_s, UTC), "by": by, "words": words[what]}
        )
