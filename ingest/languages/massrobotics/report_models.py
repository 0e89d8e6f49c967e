"""The two reports of the standard, as models of every key they may have.

Types are strict and numbers are finite. Keys that the standard requires are required, except the angle and the datum:
a location without them still says where the robot is. The models do not check the text inside a string (UUID,
timestamp, state) or the length of a list. The parser checks those, so that it can count a deviation instead of
rejecting the message. Keys that the standard does not have are kept in `__pydantic_extra__`.
"""

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field


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
    linear: float
    """Metres a second along the heading."""
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

    timestamp: str


class IdentityReport(Report):
    """Who a robot is and how large (standard, section 4)."""

    uuid: str
    timestamp: str
    manufacturerName: str  # noqa: N815
    robotModel: str  # noqa: N815
    robotSerialNumber: str  # noqa: N815
    baseRobotEnvelope: Extent  # noqa: N815
    maxSpeed: float | None = None  # noqa: N815
    maxRunTime: float | None = None  # noqa: N815
    emergencyContactInformation: str | None = None  # noqa: N815
    chargerType: str | None = None  # noqa: N815
    supportVendorName: str | None = None  # noqa: N815
    supportVendorContactInformation: str | None = None  # noqa: N815
    productDocumentation: str | None = None  # noqa: N815
    thumbnailImage: str | None = None  # noqa: N815
    cargoType: str | None = None  # noqa: N815
    cargoMaxVolume: Extent | None = None  # noqa: N815
    cargoMaxWeight: str | None = None  # noqa: N815


class StatusReport(Report):
    """Where a robot is, how it is, and where it will be (standard, section 5)."""

    uuid: str
    timestamp: str
    operationalState: str  # noqa: N815
    location: ReportedLocation
    velocity: Velocity | None = None
    batteryPercentage: float | None = None  # noqa: N815
    remainingRunTime: float | None = None  # noqa: N815
    loadPercentageStillAvailable: float | None = None  # noqa: N815
    errorCodes: Annotated[list[str], Field(fail_fast=True)] | None = None  # noqa: N815
    destinations: Annotated[list[PredictedLocation], Field(fail_fast=True)] | None = None
    path: Annotated[list[PredictedLocation], Field(fail_fast=True)] | None = None
