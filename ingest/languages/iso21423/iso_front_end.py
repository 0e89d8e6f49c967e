"""ISO 21423 as one of the languages: resources of robots on a broker, whose topics have the robot's UUID.

The result of a message is an identity (an identity or a footprint), a status (an odometry), or an update.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import lru_cache, partial
from math import inf, isfinite
from operator import attrgetter
from typing import Any
from uuid import UUID, uuid5

from msgspec.structs import replace

from ingest.languages import timestamps
from ingest.languages.front_end import Topic, TopicFrontEnd, TopicSender
from ingest.languages.geometry.outlines import Outline, outline_of
from ingest.languages.iso21423.iso_memory import NOTHING, IsoMemory, IsoPose
from ingest.languages.iso21423.iso_messages import (
    KEYS,
    REQUIRED,
    RESOURCES,
    BatteryMessage,
    CorePoint,
    FootprintMessage,
    IdentityMessage,
    IsoDetails,
    IsoMessage,
    OdometryMessage,
    OdometryPose,
    PlanMessage,
    StatusMessage,
    TrajectoryMessage,
    WayMessage,
)
from ingest.languages.iso21423.iso_rules import CHAPTERS, RULES
from ingest.languages.iso21423.iso_status import path_of, states_of, status_of
from ingest.languages.iso21423.iso_way import is_moving, way_of
from ingest.languages.model import (
    MAX_POSITION,
    MAX_SPEED_MPS,
    MAX_TEXT,
    Identity,
    Message,
    Path,
    datum_name,
    only_datum,
    update_of,
)
from ingest.languages.rules import Findings, RejectedError, Rule
from ingest.languages.tolerance.heard import heard_after
from ingest.languages.tolerance.tolerant_json import KnownNames, decoded, lacks_required, stamp_of, time_of

PREFIXES = ("/ISO_21423/v1",)
ROBOT = "IMR"
"""The entity type of robots."""
NAMED = UUID("5e0f8c1c-21d9-5b34-8b1f-2142300000aa")
"""Namespace of the UUIDs of robots whose topic has none."""
NO_OUTLINE = Outline(0.0, 0.0)
NAMES = KnownNames(
    frozenset(("pose", "velocity", "locationPoint", "x", "y", "ccsId", "orientation", "yaw", *KEYS.values())),
    keys={"position": ("locationPoint",), "location": ("locationPoint",)},
)
MOST_CHARGE = 1.5
"""A battery that is fuller is sent in percent; one that is less so is full, but for calibration."""
_TOPICS_CACHED = 65_536


@lru_cache(_TOPICS_CACHED)
def _parsed_topic(topic: str) -> Topic | None:
    """The last three parts: entity type, UUID and resource. None unless it is a robot's."""
    parts = topic.split("/")
    if len(parts) < 3 or parts[-3] != ROBOT or not all(parts[-2:]):
        return None
    try:
        uuid = str(UUID(parts[-2]))
    except ValueError:
        uuid = str(uuid5(NAMED, parts[-2]))
    return Topic(TopicSender(uuid, "", ""), parts[-1])


def _read(
    raw: bytes, topic: Topic, memory: IsoMemory, findings: Findings, arrival_s: float
) -> tuple[Message, IsoMemory]:
    resource = topic.kind
    message = _decoded(resource, raw, findings, is_first=resource not in memory.heard or resource in memory.respelt)
    if "key-spelling" in findings and resource not in memory.respelt:
        memory = replace(memory, respelt=memory.respelt | {resource})
    stamp = stamp_of(message.timestamp, findings)
    has_pose = isinstance(message, OdometryMessage)
    last = memory.heard.get(resource)
    heard, stamp, is_used = heard_after(last, message, stamp, findings, arrival_s, has_pose=has_pose)
    if heard:
        memory = replace(memory, heard=memory.heard | {resource: heard})
    if not is_used:
        return update_of(topic.sender.uuid, findings), memory
    if isinstance(message, OdometryMessage):
        return _read_odometry(message, topic.sender.uuid, stamp, memory, findings)
    if isinstance(message, IdentityMessage | FootprintMessage):
        memory = _with_body(message, memory, findings)
        if memory.identity is None:
            return update_of(topic.sender.uuid, findings), memory
        return _identity(topic.sender.uuid, stamp, memory.identity, memory, findings), memory
    memory = _with_update(message, stamp, memory, findings)
    return update_of(topic.sender.uuid, findings), memory


def _decoded(resource: str, raw: bytes, findings: Findings, *, is_first: bool) -> IsoMessage:
    """The message of a resource. Raises `RejectedError` if it can't be understood."""
    keys = _LACKS_KEY[resource], _REQUIRED[resource]
    return decoded(RESOURCES[resource], raw, findings, *keys, NAMES, is_first=is_first)


def _lacks_key_of_pose(message: OdometryMessage) -> bool:
    """Whether a key of an odometry is absent that is required or used."""
    pose = message.pose
    if pose is None or message.velocity is None or message.timestamp is None:
        return True
    return pose.location_point.ccs_id is None or pose.orientation is None or pose.orientation.yaw is None


_REQUIRED = {resource: [(key, KEYS.get(key, key)) for key in REQUIRED.get(resource, ())] for resource in RESOURCES}
"""By resource, the required keys as attributes and as spelt in messages."""
_LACKS_KEY: dict[str, Callable[[Any], bool]] = {
    resource: partial(lacks_required, attrgetter("timestamp", *REQUIRED.get(resource, ("timestamp",))))
    for resource in RESOURCES
} | {"odometry": _lacks_key_of_pose}
"""By resource, whether a message is to be read anew, since a key may be there in another spelling."""


def _read_odometry(
    message: OdometryMessage, uuid: str, stamp: timestamps.Stamp, memory: IsoMemory, findings: Findings
) -> tuple[Message, IsoMemory]:
    pose = message.pose
    if pose is None or abs(pose.location_point.x) > MAX_POSITION or abs(pose.location_point.y) > MAX_POSITION:
        raise RejectedError("position-absurd", "odometry has no position on any floor; send metres")
    stamp = stamp if stamp.is_known else timestamps.Stamp(memory.path_stamp_s, inf)
    moves = is_moving(memory.pose, stamp.t_s, pose, message.velocity)
    on_map = _on_known_map(pose, stamp.t_s, memory, findings)
    memory = replace(memory, pose=IsoPose(stamp, on_map, message.velocity, moves))
    status = status_of(uuid, memory, findings)
    return status or update_of(uuid, findings), memory


def _on_known_map(pose: OdometryPose, t_s: float, memory: IsoMemory, findings: Findings) -> OdometryPose:
    """The pose. One that names no coordinate system is in the one of the robot's paths, or else in its last one.

    What is over of a path counts only for a robot that has no last one.
    """
    at, last = pose.location_point, memory.pose.pose.location_point.ccs_id if memory.pose else None
    if datum_name(at.ccs_id):
        return pose
    paths = memory.path, memory.plan
    ahead = only_datum(datum for path in paths for datum in _datums_ahead(path, t_s))
    known = ahead or last or only_datum(datum for path in paths for datum in path.datums)
    if not known:
        return pose
    findings.note("map-missing", "pose.locationPoint.ccsId", at.ccs_id, known)
    return replace(pose, location_point=replace(at, ccs_id=known))


def _datums_ahead(path: Path, t_s: float) -> Iterator[str]:
    """The datums of a path from the point on that was passed last at a time: none if it is over, all without times."""
    has_times = path.ends_s[0] != path.ends_s[1]
    for datum, (piece_end_s, *_) in zip(path.datums, path.poses[1:] + path.poses[-1:], strict=True):
        if piece_end_s > t_s or not has_times:
            yield datum


def _with_update(message: IsoMessage, stamp: timestamps.Stamp, memory: IsoMemory, findings: Findings) -> IsoMemory:
    """The memory after a message without pose and size."""
    match message:
        case TrajectoryMessage():
            path = path_of(message.local_trajectory or [], "localTrajectory", stamp.t_s, findings)
            return replace(memory, path=path, path_stamp_s=time_of(stamp, path))
        case PlanMessage():
            return replace(memory, plan=path_of(message.global_plan or [], "globalPlan", stamp.t_s, findings))
        case WayMessage():
            return replace(memory, way=way_of(message.global_path, findings))
        case StatusMessage():
            states = states_of(message.named_states or [], findings)
            if not any(state.startswith("MODE_") for state in states):
                findings.note("mode-missing", "states", message.named_states, "automatic")
            return replace(memory, states=states)
        case BatteryMessage(battery_soc=charge) if charge is not None:
            battery_pct = min(max(charge if charge > MOST_CHARGE else 100.0 * charge, 0.0), 100.0)
            if not 0.0 <= charge <= 1.0:
                findings.note("battery-out-of-range", "batterySoc", charge, f"{battery_pct:g} %")
            return replace(memory, battery_pct=battery_pct)
    return memory


def _with_body(message: IdentityMessage | FootprintMessage, memory: IsoMemory, findings: Findings) -> IsoMemory:
    """The memory after an identity or a footprint. An empty footprint means that of the identity."""
    if isinstance(message, IdentityMessage):
        return replace(memory, identity=message)
    corners = message.footprint or message.imr_footprint
    height_m = message.height if message.height is not None else message.imr_height
    return replace(memory, outline=_outline(corners, "footprint", findings) if corners else None, height_m=height_m)


def _outline(corners: list[CorePoint], path: str, findings: Findings) -> Outline | None:
    """The outline under a key. None if it has no area."""
    outline = outline_of([(corner.x, corner.y) for corner in corners]) if len(corners) > 2 else NO_OUTLINE
    if outline.length_m > 0 and outline.width_m > 0:
        return outline
    findings.note("envelope-not-positive", path, len(corners), "left out: no area")
    return None


def _identity(
    uuid: str, stamp: timestamps.Stamp, message: IdentityMessage, memory: IsoMemory, findings: Findings
) -> Identity:
    details = message.details or IsoDetails()
    outline = memory.outline or _outline(details.imr_footprint or [], "details.imrFootprint", findings) or NO_OUTLINE
    if outline.is_simplified:
        findings["outline-not-usable"] = None
    height_m = memory.height_m if memory.height_m is not None else details.imr_height or 0.0
    speed_mps = details.rated_speed
    if speed_mps is not None and not 0.0 < speed_mps <= MAX_SPEED_MPS and isfinite(speed_mps):
        findings.note("speed-limit-not-positive", "details.ratedSpeed", speed_mps, "left out")
        speed_mps = None
    return Identity(
        uuid=uuid,
        stamp_s=time_of(stamp),
        manufacturer=(message.manufacturer_name or "")[:MAX_TEXT],
        model=(details.imr_model or "")[:MAX_TEXT],
        serial=(details.imr_serial_number or details.imr_name or uuid[:8])[:MAX_TEXT],
        envelope_m=(outline.length_m, outline.width_m, max(height_m, 0.0)),
        offset_m=outline.offset_m,
        outline=outline.outline,
        max_speed_mps=speed_mps,
        findings=tuple(findings),
        oddities=tuple(findings.oddities),
    )


class IsoFrontEnd(TopicFrontEnd):
    """The memory of a robot is an `IsoMemory`."""

    standard = "ISO 21423"
    chapters: Mapping[str, tuple[Rule, ...]] = CHAPTERS
    rules: Mapping[str, Rule] = RULES
    kinds, with_pose = RESOURCES, frozenset(("odometry", "localTrajectory"))
    form = f"{ROBOT}/UUID"
    nothing = NOTHING
    parsed, read_kind, status_of = staticmethod(_parsed_topic), staticmethod(_read), staticmethod(status_of)

    def topic_filters(self, prefixes: Sequence[str], manufacturers: Sequence[str]) -> list[str]:  # noqa: ARG002
        return [f"{prefix}/{ROBOT}/+/{resource}" for prefix in prefixes or PREFIXES for resource in RESOURCES]
