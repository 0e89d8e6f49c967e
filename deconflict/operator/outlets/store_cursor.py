"""A place in the store that an outlet has come to, and what is measured of it."""

import asyncio
import logging
from collections.abc import AsyncIterator

from deconflict.operator.store.publisher import Line, Publisher
from deconflict.operator.store.store import Store, StoreError

log = logging.getLogger(__name__)

STORE_RETRY_S = 1.0


def ending() -> bool:
    """Whether the task that asks has been cancelled, whatever error has taken the place of that."""
    task = asyncio.current_task()
    return task is not None and task.cancelling() > 0


class Following:
    """One outlet's position. `taken` moves it on; what is not taken is seen again."""

    def __init__(self, name: str, store: Store, publisher: Publisher) -> None:
        self.name = name
        self.seq = 0
        self._store, self._publisher = store, publisher
        self._failing = False
        self._publisher.measures.count("deconflict_outlet_deliveries_total", name, by=0)
        self._publisher.measures.count("deconflict_outlet_failures_total", name, by=0)

    async def begin(self) -> None:
        """Go on where it stopped; an outlet that is new begins with the next revision."""
        self.seq = first = self._publisher.last_seq
        while True:
            try:
                known = await asyncio.to_thread(self._store.position, self.name)
            except StoreError as error:
                await self._wait_for_store(error)
            else:
                self._move(first if known is None else known)
                return

    async def lines(self) -> AsyncIterator[Line]:
        """Every revision after the position, for ever. A store that can't be read is tried again."""
        while True:
            try:
                found = await self._publisher.after(self.seq)
            except StoreError as error:
                await self._wait_for_store(error)
                continue
            for line in found:
                yield line

    def taken(self, line: Line) -> None:
        """The other end has it. Its place is stored soon: nobody waits for a slow disk."""
        self._publisher.measures.count("deconflict_outlet_deliveries_total", self.name)
        if self._failing:
            log.info("%s takes advisories again, %s wait", self.name, self._publisher.last_seq - line.seq)
            self._failing = False
        self._move(line.seq)

    def _move(self, seq: int) -> None:
        self.seq = seq
        self._measure()
        self._store.move(self.name, seq)
        self._publisher.begin_storing()

    def failed(self, why: str) -> None:
        """The other end did not take it. Told once, until it takes something again."""
        self._publisher.measures.count("deconflict_outlet_failures_total", self.name)
        self._measure()
        if not self._failing:
            log.warning("%s takes no advisories and is tried again: %s", self.name, why)
            self._failing = True

    async def _wait_for_store(self, error: StoreError) -> None:
        log.warning("%s waits for the store: %s", self.name, error)
        await asyncio.sleep(STORE_RETRY_S)

    def _measure(self) -> None:
        waiting = self._publisher.measures.values["deconflict_outlet_waiting"]
        waiting[self.name,] = max(self._publisher.last_seq - self.seq, 0)
