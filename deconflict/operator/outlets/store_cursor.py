"""An outlet's position in the store, and its measures."""

import asyncio
import logging
import time
from collections.abc import AsyncIterator, Callable, Iterable

from deconflict.operator.store.publisher import PublishedLine, PublishedPage, Publisher
from deconflict.operator.store.store import Store, StoreError
from deconflict_client.advisory import KindChoice
from deconflict_client.situations import chosen_kinds
from ingest.measures.outages import OutageLog

log = logging.getLogger(__name__)

STORE_RETRY_S = 1.0
REMOVAL_RETRY_S = 0.01


def is_being_cancelled() -> bool:
    """Whether the present task has been cancelled, even if another error hides it."""
    task = asyncio.current_task()
    return task is not None and task.cancelling() > 0


class StoreCursor:
    """One outlet's position, and the kinds that it receives.

    `delivered` moves the position on; a revision that is not delivered comes again.
    """

    def __init__(
        self,
        name: str,
        kinds: Iterable[KindChoice],
        store: Store,
        publisher: Publisher,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.name, self.kinds = name, chosen_kinds(kinds)
        self.seq = 0
        self._store, self._publisher = store, publisher
        self._outages = OutageLog(clock)
        self._publisher.measures.count("deconflict_outlet_deliveries_total", name, by=0)
        self._publisher.measures.count("deconflict_outlet_failures_total", name, by=0)

    async def begin(self) -> None:
        """Resume at the stored position. A new outlet begins with the next revision."""
        self.seq = first = self._publisher.last_seq
        while True:
            try:
                known = await asyncio.to_thread(self._store.position, self.name)
            except StoreError as error:
                await self._wait_for_store(error)
            else:
                self._move(first if known is None else known)
                return

    async def lines(self) -> AsyncIterator[PublishedLine]:
        """Every revision of its kinds after the position, without end. Retries if the store can't be read."""
        while True:
            try:
                page = await self._next_page()
            except StoreError as error:
                await self._wait_for_store(error)
                continue
            for line in page.lines:
                yield line
            self._move(page.last)

    async def _next_page(self) -> PublishedPage:
        """The next page. Waits for the next revision. Raises `StoreError`.

        The store keeps each advisory that this page or an earlier one leaves open, until its end is delivered.
        """
        last = self.seq
        try:
            while (removed_to := self._store.outlets.begin_page(self.name)) is None:
                await asyncio.sleep(REMOVAL_RETRY_S)
            page = await self._publisher.after(self.seq, self.kinds, removed_to)
            last = page.last
        finally:
            self._store.outlets.end_page(self.name, last)
        return page

    def delivered(self, line: PublishedLine) -> None:
        """The receiver has the revision."""
        self._publisher.measures.count("deconflict_outlet_deliveries_total", self.name)
        if self._outages.worked():
            log.info("%s accepts revisions again, %s wait", self.name, self._publisher.last_seq - line.seq)
        self._move(line.seq)

    def _move(self, seq: int) -> None:
        """Set the position. The publisher stores it: an outlet that catches up has no commit for each revision."""
        self.seq = seq
        self._measure()
        self._store.set_position(self.name, seq)

    def failed(self, reason: str) -> None:
        """The receiver did not accept the revision. One outage is logged once, and of many not all."""
        self._publisher.measures.count("deconflict_outlet_failures_total", self.name)
        self._measure()
        more = self._outages.failed()
        if more is not None:
            log.warning("%s accepts no revisions and is tried again: %s%s", self.name, reason, more)

    async def _wait_for_store(self, error: StoreError) -> None:
        log.warning("%s waits for the store: %s", self.name, error)
        await asyncio.sleep(STORE_RETRY_S)

    def _measure(self) -> None:
        waiting = self._publisher.measures.values["deconflict_outlet_waiting"]
        waiting[self.name,] = max(self._publisher.last_seq - self.seq, 0)
