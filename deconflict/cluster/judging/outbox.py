"""Revisions on their way to the durable stream. The engine does not wait until they are written."""

import asyncio
from collections.abc import Callable, Iterable

from deconflict.advisory import AnyAdvisory
from deconflict.cluster.judging.stream_writer import StreamWriter
from deconflict.cluster.nats.stream_records import StreamRecord
from deconflict.cluster.tiles.tiles import FloorPosition

MOST_WAITING = 20_000
"""Most revisions, and passes that decided them, that wait for a server that accepts none: some 40 MB."""
HomedRevision = tuple[FloorPosition | None, AnyAdvisory]


class UnwrittenError(Exception):
    """The server has accepted nothing for long."""

    def __init__(self) -> None:
        super().__init__(f"{MOST_WAITING} revisions wait for a NATS server that accepts none; the engine restarts")


class Outbox:
    """Writes revisions in order, one after the other, and waits as long as each takes."""

    def __init__(self, writer: StreamWriter) -> None:
        self._writer = writer
        self._waiting: asyncio.Queue[tuple[list[HomedRevision], Callable[[], None]]] = asyncio.Queue()
        self._overruled: list[StreamRecord] = []
        self._waiting_count = 0
        """Revisions and passes that wait, as `MOST_WAITING` counts them."""

    def add_pass(self, revisions: Iterable[HomedRevision], then: Callable[[], None] = lambda: None) -> None:
        """Queue the revisions of one pass; calls `then` once all are written. Raises `UnwrittenError`."""
        queued = list(revisions)
        self._waiting_count += 1 + len(queued)
        if self._waiting_count > MOST_WAITING:
            raise UnwrittenError
        self._waiting.put_nowait((queued, then))

    def take_overruled(self) -> list[StreamRecord]:
        """The records that another engine wrote in place of queued revisions. Returns each once."""
        overruled, self._overruled = self._overruled, []
        return overruled

    async def run(self) -> None:
        """Write revisions until cancelled."""
        while True:
            revisions, then = await self._waiting.get()
            for home, advisory in revisions:
                if overruling := await self._writer.write(home, advisory):
                    self._overruled.append(overruling)
            self._waiting_count -= 1 + len(revisions)
            then()
