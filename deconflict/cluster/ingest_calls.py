"""All ingests of a cluster, as an operator face asks the one receiver of a single machine."""

import asyncio
import json
import time
from collections.abc import Awaitable, Callable
from contextlib import suppress
from dataclasses import replace
from typing import Any

import numpy as np

from deconflict.cluster.nats.bus import Bus
from deconflict.cluster.nats.subscriptions import BUS_ERRORS
from deconflict.cluster.tiles.channels import EVERY, Floors, late
from deconflict.operator.live.recent_batches import RecentBatches, packed_batch, unpacked_batch
from deconflict.runtime.rpc import Handler, LinkDownError
from ingest.batch import Batch

WITHIN_S, ROBOTS_WITHIN_S = 1.5, 8.0
"""How long answers are waited for; the documents of ten thousand robots take seconds."""
TICK_S = 0.2
IDLE_S = 10.0
"""Where nobody has looked at the floor for so long it is no longer heard."""


class Ingests:
    """Answers a face from what all ingests answer. The floor is heard only while somebody looks at it."""

    def __init__(self, bus: Bus) -> None:
        self._bus, self._recent, self._floors = bus, RecentBatches(), Floors()
        self._waiting: list[Batch] = []
        self._arrived_s: dict[str, float] = {}
        """When the newest status of each robot arrived."""
        self._leave: Callable[[], Awaitable[None]] | None = None
        self._followed_s = 0.0
        self._beginning = asyncio.Lock()
        """Who asks may have given up and ask again before the floor is heard."""

    def calls(self) -> dict[str, Handler]:
        """Named as those of a receiver."""
        return {
            "robots": self._robots,
            "quarantine": self._listed("quarantine"),
            "measures": self._listed("measures"),
            "unidentified": self._listed("unidentified"),
            "follow": self._follow,
        }

    async def run(self) -> None:
        """Hand on what is heard, a batch at a time, and cease to hear what nobody asks for."""
        while True:
            await asyncio.sleep(TICK_S)
            waiting, self._waiting = self._waiting, []
            if waiting:
                batch = self._joined(waiting)
                self._recent.add(batch.now_s, batch.to_bytes())
            if self._leave and time.monotonic() - self._followed_s > IDLE_S:
                with suppress(*BUS_ERRORS):
                    await self._leave()
                self._leave, self._recent, self._arrived_s = None, RecentBatches(), {}

    def _listed(self, question: str) -> Handler:
        async def answer(_: bytes) -> bytes:
            return json.dumps([one for told in await self._told(question) for one in told]).encode()

        return answer

    async def _told(self, question: str, within_s: float = WITHIN_S) -> list[list[Any]]:
        """What each ingest lists. Raises `LinkDownError` where there is none."""
        return [json.loads(one) for one in await self._asked(question, within_s)]

    async def _asked(self, question: str, within_s: float) -> list[bytes]:
        try:
            answers = await self._bus.ask(question, within_s)
        except BUS_ERRORS as error:
            raise LinkDownError("NATS server") from error
        if not answers:
            raise LinkDownError("ingest")
        return answers

    async def _robots(self, _: bytes) -> bytes:
        """One document a robot, from where it was heard last."""
        documents = [one for told in await self._told("robots", ROBOTS_WITHIN_S) for one in told]
        newest = {one["uuid"]: one for one in sorted(documents, key=lambda one: -one["age_s"])}
        return json.dumps([newest[uuid] for uuid in sorted(newest)]).encode()

    async def _follow(self, payload: bytes) -> bytes:
        """As a receiver tells of its own floor."""
        self._followed_s = time.monotonic()
        await self._begin()
        if told := await self._recent.after(int(payload)):
            return told
        parts = [unpacked_batch(one)[2] for one in await self._asked("follow", WITHIN_S)]
        whole = self._joined([self._floors.renumbered(one) for one in parts if one])
        return packed_batch(self._recent.number, whole.to_bytes(), whole=True)

    async def _begin(self) -> None:
        """Hear the floor, once. Raises `LinkDownError`."""
        async with self._beginning:
            if self._leave is None:
                try:
                    self._leave = await self._bus.hear_rows(EVERY, self._hear)
                except BUS_ERRORS as error:
                    raise LinkDownError("NATS server") from error

    def _hear(self, data: bytes) -> None:
        self._waiting.append(self._floors.renumbered(Batch.from_bytes(data)))

    def _joined(self, batches: list[Batch]) -> Batch:
        """The robots of some batches of which nothing newer was told."""
        floors = tuple(self._floors.names)
        joined = Batch.joined([replace(one, floors=floors) for one in batches])
        kept = joined.take(np.flatnonzero(~late(joined, self._arrived_s)), joined.gone)
        self._arrived_s.update(zip(kept.robots, kept.arrival_s.tolist(), strict=True))
        for uuid in kept.gone:
            self._arrived_s.pop(uuid, None)
        return kept
