"""What the words of a message mean: UUIDs, datums and states, as they stand and as senders spell them."""

import re
from functools import lru_cache
from uuid import UUID, uuid5

from ingest.languages.massrobotics.conformance_rules import Findings, RejectedError
from ingest.settings import NIL_DATUM

NAMED_ROBOTS = UUID("b7f0f4f1-3a3c-5d52-9a63-2b2c8a0f9d10")
"""Namespace of the UUIDs of robots that are known by name."""
MAX_WORD = 80
"""Letters kept of a datum or state that the standard does not know."""

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
"""Letters and digits of a state, case folded, to the schema's spelling."""

_RFC_4122 = re.compile(r"[0-9a-f]{8}-[0-9a-f]{4}-[1-8][0-9a-f]{3}-[89ab][0-9a-f]{3}-[0-9a-f]{12}")
_UUID = re.compile(r"[0-9a-f]{8}-[0-9a-f]{4}-[0-9a-f]{4}-[0-9a-f]{4}-[0-9a-f]{12}")
_UUID_LETTERS, _REMEMBERED = 36, 1024
"""Datums that are known to be plain, or not: the same few come again and again."""
_ROBOTS_REMEMBERED = 16_384
"""UUIDs in spellings of their own that are kept read: each comes once a second."""
_HEX = re.compile(r"[0-9a-f]{32}")


def robot_uuid(text: str, names_as_uuid: str | None, findings: Findings) -> str:
    """The UUID that `text` means, in lower case with dashes. A name becomes one of `names_as_uuid`, if given."""
    if _RFC_4122.fullmatch(text):
        return text
    uuid, found = (_known_robot if len(text) <= MAX_WORD else _robot)(text, names_as_uuid)
    if found:
        findings.update(dict.fromkeys(found))
    return uuid


def _robot(text: str, names_as_uuid: str | None) -> tuple[str, tuple[str, ...]]:
    """The UUID that `text` means, and the findings on it."""
    plain = _plain_uuid(text)
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


_known_robot = lru_cache(_ROBOTS_REMEMBERED)(_robot)


def is_uuid(text: str) -> bool:
    return _plain_uuid(text) is not None


def _plain_uuid(text: str) -> str | None:
    digits = text.strip().lower().removeprefix("urn:uuid:").strip("{}").replace("-", "")
    if not _HEX.fullmatch(digits):
        return None
    return f"{digits[:8]}-{digits[8:12]}-{digits[12:16]}-{digits[16:20]}-{digits[20:]}"


def datum(right: str | None, other: str | None, findings: Findings, *, empty: str) -> str:
    """A datum in lower case, from the key where it belongs or from the other.

    One that is absent, empty or nil breaks the rule `empty`; a nil one stays, since a site may map it.
    """
    if other is not None:
        findings["datum-key"] = None
    text = other if right is None else right
    if text is not None and len(text) == _UUID_LETTERS and _is_plain_datum(text):
        return text
    lower = (text or "").strip().lower()
    if lower in ("", NIL_DATUM):
        findings[empty] = None
    elif not _UUID.fullmatch(lower):
        findings["datum-not-uuid"] = None
    elif lower != text:
        findings["datum-upper-case"] = None
    return lower[:MAX_WORD]


@lru_cache(_REMEMBERED)
def _is_plain_datum(text: str) -> bool:
    return _UUID.fullmatch(text) is not None and text != NIL_DATUM


def state(text: str, findings: Findings) -> tuple[str, bool]:
    """The state in the schema's spelling, or the sender's own word, and whether the standard knows it."""
    if text in STATES:
        if text == "offline":
            findings["state-offline"] = None
        return text, True
    alias = _ALIASES.get("".join(letter for letter in text[:MAX_WORD].casefold() if letter.isalnum()))
    findings["state-alias" if alias else "state-unknown"] = None
    return (alias, True) if alias else (text[:MAX_WORD], False)
