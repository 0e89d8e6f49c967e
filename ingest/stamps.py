"""Timestamps as senders write them: RFC 3339, and what comes near it."""

import re
from dataclasses import dataclass
from datetime import UTC, datetime

EARLIEST_S, LATEST_S = 0.0, 4102444800.0
"""1970 and 2100: a message's own stamp outside them is absurd."""

_STRICT = re.compile(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d(?:\.\d+)?(?:Z|[+-]\d\d:\d\d)")
_LOOSE = re.compile(
    r"\s*(\d{4}-\d\d-\d\d)[Tt ](\d\d:\d\d:\d\d)(?:[.,](\d+))?\s*(?:([Zz])|([+-]\d\d)(:?)(\d\d)|([+-]\d\d))?\s*"
)
_EPOCH = re.compile(r"\s*(\d{1,11})(?:[. ](\d{1,9}))?\s*")


@dataclass(frozen=True, slots=True)
class Stamp:
    """A moment in the sender's own time."""

    t_s: float
    """Seconds since the epoch."""
    resolution_s: float
    """What one unit of the last digit sent is worth."""
    findings: tuple[str, ...] = ()


def parse(text: str) -> Stamp | None:
    """The moment that `text` names, or None where it names none."""
    if _STRICT.fullmatch(text):
        return _strict(text)
    return _loose(text) or _epoch(text)


def write(t_s: float) -> str:
    """RFC 3339 in UTC to the microsecond."""
    return datetime.fromtimestamp(t_s, UTC).strftime("%Y-%m-%dT%H:%M:%S.%fZ")


def _strict(text: str) -> Stamp | None:
    try:
        moment = datetime.fromisoformat(text)
    except ValueError:
        return None
    dot = text.find(".", 19, 20)
    digits = len(re.match(r"\d*", text[20:]).group()) if dot == 19 else 0  # type: ignore[union-attr]
    utc = text[-1] == "Z" or text[-6:] in ("+00:00", "-00:00")
    return Stamp(moment.timestamp(), 10.0**-digits, () if utc else ("stamp-not-utc",))


def _loose(text: str) -> Stamp | None:
    found = _LOOSE.fullmatch(text)
    if not found:
        return None
    date, time, fraction, zulu, hours, colon, minutes, hours_only = found.groups()
    offset = "+00:00" if zulu else f"{hours or hours_only or '+00'}:{minutes or '00'}"
    try:
        moment = datetime.fromisoformat(f"{date}T{time}.{(fraction or '0')[:6]:0<6}{offset}")
    except ValueError:
        return None
    findings = []
    if not (zulu or hours or hours_only):
        findings.append("stamp-no-offset")
    if (hours and not colon) or hours_only:
        findings.append("stamp-offset-no-colon")
    if offset[1:] != "00:00":
        findings.append("stamp-not-utc")
    if text[10:11] != "T" or zulu == "z" or text != text.strip() or "," in text:
        findings.append("stamp-space")
    return Stamp(moment.timestamp(), 10.0 ** -len(fraction or ""), tuple(findings))


def _epoch(text: str) -> Stamp | None:
    found = _EPOCH.fullmatch(text)
    if not found:
        return None
    seconds, fraction = found.group(1), found.group(2) or ""
    nanoseconds = fraction.rjust(9, "0") if " " in text.strip() else fraction.ljust(9, "0")
    return Stamp(int(seconds) + int(nanoseconds) * 1e-9, 10.0 ** -len(fraction), ("stamp-epoch",))
