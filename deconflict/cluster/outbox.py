"""Revisions on their way to the durable stream: who decides goes on deciding while they are told."""

import asyncio
from collections.abc import Callable, Iterable

from deconflict.advisory import AnyAdvisory
from deconflict.cluster.lines import Line
from deconflict.cluster.teller import Teller
from deconflict.cluster.tiles import Place

Revision = tuple[Place | None, AnyAdvisory]


class Outbox:
    """Tells what is put in, one after the other, however long it takes."""

    def __init__(self, teller: Teller) -> None:
        self._teller = teller
        self._waiting: asyncio.Queue[tuple[list[Revision], Callable[[], None]]] = asyncio.Queue()
        self._overruled: list[Line] = []

    def put(self, revisions: Iterable[Revision], then: Callable[[], None] = lambda: None) -> None:
        """Have revisions told, each with its home, and `then` done."""
        self._waiting.put_nowait((list(revisions), then))

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
            then()
