"""Revisions on their way to the durable stream: who decides goes on deciding while they are told."""

import asyncio
from collections.abc import Callable, Iterable

from deconflict.advisory import AnyAdvisory
from deconflict.cluster.judging.stream_writer import Teller
from deconflict.cluster.nats.stream_records import Line
from deconflict.cluster.tiles.tiles import Place

MOST_WAITING = 20_000
"""Revisions, and steps that they were decided in, that wait for a server that takes none: some 40 MB."""
Revision = tuple[Place | None, AnyAdvisory]


class UntoldError(Exception):
    """The server has taken nothing for long."""

    def __init__(self) -> None:
        super().__init__(f"{MOST_WAITING} revisions wait for a NATS server that takes none; the engine begins anew")


class Outbox:
    """Tells what is put in, one after the other, however long it takes."""

    def __init__(self, teller: Teller) -> None:
        self._teller = teller
        self._waiting: asyncio.Queue[tuple[list[Revision], Callable[[], None]]] = asyncio.Queue()
        self._overruled: list[Line] = []
        self._much = 0
        """How much waits, as `MOST_WAITING` counts it."""

    def put(self, revisions: Iterable[Revision], then: Callable[[], None] = lambda: None) -> None:
        """Have revisions told, each with its home, and `then` done. Raises `UntoldError` where too much waits."""
        step = list(revisions)
        self._much += 1 + len(step)
        if self._much > MOST_WAITING:
            raise UntoldError
        self._waiting.put_nowait((step, then))

    def overruled(self) -> list[Line]:
        """What stands in place of revisions that were put in; each is told of once."""
        stands, self._overruled = self._overruled, []
        return stands

    async def run(self) -> None:
        """Until cancelled."""
        while True:
            revisions, then = await self._waiting.get()
            for home, advisory in revisions:
                if stands := await self._teller.tell(home, advisory):
                    self._overruled.append(stands)
            self._much -= 1 + len(revisions)
            then()
