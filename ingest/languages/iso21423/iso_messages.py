"""The messages of ISO 21423 as far as they are read. Every key is optional, so that a gap does not hide the rest.

The names follow public descriptions and senders of the standard. Where they differ, both are read.
"""

import msgspec


class IsoObject(msgspec.Struct, rename="camel", gc=False, frozen=True):
    """A JSON object of ISO 21423."""


class IsoMessage(IsoObject, frozen=True):
    timestamp: str | None = None


class LocationPoint(IsoObject, frozen=True):
    """A point in a common coordinate system."""

    x: float
    y: float
    z: float | None = None
    ccs_id: str | None = None


class Orientation(IsoObject, frozen=True):
    yaw: float | None = None


class OdometryPose(IsoObject, frozen=True):
    location_point: LocationPoint
    orientation: Orientation | None = None


class Speeds(IsoObject, frozen=True):
    """Metres a second along the heading, and radians a second."""

    linear: float | None = None
    angular: float | None = None


class OdometryMessage(IsoMessage, frozen=True):
    pose: OdometryPose | None = None
    velocity: Speeds | None = None


class TimedPoint(IsoObject, frozen=True):
    """A point, and when the robot expects to be there."""

    location_point: LocationPoint
    timestamp: str = ""
    orientation: Orientation | None = None


class TrajectoryMessage(IsoMessage, frozen=True):
    local_trajectory: list[TimedPoint] | None = None


class CurvePoint(IsoObject, frozen=True):
    """A control point of a curve."""

    location_point: LocationPoint
    weight: float | None = None

    @property
    def x(self) -> float:
        return self.location_point.x

    @property
    def y(self) -> float:
        return self.location_point.y


class WayCurve(IsoObject, frozen=True):
    """A NURBS without times."""

    control_points: list[CurvePoint]
    degree: int | None = None
    knots: list[float] | None = None

    @property
    def knot_vector(self) -> list[float] | None:
        return self.knots


class WayMessage(IsoMessage, frozen=True):
    global_path: WayCurve | None = None


class PlanMessage(IsoMessage, frozen=True):
    global_plan: list[TimedPoint] | None = None


class CorePoint(IsoObject, frozen=True):
    """A point of a polygon in the robot's frame."""

    x: float
    y: float


class IsoDetails(IsoObject, frozen=True):
    imr_model: str | None = None
    imr_serial_number: str | None = None
    imr_name: str | None = None
    imr_footprint: list[CorePoint] | None = None
    imr_height: float | None = None
    rated_speed: float | None = None


class IdentityMessage(IsoMessage, frozen=True):
    manufacturer_name: str | None = None
    details: IsoDetails | None = None


class FootprintMessage(IsoMessage, frozen=True):
    """The outline at present, with its payload."""

    footprint: list[CorePoint] | None = None
    imr_footprint: list[CorePoint] | None = None
    height: float | None = None
    imr_height: float | None = None


class StatusMessage(IsoMessage, frozen=True):
    states: list[str] | None = None
    operating_states: list[str] | None = None
    """The name in the standard's table."""

    @property
    def named_states(self) -> list[str] | None:
        """The states under either name. None if there are none under both."""
        return self.operating_states if self.states is None else self.states


class BatteryMessage(IsoMessage, frozen=True):
    battery_soc: float | None = None
    """Between 0 and 1."""


STATES = (
    "MODE_AUTO",
    "MODE_MANUAL",
    "MODE_SEMIAUTO",
    "MODE_TELEOP",
    "MODE_MAINTENANCE",
    "OFFLINE",
    "LOST_CONNECTION",
    "LOST",
    "BLOCKED",
    "STOP_CATEGORY_0",
    "STOP_CATEGORY_1",
    "STOP_CATEGORY_2",
    "PAUSED",
    "IDLE",
    "PARKED",
    "CHARGING",
    "DOCKING",
    "UNDOCKING",
    "WAIT_FOR_RESET",
    "WAIT_FOR_EVENT",
    "WAIT_FOR_ATTACHMENT",
    "ATTACHMENT_ACTIVE",
    "FORWARD",
    "BACKWARD",
    "REVERSE",
    "TURN_LEFT",
    "TURN_RIGHT",
    "ROTATING",
    "MOVING",
    "STOPPED",
)
"""States as public descriptions name them. Others mean what the motion of the robot shows."""
RESOURCES: dict[str, type[IsoMessage]] = {
    "identity": IdentityMessage,
    "footprint": FootprintMessage,
    "odometry": OdometryMessage,
    "localTrajectory": TrajectoryMessage,
    "globalPlan": PlanMessage,
    "globalPath": WayMessage,
    "status": StatusMessage,
    "batteryStatus": BatteryMessage,
    "disconnection": IsoMessage,
}
"""By the last part of the topic. Of some only the time is read."""
REQUIRED: dict[str, tuple[str, ...]] = {
    "identity": ("manufacturer_name", "details"),
    "odometry": ("pose", "velocity"),
    "localTrajectory": ("local_trajectory",),
    "globalPath": ("global_path",),
    "globalPlan": ("global_plan",),
    "status": ("named_states",),
    "batteryStatus": ("battery_soc",),
}
KEYS = {
    "manufacturer_name": "manufacturerName",
    "local_trajectory": "localTrajectory",
    "global_path": "globalPath",
    "global_plan": "globalPlan",
    "named_states": "states",
    "battery_soc": "batterySoc",
}
"""Spelling in messages, where it is another."""
