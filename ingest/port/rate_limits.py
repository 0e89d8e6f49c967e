"""Rate limits: each vendor may send a limited number of messages per second.

Each vendor has a token bucket (Turner 1986, "leaky bucket as a meter"). Messages beyond the rate wait, one for each
robot. A newer message of a robot replaces its waiting one, so that only outdated messages are dropped.
"""

import re
from collections import OrderedDict
from dataclasses import dataclass, field
from typing import NamedTuple

from ingest.port.connection import Connection

BURST_S = 1.0
"""A vendor may send this many seconds' worth of messages at once."""
MOST_WAITING = 10_000
"""Robots of one vendor with a waiting message. Beyond it, the message that has waited longest is dropped."""
MOST_WAITING_BYTES = 32 << 20
"""The same limit for the size of a vendor's waiting messages."""
MOST_BUCKETS = 1000
"""Buckets kept for vendors and addresses. Beyond it, full ones are removed."""
UUID = re.compile(rb'"uuid"\s*:\s*"([^"]{1,64})"', re.IGNORECASE)


class ArrivedMessage(NamedTuple):
    """One message as it arrived."""

    raw: bytes
    arrival_s: float
    connection: Connection


@dataclass(slots=True, eq=False)
class TokenBucket:
    """The messages that one vendor may still send, and those that wait."""

    tokens: float
    """Messages that may be delivered now."""
    filled_s: float
    """When tokens were last added."""
    waiting: OrderedDict[bytes, ArrivedMessage] = field(default_factory=OrderedDict)
    """By robot and kind of report, oldest first."""
    waiting_bytes: int = 0

    def pop_oldest(self) -> ArrivedMessage:
        """Remove the message that has waited longest."""
        message = self.waiting.popitem(last=False)[1]
        self.waiting_bytes -= len(message.raw)
        return message

    def fill(self, now_s: float, rate: float) -> None:
        """Add the tokens for the time since the last call."""
        self.tokens = min(self.tokens + max(now_s - self.filled_s, 0.0) * rate, rate * BURST_S)
        self.filled_s = now_s


class RateLimits:
    """The buckets of all vendors. `now_s` is of a monotonic clock."""

    def __init__(self, messages_a_second: float) -> None:
        self.rate = messages_a_second
        self._buckets: dict[str, TokenBucket] = {}

    def admit(self, vendor: str, message: ArrivedMessage, now_s: float) -> tuple[bool, list[ArrivedMessage]]:
        """Whether the message may be delivered at once; if not, it waits. With it the messages dropped for it."""
        bucket = self._buckets.get(vendor)
        if bucket is None:
            if len(self._buckets) >= MOST_BUCKETS:
                self._remove_idle(now_s)
            bucket = self._buckets[vendor] = TokenBucket(self.rate * BURST_S, now_s)
        bucket.fill(now_s, self.rate)
        if bucket.tokens >= 1 and not bucket.waiting:
            bucket.tokens -= 1
            return True, []
        return False, _enqueue(bucket, message)

    def due(self, now_s: float) -> list[ArrivedMessage]:
        """Remove and return the messages that may be delivered now, oldest first for each vendor.

        Call it many times a second.
        """
        due = []
        for bucket in self._buckets.values():
            bucket.fill(now_s, self.rate)
            while bucket.waiting and bucket.tokens >= 1:
                bucket.tokens -= 1
                due.append(bucket.pop_oldest())
        self._remove_idle(now_s)
        return due

    def _remove_idle(self, now_s: float) -> None:
        """Remove full buckets in which nothing waits. They are as good as new."""
        for bucket in self._buckets.values():
            bucket.fill(now_s, self.rate)
        full = self.rate * BURST_S
        self._buckets = {
            name: bucket for name, bucket in self._buckets.items() if bucket.waiting or bucket.tokens < full
        }

    def __len__(self) -> int:
        return len(self._buckets)

    @property
    def waiting(self) -> bool:
        """Whether a message waits."""
        return any(bucket.waiting for bucket in self._buckets.values())


def uuid_in(raw: bytes) -> bytes | None:
    """The first UUID in a message, in lower case. None if it has none."""
    found = UUID.search(raw)
    return found.group(1).lower() if found else None


def _enqueue(bucket: TokenBucket, message: ArrivedMessage) -> list[ArrivedMessage]:
    """Let the message wait in the place of its robot's older message, or at the end. Returns the dropped messages."""
    connection = message.connection
    key = (not connection.topic and uuid_in(message.raw)) or b"connection %d" % connection.id
    key += b" status" if b'"operationalState"' in message.raw else b""
    older = bucket.waiting.get(key)
    bucket.waiting[key] = message
    bucket.waiting_bytes += len(message.raw) - (len(older.raw) if older else 0)
    dropped = [older] if older else []
    while len(bucket.waiting) > MOST_WAITING or bucket.waiting_bytes > MOST_WAITING_BYTES:
        dropped.append(bucket.pop_oldest())
    return dropped
