"""Rejected messages, kept for people to read: the newest of each vendor, limited in number and size."""

from collections import deque
from dataclasses import dataclass
from typing import Any

from ingest.languages import timestamps

KEPT_BYTES = 2048
"""Of each message; enough to see what is wrong with it."""
KEPT_PER_VENDOR = 100
MOST_VENDORS = 100


@dataclass(frozen=True, slots=True)
class RejectedMessage:
    """A rejected message and the reason."""

    raw: bytes
    """Its first `KEPT_BYTES`."""
    size: int
    """Bytes of the whole message."""
    rule: str
    reason: str
    connection: int
    """Number of the connection."""
    arrival_s: float


class Quarantine:
    """The newest rejected messages of each vendor, so that many of one vendor do not displace those of others."""

    def __init__(self) -> None:
        self._by_vendor: dict[str, deque[RejectedMessage]] = {}
        self.displaced = 0
        """How many messages were displaced or not kept."""

    def add(self, message: RejectedMessage, vendor: str) -> None:
        if vendor not in self._by_vendor and len(self._by_vendor) >= MOST_VENDORS:
            self.displaced += 1
            return
        kept = self._by_vendor.setdefault(vendor, deque(maxlen=KEPT_PER_VENDOR))
        self.displaced += len(kept) == KEPT_PER_VENDOR
        kept.append(message)

    def documents(self) -> list[dict[str, Any]]:
        """JSON-ready, newest first."""
        messages = [(message, vendor) for vendor, kept in self._by_vendor.items() for message in kept]
        messages.sort(key=lambda pair: pair[0].arrival_s, reverse=True)
        return [_document(message, vendor) for message, vendor in messages]


def _document(message: RejectedMessage, vendor: str) -> dict[str, Any]:
    return {
        "received": timestamps.write(message.arrival_s),
        "vendor": vendor,
        "connection": message.connection,
        "rule": message.rule,
        "reason": message.reason,
        "message": message.raw.decode(errors="backslashreplace"),
        "size_bytes": message.size,
        "cut_short": message.size > len(message.raw),
    }


def rejected_message(raw: bytes, rule: str, reason: str, connection: int, arrival_s: float) -> RejectedMessage:
    """The record of a rejected message."""
    return RejectedMessage(raw[:KEPT_BYTES], len(raw), rule, reason, connection, arrival_s)
