"""What a running cluster says of itself: at one moment, and every quarter of a simulated second."""

import asyncio
import json
import time
from dataclasses import dataclass, field
from datetime import datetime
from typing import Any

import httpx
from websockets.asyncio.client import connect

from benchmarks.endtoend import LATENCY, Usage
from benchmarks.slow_motion.started_cluster import StartedCluster
from deconflict.cluster.nats.bus import Bus
from deconflict.cluster.tiles.tile_owners import OwnerTable
from deconflict.cluster.tiles.tiles import Tile
from ingest.measures.measures import Histogram, Labels, joined_values

SAMPLE_EVERY_S = 0.25
ASK_WITHIN_S = 8.0
PASSES = "deconflict_sweep_duration_seconds"

Counts = dict[str, dict[Labels, float]]


@dataclass(frozen=True)
class Moment:
    """Figures since the start, at one simulated time."""

    at_s: float
    usage: dict[str, list[Usage]]
    varz: dict[str, Any]
    streams: dict[str, dict[str, Any]]
    """State of each stream of the server by its name, without the cluster's."""
    ingests: Counts
    engines: Counts
    latency: Histogram
    passes: int
    """Passes of all engines."""

    def accepted(self) -> float:
        """Messages that the ingests have accepted, identities included."""
        return sum(
            value for labels, value in self.ingests.get("deconflict_messages_total", {}).items() if "accepted" in labels
        )


@dataclass
class Sampler:
    """Watches a cluster over a connection of its own."""

    started: StartedCluster
    bus: Bus
    http: httpx.AsyncClient
    table: OwnerTable = field(default_factory=OwnerTable)
    moves: int = 0
    """Tiles that have got another owner."""
    written: list[tuple[float, int]] = field(default_factory=list)
    """By sample, simulated time and the number of the last revision in the stream."""
    lags_s: list[float] = field(default_factory=list)
    """By sample, for how long the first revision that the face lacked had been in the stream."""
    lag_revisions: int = 0
    """The most revisions that the face lacked."""
    delay_s: float = 0.0
    """The greatest age of a pass in an engine's outbox."""
    shown_s: list[float] = field(default_factory=list)
    """Of each revision that a subscriber of the face received, the time since an engine decided it."""

    async def run(self) -> None:
        """Sample until cancelled."""
        while True:
            began_s = time.monotonic()
            await self._sample()
            await asyncio.sleep(max(SAMPLE_EVERY_S - (time.monotonic() - began_s), 0.0))

    async def moment(self) -> Moment:
        """All figures as they are now."""
        answers = await self.bus.requests.ask("measures", ASK_WITHIN_S)
        documents = self._engine_documents()
        rows = [row for document in documents for row in document["histograms"].get(LATENCY, [])]
        passes = [row for document in documents for row in document["histograms"].get(PASSES, [])]
        return Moment(
            at_s=time.time(),
            usage=self.started.usage(),
            varz=await self._get(f"{self.started.monitor}/varz"),
            streams=await self._streams(),
            ingests=joined_values(document for answer in answers for document in json.loads(answer)),
            engines=joined_values(documents),
            latency=Histogram.joined(rows) if rows else Histogram(),
            passes=sum(sum(row[2]) for row in passes),
        )

    def engines(self) -> dict[str, dict[Tile, float]]:
        """By live engine its tiles and their statuses a second, as of its last heartbeat."""
        return {
            name: {Tile.named(tile): per_s for tile, per_s in member["loads"].items()}
            for name, member in self.bus.state.members().items()
            if "loads" in member
        }

    async def stored(self) -> int:
        """The number of the last revision that the operator face has stored."""
        return int((await self._get(f"{self.started.face}/advisories?limit=1"))["seq"])

    async def follow_face(self) -> None:
        """Note how long revisions take from an engine to a subscriber of the operator face. Until cancelled."""
        after = await self.stored()
        address = f"{self.started.face.replace('http', 'ws', 1)}/advisories/stream?after={after}"
        async with connect(address, proxy=None) as stream:
            async for message in stream:
                decided = datetime.fromisoformat(json.loads(message)["updated_at"])
                self.shown_s.append(time.time() - decided.timestamp())

    async def _sample(self) -> None:
        _, document = await self.bus.state.table()
        table = OwnerTable.of_document(document) if document else OwnerTable()
        before = self.table.owners
        self.moves += sum(before.get(tile, owner) != owner for tile, owner in table.owners.items())
        self.table = table
        last = (await self._streams())["told"]["last_seq"]
        stored, now_s = await self.stored(), time.time()
        self.written.append((now_s, last))
        lacking = [at_s for at_s, seq in self.written if seq > stored]
        self.lags_s.append(now_s - lacking[0] if lacking else 0.0)
        self.lag_revisions = max(self.lag_revisions, last - stored)
        delays = joined_values(self._engine_documents()).get("deconflict_delivery_delay_seconds", {})
        self.delay_s = max([self.delay_s, *delays.values()])

    def _engine_documents(self) -> list[dict[str, Any]]:
        members = self.bus.state.members().values()
        return [document for member in members for document in member.get("measures", ())]

    async def _streams(self) -> dict[str, dict[str, Any]]:
        answer = await self._get(f"{self.started.monitor}/jsz?streams=true")
        streams = answer["account_details"][0]["stream_detail"]
        return {stream["name"].removeprefix(f"{self.bus.name}-"): stream["state"] for stream in streams}

    async def _get(self, url: str) -> Any:
        return (await self.http.get(url)).json()
