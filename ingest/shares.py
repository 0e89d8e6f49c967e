"""Fair shares: no vendor takes more than its allowed rate of messages, whatever it sends.

A token bucket for each vendor (Turner 1986, "leaky bucket as a meter"). Beyond its rate a vendor's messages wait, one
for each robot, and the newest of a robot takes the place of an older one: what is shed is what has been overtaken.
"""

import re
from collections import OrderedDict
from dataclasses import dataclass, field
from typing import NamedTuple

from ingest.connection import Connection

BURST_S = 1.0
"""A vendor may send so many seconds' worth at once."""
MOST_WAITING = 10_000
"""Robots of one vendor with a message waiting; beyond, the message that waited longest is shed."""
UUID = re.compile(rb'"uuid"\s*:\s*"([^"]{1,64})"', re.IGNORECASE)


class Arrived(NamedTuple):
    """One message as it came."""

    raw: bytes
    arrival_s: float
    connection: Connection


@dataclass(slots=True, eq=False)
class Share:
    """One vendor's allowance."""

    tokens: float
    filled_s: float
    waiting: OrderedDict[bytes, Arrived] = field(default_factory=OrderedDict)

    def fill(self, now_s: float, rate: float) -> None:
        self.tokens = min(self.tokens + max(now_s - self.filled_s, 0.0) * rate, rate * BURST_S)
        self.filled_s = now_s


class Shares:
    """Every vendor's allowance. `now_s` is of a clock that nobody sets."""

    def __init__(self, messages_a_second: float) -> None:
        self._rate = messages_a_second
        self._shares: dict[str, Share] = {}

    def admit(self, vendor: str, one: Arrived, now_s: float) -> tuple[bool, Arrived | None]:
        """Whether a message may be taken at once; if not it waits, and the message that is shed for it is returned."""
        share = self._shares.get(vendor)
        if share is None:
            share = self._shares[vendor] = Share(self._rate * BURST_S, now_s)
        share.fill(now_s, self._rate)
        if share.tokens >= 1 and not share.waiting:
            share.tokens -= 1
            return True, None
        return False, _wait(share, one)

    def due(self, now_s: float) -> list[Arrived]:
        """Messages whose turn has come, oldest first within a vendor; call it many times a second."""
        taken, idle = [], []
        for vendor, share in self._shares.items():
            share.fill(now_s, self._rate)
            while share.waiting and share.tokens >= 1:
                share.tokens -= 1
                taken.append(share.waiting.popitem(last=False)[1])
            if not share.waiting and share.tokens >= self._rate * BURST_S:
                idle.append(vendor)
        for vendor in idle:
            del self._shares[vendor]
        return taken

    @property
    def waiting(self) -> bool:
        return any(share.waiting for share in self._shares.values())


def _wait(share: Share, one: Arrived) -> Arrived | None:
    """Let it wait in the place of the older message of its robot, or at the end; the message shed for it."""
    found = UUID.search(one.raw)
    key = found.group(1).lower() if found else b"connection %d" % one.connection.id
    key += b" status" if b'"operationalState"' in one.raw else b""
    overtaken = share.waiting.get(key)
    share.waiting[key] = one
    if overtaken is None and len(share.waiting) > MOST_WAITING:
        return share.waiting.popitem(last=False)[1]
    return overtaken
