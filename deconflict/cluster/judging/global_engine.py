"""The engine that watches over what is not of one place: hears every ingest whole, and tells what that comes to.

Each engine has a lookout, idle but at the one that the table names. Who takes over goes on with what the stream has
open, hears the last seconds again and is told every robot anew.
"""

import asyncio
import logging
import time
from collections.abc import Awaitable, Callable, Sequence
from contextlib import suppress
from threading import Lock
from typing import Any

from deconflict.advice.async_answers import Submit
from deconflict.advisories.finding_lifecycle import FindingAdvisory
from deconflict.advisory import ConflictAdvisory
from deconflict.cluster.judging.global_judge import Commons
from deconflict.cluster.judging.outbox import Outbox
from deconflict.cluster.judging.stream_writer import Teller
from deconflict.cluster.nats.bus import Bus
from deconflict.cluster.nats.stream_records import Line
from deconflict.cluster.nats.subscriptions import BUS_ERRORS
from deconflict.cluster.tiles.channels import EVERY
from deconflict.runtime.learned_state import UnreadableError, packed, unpacked
from deconflict.settings.site import Site
from ingest.batch import Batch

log = logging.getLogger(__name__)

LOOK_S = 0.25
COMMONS = "commons"
"""The name under which what was learned of queues is kept."""


class Lookout:
    """One engine's. Its commons are touched by one thread at a time."""

    def __init__(self, site: Site, bus: Bus, teller: Teller, submit: Submit) -> None:
        self.site, self._bus, self._teller, self._submit = site, bus, teller, submit
        self._commons: Commons | None = None
        self._leave: Callable[[], Awaitable[None]] | None = None
        self._asked = -1
        """The bus's count of renewals when ingests were asked for all their robots."""
        self._turn = Lock()
        self._parcels: list[bytes] = []
        self._lines: list[Line] = []
        self.outbox = Outbox(teller)
        self.measured: list[dict[str, Any]] = []
        """What it measured, as of its last look."""
        self.presence: dict[str, Any] | None = None
        """Who is still there, as of its last look; None where it watches over nothing."""

    def hear(self, lines: Sequence[Line]) -> None:
        """Lines of the stream, in order."""
        if self._commons:
            self._lines += lines

    def _take(self, parcel: bytes) -> None:
        if self._commons:
            self._parcels.append(parcel)

    async def run(self, watches: Callable[[], bool]) -> None:
        """Look as long as this is called for; `watches` says whether it is this engine's turn."""
        inbox = await self._bus.inbox(self._take)
        while True:
            with suppress(*BUS_ERRORS):
                await self._take_turns(inbox, turn=watches())
            if self._commons:
                await self._look(self._commons)
            await asyncio.sleep(LOOK_S)

    async def _take_turns(self, inbox: str, *, turn: bool) -> None:
        if not turn:
            self._rest()
            if self._leave:
                await self._leave()
                self._leave = None
            return
        if self._commons is None:
            kept = await self._bus.kept(COMMONS)
            stands = [one for one in self._teller.open() if not isinstance(one, ConflictAdvisory)]
            self._commons, self._asked = self._new(stands, kept), -1
        elif self._commons.site is not self.site:
            learned = self._commons.learned()
            self._commons, self._asked = Commons(self.site, self._commons.open(), self._submit, learned), -1
        if self._leave is None:
            self._leave = await self._bus.hear_rows(EVERY, self._take)
        if self._asked != (renewals := self._bus.renewals):
            await self._bus.want([EVERY], inbox)
            self._asked = renewals

    def _new(self, stands: Sequence[FindingAdvisory], kept: bytes | None) -> Commons:
        """Goes on with what stands, and with what those who watched before have learned."""
        try:
            return Commons(self.site, stands, self._submit, unpacked(kept) if kept else None)
        except UnreadableError as error:
            log.warning("what was learned of queues can't be read, and is learned anew: %s", error)
            return Commons(self.site, stands, self._submit)

    async def keep(self) -> None:
        """Have kept what was learned here, for who watches next."""
        if self._commons:
            await self._bus.keep(COMMONS, await asyncio.to_thread(self._learned, self._commons))

    def _learned(self, commons: Commons) -> bytes:
        with self._turn:
            learned = commons.learned()
        return packed(learned)

    def _rest(self) -> None:
        self._commons = self.presence = None
        self.outbox.overruled()
        for waiting in (self._parcels, self._lines, self.measured):
            waiting.clear()

    async def _look(self, commons: Commons) -> None:
        parcels, self._parcels = self._parcels, []
        lines, self._lines = self._lines, []
        told = await asyncio.to_thread(self._step, commons, parcels, lines, self.outbox.overruled())
        self.measured, self.presence = [commons.measures.as_document()], commons.presence(time.time())
        self.outbox.put((None, one) for one in told)

    def _step(
        self, commons: Commons, parcels: Sequence[bytes], lines: Sequence[Line], overruled: Sequence[Line]
    ) -> list[FindingAdvisory]:
        with self._turn:
            for told, over in ((lines, False), (overruled, True)):
                for line in told:
                    if line.advisory and not isinstance(line.advisory, ConflictAdvisory):
                        commons.hear(line.advisory, overruled=over)
            commons.receive([Batch.from_bytes(one) for one in parcels])
            return commons.step(time.time())
