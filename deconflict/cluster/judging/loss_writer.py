"""Losses on their way to their stream. The engine does not wait until they are written."""

import asyncio
import logging
from collections import deque
from collections.abc import Sequence

from deconflict.cluster.ingest_feed import RETRY_S
from deconflict.cluster.nats.loss_stream import LossStream
from deconflict.cluster.nats.subscriptions import BUS_ERRORS
from deconflict.operator.ledger.loss_ledger import LedgerEntry
from ingest.measures.measures import Measures

MOST_WAITING = 2_000
"""Messages. If more wait, the oldest are dropped: advisories do not wait for losses."""
MOST_OF_A_MESSAGE = 100

log = logging.getLogger(__name__)


class LossWriter:
    """Writes losses in order, and tries again as long as it takes."""

    def __init__(self, stream: LossStream, measures: Measures) -> None:
        self._stream, self._measures = stream, measures
        self._waiting: deque[tuple[str, Sequence[LedgerEntry]]] = deque()
        self._has_news = asyncio.Event()

    def add(self, entries: Sequence[LedgerEntry]) -> None:
        for first in range(0, len(entries), MOST_OF_A_MESSAGE):
            self._waiting.append((self._stream.next_id(), entries[first : first + MOST_OF_A_MESSAGE]))
        while len(self._waiting) > MOST_WAITING:
            _, dropped = self._waiting.popleft()
            self._measures.count("deconflict_losses_dropped_total", by=len(dropped))
        if self._waiting:
            self._has_news.set()

    async def run(self) -> None:
        """Write until cancelled."""
        while True:
            await self._has_news.wait()
            self._has_news.clear()
            while self._waiting:
                message = self._waiting[0]
                try:
                    await self._stream.write(*message)
                except BUS_ERRORS as error:
                    log.warning("%d messages of losses are not written yet: %s", len(self._waiting), error or "timeout")
                    await asyncio.sleep(RETRY_S)
                    continue
                if self._waiting and self._waiting[0] is message:
                    self._waiting.popleft()
