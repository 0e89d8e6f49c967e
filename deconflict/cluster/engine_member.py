"""An engine of a cluster: receives the parcels of its tiles, judges, and writes its advisories to the durable stream.

It owns its tiles until the owner table changes. If an engine dies, the others notice within `LEASE_S`. They divide its
tiles, receive the last seconds again, and resume with the advisories of the stream. If an engine was only stopped for a
while, the stream refuses its late revisions: it accepts a revision only after the one that it follows.
"""

import asyncio
import logging
import time
from collections.abc import Awaitable, Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path
from threading import Lock
from typing import Any
from uuid import uuid4

from deconflict.advice.advice_thread import AdviceThread
from deconflict.cluster.ingest_feed import RETRY_S
from deconflict.cluster.judging.global_engine import GlobalEngine, revisions_of
from deconflict.cluster.judging.heard_canaries import HeardCanaries
from deconflict.cluster.judging.loss_writer import LossWriter, ShardLosses
from deconflict.cluster.judging.outbox import Outbox
from deconflict.cluster.judging.pass_watch import PassWatch
from deconflict.cluster.judging.shard import Shard, ShardRevision, conflicts_only_site
from deconflict.cluster.judging.stream_writer import StreamWriter
from deconflict.cluster.kept_learning import kept_parts, log_set_aside
from deconflict.cluster.nats.bus import Bus
from deconflict.cluster.nats.nats_tasks import answered, beat_repeatedly, call_last, open_bus, run_until
from deconflict.cluster.nats.stream_records import StreamRecord
from deconflict.cluster.nats.subscriptions import BUS_ERRORS
from deconflict.cluster.own_ingest import OwnFace, OwnIngest
from deconflict.cluster.tiles.tile_channels import CANARIES, ChannelSorter, reach_m
from deconflict.cluster.tiles.tile_owners import OwnerTable, revised_table
from deconflict.cluster.tiles.tiles import Grid, Tile
from deconflict.engine.engine import Engine
from deconflict.engine.load_shedding import Effort, LoadShedder, adapt_effort
from deconflict.engine.message_latency import LEARNED_EVERY_S, arrivals_s, observe_latency
from deconflict.foresight.losses.loss_places import PlacedLoss
from deconflict.foresight.presence.presence import MOST_SHOWN
from deconflict.foresight.probability.advice_followers import waits_until_s
from deconflict.operator.ledger.loss_ledger import ledger_entries
from deconflict.runtime.learned_state import Part, packed
from deconflict.settings.cluster_settings import Cluster
from deconflict.settings.hot_reload import CurrentSite
from deconflict.settings.site import Site
from deconflict_client.advisory import ConflictAdvisory
from deconflict_client.situations import advisories_of
from ingest.batch import Batch, Floats
from ingest.measures.measures import Measures

log = logging.getLogger(__name__)

LISTEN_S, MOST_AT_ONCE = 0.05, 32
"""Interval of the checks for new channels, and the number of subscriptions that begin at once."""
LEARNED_NAME = "conflicts"
"""Name under which the bus keeps the learned state of conflicts."""
LEAST_EFFORT = Effort.COARSE
"""With less, its conflicts would be raised later than by the engines around, and these would find other homes."""
CATCH_UP_TIMEOUT_S = 30.0
"""A new member waits at most this long for the open advisories."""


class EngineMember:
    """One engine. Only one thread at a time uses its shard."""

    def __init__(self, site: Site, settings: Cluster, runtime: Path, ended_early: str = "") -> None:
        """With `ended_early`, how the engine before ended, this one starts without the learned state."""
        self._ended_early = ended_early
        self._site, self._settings, self._current_site = site, settings, CurrentSite(runtime, site)
        self._bus = Bus(settings, site.store.keep_days)
        self.name = f"engine-{uuid4().hex[:12]}"
        self.measures = Measures()
        self._adviser = AdviceThread()
        self._load = LoadShedder(site.engine.deadline_s, least=LEAST_EFFORT)
        self._shard = self._shard_of(self._engine())
        self._shard_lock = Lock()
        self._losses = ShardLosses(site, self._last_advised_wait_s)
        self._loss_writer = LossWriter(self._bus.losses, self.measures)
        self._parcels: list[bytes] = []
        self._canaries, self._watch = HeardCanaries(), PassWatch("the engine")
        self._records: list[StreamRecord] = []
        self._needed: set[str] = set()
        """The channels that the shard needs."""
        self._requested = -1
        """The bus's count of reconnects at the last request for all robots of the channels."""
        self._subscribed: dict[str, Callable[[], Awaitable[None]]] = {}
        """By channel, the function that ends the subscription."""
        self._own_ingest = OwnIngest(self._bus.connection, runtime, self._new_sorter)
        self._own_face = OwnFace(self._bus.connection, runtime, self._own_ingest, self._reported)
        self._writer = StreamWriter(self._bus.revisions, self.measures)
        self._global_engine = GlobalEngine(site, self._bus, self._writer, self._adviser.submit, ended_early)
        self._outbox = Outbox(self._writer)
        self._table = OwnerTable()
        self._document: dict[str, Any] = {"loads": {}}
        """What its heartbeats carry."""

    async def run(self, stop: asyncio.Event) -> None:
        """Judge until `stop` is set."""
        if not await open_bus(self._bus, stop):
            return
        with suppress(*BUS_ERRORS):
            await self._restore_learned()
        await answered(lambda: self._bus.follow_channel(CANARIES, self._canaries.add))
        waiting = await self._bus.revisions.follow(self._add_record)
        with suppress(TimeoutError):
            async with asyncio.timeout(CATCH_UP_TIMEOUT_S):
                while len(self._records) < waiting:
                    await asyncio.sleep(0.02)
        try:
            await run_until(
                stop,
                beat_repeatedly(self._bus, self._beat),
                self._outbox.run(),
                self._loss_writer.run(),
                self._global_engine.outbox.run(),
                self._writer.keep_complete(),
                self._judge(),
                self._listen(),
                self._own_ingest.run(self._add_parcel),
                self._own_face.run(),
                self._keep_learned(),
                self._global_engine.run(lambda: self._table.global_engine == self.name),
            )
            await call_last(self._bus, self._bus.roster.leave, self._keep_learned_now)
        finally:
            self._adviser.end()
            await self._bus.close()

    def _engine(self, learned: Mapping[str, Part] | None = None) -> Engine:
        return Engine(
            conflicts_only_site(self._site), submit=self._adviser.submit, learned=learned, conflicts_only=True
        )

    def _shard_of(self, engine: Engine) -> Shard:
        return Shard(engine, Grid(self._settings.tile_m), reach_m(self._settings.fastest_mps, engine.site.conflict))

    def _new_sorter(self) -> ChannelSorter:
        return ChannelSorter.of(self._settings, self._site.conflict)

    def _last_advised_wait_s(self, uuid: str) -> float:
        return self._shard.engine.foresight.last_advised_wait_s(uuid)

    async def _restore_learned(self) -> None:
        """Resume with the learned state of earlier engines."""
        if parts := kept_parts(LEARNED_NAME, await self._bus.state.kept(LEARNED_NAME), self._ended_early):
            engine = self._engine(parts)
            log_set_aside(LEARNED_NAME, engine.set_aside)
            self._shard = self._shard_of(engine)

    async def _keep_learned(self) -> None:
        while True:
            await asyncio.sleep(LEARNED_EVERY_S)
            with suppress(*BUS_ERRORS):
                await self._keep_learned_now()

    async def _keep_learned_now(self) -> None:
        """Keep the learned state of the busiest engine and of the global judge, for engines that start later."""
        members = self._bus.state.members()
        burdens = {name: sum(member["loads"].values()) for name, member in members.items() if "loads" in member}
        if max(burdens, key=lambda name: (burdens[name], name), default=self.name) == self.name:
            await self._bus.state.keep(LEARNED_NAME, await asyncio.to_thread(self._learned))
        await self._global_engine.keep_learned()

    def _learned(self) -> bytes:
        with self._shard_lock:
            learned = self._shard.engine.learned()
        return packed(learned)

    async def _beat(self) -> None:
        """Send a heartbeat, and write the owner table if a tile needs another owner."""
        for watch in (self._watch, self._global_engine.watch):
            watch.beat()
        state = self._bus.state
        await self._bus.beat(self.name, self._document | {"canary": self._canaries.oldest(state.ingests())})
        members = state.members()
        number, document = await state.table()
        table = OwnerTable.of_document(document) if document else OwnerTable()
        loads = {
            name: {Tile.named(tile): per_s for tile, per_s in member["loads"].items()}
            for name, member in members.items()
            if "loads" in member
        }
        roots = {Tile.named(root) for member in members.values() for root in member.get("roots", ())}
        revised = revised_table(table, loads, roots, self._settings.tile_m, self._settings.hot_per_s)
        if revised != table and state.knows_members() and await state.write_table(revised.document(), number):
            log.info("%s divides %s tiles among %s engines", self.name, len(revised.owners), len(loads))
            table = revised
        self._table = table

    async def _judge(self) -> None:
        counted_s, held = time.monotonic(), self._shard.area.tiles
        while True:
            if not self._outbox.has_room():
                await asyncio.sleep(RETRY_S)
                continue
            began_s = time.monotonic()
            parcels, self._parcels = self._parcels, []
            records, self._records = self._records, []
            overruled = self._outbox.take_overruled()
            for record in records:
                self._writer.note(record)
            self._global_engine.add_records(records)
            heard = self._own_ingest.robots
            owned = self._table.of(self.name) | self._own_ingest.tiles, heard
            with self._watch.passing():
                found = await asyncio.to_thread(self._run_pass, *owned, parcels, records, overruled)
            revisions, arrivals, losses = found
            self._loss_writer.add(ledger_entries(losses))
            if heard is not None:
                advisories = [revision.advisory for revision in revisions]
                self._own_face.note_pass(time.time(), advisories, self._shard.engine.conflicts())
            if revisions or heard is None:
                self._outbox.add_pass(revisions, partial(self._observe_latency, arrivals))
            self._needed = self._shard.channels()
            if began_s - counted_s >= 1.0:
                whole, held = held & self._shard.area.tiles, self._shard.area.tiles
                self._update_document(whole, began_s - counted_s)
                counted_s = began_s
            if site := self._current_site.changed():
                self._apply(site)
            await asyncio.sleep(max(self._site.engine.tick_s - (time.monotonic() - began_s), 0.0))

    def _update_document(self, tiles: Iterable[Tile], interval_s: float) -> None:
        """Set what the next heartbeats carry. `tiles` are those that this engine owned for the whole interval."""
        outboxes, now_s = (self._outbox, self._global_engine.outbox), time.monotonic()
        self.measures.level("deconflict_delivery_delay_seconds", {(): max(box.delay_s(now_s) for box in outboxes)})
        loads, self._shard.loads = self._shard.loads, type(self._shard.loads)()
        self._document = {
            "loads": {str(tile): loads[tile] / interval_s for tile in sorted(tiles)},
            "measures": [
                *self._shard.measures(),
                self._losses.measures.as_document(),
                self.measures.as_document(),
                *self._global_engine.measures,
            ],
            "presence": self._global_engine.presence,
            "distrusted": self._shard.distrusted()[:MOST_SHOWN],
        }

    def _reported(self) -> list[dict[str, Any]]:
        measures: list[dict[str, Any]] = self._document.get("measures", [])
        return measures

    def _apply(self, site: Site) -> None:
        """Use a changed site file, and request all robots again."""
        self._site = self._global_engine.site = site
        engine = self._shard.engine.renewed(conflicts_only_site(site))
        self._shard.renew(engine, reach_m(self._settings.fastest_mps, site.conflict))
        self._losses.renew(site)
        self._load = LoadShedder(site.engine.deadline_s, self._load.effort, LEAST_EFFORT)
        self._requested = -1
        log.info("%s uses the changed site file", self.name)

    def _run_pass(
        self,
        tiles: frozenset[Tile],
        heard: set[str] | None,
        parcels: Sequence[bytes],
        records: Sequence[StreamRecord],
        overruled: Sequence[StreamRecord],
    ) -> tuple[list[ShardRevision], dict[str, Floats], list[PlacedLoss]]:
        """The revisions of one pass, by vendor the arrival times of the messages that it reflects, and its losses."""
        with self._shard_lock:
            shard, began_s = self._shard, time.perf_counter()
            for group, is_overruled in ((records, False), (overruled, True)):
                for record in group:
                    if record.home and isinstance(record.advisory, ConflictAdvisory):
                        shard.adopt(ShardRevision(record.home, record.advisory), overruled=is_overruled)
            shard.hear_only(heard, time.time())
            if has_other_tiles := tiles != shard.area.tiles:
                shard.set_tiles(tiles)
            own = shard.receive([Batch.from_bytes(parcel) for parcel in parcels])
            now_s = time.time()
            due = shard.step(now_s, self._load.effort)
            took_s = time.perf_counter() - began_s
            if not has_other_tiles:
                adapt_effort(self._load, self.measures, took_s)
            self._adviser.count(self.measures)
            published = revisions_of(records)
            shard.engine.foresight.note_advice(now_s, waits_until_s(advisories_of(published)))
            self._losses.note(now_s, published)
            losses = self._losses.own(shard.engine.losses, shard.area)
            self._canaries.judge()
            shard.engine.measures.observe("deconflict_sweep_duration_seconds", [took_s])
            return due, arrivals_s(own, time.time()) if own else {}, losses

    async def _listen(self) -> None:
        """Subscribe to the channels that are needed, and request their robots; leave the other channels."""
        inbox = await self._bus.requests.open_inbox(self._add_parcel)
        while True:
            await asyncio.sleep(LISTEN_S)
            with suppress(*BUS_ERRORS):
                if self._requested != (renewals := self._bus.renewals):
                    await self._bus.requests.request_robots(self._subscribed, inbox)
                    self._requested = renewals
                for channel in self._subscribed.keys() - self._needed:
                    await self._subscribed.pop(channel)()
                new = sorted(self._needed - self._subscribed.keys())[:MOST_AT_ONCE]
                if new:
                    await self._subscribe_all(new, inbox)

    async def _subscribe_all(self, channels: Sequence[str], inbox: str) -> None:
        """Subscribe to channels. Raises the first error, after the others have succeeded or failed too."""
        results = await asyncio.gather(*map(self._subscribe, channels), return_exceptions=True)
        await self._bus.requests.request_robots([channel for channel in channels if channel in self._subscribed], inbox)
        for error in filter(None, results):
            raise error

    async def _subscribe(self, channel: str) -> None:
        self._subscribed[channel] = await self._bus.follow_channel(channel, self._add_parcel)

    def _add_parcel(self, parcel: bytes) -> None:
        self._parcels.append(parcel)

    def _add_record(self, record: StreamRecord) -> None:
        self._records.append(record)

    def _observe_latency(self, arrivals: Mapping[str, Floats]) -> None:
        observe_latency(self.measures, arrivals, time.time())
