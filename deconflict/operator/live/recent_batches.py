"""The newest batches, for those who follow the floor. Neither the engine nor a follower waits for a follower."""

import asyncio
from collections import deque
from contextlib import suppress
from struct import Struct

from ingest.batch import Batch

KEPT_S = 1.6
"""Batches are kept for this long; a follower that is further behind receives the whole floor."""
TICK_TIMEOUT_S = 1.0
"""A follower waits for a tick for at most this long; then it receives an empty batch."""
HEAD = Struct(">Q?")
"""The number of a batch, and whether it is the whole floor."""


class RecentBatches:
    """Batches by number. A number is the tick's time in microseconds, so numbers rise across restarts too."""

    def __init__(self) -> None:
        self.number = 0
        """Of the newest batch."""
        self._kept: deque[tuple[int, int, bytes]] = deque()
        """For each batch: the number of the batch before, its own number, and its bytes."""
        self._news = asyncio.Event()

    def add(self, now_s: float, batch: bytes) -> None:
        before, self.number = self.number, max(self.number + 1, round(now_s * 1e6))
        self._kept.append((before, self.number, batch))
        while self._kept[0][1] < self.number - KEPT_S * 1e6:
            self._kept.popleft()
        self._news.set()
        self._news = asyncio.Event()

    async def after(self, number: int) -> bytes | None:
        """The packed batch that follows `number`; an empty one if no tick comes within `TICK_TIMEOUT_S`.

        None if that batch is no longer kept, and for 0: then the follower needs the whole floor.
        """
        if number == self.number:
            with suppress(TimeoutError):
                async with asyncio.timeout(TICK_TIMEOUT_S):
                    await self._news.wait()
            if number == self.number:
                return packed_batch(number, b"", whole=False)
        for before, own, batch in self._kept:
            if number and before == number:
                return packed_batch(own, batch, whole=False)
        return None


def packed_batch(number: int, batch: bytes, *, whole: bool) -> bytes:
    return HEAD.pack(number, whole) + batch


def is_empty(data: bytes) -> bool:
    """Whether a packed batch is one that says that no tick came."""
    return len(data) == HEAD.size


def unpacked_batch(data: bytes) -> tuple[int, bool, Batch | None]:
    """The number, whether it is the whole floor, and the batch; None if no tick came."""
    number, whole = HEAD.unpack_from(data)
    body = data[HEAD.size :]
    return number, whole, Batch.from_bytes(body) if body else None
