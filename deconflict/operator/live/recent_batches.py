"""The newest batches, kept for whoever watches the floor: the engine never waits for a watcher, nor one for another."""

import asyncio
from collections import deque
from contextlib import suppress
from struct import Struct

from ingest.batch import Batch

KEPT = 16
"""Batches; a watcher that is further behind is given the whole floor."""
PATIENCE_S = 1.0
"""How long a watcher waits for a tick before it is told that there is none."""
HEAD = Struct(">Q?")
"""The number of a batch, and whether it is the whole floor."""


class Recent:
    """Batches by number. Numbers rise, over restarts too: they are the microseconds of the ticks."""

    def __init__(self) -> None:
        self.number = 0
        """Of the newest batch."""
        self._kept: deque[tuple[int, int, bytes]] = deque(maxlen=KEPT)
        """The number of the batch before, its own, and it."""
        self._news = asyncio.Event()

    def add(self, now_s: float, batch: bytes) -> None:
        before, self.number = self.number, max(self.number + 1, round(now_s * 1e6))
        self._kept.append((before, self.number, batch))
        self._news.set()
        self._news = asyncio.Event()

    async def after(self, number: int) -> bytes | None:
        """The parcel with the batch that follows `number`, empty where there was no tick for `PATIENCE_S`.

        None where that batch is not kept, and for 0: the watcher needs the whole floor.
        """
        if number == self.number:
            with suppress(TimeoutError):
                async with asyncio.timeout(PATIENCE_S):
                    await self._news.wait()
            if number == self.number:
                return parcel(number, b"", whole=False)
        for before, own, batch in self._kept:
            if number and before == number:
                return parcel(own, batch, whole=False)
        return None


def parcel(number: int, batch: bytes, *, whole: bool) -> bytes:
    return HEAD.pack(number, whole) + batch


def opened(data: bytes) -> tuple[int, bool, Batch | None]:
    """The number, whether it is the whole floor, and the batch; None where there was no tick."""
    number, whole = HEAD.unpack_from(data)
    body = data[HEAD.size :]
    return number, whole, Batch.from_bytes(body) if body else None
