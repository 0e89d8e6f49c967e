"""Rejected messages, kept for a person to read: the newest of each vendor, within bounds."""

from collections import deque
from dataclasses import dataclass
from typing import Any

from ingest.languages.massrobotics import timestamps

KEPT_BYTES = 2048
"""Of each message; enough to see what is wrong with it."""
KEPT_PER_VENDOR = 100
MOST_VENDORS = 100


@dataclass(frozen=True, slots=True)
class Rejected:
    """One rejected message and why."""

    raw: bytes
    size: int
    rule: str
    reason: str
    connection: int
    arrival_s: float


class Quarantine:
    """The newest rejects of each vendor, so that one vendor's flood hides no other's."""

    def __init__(self) -> None:
        self._by_vendor: dict[str, deque[Rejected]] = {}
        self.pushed_out = 0
        """Rejects no longer kept."""

    def add(self, rejected: Rejected, vendor: str) -> None:
        if vendor not in self._by_vendor and len(self._by_vendor) >= MOST_VENDORS:
            self.pushed_out += 1
            return
        kept = self._by_vendor.setdefault(vendor, deque(maxlen=KEPT_PER_VENDOR))
        self.pushed_out += len(kept) == KEPT_PER_VENDOR
        kept.append(rejected)

    def documents(self) -> list[dict[str, Any]]:
        """JSON-ready, newest first."""
        everything = [(one, vendor) for vendor, kept in self._by_vendor.items() for one in kept]
        everything.sort(key=lambda pair: pair[0].arrival_s, reverse=True)
        return [_document(one, vendor) for one, vendor in everything]


def _document(one: Rejected, vendor: str) -> dict[str, Any]:
    return {
        "received": timestamps.write(one.arrival_s),
        "vendor": vendor,
        "connection": one.connection,
        "rule": one.rule,
        "reason": one.reason,
        "message": one.raw.decode(errors="backslashreplace"),
        "size_bytes": one.size,
        "cut_short": one.size > len(one.raw),
    }


def rejected(raw: bytes, rule: str, reason: str, connection: int, arrival_s: float) -> Rejected:
    """A reject with as much of its message as is kept."""
    return Rejected(raw[:KEPT_BYTES], len(raw), rule, reason, connection, arrival_s)
