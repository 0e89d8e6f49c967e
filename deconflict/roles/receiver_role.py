"""The receiver: vendors' sockets in, batches out at each tick, everything recorded in the order it happened."""

import asyncio
import json
import logging
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from operator import attrgetter
from pathlib import Path
from random import Random

from deconflict.operator.live.recent_batches import Recent, parcel
from deconflict.runtime.rpc import PortTakenError, listening, socket_path
from deconflict.settings.fleet_factory import fleet_of, load_fast_path
from deconflict.settings.hot_reload import InForce
from deconflict.settings.site import Site
from ingest.clocks import SteadyClock
from ingest.fleet import fleet_report
from ingest.fleet.introductions import Introduction
from ingest.fleet.owners.vendor_registry import VendorRegistry
from ingest.fleet.recovery import recover
from ingest.frames.frame_registry import FrameRegistry
from ingest.measures.measures import Measures
from ingest.port.connection import Connection
from ingest.port.dialer import Dialer
from ingest.port.rate_limits import ArrivedMessage
from ingest.port.receiver import Receiver
from ingest.recording.log_reader import segments
from ingest.recording.recorder import Recorder, quantise
from ingest.security.tokens import SecretError
from ingest.security.vendor_credentials import VendorCredentials

logger = logging.getLogger(__name__)

DISK_S = 0.05
"""How long a batch waits for its messages to be recorded. Where the disk still owes earlier ones it does not wait."""
DOCUMENTS_AT_ONCE = 20
INTRODUCER = "another ingest"
"""As the peer of what robots have said of themselves elsewhere."""
RELOAD_CHECK_S = 0.2


FAST_PATH_AFTER = 1000
"""Messages after which the fast path is loaded, in a thread of its own: a receiver of few messages saves its memory."""


class ReceiverRole:
    """Holds the robots' port, the fleet's state and the recording. The engine paces it by asking for batches."""

    def __init__(self, site: Site, runtime: Path, log: Path, wall: Callable[[], float] = time.time) -> None:
        """`wall` is the host's clock."""
        self._clock = SteadyClock(wall, time.monotonic)
        self.site, self._runtime = site, runtime
        self.measures = Measures()
        self.measures.begin(
            "deconflict_ticks_total", "deconflict_recorded_bytes_total", "deconflict_recorded_lines_dropped_total"
        )
        self.fleet = fleet_of(site, self.measures)
        found = recover(self.fleet, segments(log) if log.is_dir() else [], self._now_s())
        if found.messages:
            logger.info("the floor is as it was: %s messages read back from the recording", found.messages)
        self.recorder = Recorder(site.recorder, log, self.measures, self._now_s)
        self.receiver = Receiver(
            site.receiver,
            VendorCredentials(site.vendors),
            self._deliver,
            self._refuse,
            self._closed,
            overtaken=self._overtaken,
            measures=self.measures,
            clock=self._now_s,
            first_id=found.connection + 1,
            shares_port=bool(site.cluster and site.cluster.share_port),
        )
        self.ready = asyncio.Event()
        """Set once its ports are open."""
        self._tick_s = 0.0
        self._fast_path_asked = False
        self._recent = Recent()
        self._dialers: dict[tuple[str, str], asyncio.Task[None]] = {}
        """By address and vendor."""

    async def run(self, stop: asyncio.Event) -> None:
        """Serve until `stop` is set."""
        calls = {
            "batch": self._batch,
            "robots": self._robots,
            "quarantine": self._quarantine,
            "measures": self._measures,
            "unidentified": self._unidentified,
            "introductions": self._introductions,
            "introduce": self._introduce,
            "follow": self._follow,
        }
        await self._open_port()
        self._dial()
        renewing = asyncio.create_task(self._renew())
        try:
            async with listening(socket_path(self._runtime, "receiver"), calls):
                self.ready.set()
                await stop.wait()
        finally:
            ending = [renewing, *self._dialers.values()]
            for task in ending:
                task.cancel()
            await asyncio.gather(*ending, return_exceptions=True)
            await self.receiver.close()
            self.recorder.close()

    async def _open_port(self) -> None:
        settings = self.site.receiver
        try:
            await self.receiver.start()
        except OSError as error:
            raise PortTakenError("receiver", settings.host, settings.port) from error

    def _deliver(self, raw: bytes, arrival_s: float, connection: Connection) -> None:
        rule = self.fleet.receive(raw, arrival_s, connection)
        self.recorder.received(raw, arrival_s, connection, rule)

    def _overtaken(self, one: ArrivedMessage, uuid: str) -> None:
        self.fleet.count_overtaken(uuid, one.arrival_s, one.connection)
        self.recorder.overtaken(*one)

    def _refuse(self, rule: str, reason: str, arrival_s: float, connection: Connection) -> None:
        self.fleet.reject(rule, reason, b"", arrival_s, connection)
        self.recorder.received(b"", arrival_s, connection, rule)

    def _closed(self, connection: Connection) -> None:
        self.fleet.connection_closed(connection)
        self.recorder.closed(connection, self._now_s())

    async def _renew(self) -> None:
        """Take up changed settings as soon as they are in force."""
        in_force = InForce(self._runtime, self.site)
        while True:
            if site := in_force.changed():
                self._take_up(site)
            await asyncio.sleep(RELOAD_CHECK_S)

    def _take_up(self, site: Site) -> None:
        try:
            self.receiver.use_credentials(VendorCredentials(site.vendors))
        except SecretError as error:
            logger.error("vendors' credentials stay as they were: %s", error)
        self.receiver.use_limits(site.receiver)
        self.recorder.reconfigure(site.recorder)
        before, self.site = self.site, site
        if (before.datums, before.vendors, before.reading) != (site.datums, site.vendors, site.reading):
            self.fleet.reconfigure(VendorRegistry(site.vendors), FrameRegistry(site.datums, site.vendors), site.reading)
        self._dial()

    def _dial(self) -> None:
        """Dial the addresses of the site file, and no longer those that were taken out of it."""
        wanted = {(url, vendor.name) for vendor in self.site.vendors for url in vendor.dial}
        for gone in self._dialers.keys() - wanted:
            self._dialers.pop(gone).cancel()
        for new in sorted(wanted - self._dialers.keys()):
            self._dialers[new] = asyncio.create_task(self._dialer(*new).run())

    def _dialer(self, url: str, vendor: str) -> Dialer:
        return Dialer(self.receiver, url, vendor, time.monotonic, Random())

    async def _batch(self, payload: bytes) -> bytes:
        """The next tick's batch. The first call of an engine asks for everything, each tells its effort and the
        answers that it still waits for.

        What the engine is told is recorded before, so that it survives the death of this process, but only where the
        disk is prompt.
        """
        words = payload.split()
        everything = words[:1] == [b"everything"]
        effort, pending = map(int, words[1:]) if words[1:] else (0, 0)
        early_s = self._tick_s + self.site.engine.tick_s - self._now_s()
        if early_s > 0:  # even a sleep of nothing lasts until the loop has gone round
            await asyncio.sleep(early_s)
        now_s = quantise(max(self._now_s(), self._tick_s))
        self._tick_s = now_s
        if everything:
            self.recorder.engine_started(now_s)
        was_behind = self.recorder.behind
        self.recorder.tick(now_s, effort, pending)
        self.measures.count("deconflict_ticks_total")
        self._ask_for_fast_path()
        batch = self.fleet.next_batch(now_s, everything).to_bytes()
        self._recent.add(now_s, batch)
        if not was_behind and self.recorder.behind:
            await asyncio.to_thread(self.recorder.sync, DISK_S)
        return batch

    def _ask_for_fast_path(self) -> None:
        messages = sum(self.measures.values["deconflict_messages_total"].values())
        if not self._fast_path_asked and messages >= FAST_PATH_AFTER:
            self._fast_path_asked = True
            load = partial(self._load_fast_path, asyncio.get_running_loop())
            threading.Thread(target=load, name="fast path", daemon=True).start()

    def _load_fast_path(self, loop: asyncio.AbstractEventLoop) -> None:
        fast_path = load_fast_path()
        with suppress(RuntimeError):  # the role has ended meanwhile, and its loop with it
            if fast_path:
                loop.call_soon_threadsafe(self.fleet.use, fast_path)

    async def _follow(self, payload: bytes) -> bytes:
        """The batch after the one with the given number, as the engine was given it, for who watches the floor."""
        told = await self._recent.after(int(payload))
        return told or parcel(self._recent.number, self.fleet.snapshot(self._now_s()).to_bytes(), whole=True)

    async def _robots(self, _: bytes) -> bytes:
        """All the documents, a few at a time: those of ten thousand robots take seconds, and messages can't wait."""
        told, now_s = [], self._now_s()
        for number, robot in enumerate(sorted(self.fleet.robots.values(), key=attrgetter("uuid"))):
            told.append(json.dumps(fleet_report.robot_document(self.fleet, robot, now_s)))
            if number % DOCUMENTS_AT_ONCE == 0:
                await asyncio.sleep(0)
        return f"[{','.join(told)}]".encode()

    async def _quarantine(self, _: bytes) -> bytes:
        return json.dumps(self.fleet.quarantine.documents()).encode()

    async def _unidentified(self, _: bytes) -> bytes:
        return json.dumps(self.fleet.unidentified()).encode()

    async def _introductions(self, payload: bytes) -> bytes:
        """What robots have said of themselves after a time of arrival."""
        return json.dumps([one.document() for one in self.fleet.introductions(float(payload))]).encode()

    async def _introduce(self, payload: bytes) -> bytes:
        """What robots that are here have said of themselves elsewhere, taken in and recorded as if it came here."""
        for one in map(Introduction.of_document, json.loads(payload)):
            if self.fleet.lacks(one):
                connection, now_s = self.receiver.new_connection(INTRODUCER, "/", one.vendor), self._now_s()
                self.recorder.received(one.raw, now_s, connection, self.fleet.introduce(one, now_s, connection))
                self._closed(connection)
        return b""

    async def _measures(self, _: bytes) -> bytes:
        fleet_report.measure(self.fleet, self._now_s())
        self.measures.level("deconflict_host_clock_off_seconds", {(): self._clock.off_s})
        return json.dumps([self.measures.as_document()]).encode()

    def _now_s(self) -> float:
        return quantise(self._clock())
