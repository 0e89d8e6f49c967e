"""The two reports of the standard, as models of every key they may have.

Types are strict and numbers are finite. Keys that the standard requires are required, except the angle and the datum:
a location without them still says where the robot is. The models do not check the text inside a string (UUID,
timestamp, state) or the length of a list. The parser checks those, so that it can count a deviation instead of
rejecting the message. Keys that the standard does not have are kept in `__pydantic_extra__`.
"""

from typing import Annotated

from pydantic import Field

from ingest.languages.massrobotics.amounts import AmountsReport
from ingest.languages.massrobotics.json_objects import Extent, PredictedLocation, Report, ReportedLocation, Velocity


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


class StatusReport(AmountsReport):
    """Where a robot is, how it is, and where it will be (standard, section 5)."""

    uuid: str
    timestamp: str
    operationalState: str  # noqa: N815
    location: ReportedLocation
    velocity: Velocity | None = None
    errorCodes: Annotated[list[str], Field(fail_fast=True)] | None = None  # noqa: N815
    destinations: Annotated[list[PredictedLocation], Field(fail_fast=True)] | None = None
    path: Annotated[list[PredictedLocation], Field(fail_fast=True)] | None = None
