"""The status of a robot by its newest odometry, states, trajectory and plan."""

from math import ceil, nan, pi, remainder
from operator import lt

from ingest.batch import Amounts
from ingest.frames.assumed_motion import DRIVES_MPS, MOVING_MPS
from ingest.languages import timestamps
from ingest.languages.iso21423.iso_memory import IsoMemory, IsoPose
from ingest.languages.iso21423.iso_messages import STATES, Speeds, TimedPoint
from ingest.languages.iso21423.iso_way import along_way
from ingest.languages.model import (
    MAX_POSITION,
    MAX_SPEED_MPS,
    NO_PATH,
    Path,
    Row,
    Status,
    beyond_turn,
    datum_name,
    goes_on_beside,
)
from ingest.languages.rules import Findings
from ingest.languages.tolerance.spelling import folded
from ingest.languages.tolerance.value_kinds import UNKNOWN
from ingest.languages.tolerance.value_reader import LEFT_OUT

MOST_POINTS = 200
"""Of a path with more points every second one is used, or every third, and so on, and the last one."""
OUTDATED_S = 3.0
"""A trajectory should come once a second. One that is so much older than the pose is followed only while it goes on
beside it."""
BLOCKED = frozenset(("STOP_CATEGORY_0", "STOP_CATEGORY_1", "STOP_CATEGORY_2", "BLOCKED", UNKNOWN))
"""A robot in one of these stands if it does not move."""
BY_STATE = {
    "OFFLINE": "offline",
    "CHARGING": "charging",
    "WAIT_FOR_RESET": "waitingHumanEvent",
    "PAUSED": "waitingExternalEvent",
    "WAIT_FOR_EVENT": "waitingExternalEvent",
    "WAIT_FOR_ATTACHMENT": "waitingExternalEvent",
    "ATTACHMENT_ACTIVE": "waitingInternalEvent",
    "IDLE": "idle",
    "PARKED": "idle",
}
"""What a robot does in a state. The first that holds counts."""
MOST_STATES = 50
BY_SPELLING = {folded(state): state for state in STATES}


def status_of(uuid: str, memory: IsoMemory, findings: Findings) -> Status | None:
    """The status. None before the robot has sent a pose."""
    if memory.pose is None:
        return None
    stamp, pose, velocity, _ = memory.pose
    at = pose.location_point
    yaw_rad = pose.orientation.yaw if pose.orientation else None
    if yaw_rad is None:
        findings.note("heading-missing", "pose.orientation.yaw", None, "the direction of travel")
    if not at.ccs_id:
        findings.note("map-missing", "pose.locationPoint.ccsId", at.ccs_id, "compared with nothing")
    linear_mps = velocity.linear if velocity else None
    if linear_mps is not None and abs(linear_mps) > MAX_SPEED_MPS:
        findings.note("speed-absurd", "velocity.linear", linear_mps, LEFT_OUT)
        linear_mps = None
    path, basis = along_way(memory, memory.pose, _followed(memory, memory.pose, findings))
    return Status(
        uuid,
        stamp.t_s,
        stamp.resolution_s,
        _state(memory, memory.pose),
        True,
        at.x,
        at.y,
        0.0,
        nan if yaw_rad is None else remainder(yaw_rad, 2 * pi),
        datum_name(at.ccs_id),
        linear_mps,
        velocity.angular if velocity else None,
        Amounts(nan if memory.battery_pct is None else memory.battery_pct),
        (),
        memory.plan,
        path,
        tuple(findings),
        basis,
        is_blocked=not (BLOCKED.isdisjoint(memory.states) or _speed_mps(velocity) > DRIVES_MPS),
        is_lost="LOST" in memory.states,
        oddities=tuple(findings.oddities),
        heading_sent=beyond_turn(yaw_rad),
    )


def _followed(memory: IsoMemory, pose: IsoPose, findings: Findings) -> Path:
    """The trajectory, if it is new, or goes on and puts the robot near its place. It may also begin later."""
    path, t_s, at = memory.path, pose.stamp.t_s, pose.pose.location_point
    if path is NO_PATH or memory.path_stamp_s >= t_s - OUTDATED_S:
        return path
    if {*path.datums} <= {"", datum_name(at.ccs_id)} and goes_on_beside(path, t_s, at.x, at.y):
        return path
    if path.ends_s[1] > t_s or _speed_mps(pose.velocity) > DRIVES_MPS:
        findings["path-outdated"] = None
    return NO_PATH


def _state(memory: IsoMemory, pose: IsoPose) -> str:
    """The state of the MassRobotics standard that comes nearest."""
    is_moving = _speed_mps(pose.velocity) > MOVING_MPS
    modes = {state for state in memory.states if state.startswith("MODE_")}
    if modes & {"MODE_MANUAL", "MODE_TELEOP"}:
        return "manualOverride"
    if "MODE_MAINTENANCE" in modes:
        return "manualOverride" if is_moving else "disabled"
    named = next((BY_STATE[state] for state in BY_STATE if state in memory.states), None)
    if named and not (named == "idle" and is_moving):
        return named
    return "navigating" if modes or is_moving or memory.path is not NO_PATH else "idle"


def _speed_mps(velocity: Speeds | None) -> float:
    """The reported speed, 0 if none was sent."""
    return abs(velocity.linear or 0.0) if velocity else 0.0


def states_of(sent: list[str], findings: Findings) -> tuple[str, ...]:
    """The states in the standard's spelling; `UNKNOWN` stands for those that it does not have."""
    states = []
    for row, name in enumerate(sent[:MOST_STATES]):
        state = name if name in BY_SPELLING.values() else BY_SPELLING.get(folded(name), "")
        path = f"states[{row}]"
        if not state:
            findings.note("word-unknown", path, name, "by what the robot does")
        elif state != name:
            findings.note("word-spelling", path, name, state)
        states.append(state or UNKNOWN)
    return tuple(states)


def path_of(points: list[TimedPoint], key: str, stamp_s: float, findings: Findings) -> Path:
    """Points under a key, with the robot's own times. A heading that is not told is the direction of travel."""
    rows: list[Row] = []
    datums: list[str] = []
    each = ceil(len(points) / MOST_POINTS)
    for row, point in enumerate(points):
        if row % max(each, 1) and row < len(points) - 1:
            continue
        at = point.location_point
        if abs(at.x) > MAX_POSITION or abs(at.y) > MAX_POSITION:
            findings.note("point-absurd", f"{key}[{row}].locationPoint", [at.x, at.y], LEFT_OUT)
        else:
            yaw_rad = point.orientation.yaw if point.orientation else None
            t_s = timestamps.point_time_s(point.timestamp, f"{key}[{row}].timestamp", findings)
            rows.append((t_s, at.x, at.y, nan if yaw_rad is None else remainder(yaw_rad, 2 * pi)))
            datums.append(datum_name(at.ccs_id))
    if not rows:
        return NO_PATH
    times = timestamps.filled([row[0] for row in rows], stamp_s)
    rows = [(t_s, *row[1:]) for t_s, row in zip(times, rows, strict=True)]
    in_order = all(map(lt, times, times[1:]))
    if not in_order:
        rule = "path-times-equal" if len(set(times)) < len(times) else "path-unordered"
        findings.note(rule, f"{key}[*].timestamp", timestamps.first_fall(times), "sorted, or new times")
    return Path(tuple(rows), tuple(datums), in_order, (times[0], times[-1]))
