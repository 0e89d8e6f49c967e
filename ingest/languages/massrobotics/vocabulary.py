"""UUIDs, datums and states of a message, as the standard spells them and as senders do."""

import re
from functools import lru_cache
from uuid import UUID, uuid5

from ingest.frames.assumed_motion import DRIVES_MPS
from ingest.languages.rules import Findings, RejectedError
from ingest.settings import NIL_DATUM, plain_uuid

NAMED_ROBOTS = UUID("b7f0f4f1-3a3c-5d52-9a63-2b2c8a0f9d10")
"""Namespace of the UUIDs of robots that are known by name."""
MAX_WORD = 80
"""Characters kept of a datum or state that the standard does not know."""

STATES = frozenset(
    (
        "navigating",
        "idle",
        "disabled",
        "offline",
        "charging",
        "waitingHumanEvent",
        "waitingExternalEvent",
        "waitingInternalEvent",
        "manualOverride",
    )
)
_ALIASES = {state.casefold(): state for state in STATES} | {
    "manual": "manualOverride",
    "manualmode": "manualOverride",
    "waiting": "waitingInternalEvent",
    "waitinghuman": "waitingHumanEvent",
    "waitingforhumanevent": "waitingHumanEvent",
    "waitingonexternalevent": "waitingExternalEvent",
    "waitingoninternalevent": "waitingInternalEvent",
    "loadingunloading": "waitingExternalEvent",
    "moving": "navigating",
}
"""From the letters and digits of a state, case folded, to the schema's spelling."""

_RFC_4122 = re.compile(r"[0-9a-f]{8}-[0-9a-f]{4}-[1-8][0-9a-f]{3}-[89ab][0-9a-f]{3}-[0-9a-f]{12}")
_UUID = re.compile(r"[0-9a-f]{8}-[0-9a-f]{4}-[0-9a-f]{4}-[0-9a-f]{4}-[0-9a-f]{12}")
_UUID_LENGTH = 36
_DATUMS_CACHED = 1024
"""Datums whose check is cached: the same few come again and again."""
_ROBOTS_CACHED = 16_384
"""Results cached for UUIDs that are not spelt as RFC 4122 does: each comes once a second."""


def robot_uuid(text: str, names_as_uuid: str | None, findings: Findings) -> str:
    """The UUID that `text` spells, in lower case with dashes. Raises `RejectedError` if it spells none.

    With `names_as_uuid`, a vendor, any other text is a name, and the UUID is derived from vendor and name.
    """
    if _RFC_4122.fullmatch(text):
        return text
    uuid, found = (_cached_robot if len(text) <= MAX_WORD else _robot)(text, names_as_uuid)
    for rule in found:
        findings.note(rule, "uuid", text, uuid)
    return uuid


def _robot(text: str, names_as_uuid: str | None) -> tuple[str, tuple[str, ...]]:
    """The UUID that `text` spells or names, and its deviations."""
    plain = plain_uuid(text)
    if plain:
        found = {
            "uuid-no-dashes": text.lower() != plain,
            "uuid-upper-case": text.lower() != text,
            "uuid-not-rfc4122": not _RFC_4122.fullmatch(plain),
        }
        return plain, tuple(rule for rule, is_so in found.items() if is_so)
    if names_as_uuid and text.strip():
        return str(uuid5(NAMED_ROBOTS, f"{names_as_uuid}/{text}")), ("uuid-is-name",)
    reason = f"{text[:60]!r} is no UUID; send one, or set names_as_uuid for this vendor in the site file"
    raise RejectedError("uuid-unreadable", reason)


_cached_robot = lru_cache(_ROBOTS_CACHED)(_robot)


def is_uuid(text: str) -> bool:
    return plain_uuid(text) is not None


def datum(proper: str | None, misplaced: str | None, findings: Findings, *, empty: str, path: str = "") -> str:
    """A datum in lower case. `proper` is under the key that the schema has for it, `misplaced` under the other key.

    A datum that is absent, empty or nil deviates from the rule `empty`. A nil one is returned, since a site may map it.
    Deviations are named if a path is given, that of the key which the schema has.
    """
    found = []
    if misplaced is not None:
        found.append("datum-key")
    text = misplaced if proper is None else proper
    if text is not None and len(text) == _UUID_LENGTH and _is_plain_datum(text):
        lower = text
    else:
        lower = (text or "").strip().lower()
        found += _datum_deviations(lower, text, empty)
    for rule in found:
        if path:
            findings.note(rule, path, text, lower[:MAX_WORD] or "none")
        else:
            findings[rule] = None
    return lower[:MAX_WORD]


def _datum_deviations(lower: str, text: str | None, empty: str) -> list[str]:
    if lower in ("", NIL_DATUM):
        return [empty]
    if not _UUID.fullmatch(lower):
        return ["datum-not-uuid"]
    return ["datum-upper-case"] if lower != text else []


@lru_cache(_DATUMS_CACHED)
def _is_plain_datum(text: str) -> bool:
    return _UUID.fullmatch(text) is not None and text != NIL_DATUM


def state(text: str, findings: Findings) -> tuple[str, bool]:
    """The state and whether the standard has it: in the schema's spelling if it does, else as sent."""
    if text in STATES:
        if text == "offline":
            findings.note("state-offline", "operationalState", text, "present and standing")
        return text, True
    alias = _ALIASES.get("".join(letter for letter in text[:MAX_WORD].casefold() if letter.isalnum()))
    if alias:
        findings.note("state-alias", "operationalState", text, alias)
        return alias, True
    findings.note("state-unknown", "operationalState", text, "by what the robot does")
    return text[:MAX_WORD], False


def by_motion(state: str, linear_mps: float | None) -> str:
    """The state of a robot that sent none of the standard's: a robot that drives is navigating."""
    return "navigating" if linear_mps is not None and abs(linear_mps) > DRIVES_MPS else state
