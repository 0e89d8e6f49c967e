"""Robots as `GET /robots` returns them: what each reported, and how the service reads it."""

from typing import Any, Literal

from pydantic import BaseModel, Field

from deconflict_client.answers.filter_models import Filtered
from deconflict_client.answers.vendor_models import NamedOddValue
from deconflict_client.participant_kinds import ParticipantKind


class RobotClock(BaseModel):
    """The estimate for a robot's clock and connection."""

    offset_s: float = Field(description="our time minus the robot's; negative if its clock is fast")
    delay_s: float = Field(description="from the time of a pose to its arrival")


class RobotPosition(BaseModel):
    """Where a robot was at its last status, in the frame of its floor."""

    x: float = Field(description="metres")
    y: float = Field(description="metres")
    yaw_rad: float | None = Field(description="null if it does not report one")


class RobotEnvelope(BaseModel):
    """The box around a robot."""

    length_m: float
    width_m: float
    height_m: float | None = Field(description="null if it is not known")


class RobotDestination(BaseModel):
    """Where a robot goes next, in the frame of that floor."""

    floor: str | None = Field(description="UUID of its datum; null if the place is on no floor that is compared")
    x: float = Field(description="metres")
    y: float = Field(description="metres")
    expected_s: float | None = Field(description="when, as the robot says, seconds since the epoch")


class RobotForecast(BaseModel):
    """Where a robot is expected to be."""

    basis: str = Field(description="what it is made of: path, velocity, ...")
    reach_m: float = Field(description="from its first pose to its last, as the crow flies")
    knots: list[tuple[float, float, float, float | None]] = Field(
        description="poses: seconds after `event_s`, x and y in metres, yaw in radians"
    )


class TakenOff(BaseModel):
    """Why a silent robot counts as gone."""

    at_s: float = Field(description="when another robot drove through its place, seconds since the epoch")
    by: str = Field(description="name of the other robot")


class OffFloorNote(BaseModel):
    """What an operator says of a robot that is off the floor."""

    by: str = Field(description="who says so; empty if people do not sign in and gave no name")
    at_s: float = Field(description="since when, seconds since the epoch")
    floor: str | None = Field(description="UUID of the datum on which it was; null for a map on no floor")
    x: float = Field(description="where it was, metres")
    y: float = Field(description="metres")
    still_heard: bool = Field(description="whether it has reported since, from the same place")
    age_s: float | None = Field(description="since its last status; null if none is known")


class MovedByHand(BaseModel):
    """The last move that a robot can't have driven."""

    at_s: float = Field(description="when it was first heard at the other place, seconds since the epoch")
    distance_m: float
    took_s: float = Field(description="time between the two poses")
    times: int = Field(description="how many such moves there were since it is known")
    sentence: str


class HeardRobot(BaseModel):
    """One robot. What depends on its position is null or absent until it has one."""

    uuid: str
    name: str
    vendor: str
    language: str = Field(description="standard of its messages")
    participant: ParticipantKind = Field(description="what it stands for, by the site file")
    source: str = Field(description="where its messages come from")
    examined: bool = Field(description="whether it is compared with others as soon as it can be")
    unexamined_reason: str | None = None
    compared: bool
    not_compared_reason: str | None = Field(None, description="why not, and what to send or set")
    identified: bool = Field(description="whether it has sent an identity report")
    presence: Literal["present", "quiet", "silent"]
    age_s: float | None = Field(description="since its last status")
    state: str | None = Field(None, description="as it reports it; null before its first status")
    destination: RobotDestination | None = Field(None, description="null if it announces none")
    battery_pct: float | None = Field(None, description="level of its battery; null if it does not report one")
    run_time_left_s: float | None = Field(None, description="how much longer the battery lasts")
    load_used_pct: float | None = Field(None, description="share of the load that it can carry")
    clock: RobotClock
    deviations: dict[str, int] = Field(description="by rule, how many of its messages deviate")
    odd_values: list[NamedOddValue] = Field(description="what shows the deviations, the newest first")
    sizes: list[str] = Field(description="how sizes beyond `reading.largest_body_m` are read")
    identity: dict[str, Any] | None = Field(
        None, description="its identity report, in its language; over 64 KiB only `too_long_bytes`"
    )
    status: dict[str, Any] | None = Field(None, description="its last status, in its language; see `identity`")
    floor: str | None = Field(None, description="UUID of the datum in whose frame its position is")
    comparable: bool | None = Field(None, description="whether its map has a place on a floor of the site")
    location: RobotPosition | None = None
    event_s: float | None = Field(None, description="time of its last status, seconds since the epoch")
    doubt_m: float | None = Field(None, description="how far its position may be off")
    envelope: RobotEnvelope | None = None
    forecast: RobotForecast | None = None
    off_floor: OffFloorNote | None = Field(None, description="null unless an operator says that it is off the floor")
    moved: MovedByHand | None = Field(None, description="null if all its moves can have been driven")
    still_there: float = Field(description="the probability that it is still on the floor")
    taken_off: TakenOff | None = None


class RobotList(Filtered):
    """Every known robot that matches: what it reported, and how the service reads it."""

    robots: list[HeardRobot]
