"""Publishing: store first, then wake whoever follows the stream. A follower is only its position in the store."""

import asyncio
from collections import deque
from collections.abc import Sequence
from itertools import islice
from typing import NamedTuple

from deconflict.advisory import Acknowledgement, AnyAdvisory
from deconflict.store import Store
from ingest.measures import Measures

TAIL_LENGTH = 1024
STEP = 100


class Line(NamedTuple):
    """One revision as the stream sends it."""

    seq: int
    text: str


class Publisher:
    """Appends to the store off the event loop and keeps the newest lines, so that followers share one reading."""

    def __init__(self, store: Store, measures: Measures) -> None:
        self._store, self.measures = store, measures
        self._tail: deque[Line] = deque(maxlen=TAIL_LENGTH)
        self._appending = asyncio.Lock()
        self._news = asyncio.Event()
        self.last_seq = store.last_seq()
        """The newest number known to followers."""

    async def publish(self, advisories: Sequence[AnyAdvisory]) -> list[AnyAdvisory]:
        """Store revisions and make them known; returns them with their numbers. Raises `StoreError`.

        What could not be stored is not made known. It may be sent again: what is stored already is not doubled.
        """
        async with self._appending:
            try:
                stored = await asyncio.to_thread(self._store.append, advisories)
            except Exception:
                self.measures.count("deconflict_store_failures_total")
                raise
            self._announce([one for one in stored if one.seq > self.last_seq])
        return stored

    async def acknowledge(self, advisory_id: str, answer: Acknowledgement) -> AnyAdvisory | None:
        """Store an answer and make it known; the newest revision with it, or None where there is no such advisory."""
        async with self._appending:
            answered = await asyncio.to_thread(self._store.acknowledge, advisory_id, answer)
            if answered:
                self._announce([answered])
        return answered

    async def after(self, seq: int) -> list[Line]:
        """Up to `STEP` lines with numbers above `seq`, ascending; waits for the first. Raises `StoreError`."""
        while True:
            while self.last_seq <= seq:
                await self._news.wait()
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
