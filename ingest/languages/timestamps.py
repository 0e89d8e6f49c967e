"""Timestamps as senders write them: RFC 3339, and spellings close to it."""

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from functools import lru_cache
from itertools import pairwise
from math import floor, inf, isfinite, isnan, nan

import msgspec
import numpy as np

from ingest.languages.rules import Findings

EARLIEST_S, LATEST_S = 0.0, 4102444800.0
"""1970 and 2100."""

_DATE, _TIME = r"(\d{4}-\d\d-\d\d)", r"(\d\d:\d\d:\d\d)"
_OFFSET = r"(?:(Z)|([+-]\d\d)(:?)(\d\d)?)?"
_HEAD = re.compile(rf"{_DATE}T{_TIME}", re.ASCII)
_TAIL = re.compile(rf"(?:\.(\d+))?{_OFFSET}", re.ASCII)
_VARIANT = re.compile(rf"\s*{_DATE}[Tt ]{_TIME}(?:[.,](\d+))? *([Zz]|[+-][\d:]+[Zz]?)?\s*", re.ASCII)
_COUNT = re.compile(r"\s*(\d{1,20})(?:([. ])(\d{1,9}))?\s*", re.ASCII)
_HEAD_LENGTH, _MAX_LENGTH = 19, 40
_FINEST_S, _FINEST_DIGITS = 1e-9, 9
_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
_US = timedelta(microseconds=1)
_CACHED = 4096
"""Parsed heads and tails of stamps that are cached: the same few come again and again."""


class Stamp(msgspec.Struct, frozen=True, gc=False):
    """A moment in the sender's own time."""

    t_s: float
    """Seconds since the epoch."""
    resolution_s: float
    """The time that one unit of the last digit sent stands for."""
    findings: tuple[str, ...] = ()

    @property
    def is_known(self) -> bool:
        """Whether it could be read."""
        return isfinite(self.resolution_s)


NO_STAMP = Stamp(nan, inf)
"""Of a message that has none, or one that can't be read."""


@dataclass(frozen=True, slots=True)
class _Tail:
    """The part of a date-time after the seconds: the fraction and the offset from UTC."""

    after_us: int
    """The fraction less the offset from UTC."""
    resolution_s: float
    findings: tuple[str, ...]


def point_time_s(text: str, path: str, findings: Findings) -> float:
    """The time of a point; nan, which is noted, if there is none that can be read."""
    stamp = parse(text)
    if stamp is None or not plausible(stamp.t_s):
        findings.note("point-time-unreadable", path, text, "between its neighbours")
        return nan
    if stamp.findings:
        findings.update(dict.fromkeys(stamp.findings))
    return stamp.t_s


def first_fall(times: Sequence[float]) -> list[float]:
    """The first two neighbours of which the second is not later. Empty if there are none."""
    return list(next((pair for pair in pairwise(times) if pair[0] >= pair[1]), ()))


def filled(times: Sequence[float], stamp_s: float) -> list[float]:
    """Times (p,) of points, each nan replaced by what lies between its neighbours.

    `stamp_s`, that of the message, stands before the first known time. After the last there is a second for each
    point. If no time is known, all are `stamp_s`: then the speed of the robot gives the times.
    """
    known = [row for row, t_s in enumerate(times) if not isnan(t_s)]
    if len(known) == len(times):
        return list(times)
    if not known:
        return [0.0 if isnan(stamp_s) else stamp_s] * len(times)
    first, last = known[0], known[-1]
    rows = [-1, *known, len(times)]
    before_s = min(stamp_s, times[first]) if not isnan(stamp_s) else times[first] - first - 1
    marks_s = [before_s, *(times[row] for row in known), times[last] + len(times) - last]
    return np.interp(range(len(times)), rows, marks_s).tolist()


def parse(text: str) -> Stamp | None:
    """The moment that `text` names. None if it is no time."""
    return _rfc_3339(text) or _variant(text) or _epoch(text)


def plain_seconds(texts: Iterable[str]) -> tuple[list[float], tuple[str, ...]] | None:
    """The moments that one or more `texts` name, and their deviations. None unless all are RFC 3339 and plausible."""
    moments_s, after_us = [], 0
    known: str | None = None
    findings: tuple[str, ...] = ()
    for text in texts:
        ending = text[_HEAD_LENGTH:]
        if ending != known:  # most paths have one fraction for all points
            tail = _tail(ending) if len(text) <= _MAX_LENGTH else None
            if tail is None:
                return None
            known, after_us = ending, tail.after_us
            findings += tail.findings
        head_us = _head_us(text[:_HEAD_LENGTH])
        if head_us is None:
            return None
        moments_s.append((head_us + after_us) / 1_000_000)
    return (moments_s, findings) if all(map(plausible, (min(moments_s), max(moments_s)))) else None


def plausible(t_s: float) -> bool:
    """Whether a time lies between 1970 and 2100."""
    return EARLIEST_S <= t_s <= LATEST_S


def write(t_s: float) -> str:
    """RFC 3339 in UTC to the microsecond."""
    whole_s = floor(t_s)
    after_us = round((t_s - whole_s) * 1e6)
    if after_us == 1_000_000:
        whole_s, after_us = whole_s + 1, 0
    return f"{_second(whole_s)}.{after_us:06d}Z"


@lru_cache(_CACHED)
def _second(t_s: int) -> str:
    return datetime.fromtimestamp(t_s, UTC).isoformat()[:_HEAD_LENGTH]


def _rfc_3339(text: str) -> Stamp | None:
    """A date-time as RFC 3339 spells it. The offset may lack a colon or be missing."""
    if len(text) > _MAX_LENGTH:
        return None
    head_us, tail = _head_us(text[:_HEAD_LENGTH]), _tail(text[_HEAD_LENGTH:])
    if head_us is None or tail is None:
        return None
    return Stamp((head_us + tail.after_us) / 1_000_000, tail.resolution_s, tail.findings)


@lru_cache(_CACHED)
def _head_us(text: str) -> int | None:
    found = _HEAD.fullmatch(text)
    if not found:
        return None
    is_leap = text.endswith(":60")
    try:
        moment = datetime.fromisoformat(f"{text[:-2]}59+00:00" if is_leap else f"{text}+00:00")
    except ValueError:
        return None
    return (moment - _EPOCH) // _US + is_leap * 1_000_000


@lru_cache(_CACHED)
def _tail(text: str) -> _Tail | None:
    found = _TAIL.fullmatch(text)
    if not found:
        return None
    fraction, zulu, hours, colon, minutes = found.groups()
    offset_min = abs(int(hours or 0)) * 60 + int(minutes or 0)
    if offset_min >= 24 * 60 or int(minutes or 0) >= 60:
        return None
    findings = []
    if not (zulu or hours):
        findings.append("stamp-no-offset")
    if hours and not (colon and minutes):
        findings.append("stamp-offset-no-colon")
    if offset_min:
        findings.append("stamp-not-utc")
    fraction_us = int(f"{(fraction or '0')[:6]:0<6}")
    ahead_us = offset_min * (-60_000_000 if hours and hours[0] == "-" else 60_000_000)
    return _Tail(fraction_us - ahead_us, digit_resolution_s(len(fraction or "")), tuple(findings))


def _variant(text: str) -> Stamp | None:
    """A date-time with spaces, lower-case letters, a comma, a Z after an offset, or more digits than nanoseconds."""
    found = _VARIANT.fullmatch(text)
    if not found:
        return None
    date, time, fraction, offset = found.groups(default="")
    head, offset = f"{date}T{time}", offset.upper()
    offset = offset.rstrip("Z") or offset
    stamp = _rfc_3339(f"{head}.{fraction[:_FINEST_DIGITS]}{offset}" if fraction else f"{head}{offset}")
    if stamp is None or text == f"{head}.{fraction}{offset}":
        return stamp
    return Stamp(stamp.t_s, stamp.resolution_s, (*stamp.findings, "stamp-spelling"))


def _epoch(text: str) -> Stamp | None:
    """A time since 1970: seconds and nanoseconds, or a number of s, ms, us or ns, whose size gives its unit.

    It may have a fraction.
    """
    found = _COUNT.fullmatch(text)
    if not found:
        return None
    whole, separator, fraction = found.groups()
    thousandths = max(0, (len(whole) - 9) // 3)
    if separator == " ":
        t_s, resolution_s = int(whole) + int(fraction) * 1e-9, _FINEST_S
    elif separator == ".":
        t_s = float(f"{whole}.{fraction}") / 1000**thousandths
        resolution_s = digit_resolution_s(len(fraction) + 3 * thousandths)
    else:
        t_s, resolution_s = int(whole) / 1000**thousandths, digit_resolution_s(3 * thousandths)
    return Stamp(t_s, resolution_s, ("stamp-epoch",))


def digit_resolution_s(digits: int) -> float:
    """The time that one unit of the last digit of a fraction stands for."""
    return max(10.0 ** -min(max(digits, 0), 9), _FINEST_S)
