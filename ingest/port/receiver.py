"""The robots' port: accepts WebSockets and delivers each message with the time of its arrival.

It sends no WebSocket pings: real senders never answer them, and each unanswered ping stays in memory as long as the
connection lasts. Instead, TCP keepalive keeps address translations open and finds vanished peers, and a connection that
sends nothing is closed.
"""

import asyncio
import logging
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from http import HTTPStatus
from itertools import count
from typing import cast
from urllib.parse import unquote

from websockets.asyncio.server import Server, ServerConnection, serve
from websockets.frames import CloseCode
from websockets.http11 import Request, Response
from websockets.protocol import State

from ingest.measures.lasting_loops import lasting
from ingest.measures.measures import Measures
from ingest.port.connection import Connection
from ingest.port.connection_limits import HANDSHAKE_FILES, BoundedConnection, connection_limit, set_options
from ingest.port.connection_shares import ConnectionShares, Newcomers, holder_of, site_of
from ingest.port.fair_delivery import Deliver, FairDelivery
from ingest.port.frame_cutter import FrameCuttingConnection
from ingest.port.rate_limits import ArrivedMessage
from ingest.security.certificates import Certificates, names
from ingest.security.failed_sign_ins import FailedSignIns
from ingest.security.origin_check import is_cross_site, is_fetched_elsewhere, is_page_elsewhere
from ingest.security.refused_clients import RefusedClients
from ingest.security.tls_handshakes import TlsHandshakes
from ingest.security.vendor_credentials import Refusal, VendorCredentials
from ingest.settings import UNKNOWN, ReceiverSettings, Vendor

Refuse = Callable[[str, str, float, Connection], None]
"""Gets rule, reason, arrival and connection of a message that could not be received whole."""

IDLE_CHECK_S = 5.0
CLOSE_TIMEOUT_S = 2.0
"""How long a peer may take to answer a close frame."""
MOST_CLOSING = HANDSHAKE_FILES // 2
"""Connections that are being closed to make room, at once."""


@dataclass(slots=True, eq=False)
class Session:
    """A socket whose messages are received."""

    socket: FrameCuttingConnection
    connection: Connection
    now_s: Callable[[], float]
    """The event loop's clock, which is monotonic."""
    heard_s: float
    """When it last sent a message, by that clock."""


class Receiver:
    """Accepts robots and fleet managers. Delivers on the event loop, in order of arrival and in time slices.

    Under overload it delivers only the newest status of each robot and passes the others to `overtaken`.

    `deconflict_connections_refused_total` counts by reason: `full` (answered with 503, or aborted if even the answer
    would take too many files), `unauthorised`, `another-vendor`, `another-site`, `replaced`, `idle`, `vendor-removed`,
    `protocol-error`, `unread` (it read nothing of what it was sent), and `tls-failed` (a TLS handshake failed or took
    longer than `open_timeout_s`).
    """

    def __init__(
        self,
        settings: ReceiverSettings,
        credentials: VendorCredentials,
        deliver: Deliver,
        refuse: Refuse,
        closed: Callable[[Connection], None],
        *,
        overtaken: Callable[[ArrivedMessage, str], None],
        measures: Measures,
        clock: Callable[[], float],
        owner_of: Callable[[Connection], str | None] = lambda _: None,
        first_id: int = 1,
        shares_port: bool = False,
    ) -> None:
        """Several processes may open one port with `shares_port` (`SO_REUSEPORT`). `owner_of` as of `FairDelivery`."""
        self.settings, self._shares_port = settings, shares_port
        self._credentials = credentials
        self._certificates = Certificates(settings.tls) if settings.tls else None
        self._handshakes: TlsHandshakes | None = None
        if self._certificates:
            failed = partial(self._count_refused, "tls-failed")
            self._handshakes = TlsHandshakes(self._certificates, settings.open_timeout_s, failed)
        self._refuse, self._closed = refuse, closed
        self._measures, self._clock = measures, clock
        self._ids = count(first_id)
        self._sessions: dict[str, dict[int, Session]] = {}
        """By peer and connection, oldest first."""
        self._total = 0
        self._server: Server | None = None
        self._reaper: asyncio.Task[None] | None = None
        self._closing: set[asyncio.Task[None]] = set()
        self._limit = settings.max_connections
        self._shares: ConnectionShares[Session] = ConnectionShares()
        self._failed_sign_ins, self._refused_clients = FailedSignIns(), RefusedClients()
        self._delivery = FairDelivery(settings, deliver, overtaken, measures, owner_of)
        self._slices = self._delivery.slices

    async def start(self) -> None:
        """Open the port. Raises `OSError` if that fails."""
        self._limit = connection_limit(self.settings.max_connections)
        bounded = partial(
            BoundedConnection,
            most=lambda: self._limit + HANDSHAKE_FILES,
            refused=partial(self._count_refused, "full"),
            newcomers=Newcomers(),
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
        reaping = lasting("closing idle connections, and reading tokens and certificates", self._reap, self._measures)
        self._reaper = asyncio.create_task(reaping)
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
        await self._delivery.close()
        if self._handshakes:
            self._handshakes.close()
        if self._server:
            self._server.close()
            await asyncio.gather(*self._closing, *(session.socket.close() for session in self._all_sessions()))
            await self._server.wait_closed()
        self._slices.finish()

    def use_limits(self, settings: ReceiverSettings) -> None:
        """Use other limits from now on. The address, the certificate files and the longest message stay the same."""
        self.settings = settings
        self._delivery.use_limits(settings)
        self._limit = connection_limit(settings.max_connections)

    def use_vendors(self, vendors: Sequence[Vendor]) -> None:
        """Use these vendors' credentials from now on. Connections of vendors that no longer exist are closed."""
        self._credentials = VendorCredentials(vendors, self._credentials)
        for session in self._all_sessions():
            if session.connection.vendor and not self._credentials.known(session.connection.vendor):
                reason = f"{session.connection.vendor} was taken out of the site file"
                self._close_and_count(session, "vendor-removed", CloseCode.POLICY_VIOLATION, reason)

    def new_connection(self, peer: str, path: str, vendor: str | None, *, proven: bool = False) -> Connection:
        """A connection with a new number, accepted or dialled."""
        return Connection(next(self._ids), peer, path, vendor, proven=proven)

    def take(self, raw: bytes, connection: Connection) -> None:
        """Deliver a message of a topic. If too much waits already, it is dropped: a broker can't be made to wait."""
        if self._slices.full:
            self._measures.count("deconflict_messages_shed_total", connection.vendor or UNKNOWN)
        else:
            message = ArrivedMessage(raw, self._clock(), connection)
            self._delivery.add(message, asyncio.get_running_loop().time())

    def refuse(self, rule: str, reason: str, connection: Connection) -> None:
        """Pass on that a message is not taken."""
        self._slices.run(partial(self._refuse, rule, reason, self._clock(), connection))

    def forget(self, connection: Connection) -> None:
        """Pass on that nothing more comes over a connection."""
        self._slices.run(partial(self._closed, connection))

    async def listen(self, socket: FrameCuttingConnection, connection: Connection) -> None:
        """Deliver everything that arrives over one socket until it ends."""
        now_s = asyncio.get_running_loop().time
        session = Session(socket, connection, now_s, now_s())
        self._add(session)
        try:
            socket.listen(partial(self._receive, session), partial(self._read, session))
            await socket.wait_closed()
            self._count_close(socket, connection)
        finally:
            self._remove(connection)
            self.forget(connection)

    def _read(self, session: Session, data: bytes) -> None:
        socket = session.socket
        pause_s = self._delivery.timed(session.connection, partial(socket.data_received, data), session.now_s())
        if pause_s:
            socket.transport.pause_reading()
            asyncio.get_running_loop().call_later(pause_s, socket.transport.resume_reading)

    def _receive(self, session: Session, raw: bytes) -> None:
        session.heard_s = session.now_s()
        self._delivery.add(ArrivedMessage(raw, self._clock(), session.connection), session.heard_s)
        transport = session.socket.transport
        if self._slices.full and transport.is_reading():
            transport.pause_reading()
            self._slices.when_room(transport.resume_reading)

    def _add(self, session: Session) -> None:
        set_options(session.socket)
        connection = session.connection
        self._sessions.setdefault(connection.peer, {})[connection.id] = session
        self._shares.add(session, holder_of(connection.vendor, connection.peer))
        self._total += 1
        self._measure()

    def _remove(self, connection: Connection) -> None:
        self._forget(connection)
        self._total -= 1
        self._measure()

    def _all_sessions(self) -> list[Session]:
        return [session for same_peer in self._sessions.values() for session in same_peer.values()]

    def _forget(self, connection: Connection) -> None:
        same_peer = self._sessions.get(connection.peer, {})
        if session := same_peer.pop(connection.id, None):
            self._shares.remove(session)
        if not same_peer:
            self._sessions.pop(connection.peer, None)

    def _count_close(self, socket: FrameCuttingConnection, connection: Connection) -> None:
        """Count why we closed a connection. Nothing is counted if the peer closed it."""
        protocol = socket.protocol
        code = protocol.close_sent.code if protocol.close_sent and not protocol.close_rcvd_then_sent else None
        if code == CloseCode.MESSAGE_TOO_BIG:
            most = self.settings.max_message_bytes
            reason = f"larger than {most} bytes; send a shorter path"
            self.refuse("message-too-large", reason, connection)
        elif socket.is_unread:
            self._count_refused("unread")
        elif code in {CloseCode.PROTOCOL_ERROR, CloseCode.INVALID_DATA}:
            self._count_refused("protocol-error")

    async def _admit(self, connection: ServerConnection, request: Request) -> Response | None:
        if request.path.partition("?")[0] == "/healthz":
            return connection.respond(HTTPStatus.OK, "ok\n")
        vendor, peer = self._vendor_of(connection, request), _peer(connection)
        if isinstance(vendor, Refusal):
            self._count_refused(vendor.counted_as)
            self._refused_clients.note(site_of(peer), vendor.reason)
            if vendor.status == HTTPStatus.UNAUTHORIZED and "Authorization" in request.headers:
                await asyncio.sleep(self._failed_sign_ins.delay_s(peer, asyncio.get_running_loop().time()))
            return connection.respond(HTTPStatus(vendor.status), f"{vendor.reason}\n")
        if self._total >= self._limit and not self._has_replaced(holder_of(vendor, peer)):
            self._count_refused("full")
            return connection.respond(HTTPStatus.SERVICE_UNAVAILABLE, "too many connections; try again later\n")
        return None

    def _has_replaced(self, holder: str) -> bool:
        """Close the oldest connection of the vendor or address with most, if a newcomer's has fewer."""
        if len(self._closing) >= MOST_CLOSING or not len(self._shares):
            return False
        largest = self._shares.largest_holder()
        if self._shares.held(largest) <= self._shares.held(holder) + 1:
            return False
        reason = "all places are taken, and you have most; use fewer"
        self._close_and_count(self._shares.oldest(largest), "replaced", CloseCode.TRY_AGAIN_LATER, reason)
        return True

    def _vendor_of(self, connection: ServerConnection, request: Request) -> str | Refusal | None:
        origins, hosts = request.headers.get_all("Origin"), request.headers.get_all("Host")
        is_foreign = is_cross_site if self._credentials.needed else is_page_elsewhere
        fetched = is_fetched_elsewhere(origins, request.headers.get_all("Sec-Fetch-Site"))
        if fetched or any(is_foreign(origin, "".join(hosts)) for origin in origins):
            return Refusal(403, "another-site", "pages of other sites may not speak for robots")
        encrypted = connection.transport.get_extra_info("ssl_object")
        certificate_names = names(encrypted.getpeercert()) if encrypted else ()
        token = tokens[0] if len(tokens := request.headers.get_all("Authorization")) == 1 else None
        return self._credentials.vendor(unquote(request.path), token, certificate_names)

    async def _converse(self, socket: ServerConnection) -> None:
        """Receive from an admitted connection. Its socket is a `BoundedConnection`, as `serve` was asked to create."""
        peer = _peer(socket)
        if socket.request is None:
            return
        vendor = self._vendor_of(socket, socket.request)
        if isinstance(vendor, Refusal):  # its credentials were withdrawn after it was admitted
            return
        self._make_room(peer)
        connection = self.new_connection(peer, socket.request.path, vendor, proven=self._credentials.needed)
        await self.listen(cast(FrameCuttingConnection, socket), connection)

    def _make_room(self, peer: str) -> None:
        """Close the peer's oldest connection if it has too many: some senders open one for each message."""
        same_peer = self._sessions.get(peer, {})
        if len(same_peer) >= self.settings.max_connections_per_peer:
            oldest = next(iter(same_peer.values()))
            reason = "replaced by a newer connection from the same address; close those no longer used"
            self._close_and_count(oldest, "replaced", CloseCode.POLICY_VIOLATION, reason)

    async def _reap(self) -> None:
        """Close idle connections, and read tokens and certificates that have changed. Other open connections stay."""
        while True:
            limit_s = self.settings.idle_timeout_s
            await asyncio.sleep(min(IDLE_CHECK_S, limit_s / 4))
            heard_s = asyncio.get_running_loop().time() - limit_s
            self._credentials.refresh()
            if self._certificates:
                self._certificates.refresh()
            for session in self._all_sessions():
                if session.heard_s < heard_s:
                    self._close_and_count(session, "idle", CloseCode.GOING_AWAY, f"nothing heard for {limit_s:g} s")
                elif session.socket.state is State.CLOSING:
                    self._close_within_time(session)

    def _close_and_count(self, session: Session, counted_as: str, code: CloseCode, reason: str) -> None:
        self._count_refused(counted_as)
        self._close_within_time(session, code, reason)

    def _close_within_time(self, session: Session, code: CloseCode = CloseCode.GOING_AWAY, reason: str = "") -> None:
        """Close the connection. A peer that does not answer the close in time is cut off."""
        self._forget(session.connection)
        task = asyncio.create_task(session.socket.close(code, reason))
        self._closing.add(task)
        task.add_done_callback(self._closing.discard)

    def _count_refused(self, reason: str) -> None:
        self._measures.count("deconflict_connections_refused_total", reason)

    def _measure(self) -> None:
        self._measures.level("deconflict_connections", {(): self._total})


def _peer(socket: ServerConnection) -> str:
    return str(socket.remote_address[0]) if socket.remote_address else ""
