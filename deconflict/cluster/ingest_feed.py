"""The feed's process: takes batches from the receiver of this machine, as an engine would, and sends them by tile."""

import asyncio
import json
import logging
import time
from contextlib import suppress
from pathlib import Path
from uuid import uuid4

from deconflict.cluster.broker_share import BrokerShare
from deconflict.cluster.identity_exchange import IdentityExchange
from deconflict.cluster.nats.bus import Bus
from deconflict.cluster.nats.nats_tasks import BEAT_EVERY_S, beat_repeatedly, call_last, open_bus, run_until
from deconflict.cluster.nats.shared_state import FEED
from deconflict.cluster.nats.subscriptions import BUS_ERRORS
from deconflict.cluster.tiles.tile_channels import CANARIES, ChannelSorter, parcels_of, reach_m
from deconflict.engine.canary.canary_parcel import WITH_CANARY, packed, unpacked
from deconflict.operator.live.history import BusyError, History, batch_at
from deconflict.operator.live.recent_batches import unpacked_batch
from deconflict.runtime.rpc import AsyncCaller, LinkDownError
from deconflict.settings.cluster_settings import Cluster
from deconflict.settings.hot_reload import CurrentSite
from deconflict.settings.site import Site
from ingest.batch import Batch

log = logging.getLogger(__name__)

RETRY_S = 0.2
WHOLE = b"0"
"""The batch number that requests the whole floor from the receiver."""

LISTED = ("quarantine", "measures", "unidentified", "senders", "brokers")
"""Questions whose answer is a list, so that those of several ingests are one list."""
QUESTIONS = {"robots": b"", "off_floor": b"", **dict.fromkeys(LISTED, b""), "follow": WHOLE}
"""The questions that an operator face may ask of the receiver, and the payload of each call."""
RECORDED, PAST = "recorded", "past"
"""Questions to the recording: its span, and the floor at a time, which follows."""


class IngestFeed:
    """One ingest of the cluster. The stream keeps each parcel for a while, so the feed waits for no engine."""

    def __init__(self, site: Site, settings: Cluster, runtime: Path, log_folder: Path) -> None:
        self._history = History(site, log_folder)
        self._bus, self._receiver = Bus(settings, site.store.keep_days), AsyncCaller(runtime, "receiver")
        self._settings, self._conflict = settings, site.conflict
        self._current_site = CurrentSite(runtime, site)
        self._sorter = ChannelSorter.of(settings, site.conflict)
        self._name = f"{FEED}{uuid4().hex[:12]}"
        self._receives = False
        """Whether the receiver has answered the last call."""
        self._brokers = BrokerShare(self._name, self._bus.state, self._receiver, site)

    async def run(self, stop: asyncio.Event) -> None:
        """Feed until `stop` is set."""
        if not await open_bus(self._bus, stop):
            return
        await self._bus.requests.serve_robots(self._all_parcels)
        await self._bus.requests.serve_questions(self._name, self._answer)
        try:
            exchange = IdentityExchange(self._bus, self._receiver)
            repeated = [beat_repeatedly(self._bus, each) for each in (self._beat, self._brokers.renew)]
            await run_until(stop, *repeated, self._feed(), exchange.run())
            await call_last(self._bus, self._bus.roster.leave)
        finally:
            self._history.close()
            await self._bus.close()

    async def _beat(self) -> None:
        began_s, roots = time.monotonic(), sorted(map(str, self._sorter.roots()))
        document = {"roots": roots, "brokers": self._brokers.offer(), "receives": self._receives}
        await self._bus.beat(self._name, document)
        self._brokers.note_heartbeat(began_s)

    async def _feed(self) -> None:
        request = b"everything"
        while True:
            try:
                reply, canary = unpacked(await self._receiver.call("batch", b"%b %b" % (request, WITH_CANARY)))
                batch = Batch.from_bytes(reply)
            except LinkDownError:
                request, self._receives = b"everything", False
                await asyncio.sleep(RETRY_S)
                continue
            request, self._receives = b"changes", True
            if site := self._current_site.changed():
                self._conflict, self._history.site = site.conflict, site
                self._brokers.use(site)
                self._sorter.renew(site.conflict, reach_m(self._settings.fastest_mps, site.conflict))
            try:
                if canary:
                    canary = canary._replace(due_s=canary.due_s + time.time() - time.monotonic())
                    await self._bus.send_parcel(CANARIES, packed(self._name.encode(), canary))
                for channel, part in self._sorter.sort(batch).items():
                    for parcel in parcels_of(part):
                        await self._bus.send_parcel(channel, parcel)
            except BUS_ERRORS as error:
                request = b"everything"  # sends everything once the server is back
                log.warning("parcels are not sent: %s", error or type(error).__name__)
                await asyncio.sleep(BEAT_EVERY_S)

    async def _all_parcels(self, channels: set[str]) -> list[bytes]:
        """The parcels with all robots of some channels, for an engine that has just subscribed to them."""
        try:
            _, _, batch = unpacked_batch(await self._receiver.call("follow", WHOLE))
        except LinkDownError:
            return []
        parts = ChannelSorter.of(self._settings, self._conflict).sort(batch) if batch else {}
        return [parcel for channel, part in parts.items() if channel in channels for parcel in parcels_of(part)]

    async def _answer(self, question: str) -> bytes:
        """The answer to a question of the receiver or the recording; empty if there is none."""
        name, _, at_s = question.partition(" ")
        if name == RECORDED:
            return json.dumps(await asyncio.to_thread(self._history.recorded) or [None, None]).encode()
        if name == PAST:
            with suppress(BusyError):
                return await self._history.read(batch_at, float(at_s))
        if question not in QUESTIONS:
            return b""
        try:
            return await self._receiver.call(question, QUESTIONS[question])
        except LinkDownError:
            return b""
