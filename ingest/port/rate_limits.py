"""Rate limits: each vendor may send a limited number of messages and bytes, and cause limited work, per second.

Each vendor has token buckets (Turner 1986, "leaky bucket as a meter"). Messages beyond the rates wait, one for each
robot. A newer message of a robot replaces its waiting one, so that only outdated messages are dropped.
"""

from collections import OrderedDict
from dataclasses import dataclass, field
from typing import NamedTuple, Self

from ingest.languages.massrobotics.massrobotics_front_end import UUID_KEY
from ingest.port.connection import Connection

BURST_S = 1.0
"""A vendor may send this many seconds' worth of messages at once."""
READING_SHARE = 0.2
"""The part of a core that may be spent on the sockets of one vendor, without the reading of messages."""
MOST_IN_HAND_S = 0.03
"""Processor time that admitted messages of one vendor may need until they are delivered, so that others soon follow."""
USUAL_S_PER_BYTE, LEARNING_RATE = 1e-7, 0.1
"""Processor time of a message until more is known, and the weight of each further message in its average."""
OVERHEAD_BYTES = 200
"""What any message weighs besides its bytes: an empty one takes time too."""
MOST_WAITING = 10_000
"""Robots of one vendor with a waiting message. Beyond it, the message that has waited longest is dropped."""
MOST_WAITING_BYTES = 32 << 20
"""The same limit for the size of a vendor's waiting messages."""
MOST_BUCKETS = 1000
"""Buckets kept for vendors and addresses. Beyond it, full ones are removed."""


class ArrivedMessage(NamedTuple):
    """One message as it arrived."""

    raw: bytes
    arrival_s: float
    connection: Connection


FILLED_EVERY_S = 0.001
"""A bucket is asked three times for each message; it is filled once for all messages of a millisecond."""


@dataclass(frozen=True, slots=True)
class Rates:
    """What each vendor may use in a second."""

    messages: float
    message_bytes: float = 10e6
    processor_s: float = 0.4
    """Processor time for reading messages."""
    reading_s: float = READING_SHARE
    """Processor time for sockets."""


@dataclass(slots=True, eq=False)
class TokenBucket:
    """What one vendor may still use, and the messages that wait. All but `messages` may become negative."""

    messages: float
    message_bytes: float
    processor_s: float
    reading_s: float
    filled_s: float
    """When the vendor was last given anything."""
    in_hand_bytes: int = 0
    """Messages that are admitted and not yet delivered, with their overhead."""
    s_per_byte: float = USUAL_S_PER_BYTE
    """Processor time that its messages take, on average."""
    waiting: OrderedDict[bytes, ArrivedMessage] = field(default_factory=OrderedDict)
    """By robot and kind of report, oldest first."""
    waiting_bytes: int = 0

    @classmethod
    def full(cls, rates: Rates, now_s: float) -> Self:
        """The bucket of a vendor that has used nothing."""
        bucket = cls(0.0, 0.0, 0.0, 0.0, now_s - BURST_S)
        bucket.fill(now_s, rates)
        return bucket

    def fill(self, now_s: float, rates: Rates) -> None:
        """Add what the vendor may use in the time since it was last given something, each `FILLED_EVERY_S` or later."""
        if 0.0 <= now_s - self.filled_s < FILLED_EVERY_S:
            return
        passed_s, self.filled_s = max(now_s - self.filled_s, 0.0), now_s
        self.messages = min(self.messages + passed_s * rates.messages, rates.messages * BURST_S)
        self.message_bytes = min(self.message_bytes + passed_s * rates.message_bytes, rates.message_bytes * BURST_S)
        self.processor_s = min(self.processor_s + passed_s * rates.processor_s, rates.processor_s * BURST_S)
        self.reading_s = min(self.reading_s + passed_s * rates.reading_s, rates.reading_s * BURST_S)

    def grants_message(self) -> bool:
        """Whether a message may be delivered now."""
        is_room = self.in_hand_bytes * self.s_per_byte < MOST_IN_HAND_S
        return is_room and self.messages >= 1 and self.message_bytes > 0 and self.processor_s > 0

    def admit(self, message: ArrivedMessage) -> None:
        """Take off what a message costs that is to be delivered now. Its processor time is not known yet."""
        self.messages -= 1
        self.message_bytes -= len(message.raw)
        self.in_hand_bytes += len(message.raw) + OVERHEAD_BYTES

    def delivered(self, message_bytes: int, spent_s: float, rates: Rates) -> None:
        """Take off the processor time of a message that was admitted."""
        weight_bytes = message_bytes + OVERHEAD_BYTES
        self.in_hand_bytes = max(self.in_hand_bytes - weight_bytes, 0)
        self.s_per_byte += LEARNING_RATE * (spent_s / weight_bytes - self.s_per_byte)
        self.processor_s = max(self.processor_s - spent_s, -rates.processor_s * BURST_S)

    def is_idle(self, rates: Rates) -> bool:
        """Whether nothing waits and the bucket is full: as good as new."""
        return not self.waiting and (
            not self.in_hand_bytes
            and self.messages >= rates.messages * BURST_S
            and self.message_bytes >= rates.message_bytes * BURST_S
            and self.processor_s >= rates.processor_s * BURST_S
            and self.reading_s >= rates.reading_s * BURST_S
        )

    def pop_oldest(self) -> ArrivedMessage:
        """Remove the message that has waited longest."""
        message = self.waiting.popitem(last=False)[1]
        self.waiting_bytes -= len(message.raw)
        return message


class RateLimits:
    """The buckets of all vendors. `now_s` is of a monotonic clock."""

    def __init__(self, rates: Rates) -> None:
        self.rates = rates
        self.buckets: dict[str, TokenBucket] = {}
        """By vendor or address."""

    def admit(self, vendor: str, message: ArrivedMessage, now_s: float) -> tuple[bool, list[ArrivedMessage]]:
        """Whether the message may be delivered at once; if not, it waits. With it the messages dropped for it."""
        bucket = self._filled(vendor, now_s)
        if not bucket.waiting and bucket.grants_message():
            bucket.admit(message)
            return True, []
        return False, _enqueue(bucket, message)

    def due(self, now_s: float) -> list[ArrivedMessage]:
        """Remove and return the messages that may be delivered now, oldest first for each vendor.

        Call it many times a second.
        """
        due = []
        for bucket in self.buckets.values():
            bucket.fill(now_s, self.rates)
            while bucket.waiting and bucket.grants_message():
                message = bucket.pop_oldest()
                bucket.admit(message)
                due.append(message)
        self._remove_idle(now_s)
        return due

    def delivered(self, vendor: str, message_bytes: int, spent_s: float, now_s: float) -> None:
        """Take off the processor time of a message that was admitted; 0 if a newer one took its place."""
        self._filled(vendor, now_s).delivered(message_bytes, spent_s, self.rates)

    def charge_reading(self, vendor: str, spent_s: float, now_s: float) -> float:
        """Take off processor time that a socket took. Returns for how long the socket should not be read."""
        bucket = self._filled(vendor, now_s)
        bucket.reading_s = max(bucket.reading_s - spent_s, -self.rates.reading_s * BURST_S)
        return max(-bucket.reading_s / self.rates.reading_s, 0.0)

    def _filled(self, vendor: str, now_s: float) -> TokenBucket:
        bucket = self.buckets.get(vendor)
        if bucket is None:
            if len(self.buckets) >= MOST_BUCKETS:
                self._remove_idle(now_s)
            bucket = self.buckets[vendor] = TokenBucket.full(self.rates, now_s)
        else:
            bucket.fill(now_s, self.rates)
        return bucket

    def _remove_idle(self, now_s: float) -> None:
        for bucket in self.buckets.values():
            bucket.fill(now_s, self.rates)
        self.buckets = {name: bucket for name, bucket in self.buckets.items() if not bucket.is_idle(self.rates)}

    @property
    def waiting(self) -> bool:
        """Whether a message waits."""
        return any(bucket.waiting for bucket in self.buckets.values())


def _enqueue(bucket: TokenBucket, message: ArrivedMessage) -> list[ArrivedMessage]:
    """Let the message wait in the place of its robot's older message, or at the end. Returns the dropped messages."""
    connection = message.connection
    found = None if connection.topic else UUID_KEY.search(message.raw)
    key = found.group(1).lower() if found else b"connection %d" % connection.id
    key += b" status" if b'"operationalState"' in message.raw else b""
    older = bucket.waiting.get(key)
    bucket.waiting[key] = message
    bucket.waiting_bytes += len(message.raw) - (len(older.raw) if older else 0)
    dropped = [older] if older else []
    while len(bucket.waiting) > MOST_WAITING or bucket.waiting_bytes > MOST_WAITING_BYTES:
        dropped.append(bucket.pop_oldest())
    return dropped
