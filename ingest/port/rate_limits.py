"""Fair shares: no vendor takes more than its allowed rate of messages, whatever it sends.

A token bucket for each vendor (Turner 1986, "leaky bucket as a meter"). Beyond its rate a vendor's messages wait, one
for each robot, and the newest of a robot takes the place of an older one: what is shed is what has been overtaken.
"""

import re
from collections import OrderedDict
from dataclasses import dataclass, field
from typing import NamedTuple

from ingest.port.connection import Connection

BURST_S = 1.0
"""A vendor may send so many seconds' worth at once."""
MOST_WAITING = 10_000
"""Robots of one vendor with a message waiting; beyond, the message that waited longest is shed."""
MOST_SHARES = 1000
"""Shares kept for vendors and addresses; beyond, those that are whole are forgotten."""
MOST_WAITING_BYTES = 32 << 20
"""The same of what its waiting messages weigh."""
UUID = re.compile(rb'"uuid"\s*:\s*"([^"]{1,64})"', re.IGNORECASE)


class ArrivedMessage(NamedTuple):
    """One message as it came."""

    raw: bytes
    arrival_s: float
    connection: Connection


@dataclass(slots=True, eq=False)
class TokenBucket:
    """One vendor's allowance."""

    tokens: float
    filled_s: float
    waiting: OrderedDict[bytes, ArrivedMessage] = field(default_factory=OrderedDict)
    weight: int = 0
    """Bytes of what waits."""

    def first(self) -> ArrivedMessage:
        """Take out what has waited longest."""
        one = self.waiting.popitem(last=False)[1]
        self.weight -= len(one.raw)
        return one

    def fill(self, now_s: float, rate: float) -> None:
        self.tokens = min(self.tokens + max(now_s - self.filled_s, 0.0) * rate, rate * BURST_S)
        self.filled_s = now_s


class RateLimits:
    """Every vendor's allowance. `now_s` is of a clock that nobody sets."""

    def __init__(self, messages_a_second: float) -> None:
        self.rate = messages_a_second
        self._shares: dict[str, TokenBucket] = {}

    def admit(self, vendor: str, one: ArrivedMessage, now_s: float) -> tuple[bool, list[ArrivedMessage]]:
        """Whether a message may be taken at once; if not it waits, and what is shed for it is returned."""
        share = self._shares.get(vendor)
        if share is None:
            if len(self._shares) >= MOST_SHARES:
                self._forget_idle(now_s)
            share = self._shares[vendor] = TokenBucket(self.rate * BURST_S, now_s)
        share.fill(now_s, self.rate)
        if share.tokens >= 1 and not share.waiting:
            share.tokens -= 1
            return True, []
        return False, _wait(share, one)

    def due(self, now_s: float) -> list[ArrivedMessage]:
        """Messages whose turn has come, oldest first within a vendor; call it many times a second."""
        taken = []
        for share in self._shares.values():
            share.fill(now_s, self.rate)
            while share.waiting and share.tokens >= 1:
                share.tokens -= 1
                taken.append(share.first())
        self._forget_idle(now_s)
        return taken

    def _forget_idle(self, now_s: float) -> None:
        """A share that is whole again is as if it were new."""
        for share in self._shares.values():
            share.fill(now_s, self.rate)
        whole = self.rate * BURST_S
        self._shares = {name: one for name, one in self._shares.items() if one.waiting or one.tokens < whole}

    def __len__(self) -> int:
        return len(self._shares)

    @property
    def waiting(self) -> bool:
        return any(share.waiting for share in self._shares.values())


def uuid_in(raw: bytes) -> bytes | None:
    """The first UUID that a message tells, in lower case."""
    found = UUID.search(raw)
    return found.group(1).lower() if found else None


def _wait(share: TokenBucket, one: ArrivedMessage) -> list[ArrivedMessage]:
    """Let it wait in the place of the older message of its robot, or at the end; what is shed for it."""
    key = uuid_in(one.raw) or b"connection %d" % one.connection.id
    key += b" status" if b'"operationalState"' in one.raw else b""
    overtaken = share.waiting.get(key)
    share.waiting[key] = one
    share.weight += len(one.raw) - (len(overtaken.raw) if overtaken else 0)
    shed = [overtaken] if overtaken else []
    while len(share.waiting) > MOST_WAITING or share.weight > MOST_WAITING_BYTES:
        shed.append(share.first())
    return shed
