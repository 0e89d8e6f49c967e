"""Other ends of outlets: an HTTP server that answers as it is told, and a real broker."""

import asyncio
import shutil
import socket
import ssl
import subprocess
import threading
from collections.abc import AsyncIterator, Coroutine, Iterator
from contextlib import AbstractAsyncContextManager, asynccontextmanager, contextmanager, suppress
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

import pytest
from aiomqtt import Client

from deconflict.operator.outlets.store_cursor import StoreCursor
from deconflict.operator.outlets.webhooks import WebhookOutlet
from deconflict.operator.store.publisher import Publisher
from deconflict.operator.store.store import Store
from deconflict.settings.outlet_settings import Webhook
from ingest.measures.measures import Measures
from tests.deconflict.operator.http.served_face import until
from tests.deconflict.roles.made_service import free_ports
from tests.helpers.patience import PATIENCE_S

SECRET = "a secret that both ends know"  # noqa: S105

MOSQUITTO = shutil.which("mosquitto", path="/usr/sbin:/usr/local/sbin:/usr/bin")
"""None if it is not installed."""
needs_mosquitto = pytest.mark.skipif(MOSQUITTO is None, reason="mosquitto is not installed")


@asynccontextmanager
async def working(outlet: Coroutine[Any, Any, None], publisher: Publisher) -> AsyncIterator[None]:
    """An outlet at work from when it follows `publisher`, until the end of the block."""
    running = asyncio.create_task(outlet)
    await until(lambda: publisher.measures.values["deconflict_outlet_waiting"])
    try:
        yield
    finally:
        running.cancel()
        with suppress(asyncio.CancelledError):
            await running


@dataclass
class Hearer:
    """What was posted, and the statuses to answer with before 204."""

    answers: list[int] = field(default_factory=list)
    heard: list[tuple[dict[str, str], bytes]] = field(default_factory=list)
    url: str = ""


@contextmanager
def hearing(*answers: int, tls: ssl.SSLContext | None = None) -> Iterator[Hearer]:
    hearer = Hearer(list(answers))

    class Handler(BaseHTTPRequestHandler):
        def do_POST(self) -> None:
            body = self.rfile.read(int(self.headers["content-length"]))
            hearer.heard.append(({name.lower(): value for name, value in self.headers.items()}, body))
            self.send_response(hearer.answers.pop(0) if hearer.answers else 204)
            self.end_headers()

        def log_message(self, format: str, *args: object) -> None:  # noqa: A002
            pass

    server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    if tls:
        server.socket = tls.wrap_socket(server.socket, server_side=True)
    hearer.url = f"http{'s' if tls else ''}://127.0.0.1:{server.server_address[1]}/hook?key=abc"
    thread = threading.Thread(target=server.serve_forever)
    thread.start()
    try:
        yield hearer
    finally:
        server.shutdown()
        thread.join()
        server.server_close()


@asynccontextmanager
async def broker(port: int = 0, *, settings: Path | None = None) -> AsyncIterator[int]:
    """A broker without any memory, and its port. `settings` is a file of its own, which has the port, too."""
    port = port or free_ports(1)[0]
    server = subprocess.Popen(
        [str(MOSQUITTO), *(("-c", str(settings)) if settings else ("-p", str(port)))],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    try:
        async with asyncio.timeout(PATIENCE_S):
            while not _open(port):
                await asyncio.sleep(0.02)
        yield port
    finally:
        server.terminate()
        server.wait()


def _open(port: int) -> bool:
    with socket.socket() as probe:
        return probe.connect_ex(("127.0.0.1", port)) == 0


@contextmanager
def kept(folder: Path) -> Iterator[tuple[Store, Publisher]]:
    """A store and its publisher, as one run of the service has them."""
    store = Store(folder)
    try:
        yield store, Publisher(store, Measures())
    finally:
        store.close()


def posting(url: str, store: Store, publisher: Publisher, folder: Path) -> AbstractAsyncContextManager[None]:
    """A webhook at work, until the end of the block."""
    (folder / "secret").write_text(SECRET)
    settings = Webhook(name="mes", url=url, secret=f"file:{folder / 'secret'}", retry_s=(0.02, 0.1), timeout_s=5)
    return working(WebhookOutlet(settings, StoreCursor("mes", ["advisory"], store, publisher)).run(), publisher)


def numbers(heard: list[tuple[dict[str, str], bytes]]) -> list[int]:
    return [int(headers["webhook-id"].removeprefix("advisory-")) for headers, _ in heard]


async def heard(other: Hearer, count: int) -> None:
    async with asyncio.timeout(PATIENCE_S):
        await until(lambda: len(other.heard) >= count)


async def delivered(publisher: Publisher, count: int, outlet: str = "mes") -> None:
    """So many are taken, which an outlet knows a moment after the other end."""
    async with asyncio.timeout(PATIENCE_S):
        await until(lambda: publisher.measures.values["deconflict_outlet_deliveries_total"][outlet,] >= count)


async def held_now(port: int) -> dict[str, str]:
    """What a subscriber that comes now is told at once, by topic."""
    held: dict[str, str] = {}
    async with Client("127.0.0.1", port) as client:
        await client.subscribe("deconflict/#", qos=1)
        await client.subscribe("end")
        await client.publish("end", "", qos=1)
        async for message in client.messages:
            if message.topic.value == "end":
                break
            if message.retain and isinstance(message.payload, bytes):
                held[message.topic.value] = message.payload.decode()
    return held


async def retained(port: int, wanted: set[str]) -> dict[str, str]:
    """What is held, as soon as it is of these topics and no others."""
    while set(held := await held_now(port)) != {f"deconflict/{name}" for name in wanted}:
        await asyncio.sleep(0.05)
    return held
