"""The feed's process: takes batches from the receiver of this machine, as an engine would, and sends them by tile.

Each broker of robots is heard by one ingest of the cluster at a time. Each ingest says in its heartbeats which brokers
it offers to hear, and computes by itself which of them are its own. It grants these to its receiver until the lease of
its heartbeats ends, so that the receiver stops by itself.
"""

import asyncio
import json
import logging
import time
from collections.abc import Callable, Collection, Iterable, Mapping
from contextlib import suppress
from hashlib import sha256
from math import inf
from pathlib import Path
from uuid import uuid4

from deconflict.cluster.identity_exchange import IdentityExchange
from deconflict.cluster.nats.bus import Bus
from deconflict.cluster.nats.nats_tasks import BEAT_EVERY_S, beat_repeatedly, call_last, open_bus, run_until
from deconflict.cluster.nats.shared_state import FEED, LEASE_S, SharedState
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

GRANT_TIMEOUT_S = 1.0


def hearer(broker: str, ingests: Iterable[str]) -> str | None:
    """The ingest that hears a broker; None without any. If one joins or leaves, only its own brokers move."""
    return max(ingests, key=lambda ingest: (sha256(f"{ingest} {broker}".encode()).digest(), ingest), default=None)


def brokers_of(ingest: str, offers: Mapping[str, Collection[str]]) -> list[str]:
    """The brokers that an ingest hears. `offers` has by live ingest the names of those that it can hear."""
    own = offers.get(ingest, ())
    return [broker for broker in own if hearer(broker, (each for each in offers if broker in offers[each])) == ingest]


class BrokerShare:
    """The brokers of one ingest. Times are of `clock`, which the receiver's process shares."""

    def __init__(
        self,
        ingest: str,
        state: SharedState,
        receiver: AsyncCaller,
        site: Site,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._ingest, self._state, self._receiver, self._clock = ingest, state, receiver, clock
        self._beaten_s = self._answered_s = -inf
        """When the last heartbeat that a server took, and the last call that the receiver answered, began."""
        self._joined_s = inf
        """When the first heartbeat that a server took began."""
        self._granted: list[str] = []
        self.use(site)

    def use(self, site: Site) -> None:
        """Share the brokers of these settings from now on."""
        self._configured = [source.name for source in site.mqtt_sources if source.host]

    def offer(self) -> list[str]:
        """The brokers that this ingest can hear: none if its receiver has not answered for the time of a lease."""
        return self._configured if self._clock() < self._answered_s + LEASE_S else []

    def note_heartbeat(self, began_s: float) -> None:
        """Take note that a server has taken a heartbeat with `offer`."""
        self._beaten_s, self._joined_s = began_s, min(self._joined_s, began_s)

    async def renew(self) -> None:
        """Tell the receiver which brokers to hear from now on. It hears none once this is not called for a while.

        While no NATS server answers, it goes on to hear those of before: this machine judges their robots by itself.
        """
        if not self._configured and not self._granted:
            return
        now_s, is_cut_off = self._clock(), self._state.is_cut_off()
        until_s = (self._answered_s if is_cut_off else min(self._beaten_s, self._answered_s)) + LEASE_S
        self._granted = (self._kept() if is_cut_off else self._own()) if now_s < until_s else []
        payload = json.dumps([self._granted, until_s if self._granted else 0.0]).encode()
        with suppress(LinkDownError):
            await self._receiver.call("grant_brokers", payload, GRANT_TIMEOUT_S)
            self._answered_s = now_s

    def _kept(self) -> list[str]:
        """Those that it hears now."""
        return [broker for broker in self._granted if broker in self._configured]

    def _own(self) -> list[str]:
        """Its brokers by the heartbeats; those of before until all members have had the time to send one.

        So ingests that start together take no brokers from each other.
        """
        is_new = self._clock() < self._joined_s + LEASE_S
        if is_new or not self._state.knows_members():
            return self._kept()
        offers = {member: document.get("brokers", ()) for member, document in self._state.members().items()}
        return brokers_of(self._ingest, offers)


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
