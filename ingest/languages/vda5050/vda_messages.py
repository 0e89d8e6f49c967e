"""The messages of VDA 5050 as far as they are read: the keys of 2.0, 2.1 and 3.0 together.

Every key is optional and may be null, so that a message with a gap still says the rest. `REQUIRED` names the keys that
all versions demand. Keys that are not read are skipped. `UNKNOWN` stands for a word that an enumeration does not have.
"""

from typing import Literal

import msgspec

OperatingMode = Literal[
    "AUTOMATIC",
    "SEMIAUTOMATIC",
    "MANUAL",
    "INTERVENED",
    "SERVICE",
    "TEACHIN",
    "TEACH_IN",
    "STARTUP",
    "UNKNOWN",
]
ActionStatus = Literal["WAITING", "INITIALIZING", "RUNNING", "PAUSED", "RETRIABLE", "FINISHED", "FAILED", "UNKNOWN"]
ErrorLevel = Literal["WARNING", "URGENT", "CRITICAL", "FATAL", "UNKNOWN"]
EmergencyStop = Literal["NONE", "AUTOACK", "MANUAL", "REMOTE", "UNKNOWN"]
RequestStatus = Literal["REQUESTED", "GRANTED", "REVOKED", "EXPIRED", "UNKNOWN"]
BlockingType = Literal["NONE", "SINGLE", "SOFT", "HARD", "UNKNOWN"]
OrientationType = Literal["GLOBAL", "TANGENTIAL", "UNKNOWN"]
ConnectionState = Literal["ONLINE", "OFFLINE", "HIBERNATING", "CONNECTIONBROKEN", "CONNECTION_BROKEN", "UNKNOWN"]


class VdaObject(msgspec.Struct, rename="camel", gc=False, frozen=True):
    """A JSON object of VDA 5050."""


class Header(VdaObject, frozen=True):
    header_id: int | None = None
    timestamp: str | None = None
    version: str | None = None
    manufacturer: str | None = None
    serial_number: str | None = None


class Position(VdaObject, frozen=True):
    """Where a robot is, `agvPosition` or `mobileRobotPosition`."""

    x: float
    y: float
    theta: float | None = None
    map_id: str | None = None
    position_initialized: bool | None = None
    """Of 2.x; `localized` of 3.0."""
    localized: bool | None = None
    deviation_range: float | None = None

    @property
    def key(self) -> str:
        """The key under which it stands, by what only 3.0 has."""
        return "agvPosition" if self.localized is None else "mobileRobotPosition"

    @property
    def is_lost(self) -> bool:
        """Whether the robot says that it does not know where it is."""
        return (self.position_initialized if self.localized is None else self.localized) is False


class Velocity2d(VdaObject, frozen=True):
    """Metres a second along and across the heading, and radians a second."""

    vx: float | None = None
    vy: float | None = None
    omega: float | None = None


class NodePlace(VdaObject, frozen=True):
    """Where a node is."""

    x: float
    y: float
    theta: float | None = None
    """The heading that the robot takes there."""
    allowed_deviation_theta: float | None = None
    map_id: str | None = None


class ControlPoint(VdaObject, frozen=True):
    x: float
    y: float
    weight: float | None = None


class Trajectory(VdaObject, frozen=True):
    control_points: list[ControlPoint]
    degree: int | None = None
    knot_vector: list[float] | None = None


class NodeState(VdaObject, frozen=True):
    sequence_id: int
    node_id: str = ""
    released: bool | None = None
    node_position: NodePlace | None = None


class EdgeState(VdaObject, frozen=True):
    sequence_id: int
    released: bool = False
    trajectory: Trajectory | None = None


class ActionState(VdaObject, frozen=True):
    action_id: str = ""
    action_type: str | None = None
    action_status: ActionStatus | None = None


class Point3d(VdaObject, frozen=True):
    x: float
    y: float
    z: float = 0.0
    theta: float | None = None


class LoadDimensions(VdaObject, frozen=True):
    length: float
    width: float
    height: float | None = None


class Load(VdaObject, frozen=True):
    bounding_box_reference: Point3d | None = None
    """The centre of the bottom of its box, in the robot's frame."""
    load_dimensions: LoadDimensions | None = None


class Power(VdaObject, frozen=True):
    """`batteryState` of 2.x, `powerSupply` of 3.0."""

    battery_charge: float | None = None
    state_of_charge: float | None = None
    charging: bool | None = None


class VdaError(VdaObject, frozen=True):
    error_type: str = ""
    error_level: ErrorLevel | None = None


class SafetyState(VdaObject, frozen=True):
    e_stop: EmergencyStop | None = None
    active_emergency_stop: EmergencyStop | None = None
    field_violation: bool | None = None


class AccessRequest(VdaObject, frozen=True):
    request_status: RequestStatus | None = None


class Waypoint(VdaObject, frozen=True):
    x: float
    y: float
    eta: str = ""
    theta: float | None = None


class IntermediatePath(VdaObject, frozen=True):
    polyline: list[Waypoint]


class PlannedPath(VdaObject, frozen=True):
    trajectory: Trajectory | None = None


class VdaMotion(Header, frozen=True):
    """What `state` and `visualization` share."""

    agv_position: Position | None = None
    mobile_robot_position: Position | None = None
    velocity: Velocity2d | None = None
    intermediate_path: IntermediatePath | None = None
    planned_path: PlannedPath | None = None

    @property
    def position(self) -> Position | None:
        return self.mobile_robot_position or self.agv_position


class StateMessage(VdaMotion, frozen=True):
    order_id: str | None = None
    order_update_id: int | None = None
    last_node_id: str | None = None
    last_node_sequence_id: int | None = None
    distance_since_last_node: float | None = None
    node_states: list[NodeState] | None = None
    edge_states: list[EdgeState] | None = None
    loads: list[Load] | None = None
    driving: bool | None = None
    paused: bool | None = None
    new_base_request: bool | None = None
    zone_requests: list[AccessRequest] | None = None
    edge_requests: list[AccessRequest] | None = None
    action_states: list[ActionState] | None = None
    battery_state: Power | None = None
    power_supply: Power | None = None
    operating_mode: OperatingMode | None = None
    errors: list[VdaError] | None = None
    safety_state: SafetyState | None = None


class VdaAction(VdaObject, frozen=True):
    action_id: str = ""
    blocking_type: BlockingType | None = None


class VdaNode(VdaObject, frozen=True):
    sequence_id: int
    node_id: str = ""
    released: bool | None = None
    node_position: NodePlace | None = None
    actions: list[VdaAction] | None = None


class Edge(VdaObject, frozen=True):
    sequence_id: int
    start_node_id: str = ""
    end_node_id: str = ""
    released: bool = False
    max_speed: float | None = None
    maximum_speed: float | None = None
    max_rotation_speed: float | None = None
    orientation: float | None = None
    orientation_type: OrientationType | None = None
    trajectory: Trajectory | None = None


class OrderMessage(Header, frozen=True):
    order_id: str | None = None
    order_update_id: int | None = None
    nodes: list[VdaNode] | None = None
    edges: list[Edge] | None = None


class ConnectionMessage(Header, frozen=True):
    connection_state: ConnectionState | None = None


class TypeSpecification(VdaObject, frozen=True):
    series_name: str | None = None
    agv_kinematic: str | None = None
    mobile_robot_kinematics: str | None = None


class PhysicalParameters(VdaObject, frozen=True):
    length: float | None = None
    width: float | None = None
    height_max: float | None = None
    maximum_height: float | None = None
    speed_max: float | None = None
    maximum_speed: float | None = None
    maximum_angular_speed: float | None = None


class Vertex(VdaObject, frozen=True):
    x: float
    y: float


class VdaOutline(VdaObject, frozen=True):
    """A polygon of the robot's frame, `polygonPoints` or `vertices`."""

    polygon_points: list[Vertex] | None = None
    vertices: list[Vertex] | None = None


class Geometry(VdaObject, frozen=True):
    envelopes2d: list[VdaOutline] | None = None


class FactsheetMessage(Header, frozen=True):
    type_specification: TypeSpecification | None = None
    physical_parameters: PhysicalParameters | None = None
    load_specification: object = None
    """Its loads show in which unit sizes are. What is odd in it hides nothing else."""
    agv_geometry: Geometry | None = None
    mobile_robot_geometry: Geometry | None = None


class OtherMessage(Header, frozen=True):
    """A message of which only the header is read."""


_HEADER = ("header_id", "timestamp", "version", "manufacturer", "serial_number")
_STATE = (
    "order_id",
    "order_update_id",
    "last_node_id",
    "last_node_sequence_id",
    "node_states",
    "edge_states",
    "driving",
    "action_states",
    "operating_mode",
    "errors",
    "safety_state",
)
KINDS: dict[str, type[Header]] = {
    "state": StateMessage,
    "visualization": VdaMotion,
    "order": OrderMessage,
    "connection": ConnectionMessage,
    "factsheet": FactsheetMessage,
    "zoneSet": OtherMessage,
    "responses": OtherMessage,
}
"""By the last part of the topic."""
REQUIRED: dict[str, tuple[str, ...]] = {
    "state": _HEADER + _STATE,
    "visualization": _HEADER,
    "order": (*_HEADER, "order_id", "order_update_id", "nodes", "edges"),
    "connection": (*_HEADER, "connection_state"),
    "factsheet": (*_HEADER[2:], "type_specification", "physical_parameters"),
    "zoneSet": _HEADER,
    "responses": _HEADER,
}
