"""From the bytes of a message of VDA 5050 to a model of it, with the deviations of its keys and header."""

from functools import partial
from operator import attrgetter
from typing import Any

from msgspec.structs import fields

from ingest.languages.rules import Findings
from ingest.languages.tolerance.tolerant_json import KnownNames, decoded
from ingest.languages.vda5050.vda_messages import KINDS, REQUIRED, Header, VdaMotion

_REQUIRED_KEYS = {kind: attrgetter(*keys) for kind, keys in REQUIRED.items()}
_READABLE = ("2.", "3.")
"""Versions begin with one of these, or are the whole number."""
NAMES = KnownNames(
    frozenset(("agvPosition", "mobileRobotPosition", "x", "y", "theta", "mapId", "velocity", "nodePosition"))
    | {field.encode_name for kind in KINDS for field in fields(KINDS[kind]) if field.name in REQUIRED[kind]},
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
)
"""Keys of which a likeness is noticed, and words that senders use beside those of the enumerations."""


def read_message(kind: str, raw: bytes, findings: Findings) -> Header:
    """The message of a topic that ends in `kind`. Raises `RejectedError` if it can't be understood."""
    message = decoded(KINDS[kind], raw, findings, partial(_lacks_key, kind), NAMES)
    if None in _REQUIRED_KEYS[kind](message):
        _note_absent(kind, message, findings)
    if message.version and not message.version.startswith(_READABLE) and message.version not in {"2", "3"}:
        findings.note("version-unknown", "version", message.version, "2.x or 3.x")
    return message


def _lacks_key(kind: str, message: Any) -> bool:
    """Whether a key is absent that is required or, of a pose, used."""
    if None in _REQUIRED_KEYS[kind](message):
        return True
    if not isinstance(message, VdaMotion):
        return False
    position = message.position
    return position is None or position.map_id is None or position.theta is None


def _note_absent(kind: str, message: Header, findings: Findings) -> None:
    names = {field.name: field.encode_name for field in fields(message)}
    for key in REQUIRED[kind]:
        if getattr(message, key) is None:
            findings.note("key-absent", names[key], None, "left out")
