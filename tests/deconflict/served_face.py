"""The operator face on a free port, as tests meet it: a real server, store and clients."""

import asyncio
import socket
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from fastapi import FastAPI

from deconflict.advisory import AnyAdvisory
from deconflict.asgi import FaceServer, face_server
from deconflict.operator import SourceUnavailableError, create_app
from deconflict.site import Operator
from deconflict.store import Store
from ingest.measures import Measures
from metrics.exposition import render

ROBOT_DOCUMENTS: list[dict[str, Any]] = [
    {"uuid": "0c5b4a7e-0000-4000-8000-000000000001", "vendor": "Acme", "age_s": 0.5},
    {"uuid": "0c5b4a7e-0000-4000-8000-000000000002", "vendor": "Borealis", "age_s": float("inf")},
]


@dataclass
class GivenSources:
    """Sources that answer what they were given; a role named in `down` does not answer."""

    down: set[str] = field(default_factory=set)

    async def robots(self) -> list[dict[str, Any]]:
        self._ask("receiver")
        return ROBOT_DOCUMENTS

    async def quarantine(self) -> list[dict[str, Any]]:
        self._ask("receiver")
        return [{"rule": "not-json", "reason": "ends too early", "raw": "{"}]

    async def measures(self) -> list[dict[str, Any]]:
        self._ask("receiver")
        told = Measures()
        told.count("deconflict_messages_total", "Acme", "accepted", by=7)
        return [told.as_document()]

    async def health(self) -> dict[str, Any]:
        self._ask("supervisor")
        roles = {role: "down" if role in self.down else "up" for role in ("receiver", "engine")}
        return {"status": "degraded" if self.down else "ok", "roles": roles}

    def _ask(self, role: str) -> None:
        if role in self.down:
            raise SourceUnavailableError(role)


@dataclass
class Served:
    """A face that is being served."""

    app: FastAPI
    store: Store
    sources: GivenSources
    server: FaceServer
    address: str

    @property
    def http(self) -> str:
        return f"http://{self.address}"

    def stream(self, query: str = "") -> str:
        return f"ws://{self.address}/advisories/stream{query}"

    async def publish(self, *advisories: AnyAdvisory) -> list[AnyAdvisory]:
        published: list[AnyAdvisory] = await self.app.state.publisher.publish(advisories)
        return published

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
    app = create_app(store, sources, render, Operator(**settings))
    server = face_server(app)
    host, _, port = at.partition(":")
    with socket.create_server((host, int(port))) as listening:
        serving = asyncio.create_task(server.serve([listening]))
        await until(lambda: server.started)
        try:
            yield Served(app, store, sources, server, f"127.0.0.1:{listening.getsockname()[1]}")
        finally:
            server.should_exit = True
            await serving
            store.close()


async def until(condition: Any, within_s: float = 20.0) -> None:
    """Wait for a condition that comes true by itself; fails when it does not in time."""
    async with asyncio.timeout(within_s):
        while not condition():
            await asyncio.sleep(0.005)
