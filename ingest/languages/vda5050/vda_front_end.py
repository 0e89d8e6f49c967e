"""VDA 5050 as one of the languages: messages of a broker, whose topics name the robot and the kind of message.

The result of a message is an identity (a factsheet), a status (a state or a visualization with a newer pose), or an
update (all others). A status rests on all of the robot's memory: a visualization has the pose, the newest state the
remaining nodes, and the order where these are.
"""

from collections.abc import Mapping, Sequence
from functools import lru_cache
from itertools import product
from math import hypot, inf
from typing import Any
from uuid import UUID, uuid5

import msgspec

from ingest.languages import timestamps
from ingest.languages.front_end import Topic, TopicFrontEnd, TopicSender
from ingest.languages.model import MAX_POSITION, MAX_TEXT, Message, datum_name, only_datum, update_of
from ingest.languages.rules import Findings, RejectedError, Rule
from ingest.languages.tolerance.heard import Heard, heard_after
from ingest.languages.tolerance.tolerant_json import stamp_of
from ingest.languages.vda5050 import factsheets
from ingest.languages.vda5050.base_path import order_by
from ingest.languages.vda5050.orders import Order, is_base_extended, order_of, swapped, with_update, without_far
from ingest.languages.vda5050.seen.base_ends import is_under_way
from ingest.languages.vda5050.seen.default_headings import are_default
from ingest.languages.vda5050.seen.filled_in import filled_in
from ingest.languages.vda5050.seen.line_guided import Along, along_now, placed
from ingest.languages.vda5050.seen.travels import NEAR_M, is_unfilled, travel_to
from ingest.languages.vda5050.vda_memory import NOTHING, VdaMemory, VdaPose
from ingest.languages.vda5050.vda_messages import (
    KINDS,
    ConnectionMessage,
    FactsheetMessage,
    Header,
    NodePlace,
    OrderMessage,
    Position,
    StateMessage,
    VdaMotion,
)
from ingest.languages.vda5050.vda_reader import read_message
from ingest.languages.vda5050.vda_rules import CHAPTERS, RULES
from ingest.languages.vda5050.vda_status import newest_plans, plans_after, status_of, unstamped

ROBOTS = UUID("6f1d9ac2-5b1e-53d5-9a0b-6a2f6a7c5050")
"""Namespace of the UUIDs of robots that are known by manufacturer and serial number."""
PREFIXES = ("uagv/v2", "vda5050/v3")
"""What stands before the manufacturer in topics of 2.x and 3.0, as the standard suggests."""
OVERTAKEN_S = 60.0
"""A pose that is older than the newest one by more comes from a clock that was set back."""
_TOPICS_CACHED = 65_536
_BROKEN = frozenset(("CONNECTIONBROKEN", "CONNECTION_BROKEN"))


def robot_uuid(manufacturer: str, serial: str) -> str:
    """The UUID of a robot, which the standard does not give it. Robots are named by manufacturer and serial number."""
    return str(uuid5(ROBOTS, f"{manufacturer}/{serial}"))


@lru_cache(_TOPICS_CACHED)
def _parsed_topic(topic: str) -> Topic | None:
    """The last three parts: manufacturer, serial number and kind."""
    parts = topic.split("/")
    if len(parts) < 3 or not all(parts[-3:]):
        return None
    manufacturer, serial, kind = parts[-3:]
    uuid = robot_uuid(manufacturer, serial)
    return Topic(TopicSender(uuid, manufacturer[:MAX_TEXT], serial[:MAX_TEXT]), kind)


def _read(
    raw: bytes, topic: Topic, memory: VdaMemory, findings: Findings, arrival_s: float
) -> tuple[Message, VdaMemory]:
    kind = topic.kind
    is_first = kind not in memory.heard or kind in memory.respelt
    message = read_message(kind, raw, findings, memory.state, is_first=is_first)
    if "key-spelling" in findings and kind not in memory.respelt:
        memory = msgspec.structs.replace(memory, respelt=memory.respelt | {kind})
    _compare_names(message, topic.sender, findings)
    has_no_time = isinstance(message, FactsheetMessage) and not message.timestamp
    stamp = timestamps.NO_STAMP if has_no_time else stamp_of(message.timestamp, findings)
    last = None if _is_last_will(message) else memory.heard.get(kind)
    has_pose = isinstance(message, VdaMotion)
    heard, stamp, is_used = heard_after(last, message, stamp, findings, arrival_s, message.header_id, has_pose=has_pose)
    changes: dict[str, Any] = {"heard": memory.heard | {kind: heard}} if heard else {}
    if not is_used:
        return update_of(topic.sender.uuid, findings), msgspec.structs.replace(memory, **changes) if changes else memory
    if isinstance(message, StateMessage):
        message = without_far(message, findings)
    if isinstance(message, VdaMotion):
        return _read_motion(message, topic, stamp, memory, changes, findings)
    memory = msgspec.structs.replace(memory, **changes)
    if isinstance(message, FactsheetMessage):
        identity = factsheets.identity_of(*topic.sender, message, stamp, findings)
        return identity, msgspec.structs.replace(memory, abilities=factsheets.abilities_of(message))
    if isinstance(message, OrderMessage):
        memory = _with_order(memory, order_of(message, memory.state, findings), findings)
    elif isinstance(message, ConnectionMessage):
        memory = _with_connection(memory, message.connection_state or "", heard)
    return update_of(topic.sender.uuid, findings), memory


def _with_order(memory: VdaMemory, newest: Order, findings: Findings) -> VdaMemory:
    orders = with_update(memory.orders, newest, findings)
    if orders is memory.orders:
        orders, outdated = swapped(orders, newest, memory.state or StateMessage())
        return msgspec.structs.replace(memory, orders=orders, outdated=outdated)
    bases = memory.bases
    if is_base_extended(memory.orders, orders[-1]) and memory.state and memory.pose:
        bases = bases.after(in_time=is_under_way(memory.state, memory.pose.velocity))
    default = are_default(memory.are_headings_default, (node.place for node in orders[-1].nodes.values()), findings)
    memory = msgspec.structs.replace(memory, ways=memory.ways.after(newest), are_headings_default=default)
    return msgspec.structs.replace(memory, orders=orders, outdated=None, is_order_newer=True, bases=bases)


def _is_last_will(message: Header) -> bool:
    """Whether the broker sent it. The robot stamped it when it connected."""
    return isinstance(message, ConnectionMessage) and message.connection_state in _BROKEN


def _with_connection(memory: VdaMemory, connection: str, heard: Heard | None) -> VdaMemory:
    """The memory after a connection message. A retained one may be older than what the robot said since."""
    is_old = memory.pose is not None and heard is not None and 0.0 < heard.stamp_s < memory.pose.stamp.t_s
    return memory if is_old else msgspec.structs.replace(memory, connection=connection)


def _compare_names(message: Header, sender: TopicSender, findings: Findings) -> None:
    """Topics may replace characters that brokers do not allow, so only letters and digits are compared."""
    named = tuple(_plain((name or "")[:MAX_TEXT]) for name in (message.manufacturer, message.serial_number))
    if any(named) and named != (_plain(sender.manufacturer), _plain(sender.serial)):
        findings.note("robot-not-of-topic", "serialNumber", message.serial_number, "as the topic says")


@lru_cache(_TOPICS_CACHED)
def _plain(name: str) -> str:
    return "".join(filter(str.isalnum, name)).casefold()


def _read_motion(
    message: VdaMotion,
    topic: Topic,
    stamp: timestamps.Stamp,
    memory: VdaMemory,
    changes: dict[str, Any],
    findings: Findings,
) -> tuple[Message, VdaMemory]:
    """What a state or a visualization says. `changes` are those of the memory by any message."""
    own_stamp = stamp if stamp.is_known else unstamped(message.intermediate_path)
    changes = changes | {"plans": plans_after(memory.plans, message, topic.kind, own_stamp.t_s, findings)}
    if isinstance(message, StateMessage):
        changes |= _with_state(memory, message)
    after = msgspec.structs.replace(memory, **changes)
    position, along = _position(message, own_stamp.t_s, after, findings)
    if position is None:
        pose = msgspec.structs.replace(memory.pose, along=along) if memory.pose and along else memory.pose
        return update_of(topic.sender.uuid, findings), msgspec.structs.replace(after, pose=pose)
    if not (abs(position.x) <= MAX_POSITION and abs(position.y) <= MAX_POSITION):
        raise RejectedError("position-absurd", f"position {position.x:g}, {position.y:g} is off any floor; send metres")
    if memory.pose and _is_late(stamp, memory.pose.stamp, memory.heard.get(topic.kind)):
        findings["stamp-not-increasing"] = None
        return update_of(topic.sender.uuid, findings), after
    signed_off = memory.heard.get("connection")
    if not (signed_off and stamp.t_s <= signed_off.stamp_s):
        after = msgspec.structs.replace(after, connection="ONLINE")
    position, after = _on_its_map(position, message, own_stamp.t_s, after, findings)
    was_at = memory.pose.position if memory.pose else None
    stands = isinstance(message, StateMessage) and message.driving is False
    moves = topic.kind, position, message.velocity
    filled, position, velocity = filled_in(after.filled, *moves, was_at, says_standing=stands)
    path, plan = newest_plans(after.plans, topic.kind, stamp.t_s, position)
    travel = travel_to(memory.pose.travel if memory.pose else None, own_stamp.t_s, position)
    pose = VdaPose(own_stamp, position, velocity, path, plan, travel, along)
    after = msgspec.structs.replace(after, pose=pose, filled=filled)
    status = status_of(topic.sender.uuid, after, findings)
    return status or update_of(topic.sender.uuid, findings), after


def _with_state(memory: VdaMemory, state: StateMessage) -> dict[str, Any]:
    """The changes of the memory by a state."""
    orders, outdated = swapped(memory.orders, memory.outdated, state)
    changes = {"state": state, "orders": orders, "outdated": outdated, "unheard": None}
    changes |= {"is_order_newer": False, "connection": "ONLINE"}
    changes["lists_nodes"] = memory.lists_nodes or bool(state.node_states)
    if not orders and any(node.node_position for node in state.node_states or ()):
        ahead = (node.node_position for node in state.node_states or ())
        changes["are_headings_default"] = are_default(memory.are_headings_default, ahead, Findings())
    if order_by(msgspec.structs.replace(memory, **changes), state) is None:
        changes["unheard"] = memory.ways.order_for(state, state.position, orders)
    return changes


def _position(
    message: VdaMotion, t_s: float, memory: VdaMemory, findings: Findings
) -> tuple[Position | None, Along | None]:
    """Where the robot is. If it does not say it, or says 0, 0 without having been near that, its last node shows it.

    That may be far back, so a place that it said not long before counts for more.
    """
    position, before, along = message.position, memory.pose, None
    if position and not is_unfilled(position, before.travel if before else None, t_s):
        return position, None
    key = "mobileRobotPosition" if (message.version or "").startswith("3") else "agvPosition"
    if isinstance(message, StateMessage) and (before is None or before.gives_way_to_nodes(t_s)):
        along = along_now(before.along if before else None, message, t_s)
        was_at = before.position if before else None
        at = placed(message, order_by(memory, message), memory.ways, along.since_m, was_at)
        if at and (position is None or position.is_lost or hypot(at.x, at.y) > NEAR_M):
            findings.note("position-by-node", key, None, f"{along.since_m:.1f} m after node {message.last_node_id}")
            return at, along
    if position and (before is None or before.gives_way_to_nodes(t_s)):
        return position, along
    findings.note("position-missing", key, None if position is None else "0, 0", "where it was last seen")
    return None, along


def _on_its_map(
    position: Position, message: VdaMotion, t_s: float, memory: VdaMemory, findings: Findings
) -> tuple[Position, VdaMemory]:
    """The position on the map that is meant, and the memory with what it shows of the names of maps."""
    if isinstance(message, StateMessage):
        position = _on_known_map(position, message, memory, findings)
        return position, msgspec.structs.replace(memory, visualized=memory.visualized.after_state(t_s, position))
    memory = msgspec.structs.replace(memory, visualized=memory.visualized.after_visualization(t_s, position))
    return _on_known_map(position, message, memory, findings), memory


def _on_known_map(position: Position, message: VdaMotion, memory: VdaMemory, findings: Findings) -> Position:
    """The position. One that names no map is on that of the nodes of its state, or else on the robot's last one.

    Those of the order count from the last one that the robot has passed.
    Programs that do not know yet where the robot is send zeros without a map. The name that visualizations have for the
    map of the states stands for that.
    """
    if not isinstance(message, StateMessage) and (stated := memory.visualized.map_of(position)):
        findings.note("map-of-state", f"{position.key}.mapId", position.map_id, stated)
        return msgspec.structs.replace(position, map_id=stated)
    if datum_name(position.map_id) or position.is_lost:
        return position
    places: list[NodePlace | None] = []
    if isinstance(message, StateMessage):
        places += [node.node_position for node in message.node_states or ()]
        if order := order_by(memory, message):
            passed = order.passed_by(message)
            places += [node.place for number, node in order.nodes.items() if number >= passed]
    last = memory.pose.position.map_id if memory.pose else None
    known = only_datum(datum_name(place.map_id) for place in places if place) or last
    if not known:
        return position
    findings.note("map-missing", f"{position.key}.mapId", position.map_id, known)
    return msgspec.structs.replace(position, map_id=known)


def _is_late(stamp: timestamps.Stamp, newest: timestamps.Stamp, last: Heard | None) -> bool:
    """Whether a pose was overtaken by one of another topic. `last` is the message before of its own topic.

    If it is older than that one, or much older than the newest pose, the robot's clock was set back. A message that is
    repeated was not.
    """
    if not (stamp.is_known and newest.is_known) or (last and stamp.t_s < last.stamp_s):
        return False
    is_repeated = last is not None and stamp.t_s == last.stamp_s
    return 0.0 < newest.t_s - stamp.t_s <= (inf if is_repeated else OVERTAKEN_S)


class VdaFrontEnd(TopicFrontEnd):
    """The memory of a robot is a `VdaMemory`."""

    standard = "VDA 5050, versions 2.0, 2.1 and 3.0"
    chapters: Mapping[str, tuple[Rule, ...]] = CHAPTERS
    rules: Mapping[str, Rule] = RULES
    kinds, with_pose = KINDS, frozenset(("state", "visualization"))
    form = "MANUFACTURER/SERIAL"
    nothing = NOTHING
    parsed, read_kind, status_of = staticmethod(_parsed_topic), staticmethod(_read), staticmethod(status_of)

    def topic_filters(self, prefixes: Sequence[str], manufacturers: Sequence[str]) -> list[str]:
        parts = product(prefixes or PREFIXES, manufacturers or ("+",), KINDS)
        return ["/".join((*filter(None, (prefix,)), manufacturer, "+", kind)) for prefix, manufacturer, kind in parts]
