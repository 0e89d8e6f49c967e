"""A machine that no NATS server is connected to: its engine judges the robots of its own ingest, for its own face.

The engine takes the batches of this machine's receiver, as an operator face does. It publishes only on robots that it
hears so, and owns the tiles in which they may be. What it publishes waits for the stream as always, and goes to the
operator face of this machine at once, in the parcels that the engine of a single machine sends.
"""

import asyncio
import logging
import time
from collections import deque
from collections.abc import Callable, Iterable
from contextlib import suppress
from pathlib import Path
from typing import Any

from pydantic_core import to_json

from deconflict.cluster.nats.nats_connection import NatsConnection
from deconflict.cluster.tiles.tile_channels import ChannelSorter
from deconflict.cluster.tiles.tiles import Tile
from deconflict.operator.live.recent_batches import unpacked_batch
from deconflict.runtime.parcels import STORED, cut_into_parcels, packed_parcel
from deconflict.runtime.rpc import AsyncCaller, LinkDownError
from deconflict_client.advisory import AdvisoryState, ConflictAdvisory

log = logging.getLogger(__name__)

LOOK_EVERY_S, RETRY_S = 0.1, 0.2
MOST_CLEARED, MOST_PASSES = 5_000, 600
"""Most cleared advisories, and times of passes, that wait for an operator face that does not answer."""


class OwnIngest:
    """What this machine's ingest hears while no server is connected."""

    def __init__(self, connection: NatsConnection, runtime: Path, sorter: Callable[[], ChannelSorter]) -> None:
        self._connection, self._receiver = connection, AsyncCaller(runtime, "receiver")
        self._new_sorter = sorter
        self.robots: set[str] | None = None
        """The robots that were heard; None while a server is connected."""
        self.tiles: frozenset[Tile] = frozenset()
        """Where they are or may be in conflict."""

    async def run(self, receive: Callable[[bytes], None]) -> None:
        """Hand the batches of the receiver to `receive` while no server is connected, without end."""
        while True:
            if self._connection.is_cut_off():
                await self._hear(receive)
            await asyncio.sleep(LOOK_EVERY_S)

    async def _hear(self, receive: Callable[[bytes], None]) -> None:
        log.warning("no NATS server is connected: this machine judges the robots of its own ingest")
        number, sorter, robots = 0, self._new_sorter(), set[str]()
        self.robots = robots
        while self._connection.is_cut_off():
            try:
                number, _, batch = unpacked_batch(await self._receiver.call("follow", b"%d" % number))
            except LinkDownError:
                number = 0
                await asyncio.sleep(RETRY_S)
                continue
            if batch:
                sorter.sort(batch)
                robots.update(batch.robots)
                self.tiles = frozenset(sorter.roots())
                receive(batch.to_bytes())
        self.robots, self.tiles = None, frozenset()
        log.warning("a NATS server is connected again: this machine judges its tiles")


class OwnFace:
    """The operator face of this machine, which takes decisions at once while no server is connected."""

    def __init__(
        self,
        connection: NatsConnection,
        runtime: Path,
        own_ingest: OwnIngest,
        measures: Callable[[], list[dict[str, Any]]],
    ) -> None:
        """`measures` are the engine's, as of its last report."""
        self._connection, self._operator = connection, AsyncCaller(runtime, "operator")
        self._own_ingest, self._measures = own_ingest, measures
        self._passes_s: deque[float] = deque(maxlen=MOST_PASSES)
        """Times of the passes since the last parcel."""
        self._cleared: deque[ConflictAdvisory] = deque(maxlen=MOST_CLEARED)
        self._open: dict[str, ConflictAdvisory] = {}
        """By id, as of the last pass."""
        self._taken: dict[str, int] = {}
        """By id, the revision that the face has taken of each open advisory."""

    def note_pass(
        self, now_s: float, revisions: Iterable[ConflictAdvisory], conflicts: Iterable[ConflictAdvisory]
    ) -> None:
        """Take note of what a pass decided while no server is connected, and of all that is open."""
        heard = self._own_ingest.robots or ()
        self._passes_s.append(now_s)
        self._cleared += [each for each in revisions if each.state is AdvisoryState.CLEARED]
        self._open = {each.id: each for each in conflicts if all(robot in heard for robot in each.robots)}

    async def run(self) -> None:
        """Have the face stand alone while no server is connected, and follow the stream otherwise; without end."""
        follows_stream = False
        while True:
            with suppress(LinkDownError):
                if not self._connection.is_cut_off():
                    self._forget()
                    follows_stream = follows_stream or await self._operator.call("follow_stream") == STORED
                elif self._passes_s:
                    follows_stream = False
                    if await self._operator.call("stand_alone") == STORED:
                        await self._deliver()
            await asyncio.sleep(RETRY_S)

    def _forget(self) -> None:
        for noted in (self._passes_s, self._cleared, self._open, self._taken):
            noted.clear()

    async def _deliver(self) -> None:
        """Send what changed since the last parcel that was taken. Raises `LinkDownError`."""
        cleared, passes_s, queued_s = list(self._cleared), list(self._passes_s), time.monotonic()
        changed = [each for each in self._open.values() if self._taken.get(each.id) != each.revision]
        parcels = cut_into_parcels(map(to_json, [*cleared, *changed]))
        for number, lines in enumerate(parcels or [[]], 1):
            is_last = number >= len(parcels)
            head = {"queued_s": queued_s, **({"passes_s": passes_s, "measures": self._measures()} if is_last else {})}
            if await self._operator.call("publish", packed_parcel(head, lines)) != STORED:
                return
        while self._passes_s and self._passes_s[0] <= passes_s[-1]:
            self._passes_s.popleft()
        while self._cleared and self._cleared[0] in cleared:
            self._cleared.popleft()
        self._taken |= {each.id: each.revision for each in changed}
        self._taken = {advisory_id: number for advisory_id, number in self._taken.items() if advisory_id in self._open}
