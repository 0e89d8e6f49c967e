"""The losses of one engine's share of the floors, and their way to the stream. The engine does not wait for that.

The owner of the tile in which a robot began to lose time reports the loss. Every engine that sees the robot finds the
same loss, and so exactly one of them owns it. One that first sees the robot when it already loses time takes it to
begin there, which is outside its tiles: it sees robots long before they are in them.
"""

import asyncio
import logging
from collections import deque
from collections.abc import Callable, Iterable, Sequence

from deconflict.advisories.loss_warnings import LossWarnings
from deconflict.cluster.ingest_feed import RETRY_S
from deconflict.cluster.nats.loss_stream import LossStream
from deconflict.cluster.nats.subscriptions import BUS_ERRORS
from deconflict.cluster.tiles.tiles import Area
from deconflict.engine.engine_metrics import count_losses
from deconflict.foresight.losses.loss_places import LossPlaces, PlacedLoss
from deconflict.operator.ledger.loss_ledger import LedgerEntry
from deconflict.settings.site import Site
from deconflict_client.situations import AnyRevision, advisories_of
from ingest.batch import FloorPoint
from ingest.measures.measures import Measures


class ShardLosses:
    """Gives the losses of its tiles their places, and what all engines had published when they began."""

    def __init__(self, site: Site, last_advised_wait_s: Callable[[str], float]) -> None:
        """`site` has the resources and zones."""
        self._places = LossPlaces.of(site)
        self._warnings = LossWarnings((), last_advised_wait_s)
        self.measures = Measures()

    def renew(self, site: Site) -> None:
        """Use a changed site file."""
        self._places = LossPlaces.of(site)

    def note(self, now_s: float, revisions: Iterable[AnyRevision]) -> None:
        """Take in the published revisions of all engines."""
        self._warnings.note(now_s, advisories_of(list(revisions)))

    def own(self, losses: Iterable[PlacedLoss], area: Area) -> list[PlacedLoss]:
        """The losses that began in the tiles of `area`, of all that its engine found."""
        own = [
            PlacedLoss(loss, datum, self._places.place_at(datum, loss.x_m, loss.y_m), self._warnings.notice_of(loss))
            for loss, datum, _, _ in losses
            if FloorPoint(datum, loss.x_m, loss.y_m) in area
        ]
        count_losses(self.measures, own)
        return own


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
