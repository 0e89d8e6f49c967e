"""The operator face's process: stores what the engine decides, and serves the API, the streams and the metrics."""

import asyncio
import logging
import socket
import sqlite3
import time
from collections.abc import Awaitable, Callable
from concurrent.futures import ThreadPoolExecutor
from datetime import UTC, datetime
from functools import partial
from math import inf
from pathlib import Path

from deconflict.operator.blackbox.keeper import Keeper
from deconflict.operator.http.api import create_app
from deconflict.operator.http.api_sources import Exposition
from deconflict.operator.ledger.optional_ledger import OptionalLedger
from deconflict.operator.outlets.outlets import Outlets
from deconflict.operator.public_face import PublicFace
from deconflict.operator.store.learned_file import LearnedFile
from deconflict.operator.store.optional.optional_store import OptionalStore
from deconflict.operator.store.publisher import PRUNED, STUCK_S, Publisher
from deconflict.operator.store.store import StoreError
from deconflict.roles.engine_link.live_situations import LiveSituations
from deconflict.roles.health.canary_health import CanaryHealth
from deconflict.roles.operator_calls import OperatorCalls
from deconflict.roles.operator_sources import EngineReport, OperatorSources
from deconflict.roles.processes.ports import listen_at, opened
from deconflict.runtime.rpc import listening, socket_path
from deconflict.runtime.until_either import until_either
from deconflict.settings.hot_reload import CurrentSite
from deconflict.settings.site import Site
from ingest.measures.lasting_loops import lasting
from ingest.measures.measures import Measures
from ingest.security.certificates import Certificates

log = logging.getLogger(__name__)

PRUNE_EVERY_S, PRUNE_AGAIN_S = 3600.0, 60.0
"""Time from one attempt to the next; the shorter one after a failure, such as of a locked file."""
MEASURE_SIZE_EVERY_S = 5.0
REFRESH_EVERY_S = 5.0
RELOAD_CHECK_S = 0.2
MOST_THREADS = 32
"""More than wait for a stuck disk at once, each for other work: there are threads left for what needs no disk."""
FILES_EVERY_S = 1.0
"""How often files that can't be used are tried again."""

LAST_WRITES_S = 2.0
"""How long the end of the role waits for what a slow disk is to take beside the advisories."""


class OperatorRole:
    """Owns the store, and asks the other roles for everything else that it serves."""

    def __init__(self, site: Site, runtime: Path, data: Path, exposition: Exposition) -> None:
        self._site, self._runtime = site, runtime
        self.ready = asyncio.Event()
        """Set once its port is open."""
        self.port = 0
        self._store, measures = OptionalStore(data, follows_stream=bool(site.cluster)), Measures()
        engine = EngineReport(CanaryHealth(self._store))
        self._ledger = OptionalLedger(data, site.losses, measures)
        self.sources = OperatorSources(site, runtime, data, engine, self._ledger)
        self._publisher = Publisher(self._store, measures)
        app = create_app(self._publisher, self._store, self.sources, exposition, site)
        self._face_measures = app.state.measures
        self._face = PublicFace(app, Certificates(site.operator.tls) if site.operator.tls else None)
        self._outlets = Outlets(self._store, self._publisher)
        self._keeper = Keeper(site, data, self._store, self._publisher.measures)
        learned_file = LearnedFile(data, self._publisher.measures)
        self._situations = LiveSituations(site, self._store, self._publisher)
        self._calls = OperatorCalls(
            runtime, self._store, self._publisher, self.sources, engine, learned_file, self._keeper, app.state.measures,
            self._ledger, self._situations,
        )  # fmt: skip
        if site.cluster:
            self._publisher.forward_answer = self._calls.forward_answer

    async def run(self, stop: asyncio.Event) -> None:
        """Serve until `stop` is set. Raises `HangingFaceError`."""
        self._publisher.loop = asyncio.get_running_loop()
        self._publisher.loop.set_default_executor(ThreadPoolExecutor(MOST_THREADS, "operator"))
        try:
            async with listening(socket_path(self._runtime, "operator"), self._calls.handlers()):
                await self._serve(stop)
        finally:
            await self._calls.settled(LAST_WRITES_S)
            await self._situations.settled()
            self.sources.history.close()
            await self._publisher.close()
            self._store.close()
            self._ledger.close()
        if self._calls.is_another_stream:
            aside = self._store.connections.set_aside(datetime.now(UTC))
            log.error("the stored advisories are kept as %s", aside.name)

    async def _serve(self, stop: asyncio.Event) -> None:
        serving, other_numbers = asyncio.create_task(self._serve_face()), self._calls.other_numbers
        waiting = asyncio.create_task(until_either(stop.wait(), other_numbers.wait()))
        self._outlets.renew(self._site.webhooks, self._site.mqtt)
        measures = self._publisher.measures
        tasks = [asyncio.create_task(lasting(part, loop, measures)) for part, loop in self._loops().items()]
        try:
            await asyncio.wait({serving, waiting}, return_when=asyncio.FIRST_COMPLETED)
        finally:
            waiting.cancel()
            for task in tasks:
                task.cancel()
            await asyncio.gather(*tasks, self._outlets.close(), return_exceptions=True)
            if other_numbers.is_set():
                self._publisher.end()
            self._face.end()
            if not self.port:
                serving.cancel()
            await asyncio.wait({serving})
            if not serving.cancelled():
                serving.result()

    async def _serve_face(self) -> None:
        """Serve people and programs once the port is open, until `PublicFace.end`."""
        listener = await opened("operator", self._site.operator, self._listener, self._publisher.measures)
        self.port = listener.getsockname()[1]
        serving = self._face.serve(listener)
        self.ready.set()
        await serving

    async def _listener(self) -> socket.socket:
        return listen_at("operator", self._site.operator)

    def _loops(self) -> dict[str, Callable[[], Awaitable[None]]]:
        """What runs as long as the role, by what it does."""
        return {
            "removing what is old": self._prune,
            "storing what waits, and reading secrets of outlets": self._refresh,
            "using a changed site file": self._reload,
            "writing black boxes": self._keeper.run,
            "watching what is refused": partial(
                self.sources.watch_refusals, (self._publisher.measures, self._face_measures)
            ),
            "using the file of advisories again": self._attach_store,
            "storing losses": self._store_losses,
            "watching the files of the data directory": self.sources.files.run,
            "watching the clock": self.sources.clock.run,
        }

    async def _attach_store(self) -> None:
        """Use the file of advisories as soon as it can be used, and memory if it was removed."""
        while True:
            try:
                attaching = asyncio.create_task(asyncio.to_thread(self._store.attach))
                while not (await asyncio.wait({attaching}, timeout=STUCK_S))[0]:
                    await self._publisher.leave_stuck()
                if await attaching:
                    await self._publisher.renew_numbers()
            except (StoreError, sqlite3.Error, OSError) as error:
                log.warning("the file of advisories is tried again: %s", error)
            await asyncio.sleep(FILES_EVERY_S)

    async def _store_losses(self) -> None:
        while True:
            await asyncio.to_thread(self._ledger.store)
            await asyncio.sleep(FILES_EVERY_S)

    async def _prune(self) -> None:
        """Remove old losses, and advisories that were cleared long ago, now and every hour, or soon after a failure.

        Also remove the oldest advisories if they are too many.
        """
        due_s = -inf
        while True:
            if (now_s := time.monotonic()) >= due_s:
                known = await asyncio.to_thread(self.sources.clock.file.known_time)
                before = datetime.fromtimestamp(known.before_s(self._site.store.keep_days), UTC)
                prune = partial(self._store.prune, before, known.latest_s)
                losses_done = await self._prune_losses(known.sure_s)
                is_done = await self._remove("age", f"cleared before {before}", prune) and losses_done
                due_s = now_s + (PRUNE_EVERY_S if is_done else PRUNE_AGAIN_S)
            most_bytes = self._site.store.advisories_bytes
            text = f"that changed longest ago, to keep within store.advisories_bytes = {most_bytes},"
            await self._remove("size", text, partial(self._store.prune_to, most_bytes))
            await asyncio.sleep(MEASURE_SIZE_EVERY_S)

    async def _prune_losses(self, now_s: float) -> bool:
        """Whether old losses could be removed."""
        try:
            await asyncio.to_thread(self._ledger.prune, now_s)
        except (sqlite3.Error, OSError) as error:
            log.warning("old losses can't be removed: %s", error)
            return False
        return True

    async def _remove(self, reason: str, text: str, prune: Callable[[], int]) -> bool:
        """Remove cleared advisories, and say whether they could be. `text` says which."""
        try:
            removed = await asyncio.to_thread(prune)
            used_bytes = await asyncio.to_thread(self._store.used_bytes)
        except StoreError as error:
            log.warning("old advisories can't be removed: %s", error)
            return False
        self._publisher.measures.count(PRUNED, reason, by=removed)
        self._publisher.measures.level("deconflict_store_bytes", {(): used_bytes})
        is_renewed = self._store.connections.renewal is not None
        self._publisher.measures.level("deconflict_store_renewed", {(): float(is_renewed)})
        if removed:
            log.info("%s advisories %s are removed", removed, text)
        return True

    async def _refresh(self) -> None:
        """Read changed secrets of outlets, and store their positions and what a disk that failed has not taken."""
        while True:
            await asyncio.sleep(REFRESH_EVERY_S)
            if self._store.has_pending:
                await self._publisher.store_pending()
            self._outlets.refresh()
            self.sources.certificates.document(self._site, time.time())  # it logs what ends soon

    async def _reload(self) -> None:
        """Use changed settings as soon as the supervisor has written them."""
        current = CurrentSite(self._runtime, self._site)
        while True:
            if site := current.changed():
                self._face.renew(site)
                await self._situations.renew(site)
                self._outlets.renew(site.webhooks, site.mqtt)
                self._ledger.renew(site.losses)
                self._site = self.sources.history.site = self._keeper.site = site
            await asyncio.sleep(RELOAD_CHECK_S)
