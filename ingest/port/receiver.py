"""The robots' port: WebSockets in, each message delivered with the time it arrived.

WebSocket pings are not sent: real senders never answer them, and each unanswered one is kept in memory for as long as
the connection lasts. The kernel's keepalive holds address translations open and finds vanished peers instead, and a
connection that sends nothing is closed.
"""

import asyncio
import logging
import resource
import socket as sockets
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from http import HTTPStatus
from itertools import count
from typing import Any, cast
from urllib.parse import unquote

from websockets.asyncio.server import Server, ServerConnection, serve
from websockets.frames import CloseCode
from websockets.http11 import Request, Response
from websockets.protocol import State

from ingest.measures.measures import Measures
from ingest.port.backlog import Backlog
from ingest.port.connection import Connection
from ingest.port.frame_cutter import FrameCuttingConnection, FrameCuttingServer
from ingest.port.rate_limits import ArrivedMessage, RateLimits
from ingest.port.time_slices import TimeSlices
from ingest.security.certificates import Certificates, names
from ingest.security.origin_check import is_page_elsewhere
from ingest.security.tls_handshakes import TlsHandshakes, turn_away
from ingest.security.vendor_credentials import Refusal, VendorCredentials
from ingest.settings import UNKNOWN
from ingest.settings import Receiver as Settings

Deliver = Callable[[bytes, float, Connection], None]
Refuse = Callable[[str, str, float, Connection], None]
"""Rule, reason, arrival and connection of a message that could not be had whole."""

SPARE_FILES = 200
"""File descriptors left for everything but robots."""
HANDSHAKE_FILES = 80
"""Of those, descriptors for connections that are yet to be admitted or refused. An accept takes up to 100 at once."""
IDLE_CHECK_S = 5.0
DRAIN_EVERY_S = 0.02
CLOSE_TIMEOUT_S = 2.0
"""How long a peer may take to answer a close."""
KEEPALIVE = {"TCP_KEEPIDLE": 30, "TCP_KEEPINTVL": 10, "TCP_KEEPCNT": 6}
"""Seconds until the first probe of a silent peer, seconds between probes, and unanswered probes to give up after."""

log = logging.getLogger(__name__)


@dataclass(slots=True, eq=False)
class OpenConnection:
    """A socket that is listened to."""

    socket: FrameCuttingConnection
    connection: Connection
    now_s: Callable[[], float]
    """The event loop's clock, which nobody sets."""
    heard_s: float
    """When it last sent a message."""


class Receiver:
    """Accepts robots and fleet managers. Delivers on the event loop, in order of arrival and in short turns.

    Where it is behind, it delivers the newest of a robot's statuses, and tells `overtaken` of the others.

    `deconflict_connections_refused_total` counts by reason: `full` (answered 503, or aborted where even that would
    take too many files), `unauthorised`, `another-vendor`, `another-site`, `replaced`, `idle`, `vendor-removed`,
    `protocol-error`, and `tls-failed` where a handshake of TLS failed or took longer than `open_timeout_s`.
    """

    def __init__(
        self,
        settings: Settings,
        credentials: VendorCredentials,
        deliver: Deliver,
        refuse: Refuse,
        closed: Callable[[Connection], None],
        *,
        overtaken: Callable[[ArrivedMessage, str], None],
        measures: Measures,
        clock: Callable[[], float],
        first_id: int = 1,
        shares_port: bool = False,
    ) -> None:
        """With `shares_port` others that do so too may have the same port, and the kernel gives each some of the
        connections (`SO_REUSEPORT`)."""
        self.settings, self._shares_port = settings, shares_port
        self._credentials = credentials
        self._certificates = Certificates(settings.tls) if settings.tls else None
        self._handshakes = self._shaking(self._certificates) if self._certificates else None
        self._refuse, self._closed = refuse, closed
        self._measures, self._clock = measures, clock
        self._ids = count(first_id)
        self._lines: dict[str, dict[int, OpenConnection]] = {}
        """By peer and connection, oldest first."""
        self._total = 0
        self._server: Server | None = None
        self._reaper: asyncio.Task[None] | None = None
        self._closing: set[asyncio.Task[None]] = set()
        self._limit = settings.max_connections
        self._shares = RateLimits(settings.max_messages_per_s)
        self._turns = TimeSlices()
        self._backlog = Backlog(self._turns, deliver, overtaken)
        self._draining: asyncio.Task[None] | None = None

    async def start(self) -> None:
        """Open the port. Raises `OSError` where it can't be had."""
        self._limit = limited(self.settings.max_connections)
        bounded = partial(
            _BoundedConnection,
            most=lambda: self._limit + HANDSHAKE_FILES,
            refused=self._full,
            handshakes=self._handshakes,
        )
        self._server = await serve(
            self._converse,
            self.settings.host,
            self.settings.port,
            process_request=self._admit,
            compression=None,
            max_size=self.settings.max_message_bytes,
            open_timeout=self.settings.open_timeout_s,
            close_timeout=CLOSE_TIMEOUT_S,
            ping_interval=None,
            create_connection=cast(type[ServerConnection], bounded),
            reuse_port=self._shares_port or None,
            logger=logging.getLogger("websockets.robots"),
        )
        self._reaper = asyncio.create_task(self._reap())
        self._measure()

    @property
    def port(self) -> int:
        if self._server is None:
            return self.settings.port
        return int(next(iter(self._server.sockets)).getsockname()[1])

    async def close(self) -> None:
        """Close the port and every connection that came through it."""
        if self._reaper:
            self._reaper.cancel()
            await asyncio.gather(self._reaper, return_exceptions=True)
        if self._draining:
            self._draining.cancel()
            await asyncio.gather(self._draining, return_exceptions=True)
        if self._handshakes:
            self._handshakes.close()
        if self._server:
            self._server.close()
            await asyncio.gather(*self._closing, *(line.socket.close() for line in self._all_lines()))
            await self._server.wait_closed()
        self._turns.finish()

    def bound(self, settings: Settings) -> None:
        """Other limits from now on. The address, the certificates' files and the longest message stay as they were."""
        self.settings, self._shares.rate = settings, settings.max_messages_per_s
        self._limit = limited(settings.max_connections)

    def renew(self, credentials: VendorCredentials) -> None:
        """Let vendors in by other credentials. Open connections stay, but those of a vendor that is no longer there."""
        self._credentials = credentials
        for line in self._all_lines():
            if line.connection.vendor and not credentials.known(line.connection.vendor):
                reason = f"{line.connection.vendor} was taken out of the site file"
                self._dismiss(line, "vendor-removed", CloseCode.POLICY_VIOLATION, reason)

    def new_connection(self, peer: str, path: str, vendor: str | None) -> Connection:
        """A connection with an id of its own; the dialled ones come here too."""
        return Connection(next(self._ids), peer, path, vendor)

    async def listen(self, socket: FrameCuttingConnection, connection: Connection) -> None:
        """Deliver everything that comes over one socket until it ends."""
        now_s = asyncio.get_running_loop().time
        line = OpenConnection(socket, connection, now_s, now_s())
        self._enter(line)
        try:
            socket.listen(partial(self._heard, line))
            await socket.wait_closed()
            self._ended(socket, connection)
        finally:
            self._leave(connection)
            self._turns.do(partial(self._closed, connection))

    def _heard(self, line: OpenConnection, raw: bytes) -> None:
        line.heard_s = line.now_s()
        self._take(ArrivedMessage(raw, self._clock(), line.connection), line.heard_s)
        transport = line.socket.transport
        if self._turns.full and transport.is_reading():
            transport.pause_reading()
            self._turns.when_room(transport.resume_reading)

    def _take(self, one: ArrivedMessage, now_s: float) -> None:
        """Hand on a message now, or when its sender's share allows."""
        at_once, shed = self._shares.admit(one.connection.vendor or one.connection.peer, one, now_s)
        if at_once:
            self._backlog.put(one)
        elif self._draining is None or self._draining.done():
            self._draining = asyncio.create_task(self._drain())
        if shed:
            self._measures.count("deconflict_messages_shed_total", one.connection.vendor or UNKNOWN, by=len(shed))

    async def _drain(self) -> None:
        while self._shares.waiting:
            await asyncio.sleep(DRAIN_EVERY_S)
            for one in self._shares.due(asyncio.get_running_loop().time()):
                self._backlog.put(one)

    def _enter(self, line: OpenConnection) -> None:
        _keep_alive(line.socket)
        self._lines.setdefault(line.connection.peer, {})[line.connection.id] = line
        self._total += 1
        self._measure()

    def _leave(self, connection: Connection) -> None:
        self._forget(connection)
        self._total -= 1
        self._measure()

    def _all_lines(self) -> list[OpenConnection]:
        return [line for same_peer in self._lines.values() for line in same_peer.values()]

    def _forget(self, connection: Connection) -> None:
        same_peer = self._lines.get(connection.peer, {})
        same_peer.pop(connection.id, None)
        if not same_peer:
            self._lines.pop(connection.peer, None)

    def _ended(self, socket: FrameCuttingConnection, connection: Connection) -> None:
        """Count what we closed a connection for; what the peer closed it for is its own affair."""
        ended = socket.protocol
        code = ended.close_sent.code if ended.close_sent and not ended.close_rcvd_then_sent else None
        if code == CloseCode.MESSAGE_TOO_BIG:
            most = self.settings.max_message_bytes
            reason = f"larger than {most} bytes; send a shorter path"
            self._turns.do(partial(self._refuse, "message-too-large", reason, self._clock(), connection))
        elif code in {CloseCode.PROTOCOL_ERROR, CloseCode.INVALID_DATA}:
            self._count_refused("protocol-error")

    def _admit(self, connection: ServerConnection, request: Request) -> Response | None:
        if request.path.partition("?")[0] == "/healthz":
            return connection.respond(HTTPStatus.OK, "ok\n")
        if self._total >= self._limit:
            self._full()
            return connection.respond(HTTPStatus.SERVICE_UNAVAILABLE, "too many connections; try again later\n")
        vendor = self._vendor_of(connection, request)
        if isinstance(vendor, Refusal):
            self._count_refused(vendor.counted_as)
            return connection.respond(HTTPStatus(vendor.status), f"{vendor.reason}\n")
        return None

    def _vendor_of(self, connection: ServerConnection, request: Request) -> str | Refusal | None:
        origins, hosts = request.headers.get_all("Origin"), request.headers.get_all("Host")
        if not self._credentials.needed and any(is_page_elsewhere(one, "".join(hosts)) for one in origins):
            return Refusal(403, "another-site", "pages of other sites may not speak for robots; give vendors tokens")
        encrypted = connection.transport.get_extra_info("ssl_object")
        shown = names(encrypted.getpeercert()) if encrypted else ()
        tokens = request.headers.get_all("Authorization")
        return self._credentials.vendor(unquote(request.path), tokens[0] if len(tokens) == 1 else None, shown)

    async def _converse(self, socket: ServerConnection) -> None:
        """Listen to one who was admitted; its socket is one of those that `serve` was told to make."""
        peer = str(socket.remote_address[0]) if socket.remote_address else ""
        if socket.request is None:
            return
        vendor = self._vendor_of(socket, socket.request)
        if isinstance(vendor, Refusal):  # its credentials were withdrawn since it was admitted
            return
        self._make_room(peer)
        await self.listen(cast(FrameCuttingConnection, socket), self.new_connection(peer, socket.request.path, vendor))

    def _make_room(self, peer: str) -> None:
        """Where one peer holds too many connections, the oldest goes: a sender that opens one for each message."""
        same_peer = self._lines.get(peer, {})
        if len(same_peer) >= self.settings.max_connections_per_peer:
            oldest = next(iter(same_peer.values()))
            reason = "replaced by a newer connection from the same address; close those no longer used"
            self._dismiss(oldest, "replaced", CloseCode.POLICY_VIOLATION, reason)

    async def _reap(self) -> None:
        while True:
            limit_s = self.settings.idle_timeout_s
            await asyncio.sleep(min(IDLE_CHECK_S, limit_s / 4))
            heard_s = asyncio.get_running_loop().time() - limit_s
            self._refresh()
            for line in self._all_lines():
                if line.heard_s < heard_s:
                    self._dismiss(line, "idle", CloseCode.GOING_AWAY, f"nothing heard for {limit_s:g} s")
                elif line.socket.state is State.CLOSING:
                    self._let_go(line)

    def _refresh(self) -> None:
        """Take up tokens and certificates that have changed; open connections stay."""
        self._credentials.refresh()
        if self._certificates:
            self._certificates.refresh()

    def _dismiss(self, line: OpenConnection, counted_as: str, code: CloseCode, reason: str) -> None:
        self._count_refused(counted_as)
        self._let_go(line, code, reason)

    def _let_go(self, line: OpenConnection, code: CloseCode = CloseCode.GOING_AWAY, reason: str = "") -> None:
        """Close, and cut off a peer that does not do its part in time: waiting for messages alone would not."""
        self._forget(line.connection)
        task = asyncio.create_task(line.socket.close(code, reason))
        self._closing.add(task)
        task.add_done_callback(self._closing.discard)

    def _shaking(self, certificates: Certificates) -> TlsHandshakes:
        return TlsHandshakes(certificates, self.settings.open_timeout_s, partial(self._count_refused, "tls-failed"))

    def _full(self) -> None:
        self._count_refused("full")

    def _count_refused(self, reason: str) -> None:
        self._measures.count("deconflict_connections_refused_total", reason)

    def _measure(self) -> None:
        self._measures.level("deconflict_connections", {(): self._total})


class _BoundedConnection(FrameCuttingServer):
    """Aborts at once where there are `most` TCP connections, so that accepting can never run out of descriptors.

    Once it does, asyncio logs a traceback for each waiting connection and tries again every second.
    """

    def __init__(
        self,
        *args: Any,
        most: Callable[[], int],
        refused: Callable[[], None],
        handshakes: TlsHandshakes | None,
        **kwargs: Any,
    ) -> None:
        super().__init__(*args, **kwargs)
        self._most, self._refused, self._handshakes = most, refused, handshakes

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """That it was accepted, and with TLS once more that hands are shaken."""
        accepted, shaking = cast(asyncio.Transport, transport), self._handshakes
        if shaking is None or not shaking.awaited(accepted):
            super().connection_made(accepted)
            if self._too_many(0):
                self._refused()
                self.transport.abort()
        elif self._too_many(1 + len(shaking)):
            self._refused()
            turn_away(accepted)
        else:
            shaking.begin(accepted, self)

    def _too_many(self, more: int) -> bool:
        return len(self.server.handler_tasks) + more > self._most()


def _keep_alive(socket: FrameCuttingConnection) -> None:
    raw: sockets.socket | None = socket.transport.get_extra_info("socket")
    if raw is None or raw.fileno() < 0:
        return
    raw.setsockopt(sockets.SOL_SOCKET, sockets.SO_KEEPALIVE, 1)
    for name, value in KEEPALIVE.items():
        if option := getattr(sockets, name, None):
            raw.setsockopt(sockets.IPPROTO_TCP, option, value)


def limited(wanted: int) -> int:
    """How many connections there may be: as many as wanted, but fewer where the limit of open files is lower."""
    files = descriptors()
    limit = max(min(wanted, files - SPARE_FILES), 1)
    if limit < wanted:
        log.warning("at most %d connections, because %d files may be open; raise the limit of open files", limit, files)
    return limit


def descriptors() -> int:
    """How many files this process may have open, after asking for as many as it may."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    wanted = hard if hard != resource.RLIM_INFINITY else max(soft, 1 << 16)
    try:
        resource.setrlimit(resource.RLIMIT_NOFILE, (wanted, hard))
    except (ValueError, OSError):
        return soft
    return wanted
