"""The status of a robot by its newest state, pose and order: what it does, where it is, and where it will be."""

from collections.abc import Mapping
from math import atan2, hypot, inf, nan, pi, remainder
from operator import lt
from typing import NamedTuple

from ingest.batch import Amounts, Basis
from ingest.frames.assumed_motion import DRIVES_MPS, MOVING_MPS
from ingest.languages import timestamps
from ingest.languages.geometry.trajectories import Curve, curve_of
from ingest.languages.model import (
    MAX_POSITION,
    MAX_SPEED_MPS,
    NO_PATH,
    Path,
    Row,
    Status,
    beyond_turn,
    bounded_codes,
    datum_name,
    goes_on_beside,
)
from ingest.languages.rules import Findings
from ingest.languages.tolerance.tolerant_json import time_of
from ingest.languages.tolerance.value_reader import LEFT_OUT
from ingest.languages.vda5050.base_path import NO_DRIVE, OrderedDrive, drive, order_by
from ingest.languages.vda5050.orders import is_released, states_ahead
from ingest.languages.vda5050.seen.base_ends import speed_mps
from ingest.languages.vda5050.vda_memory import Plans, VdaMemory, VdaPose
from ingest.languages.vda5050.vda_messages import (
    IntermediatePath,
    Load,
    OperatingMode,
    Position,
    StateMessage,
    VdaMotion,
    Velocity2d,
)
from ingest.sizes.stated_loads import StatedLoad

MOST_WAYPOINTS = 200
POLYLINE = "intermediatePath.polyline"
BLOCKING_LEVELS = frozenset(("CRITICAL", "FATAL", "UNKNOWN"))
WAITING = frozenset(("waitingExternalEvent", "waitingInternalEvent"))
BUSY = frozenset(("INITIALIZING", "RUNNING", "PAUSED"))
STANDING_REPORTS_S = 35.0
"""A robot that does not drive sends a state every 30 s. A few seconds are for the way to here."""
NO_STATE = StateMessage()


class _Motion(NamedTuple):
    """The velocity as `Status` has it."""

    linear_mps: float | None = None
    sideways_rad: float = 0.0
    turn_radps: float | None = None


def status_of(uuid: str, memory: VdaMemory, findings: Findings) -> Status | None:
    """The status. None before the robot has sent a pose."""
    pose, state = memory.pose, memory.state or NO_STATE
    if pose is None:
        return None
    position, stamp = pose.position, pose.stamp
    operational, motion = _operational_state(memory, state, pose), _motion(pose.velocity, findings)
    driven = _driven(memory, state, pose, operational, findings)
    basis = Basis.ORDER if pose.path is NO_PATH else Basis.PATH
    path = pose.path if driven.path is NO_PATH else driven.path
    is_blocked, is_hindered = _hindrance(state, speed_mps(pose.velocity))
    return Status(
        uuid,
        stamp.t_s,
        stamp.resolution_s,
        operational,
        True,
        position.x,
        position.y,
        0.0,
        _yaw_rad(position, findings),
        datum_of(position, findings),
        motion.linear_mps,
        motion.turn_radps,
        _amounts(state, findings),
        bounded_codes([error.error_type for error in state.errors or () if error.error_type.strip()]),
        _planned_end(pose.plan, stamp.t_s) if driven.destinations is NO_PATH else driven.destinations,
        path,
        tuple(findings),
        path_basis=basis,
        is_blocked=is_blocked,
        is_hindered=is_hindered,
        is_lost=position.is_lost,
        deviation_m=max(position.deviation_range or 0.0, 0.0),
        loads=_loads(state.loads or []),
        reports_within_s=0.0 if operational == "navigating" else STANDING_REPORTS_S,
        oddities=tuple(findings.oddities),
        heading_sent=beyond_turn(position.theta),
        sideways_rad=motion.sideways_rad,
    )


def _driven(
    memory: VdaMemory, state: StateMessage, pose: VdaPose, operational: str, findings: Findings
) -> OrderedDrive:
    """Where the robot drives by its order. One that says that it waits, and not how fast it is, may drive all the
    same."""
    if operational == "navigating":
        return drive(memory, state, pose, findings)
    if operational in WAITING and pose.motion is not pose.velocity:
        return OrderedDrive(drive(memory, state, pose, Findings()).path, NO_PATH)
    return NO_DRIVE


def datum_of(position: Position, findings: Findings) -> str:
    if not position.map_id:
        findings.note("map-missing", f"{position.key}.mapId", position.map_id, "compared with nothing")
    return datum_name(position.map_id)


def _yaw_rad(position: Position, findings: Findings) -> float:
    if position.theta is None:
        findings.note("heading-missing", f"{position.key}.theta", None, "the direction of travel")
        return nan
    return remainder(position.theta, 2 * pi)


def _motion(velocity: Velocity2d | None, findings: Findings) -> _Motion:
    if velocity is None:
        return _Motion()
    across_mps = velocity.vy or 0.0
    speed_mps = hypot(velocity.vx or 0.0, across_mps)
    if not speed_mps <= MAX_SPEED_MPS:
        findings.note("speed-absurd", "velocity", [velocity.vx, velocity.vy], LEFT_OUT)
        return _Motion(turn_radps=velocity.omega)
    if abs(across_mps) <= DRIVES_MPS:
        return _Motion(velocity.vx, 0.0, velocity.omega)
    return _Motion(speed_mps, atan2(across_mps, velocity.vx or 0.0), velocity.omega)


def _operational_state(memory: VdaMemory, state: StateMessage, pose: VdaPose) -> str:
    """The state of the MassRobotics standard that comes nearest. Where nothing says it, the motion does."""
    reported_mps = speed_mps(pose.velocity)
    if memory.connection in {"OFFLINE", "HIBERNATING"}:
        return "offline"
    is_moving = reported_mps > MOVING_MPS
    if (by_mode := _by_mode(state.operating_mode, is_moving)) is not None:
        return by_mode
    power = state.power_supply or state.battery_state
    if state.driving or reported_mps > DRIVES_MPS or (state.driving is None and is_moving):
        return "navigating"
    if power and power.charging:
        return "charging"
    standing = _standing_state(memory, state)
    says_nothing = state.driving is None and pose.velocity is None
    return "navigating" if standing == "idle" and says_nothing else standing


def _by_mode(mode: OperatingMode | None, is_moving: bool) -> str | None:
    """The state in a mode in which the fleet manager is not in control. None in the others."""
    match mode:
        case "MANUAL" | "INTERVENED":
            return "manualOverride"
        case "SERVICE" | "TEACHIN" | "TEACH_IN" | "STARTUP":
            return "manualOverride" if is_moving else "disabled"
    return None


def _standing_state(memory: VdaMemory, state: StateMessage) -> str:
    """Why a robot that does not drive stands."""
    requests = (*(state.zone_requests or ()), *(state.edge_requests or ()))
    if state.paused or any(request.request_status == "REQUESTED" for request in requests):
        return "waitingExternalEvent"
    if any(action.action_status in BUSY for action in state.action_states or ()):
        return "waitingInternalEvent"
    order = order_by(memory, state)
    nodes = order.nodes if order else {}
    if any(is_released(node, nodes.get(number)) for number, node, _ in states_ahead(state, order, Findings())):
        return "navigating"
    return "waitingExternalEvent" if state.new_base_request or state.node_states else "idle"


def _hindrance(state: StateMessage, reported_mps: float) -> tuple[bool, bool]:
    """Whether it can't move, and whether it can't although it says that it drives, if it goes on standing. A robot that
    drives can, whatever errors, fields and unknown words it reports."""
    if reported_mps > DRIVES_MPS:
        return False, False
    safety = state.safety_state
    stop = (safety.active_emergency_stop or safety.e_stop or "NONE") if safety else "NONE"
    if stop not in {"NONE", "UNKNOWN"}:
        return True, False
    is_hindered = "UNKNOWN" in (stop, state.operating_mode) or bool(safety and safety.field_violation)
    is_faulty = any(error.error_level in BLOCKING_LEVELS for error in state.errors or ())
    is_hindered |= is_faulty
    return is_hindered and not state.driving, is_hindered and bool(state.driving)


def _amounts(state: StateMessage, findings: Findings) -> Amounts:
    power = state.power_supply or state.battery_state
    charge = (power.state_of_charge if power.state_of_charge is not None else power.battery_charge) if power else None
    if charge is not None and not 0.0 <= charge <= 100.0:
        key = "powerSupply.stateOfCharge" if state.power_supply else "batteryState.batteryCharge"
        sent, charge = charge, min(max(charge, 0.0), 100.0)
        findings.note("battery-out-of-range", key, sent, f"{charge:g}")
    load_pct = nan if state.loads is None else 100.0 if state.loads else 0.0
    return Amounts(nan if charge is None else charge, nan, load_pct)


def _loads(loads: list[Load]) -> tuple[StatedLoad, ...]:
    """The loads of which size and place are stated."""
    sized = [(load.load_dimensions, load.bounding_box_reference) for load in loads]
    return tuple(
        StatedLoad(at.x, at.y, at.z, at.theta or 0.0, size.length, size.width, size.height or 0.0)
        for size, at in sized
        if size and at
    )


def _intermediate(sent: IntermediatePath | None, stamp_s: float, findings: Findings) -> Path:
    """The path that a robot has planned itself, with its own times."""
    rows: list[Row] = []
    for number, point in enumerate(sent.polyline[:MOST_WAYPOINTS] if sent else ()):
        if abs(point.x) > MAX_POSITION or abs(point.y) > MAX_POSITION:
            findings.note("point-absurd", f"{POLYLINE}[{number}]", [point.x, point.y], LEFT_OUT)
        else:
            yaw_rad = nan if point.theta is None else remainder(point.theta, 2 * pi)
            t_s = timestamps.point_time_s(point.eta, f"{POLYLINE}[{number}].eta", findings)
            rows.append((t_s, point.x, point.y, yaw_rad))
    if not rows:
        return NO_PATH
    times = timestamps.filled([row[0] for row in rows], stamp_s)
    rows = [(t_s, *row[1:]) for t_s, row in zip(times, rows, strict=True)]
    if max(times) <= stamp_s:
        findings.note("path-past", f"{POLYLINE}[*].eta", max(times), "new times by speed")
    in_order = all(map(lt, times, times[1:]))
    if not in_order:
        findings.note("path-unordered", f"{POLYLINE}[*].eta", timestamps.first_fall(times), "sorted, or new times")
    return Path(tuple(rows), ("",) * len(rows), in_order, (times[0], times[-1]))


def unstamped(sent: IntermediatePath | None) -> timestamps.Stamp:
    """In place of the stamp of a pose that has none: the time of the path that came with it."""
    return timestamps.Stamp(time_of(timestamps.NO_STAMP, _intermediate(sent, 0.0, Findings())), inf)


def _plans_of(message: VdaMotion, stamp_s: float, findings: Findings) -> Plans:
    planned = message.planned_path.trajectory if message.planned_path else None
    path = _intermediate(message.intermediate_path, stamp_s, findings)
    return Plans(stamp_s, path, curve_of(planned, findings) if planned else None)


def plans_after(
    plans: Mapping[str, Plans], message: VdaMotion, kind: str, stamp_s: float, findings: Findings
) -> dict[str, Plans]:
    """The plans by kind of message, after a message. A state by which the robot stands leaves no others."""
    own = _plans_of(message, stamp_s, findings)
    is_standing = isinstance(message, StateMessage) and message.driving is False
    return {kind: own} if is_standing else {**plans, kind: own}


def newest_plans(
    plans: Mapping[str, Plans], kind: str, stamp_s: float, position: Position
) -> tuple[Path, Curve | None]:
    """Path and curve of a message, or else those that came by the other kind, unless they are outdated.

    `stamp_s` is that of the position, nan if it is not known. A path of the other kind that does not lead along the
    position is outdated.
    """
    own = plans[kind]
    other = next((plans[each] for each in plans if each != kind), own)
    if not abs(stamp_s - other.stamp_s) <= STANDING_REPORTS_S:
        return own.path, own.curve
    is_kept = own.path is NO_PATH and goes_on_beside(other.path, stamp_s, position.x, position.y)
    return other.path if is_kept else own.path, own.curve or other.curve


def _planned_end(curve: Curve | None, stamp_s: float) -> Path:
    """The end of a planned path as a destination. Nobody says when the robot will be there."""
    if not curve:
        return NO_PATH
    return Path(((stamp_s, *curve.points[-1][:2], nan),), ("",), in_order=True, ends_s=(stamp_s, stamp_s))
