"""The two reports of the standard, as models of every key they may have.

Types are strict and numbers finite; required keys are required, but for an angle and a datum, without which a
location still tells where the robot is. What the schema asks of the text inside a string (UUID, timestamp, state)
and of the length of lists is looked at where it is read, so that a deviation can be counted rather than refused.
Keys that the standard does not have are kept aside.
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
    """Metres along the heading, across it and up; z 0 where not sent."""

    x: float
    y: float
    z: float = 0.0


class Velocity(Report):
    linear: float
    """Metres a second along the heading."""
    angular: Quaternion | None = None
    """The rotation made in one second."""


class Location(Report):
    """Where a robot is. Senders mix up the key of the datum, so both kinds of location have both."""

    x: float
    y: float
    z: float = 0.0
    angle: Quaternion | None = None
    planarDatum: str | None = None  # noqa: N815
    planarDatumUUID: str | None = None  # noqa: N815


class PredictedLocation(Location):
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
    location: Location
    velocity: Velocity | None = None
    batteryPercentage: float | None = None  # noqa: N815
    remainingRunTime: float | None = None  # noqa: N815
    loadPercentageStillAvailable: float | None = None  # noqa: N815
    errorCodes: Annotated[list[str], Field(fail_fast=True)] | None = None  # noqa: N815
    destinations: Annotated[list[PredictedLocation], Field(fail_fast=True)] | None = None
    path: Annotated[list[PredictedLocation], Field(fail_fast=True)] | None = None
