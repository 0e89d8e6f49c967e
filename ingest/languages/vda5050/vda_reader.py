"""From the bytes of a message of VDA 5050 to a model of it, with the deviations of its keys and header."""

from collections.abc import Callable
from functools import partial
from itertools import chain
from operator import attrgetter
from typing import Any

from msgspec.structs import fields

from ingest.languages.rules import Findings
from ingest.languages.tolerance.spelling import PLACE_NAMES
from ingest.languages.tolerance.tolerant_json import KnownNames, decoded, lacks_required
from ingest.languages.vda5050.vda_messages import KINDS, REQUIRED, Header, OrderMessage, StateMessage

_READABLE = ("2.", "3.")
"""Versions begin with one of these, or are the whole number."""
_REQUIRED = {
    kind: [(field.name, field.encode_name) for field in fields(KINDS[kind]) if field.name in REQUIRED[kind]]
    for kind in KINDS
}
"""By kind, the required keys as attributes and as spelt in messages."""
NAMES = KnownNames(
    frozenset(("agvPosition", "mobileRobotPosition", "x", "y", "theta", "mapId", "velocity", "nodePosition"))
    | {name for names in _REQUIRED.values() for _, name in names},
    {
        "false": "none",
        "0": "none",
        "inactive": "none",
        "released": "none",
        "auto": "automatic",
        "semiauto": "semiautomatic",
        "info": "warning",
        "warn": "warning",
        "completed": "finished",
        "done": "finished",
    },
    "sequenceId",
    dict.fromkeys(PLACE_NAMES, ("agvPosition", "nodePosition")),
)
"""Keys of which a likeness is noticed, and words and keys that senders use beside those of the standard."""


def read_message(kind: str, raw: bytes, findings: Findings, before: StateMessage | None, *, is_first: bool) -> Header:
    """The message of a topic that ends in `kind`. Raises `RejectedError` if it can't be understood.

    `is_first` if it is the robot's first of this kind, or if any before had keys in another spelling. `before` is the
    newest state: the first loads after it are looked at closely, as no key of a load is required.
    """
    lacks_key = _LACKS_KEY[kind]
    if kind == "state" and before and not before.loads:
        lacks_key = partial(_has_loads_or, lacks_key)
    message = decoded(KINDS[kind], raw, findings, lacks_key, _REQUIRED[kind], NAMES, is_first=is_first)
    _note_unreleased(message, findings)
    version = message.version
    if version and not version.startswith(_READABLE) and version not in {"2", "3"}:
        findings.note("version-unknown", "version", version, "2.x or 3.x")
    return message


def _note_unreleased(message: Header, findings: Findings) -> None:
    """Count a first node that does not say whether it is released."""
    if isinstance(message, StateMessage) and message.node_states and message.node_states[0].released is None:
        findings.note("key-absent", "nodeStates[0].released", None, "as the order says, else released")
    if isinstance(message, OrderMessage) and message.nodes and message.nodes[0].released is None:
        findings.note("key-absent", "nodes[0].released", None, "released")


def _lacks_key_of_motion(required: Callable[[Any], Any], message: Any) -> bool:
    """Whether a key is absent that is required or, of a pose, used."""
    position = message.mobile_robot_position or message.agv_position
    return position is None or position.map_id is None or position.theta is None or lacks_required(required, message)


def _lacks_key_of_state(required: Callable[[Any], Any], message: Any) -> bool:
    """The same of a state, and of the items of its lists."""
    return (
        _lacks_key_of_motion(required, message)
        or _lacks_key_of_node(message.node_states)
        or None in map(_ACTION_STATUS, message.action_states or ())
        or None in map(_ERROR_LEVEL, message.errors or ())
    )


def _lacks_key_of_order(required: Callable[[Any], Any], message: Any) -> bool:
    """The same of an order, and of the actions at its nodes."""
    if lacks_required(required, message) or _lacks_key_of_node(message.nodes):
        return True
    return None in map(_BLOCKING_TYPE, chain.from_iterable(node.actions or () for node in message.nodes))


def _lacks_key_of_node(nodes: list[Any] | None) -> bool:
    """Whether the first node lacks a key that all must have. The others are spelt as it is."""
    first = nodes[0] if nodes else None
    return first is not None and (not first.node_id or first.released is None)


def _has_loads_or(lacks_key: Callable[[Any], bool], message: StateMessage) -> bool:
    return bool(message.loads) or lacks_key(message)


_ACTION_STATUS, _ERROR_LEVEL = attrgetter("action_status"), attrgetter("error_level")
_BLOCKING_TYPE = attrgetter("blocking_type")
_LACKS = {"order": _lacks_key_of_order, "state": _lacks_key_of_state, "visualization": _lacks_key_of_motion}
_LACKS_KEY: dict[str, Callable[[Any], bool]] = {
    kind: partial(_LACKS.get(kind, lacks_required), attrgetter(*keys)) for kind, keys in REQUIRED.items()
}
"""By kind, whether a message is to be read anew, since a key may be there in another spelling."""
