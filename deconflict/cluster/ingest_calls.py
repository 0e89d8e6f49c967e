"""Answers the operator face's calls from all ingests of a cluster, as the receiver of a single machine does."""

import asyncio
import json
import time
from collections.abc import Awaitable, Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from math import inf
from typing import Any

import msgspec
import numpy as np

from deconflict.cluster.ingest_feed import LISTED, PAST, RECORDED
from deconflict.cluster.nats.bus import Bus
from deconflict.cluster.nats.subscriptions import BUS_ERRORS
from deconflict.cluster.tiles.tile_channels import EVERY, outdated
from deconflict.operator.live.history import whole_frame
from deconflict.operator.live.recent_batches import RecentBatches, packed_batch, unpacked_batch
from deconflict.runtime.rpc import Handler, LinkDownError
from ingest.batch import Batch
from ingest.frames.floor_numbers import FloorNumbers
from ingest.measures.measures import Measures
from ingest.recording.operator_events import OffFloorMark

WITHIN_S, ROBOTS_WITHIN_S = 1.5, 8.0
"""Time limits of answers. The documents of ten thousand robots take seconds."""
PAST_WITHIN_S = 15.0
"""The first look at the past also starts a process."""
TICK_S = 0.2
IDLE_S = 10.0
"""The subscription to the robots ends if nobody has followed the floor for this long."""


@contextmanager
def _server_needed() -> Iterator[None]:
    """Raises `LinkDownError` while no server answers."""
    try:
        yield
    except BUS_ERRORS as error:
        raise LinkDownError("NATS server") from error


class IngestCalls:
    """Joins the answers of all ingests. Subscribes to the robots only while somebody follows the floor."""

    def __init__(self, bus: Bus) -> None:
        self._bus, self._recent, self._floors = bus, RecentBatches(), FloorNumbers(Measures())
        self._waiting: list[Batch] = []
        self._arrived_s: dict[str, float] = {}
        """When the newest status of each robot arrived."""
        self._leave: Callable[[], Awaitable[None]] | None = None
        """Ends the subscription to the robots; None without one."""
        self._followed_s = 0.0
        self._subscribing = asyncio.Lock()
        """A caller may give up and call again before the subscription has begun."""

    def handlers(self) -> dict[str, Handler]:
        """By the names of the receiver's calls."""
        return {
            "robots": self._robots,
            **{question: self._listed(question) for question in LISTED},
            "follow": self._follow,
            RECORDED: self._recorded,
            PAST: self._past,
            "give_robot": self._give_robot,
            "off_floor": self._off_floor,
            "mark_off_floor": self._mark_off_floor,
        }

    async def run(self) -> None:
        """Join what comes to batches, and end the subscription if nobody follows the floor."""
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
            lists = await self._lists(question)
            return json.dumps([document for documents in lists for document in documents]).encode()

        return answer

    async def _lists(self, question: str, within_s: float = WITHIN_S) -> list[list[Any]]:
        """The list of each ingest. Raises `LinkDownError` if none answers."""
        return [json.loads(answer) for answer in await self._answers(question, within_s)]

    async def _answers(self, question: str, within_s: float) -> list[bytes]:
        with _server_needed():
            answers = await self._bus.requests.ask(question, within_s)
        if not answers:
            raise LinkDownError("ingest")
        return answers

    async def _robots(self, _: bytes) -> bytes:
        """The newest document of each robot."""
        lists = await self._lists("robots", ROBOTS_WITHIN_S)
        documents = [document for documents in lists for document in documents]
        oldest_first = sorted(documents, key=lambda document: -document["age_s"])
        newest = {document["uuid"]: document for document in oldest_first}
        return json.dumps([newest[uuid] for uuid in sorted(newest)]).encode()

    async def _recorded(self, _: bytes) -> bytes:
        """When the recordings begin and end, seconds since the epoch; each null without any."""
        spans = [(from_s, to_s) for from_s, to_s in await self._lists(RECORDED) if to_s]
        span = (min(from_s for from_s, _ in spans), max(to_s for _, to_s in spans)) if spans else (None, None)
        return json.dumps(span).encode()

    async def _past(self, at_s: bytes) -> bytes:
        """The floor at a time as one frame of `FloorFrames`, by the recordings of all ingests that have it in time."""
        answers = await self._answers(f"{PAST} {at_s.decode()}", PAST_WITHIN_S)
        return (await asyncio.to_thread(past_frame, answers)).encode()

    async def _give_robot(self, payload: bytes) -> bytes:
        """Let a robot belong to a vendor at every ingest, also at one that is down now. The owner before."""
        uuid, vendor = json.loads(payload)
        owners = {document["uuid"]: document["vendor"] for document in json.loads(await self._robots(b""))}
        with _server_needed():
            await self._bus.state.give(uuid, vendor)
        return json.dumps({"before": owners.get(uuid), "problem": ""}).encode()

    async def _off_floor(self, _: bytes) -> bytes:
        """The robots that are off the floor: each as the ingest has it that heard it last."""
        rows = [row for rows in await self._lists("off_floor") for row in rows]
        oldest_first = sorted(rows, key=lambda row: inf if row["age_s"] is None else row["age_s"], reverse=True)
        return json.dumps(list({row["uuid"]: row for row in oldest_first}.values())).encode()

    async def _mark_off_floor(self, payload: bytes) -> bytes:
        """Let a robot be off the floor at every ingest, also at one that is down now, or on it. What holds now."""
        mark = msgspec.structs.replace(msgspec.json.decode(payload, type=OffFloorMark), at_s=time.time())
        with _server_needed():
            held = await self._bus.state.mark_off_floor(mark)
        return msgspec.json.encode(held if held.is_off else None)

    async def _follow(self, payload: bytes) -> bytes:
        """The next batch of all ingests, as `ReceiverRole` gives those of one."""
        self._followed_s = time.monotonic()
        await self._subscribe()
        if batch := await self._recent.after(int(payload)):
            return batch
        parts = [unpacked_batch(answer)[2] for answer in await self._answers("follow", WITHIN_S)]
        whole = self._joined([part for part in parts if part])
        return packed_batch(self._recent.number, whole.to_bytes(), whole=True)

    async def _subscribe(self) -> None:
        """Subscribe to the robots, if not yet. Raises `LinkDownError`."""
        async with self._subscribing:
            if self._leave is None:
                with _server_needed():
                    self._leave = await self._bus.follow_channel(EVERY, self._add_parcel)

    def _add_parcel(self, data: bytes) -> None:
        self._waiting.append(Batch.from_bytes(data))

    def _joined(self, batches: list[Batch]) -> Batch:
        """One batch, without robots of which a newer status has come."""
        joined = self._floors.joined(batches)
        kept = joined.take(np.flatnonzero(~outdated(joined, self._arrived_s)), joined.gone)
        self._arrived_s.update(zip(kept.robots, kept.arrival_s.tolist(), strict=True))
        for uuid in kept.gone:
            self._arrived_s.pop(uuid, None)
        return kept


def past_frame(answers: Sequence[bytes]) -> str:
    """The batches of several ingests as one frame, with the newest status of each robot."""
    joined = FloorNumbers(Measures()).joined([Batch.from_bytes(answer) for answer in answers])
    newest_s: dict[str, float] = {}
    for uuid, arrival_s in zip(joined.robots, joined.arrival_s.tolist(), strict=True):
        newest_s[uuid] = max(arrival_s, newest_s.get(uuid, arrival_s))
    return whole_frame(joined.take(np.flatnonzero(~outdated(joined, newest_s))))
