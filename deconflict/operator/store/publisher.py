"""Publishing: store, then wake whoever follows the stream. A follower is only its position in the store.

A disk that fails or takes longer than `PATIENCE_S` is not waited for: people are told, and the disk is tried again.
"""

import asyncio
import logging
from collections import deque
from collections.abc import Awaitable, Callable, Sequence
from itertools import islice
from typing import NamedTuple

from deconflict.advisory import Acknowledgement, AnyAdvisory
from deconflict.operator.store.store import Store, StoreError
from ingest.measures.measures import Measures

log = logging.getLogger(__name__)

PATIENCE_S = 0.5
TAIL_LENGTH = 1024
STEP = 100


class Line(NamedTuple):
    """One revision as the stream sends it."""

    seq: int
    text: str


class StreamEndedError(Exception):
    """The numbers that were given hold no more."""


class Publisher:
    """Appends to the store off the event loop and keeps the newest lines, so that followers share one reading."""

    def __init__(self, store: Store, measures: Measures) -> None:
        self._store, self.measures = store, measures
        self.carry: Callable[[str, Acknowledgement], Awaitable[None]] | None = None
        """Takes answers to where they get their numbers, and returns once they are back; this store's own if None."""
        self._tail: deque[Line] = deque(maxlen=TAIL_LENGTH)
        self._appending = asyncio.Lock()
        self._news = asyncio.Event()
        self.last_seq = store.last_seq()
        """The newest number known to followers."""
        self.failing: str | None = None
        """Why what is told is not stored just now."""
        self._storing: asyncio.Task[None] | None = None
        self._ended = False
        measures.level("deconflict_store_unstored", {(): 0})

    async def publish(self, advisories: Sequence[AnyAdvisory]) -> list[AnyAdvisory]:
        """Store revisions and make them known; returns them with their numbers.

        They may be sent again: what is known already is not doubled. Raises `StoreError` where the store can't be read
        or too many wait for it; then they are not made known.
        """
        async with self._appending:
            try:
                taken = await asyncio.to_thread(self._store.take, advisories)
            except Exception:
                self.measures.count("deconflict_store_failures_total")
                raise
            await self.settle()
            self._announce([one for one in taken if one.seq > self.last_seq])
        return taken

    async def settle(self) -> None:
        """Have what waits for the disk stored, and wait for that a little while."""
        storing = self.begin_storing()
        await asyncio.wait({storing}, timeout=PATIENCE_S)
        if storing.done():
            storing.result()
        elif not self.failing:
            self._fail("the disk is slow")
        self.measures.level("deconflict_store_unstored", {(): self._store.unstored})

    def begin_storing(self) -> asyncio.Task[None]:
        """Have what waits for the disk stored, soon; the task that does it, one at a time."""
        if self._storing is None or self._storing.done():
            self._storing = asyncio.create_task(self._store_all())
        return self._storing

    async def close(self) -> None:
        """Have the rest stored, as far as the disk takes it; what it does not is told in the log."""
        await self.settle()
        if self._store.unstored:
            log.error("%d revisions were told and never stored", self._store.unstored)

    async def _store_all(self) -> None:
        while self._store.waits:
            try:
                await asyncio.to_thread(self._store.flush)
            except StoreError as error:
                self.measures.count("deconflict_store_failures_total")
                self._fail(str(error))
                return
        if self.failing:
            log.warning("advisories are stored again")
        self.failing = None

    def _fail(self, why: str) -> None:
        if not self.failing:
            log.error("advisories are told and not stored: %s; they are, as soon as the disk takes them", why)
        self.failing = why

    async def acknowledge(self, advisory_id: str, answer: Acknowledgement) -> AnyAdvisory | None:
        """Have an answer stored and made known; the newest revision with it, or None where there is no such."""
        if self.carry is None:
            return await self.answered(advisory_id, answer)
        if not await asyncio.to_thread(self._store.get, advisory_id):
            return None
        await self.carry(advisory_id, answer)
        return (await asyncio.to_thread(self._store.get, advisory_id))[-1]

    async def answered(self, advisory_id: str, answer: Acknowledgement, seq: int | None = None) -> AnyAdvisory | None:
        """Store an answer, under the number that it was given if any, and make it known."""
        async with self._appending:
            answered = await asyncio.to_thread(self._store.acknowledge, advisory_id, answer, seq)
            if answered and answered.seq > self.last_seq:
                self._announce([answered])
        return answered

    async def reached(self, seq: int) -> None:
        """Wait until the revision with a number is known. Raises `StreamEndedError`."""
        while self.last_seq < seq:
            if self._ended:
                raise StreamEndedError
            await self._news.wait()

    def end(self) -> None:
        """Nothing more is told under these numbers."""
        self._ended = True
        self._news.set()

    async def after(self, seq: int) -> list[Line]:
        """Up to `STEP` lines with numbers above `seq`, ascending; waits for the first. Raises `StoreError`."""
        while True:
            await self.reached(seq + 1)
            if self._tail and self._tail[0].seq <= seq + 1:
                skipped = seq + 1 - self._tail[0].seq
                return list(islice(self._tail, skipped, skipped + STEP))
            known = self.last_seq
            if found := await asyncio.to_thread(self._store.after, seq, STEP):
                return [_line(one) for one in found]
            seq = known  # all of it has been pruned

    def _announce(self, fresh: Sequence[AnyAdvisory]) -> None:
        if not fresh:
            return
        for line in sorted(_line(one) for one in fresh):
            if self._tail and line.seq != self._tail[-1].seq + 1:
                self._tail.clear()  # the tail has no holes; who is further back reads the store
            self._tail.append(line)
        self.last_seq = self._tail[-1].seq
        self.measures.count("deconflict_advisories_stored_total", by=len(fresh))
        self._news.set()
        self._news = asyncio.Event()


def _line(advisory: AnyAdvisory) -> Line:
    return Line(advisory.seq, advisory.model_dump_json())
