"""The operator face on a free port, as tests meet it: a real server, store and clients."""

import asyncio
import socket
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from fastapi import FastAPI

from deconflict.operator.blackbox.archive import Archive
from deconflict.operator.http.api import create_app
from deconflict.operator.http.api_sources import SourceUnavailableError
from deconflict.operator.http.server.uvicorn_server import OperatorServer, create_server
from deconflict.operator.ledger.loss_ledger import LossLedger
from deconflict.operator.ledger.loss_questions import LossQuestion
from deconflict.operator.live.floor_frames import FloorFrames
from deconflict.operator.live.recent_batches import RecentBatches, packed_batch, unpacked_batch
from deconflict.operator.store.publisher import Publisher
from deconflict.operator.store.store import Store
from deconflict.runtime.rpc import LinkDownError
from deconflict.settings.fleet_factory import fleet_of
from deconflict.settings.site import LossSettings, Operator, Site
from deconflict_client.answers.loss_models import LossList
from deconflict_client.situations import AnyRevision
from ingest.batch import Batch
from ingest.measures.measures import Measures
from ingest.recording.operator_events import OffFloorMark
from ingest.security.certificates import Certificates
from metrics.monitoring.exposition import render
from tests.helpers.patience import PATIENCE_S

HEARD: dict[str, Any] = {
    "name": "Tug 1",
    "language": "massrobotics",
    "participant": "robot",
    "source": "127.0.0.1",
    "examined": True,
    "compared": False,
    "not_compared_reason": "its position names no map",
    "identified": False,
    "presence": "present",
    "clock": {"offset_s": 0.0, "delay_s": 0.25},
    "deviations": {},
    "odd_values": [],
    "sizes": [],
    "still_there": 1.0,
}
ROBOT_DOCUMENTS: list[dict[str, Any]] = [
    {"uuid": "0c5b4a7e-0000-4000-8000-000000000001", "vendor": "Acme", "age_s": 0.5, **HEARD},
    {"uuid": "0c5b4a7e-0000-4000-8000-000000000002", "vendor": "Borealis", "age_s": float("inf"), **HEARD},
]


@dataclass
class GivenSources:
    """Sources that answer what they were given; a role named in `down` does not answer."""

    down: set[str] = field(default_factory=set)
    reloads: int = 0
    heard: list[dict[str, Any]] = field(default_factory=lambda: ROBOT_DOCUMENTS)
    to_mend: list[dict[str, Any]] = field(default_factory=list)
    live: dict[str, Any] = field(default_factory=dict)
    """Replaces parts of the live status."""
    recent: RecentBatches = field(default_factory=RecentBatches)
    archive: Archive | None = None
    ledger: LossLedger = field(default_factory=lambda: LossLedger(None, LossSettings()))
    marks: dict[str, OffFloorMark] = field(default_factory=dict)
    whole: Batch = field(default_factory=lambda: fleet_of(Site(), Measures()).snapshot(1.0))

    async def robots(self, uuid: str = "") -> list[dict[str, Any]]:
        self._ask("receiver")
        return [document for document in self.heard if uuid in ("", document["uuid"])]

    async def give_robot(self, uuid: str, vendor: str) -> dict[str, Any]:
        self._ask("receiver")
        problem = "" if vendor == "Acme" else f"vendor: {vendor!r} is in no site file"
        return {"before": "Borealis" if uuid == ROBOT_DOCUMENTS[0]["uuid"] else None, "problem": problem}

    async def mark_off_floor(self, mark: OffFloorMark) -> dict[str, Any]:
        self._ask("receiver")
        self.marks[mark.uuid] = mark
        return {"by": mark.by, "at_s": 5.0} if mark.is_off else {}

    async def quarantine(self) -> list[dict[str, Any]]:
        self._ask("receiver")
        return [{"rule": "not-json", "reason": "ends too early", "raw": "{"}]

    async def senders(self) -> list[dict[str, Any]]:
        return self.to_mend

    async def losses(self, question: LossQuestion) -> LossList:
        return self.ledger.ask(question)

    async def measures(self) -> list[dict[str, Any]]:
        self._ask("receiver")
        measures = Measures()
        measures.count("deconflict_messages_total", "Acme", "accepted", by=7)
        return [measures.as_document()]

    async def health(self) -> dict[str, Any]:
        self._ask("supervisor")
        roles = {role: "down" if role in self.down else "up" for role in ("receiver", "engine")}
        return {"status": "degraded" if self.down else "ok", "roles": roles}

    async def reload(self) -> dict[str, Any]:
        self._ask("supervisor")
        self.reloads += 1
        problems = ["conflict.clearance_m: is missing"] if self.reloads > 1 else []
        return {"applied": not problems, "problems": problems, "needs_restart": ["receiver.port"]}

    async def follow(self, number: int) -> tuple[int, bool, Batch | None]:
        if "receiver" in self.down:
            raise LinkDownError("receiver")
        return unpacked_batch(
            await self.recent.after(number) or packed_batch(self.recent.number, self.whole.to_bytes(), whole=True)
        )

    async def live_status(self) -> dict[str, Any]:
        roles = {role: "down" if role in self.down else "up" for role in ("receiver", "engine")}
        silent: dict[str, Any] = {"fading": {}, "taken_off": {}, "distrusted": []}
        return {"roles": roles, "vendors": {}, "unidentified": [], **silent, **self.live}

    def presence(self) -> dict[str, Any]:
        off = {"vendor": "Alder", "name": "Alder A-7", "heard_s": 5.0, "at_s": 9.0, "by": "Corvid C-12"}
        exits = [{"datum": "hall", "x_m": 40.0, "y_m": 5.0, "robots": 12}]
        return {"fading": {"one": 0.4}, "taken_off": {"other": off}, "exits": exits}

    async def floor_at(self, at_s: float) -> str:
        self._ask("recording")
        picture = FloorFrames()
        picture.add_batch(replace(self.whole, now_s=at_s), whole=True)
        return picture.since(0)

    async def recorded(self) -> tuple[float, float] | None:
        return 1.0, 2.0

    def blackboxes(self) -> list[dict[str, Any]]:
        return self.archive.boxes() if self.archive else []

    def blackbox(self, file: str) -> Path | None:
        return self.archive.path(file) if self.archive else None

    def _ask(self, role: str) -> None:
        if role in self.down:
            raise SourceUnavailableError(role)


@dataclass
class Served:
    """A face that is being served."""

    app: FastAPI
    publisher: Publisher
    store: Store
    sources: GivenSources
    server: OperatorServer
    address: str

    @property
    def http(self) -> str:
        return f"http://{self.address}"

    def stream(self, query: str = "") -> str:
        return f"ws://{self.address}/advisories/stream{query}"

    async def publish(self, *revisions: AnyRevision) -> list[AnyRevision]:
        return await self.publisher.publish(revisions)

    def connections(self) -> int:
        """Connections that the server still holds."""
        return len(self.server.server_state.connections)

    def measured(self, name: str) -> float:
        """The value of a measure of the face without labels; 0 before it is counted."""
        values: dict[tuple[str, ...], float] = self.app.state.measures.values[name]
        return values.get((), 0)


@asynccontextmanager
async def served(directory: Path, *, at: str = "127.0.0.1:0", **settings: Any) -> AsyncIterator[Served]:
    store, sources = Store(directory), GivenSources()
    publisher = Publisher(store, Measures())
    app = create_app(publisher, store, sources, render, Site(operator=Operator(**settings)))
    tls = settings.get("tls")
    server = create_server(app, Certificates(tls) if tls else None)
    host, _, port = at.partition(":")
    with socket.create_server((host, int(port))) as listening:
        serving = asyncio.create_task(server.serve([listening]))
        await until(lambda: server.started)
        try:
            yield Served(app, publisher, store, sources, server, f"127.0.0.1:{listening.getsockname()[1]}")
        finally:
            server.should_exit = True
            await serving
            store.close()


async def until(condition: Any, within_s: float = PATIENCE_S) -> None:
    """Wait for a condition that comes true by itself; fails when it does not in time."""
    async with asyncio.timeout(within_s):
        while not condition():
            await asyncio.sleep(0.005)


async def stuck_subscriber(face: Served, path: str = "/advisories/stream") -> socket.socket:
    """A subscriber that has shaken hands and reads nothing more."""
    host, port = face.address.split(":")
    loop = asyncio.get_running_loop()
    raw = socket.socket()
    raw.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    raw.setblocking(False)
    await loop.sock_connect(raw, (host, int(port)))
    request = (
        f"GET {path} HTTP/1.1\r\nHost: {face.address}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
        "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Version: 13\r\n\r\n"
    )
    await loop.sock_sendall(raw, request.encode())
    answer = b""
    while not answer.endswith(b"\r\n\r\n"):
        answer += await loop.sock_recv(raw, 1)
    assert answer.startswith(b"HTTP/1.1 101")
    return raw
