"""An engine of a cluster: hears the parcels of its tiles, judges, and tells what is its own to the durable stream.

Its tiles are its own until the table says otherwise. One that dies is missed within `LEASE_S`; the others share out its
tiles, hear the last seconds again and go on with the advisories that the stream has. What one that only stood still
tells too late is refused by the stream, which takes a revision only after the one that it follows.
"""

import asyncio
import logging
import time
from collections.abc import Awaitable, Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from functools import partial
from pathlib import Path
from threading import Lock
from typing import Any
from uuid import uuid4

from deconflict.advisory import ConflictAdvisory
from deconflict.cluster.judging.global_engine import Lookout
from deconflict.cluster.judging.outbox import Outbox
from deconflict.cluster.judging.shard import Shard, Told, judging
from deconflict.cluster.judging.stream_writer import Teller
from deconflict.cluster.nats.bus import Bus
from deconflict.cluster.nats.stream_records import Line
from deconflict.cluster.nats.subscriptions import BUS_ERRORS
from deconflict.cluster.nats.tasks import beating, connected, until
from deconflict.cluster.tiles.channels import reach_m
from deconflict.cluster.tiles.tile_owners import Table, revised
from deconflict.cluster.tiles.tiles import Grid, Tile
from deconflict.engine.engine import Engine
from deconflict.engine.message_latency import LEARNED_EVERY_S, arrivals_s, observe_latency
from deconflict.runtime.learned_state import Part, UnreadableError, packed, unpacked
from deconflict.settings.cluster_settings import Cluster
from deconflict.settings.hot_reload import CurrentSite
from deconflict.settings.site import Site
from ingest.batch import Batch, Floats
from ingest.measures.measures import Measures

log = logging.getLogger(__name__)

LISTEN_S, MOST_AT_ONCE = 0.05, 32
"""How often new channels are looked for, and how many are begun at once."""
CONFLICTS = "conflicts"
"""The name under which what engines learned of conflicts is kept."""
CAUGHT_UP_S = 30.0
"""How long a new member waits until it knows what is open."""


class Member:
    """One engine. Its shard is touched by one thread at a time."""

    def __init__(self, site: Site, settings: Cluster, runtime: Path) -> None:
        self._site, self._settings, self._in_force = site, settings, CurrentSite(runtime, site)
        self._bus = Bus(settings, site.store.keep_days)
        self.name = f"engine-{uuid4().hex[:12]}"
        self.measures = Measures()
        self._adviser = ThreadPoolExecutor(1, "adviser")
        self._shard = self._shard_of(self._engine())
        self._turn = Lock()
        self._parcels: list[bytes] = []
        self._lines: list[Line] = []
        self._wanted: set[str] = set()
        """Channels."""
        self._asked = -1
        """The bus's count of renewals when ingests were asked for all robots of the channels that are heard."""
        self._listening: dict[str, Callable[[], Awaitable[None]]] = {}
        self._teller = Teller(self._bus)
        self._lookout = Lookout(site, self._bus, self._teller, self._adviser.submit)
        self._outbox = Outbox(self._teller)
        self._table = Table()
        self._says: dict[str, Any] = {"loads": {}}

    async def run(self, stop: asyncio.Event) -> None:
        """Judge until `stop` is set."""
        if not await connected(self._bus, stop):
            return
        with suppress(*BUS_ERRORS):
            await self._resume()
        waiting = await self._bus.hear_told(self._take_line)
        with suppress(TimeoutError):
            async with asyncio.timeout(CAUGHT_UP_S):
                while len(self._lines) < waiting:
                    await asyncio.sleep(0.02)
        try:
            watching = self._lookout.run(lambda: self._table.watch == self.name)
            telling = (self._outbox.run(), self._lookout.outbox.run(), self._teller.keep())
            chores = (*telling, self._judge(), self._listen(), self._keep(), watching)
            await until(stop, beating(self._bus, self._beat), *chores)
            with suppress(*BUS_ERRORS):
                await self._keep_now()
        finally:
            self._adviser.shutdown(cancel_futures=True)
            await self._bus.close()

    def _engine(self, learned: Mapping[str, Part] | None = None) -> Engine:
        return Engine(judging(self._site), submit=self._adviser.submit, learned=learned, conflicts_only=True)

    def _shard_of(self, engine: Engine) -> Shard:
        return Shard(engine, Grid(self._settings.tile_m), reach_m(self._settings.fastest_mps, engine.site.conflict))

    async def _resume(self) -> None:
        """Go on with what engines have learned before."""
        try:
            if kept := await self._bus.kept(CONFLICTS):
                self._shard = self._shard_of(self._engine(unpacked(kept)))
        except UnreadableError as error:
            log.warning("what engines learned can't be read, and is learned anew: %s", error)

    async def _keep(self) -> None:
        while True:
            await asyncio.sleep(LEARNED_EVERY_S)
            with suppress(*BUS_ERRORS):
                await self._keep_now()

    async def _keep_now(self) -> None:
        """Have kept what the engine with most to do has learned, and who watches: a new one goes on with it."""
        burdens = {name: sum(one["loads"].values()) for name, one in self._bus.members().items() if "loads" in one}
        if max(burdens, key=lambda name: (burdens[name], name), default=self.name) == self.name:
            await self._bus.keep(CONFLICTS, await asyncio.to_thread(self._learned))
        await self._lookout.keep()

    def _learned(self) -> bytes:
        with self._turn:
            learned = self._shard.engine.learned()
        return packed(learned)

    async def _beat(self) -> None:
        """Be heard of, and see to it that every tile has an owner."""
        await self._bus.beat(self.name, self._says)
        members = self._bus.members()
        number, document = await self._bus.table()
        table = Table.of_document(document) if document else Table()
        loads = {
            name: {Tile.named(tile): per_s for tile, per_s in one["loads"].items()}
            for name, one in members.items()
            if "loads" in one
        }
        roots = {Tile.named(root) for one in members.values() for root in one.get("roots", ())}
        wanted = revised(table, loads, roots, self._settings.tile_m, self._settings.hot_per_s)
        if wanted != table and self._bus.knows_members() and await self._bus.write_table(wanted.document(), number):
            log.info("%s shares out %s tiles among %s engines", self.name, len(wanted.owners), len(loads))
            table = wanted
        self._table = table

    async def _judge(self) -> None:
        counted_s, held = time.monotonic(), self._shard.area.tiles
        while True:
            began_s = time.monotonic()
            parcels, self._parcels = self._parcels, []
            lines, self._lines = self._lines, []
            overruled = self._outbox.overruled()
            for line in lines:
                self._teller.know(line)
            self._lookout.hear(lines)
            told, arrivals = await asyncio.to_thread(self._step, self._table.of(self.name), parcels, lines, overruled)
            self._outbox.put(told, partial(self._measure_waits, arrivals))
            self._wanted = self._shard.hears()
            if began_s - counted_s >= 1.0:
                loads, self._shard.loads = self._shard.loads, type(self._shard.loads)()
                whole, held = held & self._shard.area.tiles, self._shard.area.tiles
                self._says = {
                    "loads": {str(tile): loads[tile] / (began_s - counted_s) for tile in sorted(whole)},
                    "measures": [
                        *self._shard.measured(),
                        self.measures.as_document(),
                        *self._lookout.measured,
                    ],
                    "presence": self._lookout.presence,
                }
                counted_s = began_s
            if site := self._in_force.changed():
                self._take_up(site)
            await asyncio.sleep(max(self._site.engine.tick_s - (time.monotonic() - began_s), 0.0))

    def _take_up(self, site: Site) -> None:
        """Go on by a changed site file, yet to hear of every robot again."""
        self._site = self._lookout.site = site
        engine = self._shard.engine.renewed(judging(site))
        self._shard.renew(engine, reach_m(self._settings.fastest_mps, site.conflict))
        self._asked = -1
        log.info("%s goes on by the changed site file", self.name)

    def _step(
        self, tiles: frozenset[Tile], parcels: Sequence[bytes], lines: Sequence[Line], overruled: Sequence[Line]
    ) -> tuple[list[Told], dict[str, Floats]]:
        with self._turn:
            shard, began_s = self._shard, time.perf_counter()
            for told, over in ((lines, False), (overruled, True)):
                for line in told:
                    if line.home and isinstance(line.advisory, ConflictAdvisory):
                        shard.hear(Told(line.home, line.advisory), overruled=over)
            if tiles != shard.area.tiles:
                shard.own(tiles)
            own = shard.receive([Batch.from_bytes(one) for one in parcels])
            due = shard.step(time.time())
            shard.engine.measures.observe("deconflict_sweep_duration_seconds", [time.perf_counter() - began_s])
            return due, arrivals_s(own, time.time()) if own else {}

    async def _listen(self) -> None:
        """Hear the channels that are wanted, and what there was on new ones; leave the others."""
        inbox = await self._bus.inbox(self._take)
        while True:
            await asyncio.sleep(LISTEN_S)
            with suppress(*BUS_ERRORS):
                if self._asked != (renewals := self._bus.renewals):
                    await self._bus.want(self._listening, inbox)
                    self._asked = renewals
                for channel in self._listening.keys() - self._wanted:
                    await self._listening.pop(channel)()
                new = sorted(self._wanted - self._listening.keys())[:MOST_AT_ONCE]
                if new:
                    await self._begin(new, inbox)

    async def _begin(self, channels: Sequence[str], inbox: str) -> None:
        """Hear channels. Raises the first error, once every other of them is heard or has failed too."""
        begun = await asyncio.gather(*map(self._hear, channels), return_exceptions=True)
        await self._bus.want([one for one in channels if one in self._listening], inbox)
        for error in filter(None, begun):
            raise error

    async def _hear(self, channel: str) -> None:
        self._listening[channel] = await self._bus.hear_rows(channel, self._take)

    def _take(self, parcel: bytes) -> None:
        self._parcels.append(parcel)

    def _take_line(self, line: Line) -> None:
        self._lines.append(line)

    def _measure_waits(self, arrivals: Mapping[str, Floats]) -> None:
        observe_latency(self.measures, arrivals, time.time())
