"""The feed's process: takes batches from the receiver beside it, as an engine would, and tells them by tile."""

import asyncio
import logging
from pathlib import Path
from uuid import uuid4

from deconflict.cluster.identity_exchange import Introductions
from deconflict.cluster.nats.bus import FEED, Bus
from deconflict.cluster.nats.subscriptions import BUS_ERRORS
from deconflict.cluster.nats.tasks import BEAT_S, beating, connected, until
from deconflict.cluster.tiles.channels import Sorter, pieces, reach_m
from deconflict.cluster.tiles.tiles import Grid
from deconflict.operator.live.recent_batches import unpacked_batch
from deconflict.runtime.rpc import AsyncCaller, LinkDownError
from deconflict.settings.cluster_settings import Cluster
from deconflict.settings.hot_reload import CurrentSite
from deconflict.settings.site import Site
from ingest.batch import Batch

log = logging.getLogger(__name__)

RETRY_S = 0.2
WHOLE = b"0"
"""Asks the receiver for the whole floor, as a watcher does that has seen nothing."""

QUESTIONS = {"robots": b"", "quarantine": b"", "measures": b"", "unidentified": b"", "follow": WHOLE}
"""What an operator face may ask of the receiver, and how the receiver is asked."""


class Feed:
    """One ingest. Every parcel it sends is kept for a while, so it waits for nobody."""

    def __init__(self, site: Site, settings: Cluster, runtime: Path) -> None:
        self._bus, self._receiver = Bus(settings, site.store.keep_days), AsyncCaller(runtime, "receiver")
        self._settings, self._grid, self._conflict = settings, Grid(settings.tile_m), site.conflict
        self._in_force = CurrentSite(runtime, site)
        self._sorter = self._new_sorter()
        self._name = f"{FEED}{uuid4().hex[:12]}"

    def _new_sorter(self) -> Sorter:
        return Sorter(self._grid, self._conflict, reach_m(self._settings.fastest_mps, self._conflict))

    async def run(self, stop: asyncio.Event) -> None:
        """Feed until `stop` is set."""
        if not await connected(self._bus, stop):
            return
        await self._bus.wanted(self._whole)
        await self._bus.asked(self._name, self._answer)
        try:
            introductions = Introductions(self._bus, self._receiver)
            await until(stop, beating(self._bus, self._beat), self._feed(), introductions.run())
        finally:
            await self._bus.close()

    async def _beat(self) -> None:
        await self._bus.beat(self._name, {"roots": sorted(map(str, self._sorter.roots()))})

    async def _feed(self) -> None:
        ask = b"everything"
        while True:
            try:
                batch = Batch.from_bytes(await self._receiver.call("batch", ask))
            except LinkDownError:
                ask = b"everything"
                await asyncio.sleep(RETRY_S)
                continue
            ask = b""
            if site := self._in_force.changed():
                self._conflict = site.conflict
                self._sorter.renew(site.conflict, reach_m(self._settings.fastest_mps, site.conflict))
            try:
                for channel, part in self._sorter.sort(batch).items():
                    for piece in pieces(part):
                        await self._bus.send_rows(channel, piece)
            except BUS_ERRORS as error:
                ask = b"everything"  # what is lost now is told again once the server is back
                log.warning("parcels are not sent: %s", error or type(error).__name__)
                await asyncio.sleep(BEAT_S)

    async def _whole(self, channels: set[str]) -> list[bytes]:
        """All the robots of channels, for who has come to hear them."""
        try:
            _, _, batch = unpacked_batch(await self._receiver.call("follow", WHOLE))
        except LinkDownError:
            return []
        parts = self._new_sorter().sort(batch) if batch else {}
        return [piece for channel, part in parts.items() if channel in channels for piece in pieces(part)]

    async def _answer(self, question: str) -> bytes:
        """What the receiver answers, for an operator face of any machine."""
        if question not in QUESTIONS:
            return b""
        try:
            return await self._receiver.call(question, QUESTIONS[question])
        except LinkDownError:
            return b""
