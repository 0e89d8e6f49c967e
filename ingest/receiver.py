"""The robots' port: WebSockets in, each message delivered with the time it arrived."""

import asyncio
import logging
import resource
from collections import OrderedDict
from collections.abc import Callable
from http import HTTPStatus
from itertools import count
from typing import Literal, Protocol

from websockets.asyncio.server import Server, ServerConnection, serve
from websockets.exceptions import ConnectionClosed
from websockets.http11 import Request, Response

from ingest.connection import Connection
from ingest.measures import Measures
from ingest.settings import Receiver as Settings

log = logging.getLogger(__name__)

Deliver = Callable[[bytes, float, Connection], None]
Refuse = Callable[[str, str, float, Connection], None]
"""Rule, reason, arrival and connection of a message that could not be had whole."""

SPARE_FILES = 200
"""File descriptors left for everything but robots."""
IDLE_CHECK_S = 5.0

_CLOSE_RULES = {
    1007: ("not-utf8", "the frame is not UTF-8"),
    1009: ("message-too-large", "the frame is too large"),
}


class Conversation(Protocol):
    """A socket of either side, as far as receiving goes."""

    async def recv(self, *, decode: Literal[False]) -> bytes:
        """The next message; raises `ConnectionClosed` at the end."""


class Receiver:
    """Accepts robots and fleet managers. Delivers on the event loop, in order of arrival."""

    def __init__(
        self,
        settings: Settings,
        vendors: tuple[str, ...],
        deliver: Deliver,
        refuse: Refuse,
        closed: Callable[[Connection], None],
        *,
        measures: Measures,
        clock: Callable[[], float],
    ) -> None:
        self._settings = settings
        self._vendors = {name.casefold(): name for name in vendors}
        self._deliver, self._refuse, self._closed = deliver, refuse, closed
        self._measures, self._clock = measures, clock
        self._ids = count(1)
        self._open: dict[str, OrderedDict[ServerConnection, float]] = {}
        """By peer, oldest first: each connection and when it last sent."""
        self._total = 0
        self._server: Server | None = None
        self._reaper: asyncio.Task[None] | None = None
        self._limit = settings.max_connections

    async def start(self) -> None:
        """Open the port. Raises `OSError` where it can't be had."""
        self._limit = min(self._settings.max_connections, _descriptors() - SPARE_FILES)
        self._server = await serve(
            self._converse,
            self._settings.host,
            self._settings.port,
            process_request=self._admit,
            compression=None,
            max_size=self._settings.max_message_bytes,
            open_timeout=self._settings.open_timeout_s,
            ping_timeout=None,
            logger=logging.getLogger("websockets.robots"),
        )
        self._reaper = asyncio.create_task(self._reap())
        self._measure()

    @property
    def port(self) -> int:
        if self._server is None:
            return self._settings.port
        return int(next(iter(self._server.sockets)).getsockname()[1])

    async def close(self) -> None:
        if self._reaper:
            self._reaper.cancel()
        if self._server:
            self._server.close()
            await self._server.wait_closed()

    def new_connection(self, peer: str, path: str, vendor: str | None) -> Connection:
        """A connection with an id of its own; the dialled ones come here too."""
        return Connection(next(self._ids), peer, path, vendor)

    async def listen(self, socket: Conversation, connection: Connection) -> None:
        """Deliver everything that comes over one socket until it ends."""
        try:
            while True:
                raw = await socket.recv(decode=False)
                self._deliver(raw, self._clock(), connection)
                self._heard(socket)
        except ConnectionClosed as ended:
            sent = ended.sent
            if sent and sent.code in _CLOSE_RULES:
                self._refuse(*_CLOSE_RULES[sent.code], self._clock(), connection)
        finally:
            self._closed(connection)

    def _admit(self, connection: ServerConnection, request: Request) -> Response | None:
        if request.path == "/healthz":
            return connection.respond(HTTPStatus.OK, "ok\n")
        if self._total >= self._limit:
            self._measures.count("deconflict_connections_refused_total", "full")
            return connection.respond(HTTPStatus.SERVICE_UNAVAILABLE, "too many connections; try again later\n")
        return None

    async def _converse(self, socket: ServerConnection) -> None:
        peer = str(socket.remote_address[0]) if socket.remote_address else ""
        path = socket.request.path if socket.request else "/"
        vendor = self._vendors.get(path.partition("?")[0].strip("/").casefold())
        await self._make_room(peer)
        self._open.setdefault(peer, OrderedDict())[socket] = self._clock()
        self._total += 1
        self._measure()
        try:
            await self.listen(socket, self.new_connection(peer, path, vendor))
        finally:
            self._total -= 1
            self._open[peer].pop(socket, None)
            if not self._open[peer]:
                del self._open[peer]
            self._measure()

    async def _make_room(self, peer: str) -> None:
        """Where one peer holds too many connections, the oldest goes: a sender that opens one for each message."""
        mine = self._open.get(peer, OrderedDict())
        if len(mine) >= self._settings.max_connections_per_peer:
            oldest, _ = mine.popitem(last=False)
            self._measures.count("deconflict_connections_refused_total", "replaced")
            oldest.transport.abort()

    def _heard(self, socket: Conversation) -> None:
        if isinstance(socket, ServerConnection) and socket.remote_address:
            mine = self._open.get(str(socket.remote_address[0]))
            if mine is not None and socket in mine:
                mine[socket] = self._clock()

    async def _reap(self) -> None:
        while True:
            await asyncio.sleep(min(IDLE_CHECK_S, self._settings.idle_timeout_s / 4))
            limit_s = self._clock() - self._settings.idle_timeout_s
            idle = [socket for mine in self._open.values() for socket, heard_s in mine.items() if heard_s < limit_s]
            for socket in idle:
                self._measures.count("deconflict_connections_refused_total", "idle")
                socket.transport.abort()

    def _measure(self) -> None:
        self._measures.level("deconflict_connections", {(): self._total})


def _descriptors() -> int:
    """How many files this process may have open, after asking for as many as it may."""
    _, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    wanted = hard if hard != resource.RLIM_INFINITY else 1 << 20
    resource.setrlimit(resource.RLIMIT_NOFILE, (wanted, hard))
    return wanted
