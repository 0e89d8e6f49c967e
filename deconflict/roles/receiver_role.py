"""The receiver role: takes in vendors' messages, gives a batch at each tick, and records all events in order."""

import asyncio
import json
import logging
import sys
import threading
import time
from collections.abc import Awaitable, Callable
from contextlib import suppress
from dataclasses import replace
from functools import partial
from math import inf
from operator import attrgetter
from pathlib import Path
from random import Random

from deconflict.engine.canary.canary_pair import CanaryPair
from deconflict.engine.canary.canary_parcel import WITH_CANARY, packed
from deconflict.operator.live.recent_batches import RecentBatches, is_empty, packed_batch
from deconflict.roles.engine_link.tick_times import TickTimes
from deconflict.roles.processes.ports import opened
from deconflict.roles.processes.robot_calls import RobotCalls
from deconflict.runtime.rpc import listening, socket_path
from deconflict.settings.fleet_factory import fleet_of, load_compiled_fast_path, load_fast_path
from deconflict.settings.hot_reload import CurrentSite
from deconflict.settings.site import Site
from ingest.clocks import SteadyClock
from ingest.fleet import fleet_report
from ingest.fleet.owners.owner_file import OwnerFile
from ingest.fleet.owners.vendor_registry import VendorRegistry
from ingest.fleet.recovery.kept_messages import KeptMessages
from ingest.fleet.recovery.log_recovery import recover, summary
from ingest.fleet.shared_identities import INTRODUCER, SharedIdentity
from ingest.frames.frame_registry import FrameRegistry
from ingest.languages.model import Rejection
from ingest.measures.lasting_loops import lasting, note_fault
from ingest.measures.measures import Measures
from ingest.port.brokers.heard_brokers import HeardBrokers
from ingest.port.connection import Connection
from ingest.port.connection_limits import count_failed_accepts
from ingest.port.dialer import Dialer
from ingest.port.rate_limits import ArrivedMessage
from ingest.port.receiver import Receiver
from ingest.recording.clock_notes import ClockFile
from ingest.recording.recorder import Recorder, quantise
from ingest.security.vendor_credentials import VendorCredentials

logger = logging.getLogger(__name__)

DISK_TIMEOUT_S = 0.05
"""A batch waits at most this long until its messages are recorded, and not at all if the disk is already behind."""
MEASURE_EVERY_S = 1.0
"""Levels of the fleet are measured at most so often, however many ask: of many robots that takes long."""
SENDERS_EVERY_S = 2.0
DOCUMENTS_AT_ONCE = 20
RELOAD_CHECK_S = 0.2
UNASKED_SHARE = 0.05
"""While no engine asks for batches, at most this share of the time goes into showing the floor to followers."""


FAST_PATH_AFTER = 1000
"""Messages after which the fast path is loaded: a receiver of few messages saves its memory."""


class ReceiverRole:
    """Owns the robots' port, the fleet's state and the recording. The engine sets the pace by its requests."""

    def __init__(self, site: Site, runtime: Path, log: Path, wall: Callable[[], float] = time.time) -> None:
        """`wall` is the host's clock."""
        self._clock = SteadyClock(wall, time.monotonic)
        self.site, self._runtime, self.measures = site, runtime, Measures()
        self.measures.begin(
            "deconflict_ticks_total", "deconflict_recorded_bytes_total", "deconflict_recorded_lines_dropped_total"
        )
        self.fleet = fleet_of(site, self.measures)
        self._fast_path_asked = False
        self._kept = KeptMessages(log.parent, self.fleet, self.measures)
        found = recover(self.fleet, [log], now_s := self._now_s(), self._note_recovered, self._kept.read(now_s))
        self._canary, self._measured_s = CanaryPair(self._now_s), -inf
        self._owners = OwnerFile(log.parent, self.fleet.owners, self.measures)
        if found.messages:
            logger.info("%s", summary(self.fleet, found))
        self.recorder = Recorder(site.recorder, log, self.measures, self._now_s, ClockFile(log.parent).known_time)
        self._robot_calls = RobotCalls(self.fleet, self.recorder, self._now_s)
        self.receiver = Receiver(
            site.receiver,
            VendorCredentials(site.vendors),
            self._deliver,
            self._refuse,
            self._closed,
            overtaken=self._overtaken,
            measures=self.measures,
            clock=self._now_s,
            owner_of=self.fleet.owners.owner_of_topic,
            first_id=found.connection + 1,
            shares_port=bool(site.cluster and site.cluster.share_port),
        )
        self.ready = asyncio.Event()
        """Set once its ports are open."""
        self._ticks = TickTimes(site.engine.tick_s, self._now_s)
        self._recent = RecentBatches()
        self._unasked_due_s = 0.0
        """When followers may next be shown the floor although no engine asks for it."""
        self._dialers: dict[tuple[str, str], asyncio.Task[None]] = {}
        """By address and vendor."""
        self._brokers = HeardBrokers(self.receiver, self.measures, shared=bool(site.cluster))
        self._senders: tuple[float, bytes] = -inf, b""

    async def run(self, stop: asyncio.Event) -> None:
        """Serve until `stop` is set."""
        calls = {
            "batch": self._batch,
            "robots": self._robots,
            "quarantine": self._quarantine,
            "measures": self._measures,
            "unidentified": self._unidentified,
            "shared_identities": self._shared_identities,
            "add_identities": self._add_identities,
            "follow": self._follow,
            "hear": self._brokers.hear,
            "grant_brokers": self._brokers.grant,
            "senders": self._what_to_mend,
            "brokers": self._broker_documents,
            **self._robot_calls.handlers(),
        }
        self._dial()
        self._hear_brokers()
        loops = [asyncio.create_task(lasting(part, loop, self.measures)) for part, loop in self._loops().items()]
        try:
            async with listening(socket_path(self._runtime, "receiver"), calls):
                await stop.wait()
        finally:
            tasks = [*loops, *self._dialers.values(), *self._brokers.tasks]
            for task in tasks:
                task.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)
            await self.receiver.close()
            self._owners.write()
            self._kept.write(self.recorder.files.leaving_before_s, self._now_s())
            self.recorder.close()

    def _loops(self) -> dict[str, Callable[[], Awaitable[None]]]:
        """What runs as long as the role, by what it does."""
        return {
            "using a changed site file": self._reload,
            "keeping whose robots are": self._owners.keep,
            "keeping identities": partial(self._kept.keep, lambda: self.recorder.files.leaving_before_s, self._now_s),
            "making canaries": self._canary.run,
            "opening the robots' port": self._open_port,
        }

    async def _open_port(self) -> None:
        count_failed_accepts(partial(self.measures.count, "deconflict_connections_refused_total", "no-files"))
        await opened("receiver", self.site.receiver, self.receiver.start, self.measures)
        self.ready.set()

    def _deliver(self, raw: bytes, arrival_s: float, connection: Connection) -> str | None:
        rule = self.fleet.receive(raw, arrival_s, connection)
        waits = rule is None and self.fleet.newest is not None and not self.fleet.newest.examined
        deviates = self.fleet.newest_deviates
        self.recorder.received(raw, arrival_s, connection, rule, waits=waits, deviates=deviates)
        if rule is None:
            self._ticks.note_message()
        return rule

    def _overtaken(self, message: ArrivedMessage, uuid: str) -> None:
        self.fleet.count_overtaken(uuid, message.arrival_s, message.connection)
        self.recorder.overtaken(*message)

    def _refuse(self, rule: str, reason: str, arrival_s: float, connection: Connection) -> None:
        self.fleet.reject(Rejection(rule, reason), b"", arrival_s, connection)
        self.recorder.received(b"", arrival_s, connection, rule)

    def _closed(self, connection: Connection) -> None:
        self.fleet.owners.connection_closed(connection)
        self.recorder.closed(connection, self._now_s())

    async def _reload(self) -> None:
        """Use changed settings as soon as the supervisor has written them."""
        current = CurrentSite(self._runtime, self.site)
        while True:
            if site := current.changed():
                before = self.site
                try:
                    self._apply(site)
                except Exception:
                    self.site = before  # so that the next attempt applies it
                    raise
            await asyncio.sleep(RELOAD_CHECK_S)

    def _apply(self, site: Site) -> None:
        self.receiver.use_vendors(site.vendors)
        self.receiver.use_limits(site.receiver)
        self.recorder.reconfigure(site.recorder)
        before, self.site = self.site, site
        self._ticks.shortest_s = site.engine.tick_s
        if (before.datums, before.vendors, before.reading) != (site.datums, site.vendors, site.reading):
            self.fleet.reconfigure(VendorRegistry(site.vendors), FrameRegistry(site.datums, site.vendors), site.reading)
        self._dial()
        self._hear_brokers(again=before.vendors != site.vendors)

    def _dial(self) -> None:
        """Dial new addresses of the site file, and end the dialers of removed ones."""
        addresses = {(url, vendor.name) for vendor in self.site.vendors for url in vendor.dial}
        for removed in self._dialers.keys() - addresses:
            self._dialers.pop(removed).cancel()
        for new in sorted(addresses - self._dialers.keys()):
            self._dialers[new] = asyncio.create_task(self._dialer(*new).run())

    def _hear_brokers(self, again: bool = False) -> None:
        vendors = self.fleet.owners.vendors
        self._brokers.use(self.site.mqtt_sources, (vendors.of_manufacturer, vendors.configured), again)

    def _dialer(self, url: str, vendor: str) -> Dialer:
        return Dialer(self.receiver, self.measures, url, vendor, time.monotonic, Random())

    async def _batch(self, payload: bytes) -> bytes:
        """The batch of the next tick.

        The payload is `everything` (the first call of an engine) or `changes`, then the engine's effort, the number of
        solver answers that it waits for, and what robots do as asked (JSON without blanks), and perhaps `canary` for an
        answer with the canary that is due. Unless the disk is slow, the messages of the batch are recorded before this
        returns, so that a replay has what the engine has seen even if this process is killed.
        """
        *arguments, last = payload.split() or [b""]
        with_canary = last == WITH_CANARY
        arguments += [] if with_canary else [last]
        everything = arguments[:1] == [b"everything"]
        effort, pending, followed = map(json.loads, arguments[1:]) if arguments[1:] else (0, 0, ())
        now_s = await self._ticks.next_s()
        if everything:
            self.recorder.engine_started(now_s)
        was_behind = self.recorder.writer.waiting
        self.recorder.tick(now_s, effort, pending, followed)
        self.measures.count("deconflict_ticks_total")
        self._ask_for_fast_path()
        batch = self.fleet.next_batch(now_s, everything).to_bytes()
        self._robot_calls.record_returned()
        self._recent.add(now_s, batch)
        if not was_behind and self.recorder.writer.waiting:
            await asyncio.to_thread(self.recorder.sync, DISK_TIMEOUT_S)
        return packed(batch, self._canary.take()) if with_canary else batch

    def _note_recovered(self, messages: int) -> None:
        """Load the fast path at once if numba is loaded, as in a role that is started again."""
        if messages == FAST_PATH_AFTER and "numba" in sys.modules and (fast_path := load_compiled_fast_path()):
            self._fast_path_asked = True
            self.fleet.use(fast_path)

    def _ask_for_fast_path(self) -> None:
        """Load the fast path in a thread of its own once it is worth it."""
        messages = sum(self.measures.values["deconflict_messages_total"].values())
        if not self._fast_path_asked and messages >= FAST_PATH_AFTER:
            self._fast_path_asked = True
            load = partial(self._load_fast_path, asyncio.get_running_loop())
            threading.Thread(target=load, name="fast path", daemon=True).start()

    def _load_fast_path(self, loop: asyncio.AbstractEventLoop) -> None:
        try:
            fast_path = load_fast_path()
        except Exception:  # noqa: BLE001 - it is logged
            note_fault("loading the fast path", self.measures)
            return
        with suppress(RuntimeError):  # the role and its loop have ended meanwhile
            if fast_path:
                loop.call_soon_threadsafe(self.fleet.use, fast_path)

    async def _follow(self, payload: bytes) -> bytes:
        """The batch after the one with the given number, as the engine received it, for those who follow the floor.

        Without an engine, the floor as it is, each second or less often: people see robots move before it is loaded.
        """
        batch = await self._recent.after(int(payload))
        if batch and not (is_empty(batch) and time.monotonic() >= self._unasked_due_s):
            return batch
        began_s = time.monotonic()
        snapshot = self.fleet.snapshot(self._now_s()).to_bytes()
        took_s = time.monotonic() - began_s
        self._unasked_due_s = began_s + took_s / UNASKED_SHARE
        return packed_batch(self._recent.number, snapshot, whole=True)

    async def _robots(self, uuid: bytes) -> bytes:
        """The documents of all robots, or of the one with this UUID, if it is here.

        Lets other tasks run after every few: ten thousand documents take seconds, and messages must not wait.
        """
        documents, now_s, known = [], self._now_s(), self.fleet.robots
        floors = fleet_report.robots_by_floor(self.fleet)
        wanted = filter(None, [known.get(uuid.decode())]) if uuid else known.values()
        for number, robot in enumerate(sorted(wanted, key=attrgetter("uuid"))):
            documents.append(json.dumps(fleet_report.robot_document(self.fleet, robot, now_s, floors)))
            if number % DOCUMENTS_AT_ONCE == 0:
                await asyncio.sleep(0)
        return f"[{','.join(documents)}]".encode()

    async def _quarantine(self, _: bytes) -> bytes:
        return json.dumps(self.fleet.quarantine.documents()).encode()

    async def _unidentified(self, _: bytes) -> bytes:
        return json.dumps(fleet_report.unidentified(self.fleet)).encode()

    async def _what_to_mend(self, _: bytes) -> bytes:
        """What each vendor should mend, found anew every few seconds: it takes a look at each robot."""
        found_s, answer = self._senders
        if (now_s := self._now_s()) >= found_s + SENDERS_EVERY_S:
            answer = json.dumps(fleet_report.senders(self.fleet, now_s)).encode()
            self._senders = now_s, answer
        return answer

    async def _broker_documents(self, _: bytes) -> bytes:
        return json.dumps(self._brokers.documents()).encode()

    async def _shared_identities(self, payload: bytes) -> bytes:
        """The identity reports that arrived after a time."""
        shared_identities = fleet_report.shared_identities(self.fleet, float(payload))
        return json.dumps([shared_identity.document() for shared_identity in shared_identities]).encode()

    async def _add_identities(self, payload: bytes) -> bytes:
        """Take in identity reports that came to other ingests, and record them as if they came here."""
        for shared_identity in map(SharedIdentity.of_document, json.loads(payload)):
            if fleet_report.lacks(self.fleet, shared_identity):
                connection = replace(
                    self.receiver.new_connection(INTRODUCER, "/", shared_identity.vendor),
                    language=shared_identity.language,
                    topic=shared_identity.topic,
                )
                now_s = self._now_s()
                rule = fleet_report.add_identity(self.fleet, shared_identity, now_s, connection)
                self.recorder.received(shared_identity.raw, now_s, connection, rule)
                self._closed(connection)
        return b""

    async def _measures(self, _: bytes) -> bytes:
        if (now_s := self._now_s()) >= self._measured_s + MEASURE_EVERY_S:
            self._measured_s = now_s
            fleet_report.measure(self.fleet, now_s)
        self.measures.level("deconflict_host_clock_off_seconds", {(): self._clock.off_s})
        self.measures.level("deconflict_recording_failing", {(): float(bool(self.recorder.failing))})
        packing_failing = self.recorder.files.packer.failing
        self.measures.level("deconflict_recording_packing_failing", {(): float(bool(packing_failing))})
        return json.dumps([self.measures.as_document()]).encode()

    def _now_s(self) -> float:
        return quantise(self._clock())
