"""The JSON objects inside a report of the standard, as models of every key they may have.

Types are strict and numbers are finite. Keys that the standard does not have are kept in `__pydantic_extra__`.
"""

from types import NoneType
from typing import Any, get_args, get_origin

from pydantic import BaseModel, ConfigDict


class Report(BaseModel):
    """A JSON object of the standard."""

    model_config = ConfigDict(extra="allow", strict=True, allow_inf_nan=False, frozen=True)


class Quaternion(Report):
    x: float
    y: float
    z: float
    w: float


class Extent(Report):
    """Metres along the heading, across it and up. z is 0 if not sent."""

    x: float
    y: float
    z: float = 0.0


class Velocity(Report):
    linear: float | None = None
    """Metres a second along the heading. The standard requires it."""
    angular: Quaternion | None = None
    """The rotation made in one second."""


class ReportedLocation(Report):
    """Where a robot is. Senders confuse the two keys of the datum, so every location may have either."""

    x: float
    y: float
    z: float = 0.0
    angle: Quaternion | None = None
    planarDatum: str | None = None  # noqa: N815
    planarDatumUUID: str | None = None  # noqa: N815


class PredictedLocation(ReportedLocation):
    """Where a robot will be, and when."""

    timestamp: str = ""
    """Its schema demands it; a place without it is still a place."""


def value_type(annotation: Any) -> tuple[type, bool]:
    """The type of the values that a field may have, and whether it has a list of them."""
    arguments = [argument for argument in get_args(annotation) if argument is not NoneType]
    if get_origin(annotation) is list:
        return value_type(arguments[0])[0], True
    return value_type(arguments[0]) if arguments else (annotation, False)
