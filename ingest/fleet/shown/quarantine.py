"""Rejected messages, kept for people to read: the newest of each vendor, limited in number and size.

Messages that no vendor can be named for are kept by the address that they come from.
"""

from collections import Counter, OrderedDict, deque
from dataclasses import dataclass
from typing import Any

from ingest.languages import timestamps
from ingest.languages.model import Rejection
from ingest.languages.rules import Oddity
from ingest.settings import UNKNOWN

KEPT_BYTES = 2048
"""Of each message; enough to see what is wrong with it."""
KEPT_PER_VENDOR = 100
MOST_VENDORS, MOST_ADDRESSES = 100, 50
SEVERAL = 2


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
    oddities: tuple[Oddity, ...] = ()
    """The values of the message that deviate, as far as they are named."""
    uuid: str | None = None
    """The UUID of the robot, if it could be read."""


class Quarantine:
    """The newest rejected messages of each sender, so that many of one sender do not displace those of others."""

    def __init__(self) -> None:
        self._by_vendor: dict[str, deque[RejectedMessage]] = {}
        self._by_address: OrderedDict[str, deque[RejectedMessage]] = OrderedDict()
        """The address that was heard longest ago first."""
        self.displaced = 0
        """How many messages were displaced or not kept."""

    def add(self, message: RejectedMessage, vendor: str, address: str) -> None:
        kept = self._of_address(address) if vendor == UNKNOWN else self._of_vendor(vendor)
        if kept is None:
            self.displaced += 1
        else:
            self.displaced += len(kept) == KEPT_PER_VENDOR
            kept.append(message)

    def _of_vendor(self, vendor: str) -> deque[RejectedMessage] | None:
        if vendor not in self._by_vendor and len(self._by_vendor) >= MOST_VENDORS:
            return None
        return self._by_vendor.setdefault(vendor, deque(maxlen=KEPT_PER_VENDOR))

    def _of_address(self, address: str) -> deque[RejectedMessage]:
        kept = self._by_address.setdefault(address, deque(maxlen=KEPT_PER_VENDOR))
        self._by_address.move_to_end(address)
        if len(self._by_address) > MOST_ADDRESSES:
            self.displaced += len(self._by_address.popitem(last=False)[1])
        return kept

    def rejected_robots(self, since_s: float) -> dict[str, tuple[str, RejectedMessage]]:
        """By UUID, the vendor and the newest message of robots of which several were rejected since then."""
        counts: Counter[str] = Counter()
        newest: dict[str, tuple[str, RejectedMessage]] = {}
        for vendor, kept in self._by_vendor.items():
            for message in kept:
                if message.uuid and message.arrival_s >= since_s:
                    counts[message.uuid] += 1
                    newest[message.uuid] = vendor, message
        return {uuid: found for uuid, found in newest.items() if counts[uuid] >= SEVERAL}

    def documents(self) -> list[dict[str, Any]]:
        """JSON-ready, newest first."""
        messages = [(message, vendor) for vendor, kept in self._by_vendor.items() for message in kept]
        messages += [(message, UNKNOWN) for kept in self._by_address.values() for message in kept]
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
        "odd_values": [oddity._asdict() for oddity in message.oddities],
    }


def rejected_message(raw: bytes, rejection: Rejection, connection: int, arrival_s: float) -> RejectedMessage:
    """The record of a rejected message."""
    why = rejection.rule, rejection.reason
    return RejectedMessage(
        raw[:KEPT_BYTES], len(raw), *why, connection, arrival_s, rejection.oddities, uuid=rejection.uuid
    )
