"""The state of the service as `GET /healthz` returns it."""

from typing import Literal

from pydantic import BaseModel, Field


class PartHealth(BaseModel):
    """One part of the service."""

    status: str = Field(description="ok, or what is wrong")
    reason: str = Field("", description="why it is not ok, and what to do")


class DeliveryHealthPart(PartHealth):
    delay_s: float = Field(description="age of the oldest decision that is not stored")


class RecordingHealthPart(PartHealth):
    lines_dropped: int


class AdmissionHealthPart(PartHealth):
    waiting: int = Field(description="new robots that are not examined")


class RobotsHealthPart(PartHealth):
    robots: int = Field(description="robots that it concerns")


class OffFloorHealthPart(PartHealth):
    robots: int = Field(0, description="how many robots are off the floor, as operators say")
    still_heard: list[str] = Field([], description="names of some of these that are still heard where they were")


class BrokersHealthPart(PartHealth):
    notes: list[str] = Field(description="topics of robots that are not heard, and what to set")
    heard_by: dict[str, list[str]] = Field({}, description="by broker, the connected ingests of a cluster")


class FilesHealthPart(PartHealth):
    faults: dict[str, str] = Field({}, description="by file, why it can't be used, and what to do")


class RefusalsHealthPart(PartHealth):
    notes: list[str] = Field([], description="what was refused or lost and is no fault of the service")


class CertificatesHealthPart(PartHealth):
    expires_s: dict[str, float] = Field({}, description="by key of the site file, Unix time of the end")


class MissingMember(BaseModel):
    """A member of a cluster that is not there."""

    part: str
    host: str
    process: int
    heard_s: float = Field(description="Unix time of when it was heard of last, to within 5 s")


class MembersHealthPart(PartHealth):
    there: dict[str, int] = Field({}, description="by part, how many there are; empty if that is unknown")
    expected: dict[str, int] = Field({}, description="by part, how many must be there")
    gone: list[MissingMember] = Field([], description="those that are missing, as far as they were ever heard of")


class CanaryHealthPart(PartHealth):
    latency_s: float = Field(description="from the messages of made-up robots to the stored advisory")


class StoreHealthPart(PartHealth):
    seq: int | None = Field(None, description="the newest number; null if the store can't be read")
    bytes: int | None = None
    unstored: int = Field(0, description="revisions that wait for the disk")
    pruned_for_size: int = 0
    set_aside: str | None = Field(None, description="name of the damaged file; null if there was none")
    copied: int = Field(0, description="revisions that were read from it")
    lost: int = Field(0, description="how many at most could not be read")


class KernelProgress(BaseModel):
    """How many kernels the engine has compiled."""

    done: int
    total: int


class SiteFileState(BaseModel):
    """What the last reload of the site file left to do."""

    problems: list[str] = []
    needs_restart: list[str] = Field([], description="changed keys that wait for a restart")


class ServiceHealth(BaseModel):
    """The service and its parts. A part is null if the service has none, or the supervisor does not answer."""

    status: Literal["ok", "degraded"]
    roles: dict[str, Literal["up", "down"]]
    store: StoreHealthPart
    restarts: dict[str, int] = Field({}, description="by role, how often its process was restarted")
    preparing: KernelProgress | None = Field(None, description="null unless the engine compiles its kernels")
    effort: str | None = Field(None, description="full, or how the engine saves work")
    notice: str = Field("", description="a sentence for people that the page shows")
    delivery: DeliveryHealthPart | None = None
    recording: RecordingHealthPart | None = None
    admission: AdmissionHealthPart | None = None
    pairs: RobotsHealthPart | None = None
    positions: RobotsHealthPart | None = None
    brokers: BrokersHealthPart | None = None
    files: FilesHealthPart | None = None
    certificates: CertificatesHealthPart | None = None
    refused_or_lost: RefusalsHealthPart | None = Field(None, description="what was refused or lost in ten minutes")
    supervisor: PartHealth | None = None
    clock: PartHealth | None = None
    off_floor: OffFloorHealthPart | None = None
    canary: CanaryHealthPart | None = Field(None, description="null while `cluster` is there")
    members: MembersHealthPart | None = Field(None, description="of a cluster; null on a single machine")
    cluster: PartHealth | None = Field(
        None, description="of a machine of a cluster that no NATS server is connected to; null otherwise"
    )
    site: SiteFileState = SiteFileState()
