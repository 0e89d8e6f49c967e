"""Revisions on their way to the durable stream. The engine does not wait until they are written."""

import asyncio
import time
from collections.abc import Callable, Iterable
from typing import NamedTuple

from deconflict.cluster.judging.stream_writer import StreamWriter
from deconflict.cluster.nats.stream_records import StreamRecord
from deconflict_client.situations import AnyRevision
from ingest.batch import FloorPoint

MOST_WAITING = 20_000
"""If more revisions and passes that decided them wait, some 40 MB, the engine makes no further pass."""
STUCK_S = 5.0
"""If too much waits and none of it was written for this long, the engine ends."""
HomedRevision = tuple[FloorPoint | None, AnyRevision]


class WaitingPass(NamedTuple):
    queued_s: float
    """When it was queued, monotonic time."""
    revisions: list[HomedRevision]
    then: Callable[[], None]
    """Called once all are written."""


class UnwrittenError(Exception):
    """The server has accepted nothing for long."""

    def __init__(self) -> None:
        super().__init__(
            f"{MOST_WAITING} revisions wait for a NATS server that has accepted none for {STUCK_S:g} s; "
            "the engine restarts"
        )


class Outbox:
    """Writes revisions in order, one after the other, and waits as long as each takes."""

    def __init__(self, writer: StreamWriter) -> None:
        self._writer = writer
        self._waiting: asyncio.Queue[WaitingPass] = asyncio.Queue()
        self._overruled: list[StreamRecord] = []
        self._waiting_count = 0
        """Revisions and passes that wait, as `MOST_WAITING` counts them."""
        self._queued_s: float | None = None
        """When the pass was queued that is being written, monotonic time; None if there is none."""
        self._writing_since_s: float | None = None
        """Since when its next revision is being written; None if there is none."""

    def has_room(self) -> bool:
        """Whether another pass may be added. Raises `UnwrittenError` if nothing is written any more."""
        if self._waiting_count <= MOST_WAITING:
            return True
        since_s = self._writing_since_s
        if since_s is not None and time.monotonic() - since_s > STUCK_S:
            raise UnwrittenError
        return False

    def add_pass(self, revisions: Iterable[HomedRevision], then: Callable[[], None] = lambda: None) -> None:
        """Queue the revisions of one pass; calls `then` once all are written."""
        waiting = WaitingPass(time.monotonic(), list(revisions), then)
        self._waiting_count += 1 + len(waiting.revisions)
        self._waiting.put_nowait(waiting)

    def delay_s(self, now_s: float) -> float:
        """The age of the oldest pass that is not written. `now_s` is monotonic time."""
        return 0.0 if self._queued_s is None else now_s - self._queued_s

    def take_overruled(self) -> list[StreamRecord]:
        """The records that another engine wrote in place of queued revisions. Returns each once."""
        overruled, self._overruled = self._overruled, []
        return overruled

    async def run(self) -> None:
        """Write revisions until cancelled."""
        while True:
            self._queued_s, revisions, then = await self._waiting.get()
            for home, advisory in revisions:
                self._writing_since_s = time.monotonic()
                if overruling := await self._writer.write(home, advisory):
                    self._overruled.append(overruling)
                self._writing_since_s = None
                self._waiting_count -= 1
            self._waiting_count -= 1
            self._queued_s = None
            then()
