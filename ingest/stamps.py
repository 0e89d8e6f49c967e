"""Timestamps as senders write them: RFC 3339, and what comes near it."""

import re
from dataclasses import dataclass
from datetime import UTC, datetime

EARLIEST_S, LATEST_S = 0.0, 4102444800.0
"""1970 and 2100."""

_DATE, _TIME = r"(\d{4}-\d\d-\d\d)", r"(\d\d:\d\d:\d\d)"
_OFFSET = r"(?:([Zz])|([+-]\d\d)(:?)(\d\d)?)?"
_DATE_TIME = re.compile(rf"\s*{_DATE}([Tt ]){_TIME}(?:([.,])(\d+))? *{_OFFSET}\s*", re.ASCII)
_COUNT = re.compile(r"\s*(\d{1,20})(?:([. ])(\d{1,9}))?\s*", re.ASCII)
_FINEST_S = 1e-9
_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)


@dataclass(frozen=True, slots=True)
class Stamp:
    """A moment in the sender's own time."""

    t_s: float
    """Seconds since the epoch."""
    resolution_s: float
    """What one unit of the last digit sent is worth."""
    findings: tuple[str, ...] = ()


def seconds(text: str) -> float | None:
    """Seconds since the epoch if `text` is plain RFC 3339 with a Z, else None: the fast way for `parse`."""
    shape = text[4:20:3]
    whole = shape == "--T::Z"
    if text[-1:] != "Z" or not (whole or (shape == "--T::." and text[20:-1].isdecimal() and text.isascii())):
        return None
    try:
        return (datetime.fromisoformat(text) - _EPOCH).total_seconds()
    except ValueError:
        return None


def parse(text: str) -> Stamp | None:
    """The moment that `text` names, or None where it names none."""
    t_s = seconds(text)
    if t_s is not None:
        return Stamp(t_s, _resolution_s(len(text) - 21))
    return _date_time(text) or _epoch(text)


def plausible(t_s: float) -> bool:
    """Whether a time lies in the years that a sender may mean."""
    return EARLIEST_S <= t_s <= LATEST_S


def write(t_s: float) -> str:
    """RFC 3339 in UTC to the microsecond."""
    return datetime.fromtimestamp(t_s, UTC).strftime("%Y-%m-%dT%H:%M:%S.%fZ")


def _date_time(text: str) -> Stamp | None:
    found = _DATE_TIME.fullmatch(text)
    if not found:
        return None
    date, letter, time, point, fraction, zulu, hours, colon, minutes = found.groups()
    offset = f"{hours}:{minutes or '00'}" if hours else "+00:00"
    is_leap = time.endswith(":60")
    time = time[:-2] + "59" if is_leap else time
    try:
        t_s = (datetime.fromisoformat(f"{date}T{time}.{(fraction or '0')[:6]:0<6}{offset}") - _EPOCH).total_seconds()
    except ValueError:
        return None
    findings = []
    if not (zulu or hours):
        findings.append("stamp-no-offset")
    if hours and not (colon and minutes):
        findings.append("stamp-offset-no-colon")
    if offset[1:] != "00:00":
        findings.append("stamp-not-utc")
    if letter != "T" or zulu == "z" or point == "," or " " in text or text != text.strip():
        findings.append("stamp-spelling")
    return Stamp(t_s + is_leap, _resolution_s(len(fraction or "")), tuple(findings))


def _epoch(text: str) -> Stamp | None:
    """Seconds with a fraction, seconds and nanoseconds, or a whole number of s, ms, us or ns by its size."""
    found = _COUNT.fullmatch(text)
    if not found:
        return None
    whole, separator, fraction = found.groups()
    thousandths = max(0, (len(whole) - 9) // 3)
    if separator == " ":
        t_s, resolution_s = int(whole) + int(fraction) * 1e-9, _FINEST_S
    elif separator == ".":
        t_s, resolution_s = float(f"{whole}.{fraction}"), _resolution_s(len(fraction))
    else:
        t_s, resolution_s = int(whole) / 1000**thousandths, _resolution_s(3 * thousandths)
    return Stamp(t_s, resolution_s, ("stamp-epoch",))


def _resolution_s(digits: int) -> float:
    return max(10.0 ** -min(max(digits, 0), 9), _FINEST_S)
