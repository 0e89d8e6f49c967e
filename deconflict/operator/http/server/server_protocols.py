"""The protocols of the operators' port: uvicorn's, with limits on what a client may hold and send."""

import re
import socket
from asyncio import BaseTransport, TimerHandle, Transport
from typing import Any, cast

import h11
from fastapi import FastAPI
from h11 import Request
from uvicorn._types import ASGISendEvent
from uvicorn.protocols.http.h11_impl import H11Protocol
from uvicorn.protocols.utils import ClientDisconnected
from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol
from websockets.frames import CloseCode

from deconflict.operator.http.access import COOKIE
from ingest.port.connection_shares import ConnectionShares, Newcomers, site_of
from ingest.security.tls_handshakes import TlsHandshakes

IDLE_TIMEOUT_S = 10.0
"""A connection without a request for this long is ended."""
WRITE_TIMEOUT_S = 10.0
LEAST_READ_BYTES = 1 << 16
"""A client that reads less than this of a waiting answer in `WRITE_TIMEOUT_S` is ended."""
SUBSCRIBER_BYTES, SUBSCRIBER_BYTES_PER_S = 8192, 256
"""What a subscriber may send at once, and then in a second. No message is expected."""
BAD_REQUEST = b"HTTP/1.1 400 Bad Request\r\nConnection: close\r\nContent-Length: 0\r\n\r\n"
MOST_SESSION_COOKIES = 8
"""Of one handshake; a browser keeps one for each path and domain."""
MOST_HANDSHAKES = 100
"""TLS handshakes at once. Beyond that, the address with most loses its oldest."""


_BARE_LINE_FEED, _FOLDED_LINE = re.compile(rb"(?<!\r)\n"), re.compile(rb"\r\n[ \t]")
_LENGTH, _ENCODING = (
    re.compile(rb"\r\n" + name + rb"[ \t]*:", re.I) for name in (b"content-length", b"transfer-encoding")
)


def session_cookies(headers: list[tuple[bytes, bytes]]) -> list[bytes]:
    """The pairs of the headers `Cookie` that have a session of this port. Browsers send those of others, too."""
    pairs = (pair.strip() for name, value in headers if name == b"cookie" for pair in value.split(b";"))
    return [pair for pair in pairs if pair.partition(b"=")[0].strip() == COOKIE.encode()][:MOST_SESSION_COOKIES]


def is_ambiguous(data: bytes) -> bool:
    """Whether the head of a request, as far as it has come, could be read in two ways (RFC 9112, 2.2, 5.2, 6.1)."""
    head = data.lstrip(b"\r\n").partition(b"\r\n\r\n")[0]
    if _BARE_LINE_FEED.search(head) or _FOLDED_LINE.search(head):
        return True
    return bool(_LENGTH.search(head) and _ENCODING.search(head))


class Places:
    """The connections that the port holds at most: half of them for one address, or for one signed-in person.

    Beyond that the oldest connection goes: of the same address or person, or of the one with most. A newcomer is
    always let in, so that it can sign in.
    """

    def __init__(self) -> None:
        self.most = 1 << 16
        self._shares: ConnectionShares[Transport] = ConnectionShares()
        self._by_client: dict[tuple[str, int], Transport] = {}
        self._clients: dict[Transport, tuple[str, int]] = {}

    def add(self, transport: Transport, client: tuple[str, int] | None) -> list[Transport]:
        """Give a place to a new connection. Returns the connections that lose theirs."""
        if client is not None:
            self._by_client[client], self._clients[transport] = transport, client
        return self._give(transport, site_of(client[0]) if client else "")

    def sign_in(self, client: tuple[str, int] | None, person: str) -> None:
        """Count a connection to the person who has signed in over it, and no longer to its address."""
        transport = self._by_client.get(client) if client else None
        holder = f"person {person}"
        if transport is not None and self._shares.holder(transport) != holder:
            for replaced in self._give(transport, holder):
                replaced.abort()

    def holder(self, client: tuple[str, int] | None) -> str:
        """The person who has signed in over a client's connection, or else its address."""
        transport = self._by_client.get(client) if client else None
        known = self._shares.holder(transport) if transport is not None else None
        return known or (site_of(client[0]) if client else "")

    def remove(self, transport: Transport) -> None:
        self._shares.remove(transport)
        client = self._clients.pop(transport, None)
        if client is not None:
            self._by_client.pop(client, None)

    def _give(self, transport: Transport, holder: str) -> list[Transport]:
        shares, replaced = self._shares, []
        if shares.held(holder) >= max(self.most // 2, 1):
            replaced.append(shares.oldest(holder))
        elif len(shares) >= self.most and shares.holder(transport) is None:
            replaced.append(shares.oldest(shares.largest_holder()))
        for gone in replaced:
            shares.remove(gone)
        shares.add(transport, holder)
        return replaced


class WebSocketProtocol(WebSocketsSansIOProtocol):
    """uvicorn's WebSocket protocol, without delays in sending and in closing, and with a limit on what is received.

    A subscriber that sends more is ended before its frames are parsed, and counted as `face-flood`.
    """

    _allowed_bytes, _allowed_at_s = float(SUBSCRIBER_BYTES), 0.0

    def connection_made(self, transport: BaseTransport) -> None:
        """Send small messages at once.

        asyncio turns Nagle's algorithm off only if the listening socket has an explicit protocol number, which
        `socket.create_server` does not set. With Nagle's algorithm, messages arrive up to 40 ms late.
        """
        super().connection_made(transport)
        self._handshake_timer = self.loop.call_later(IDLE_TIMEOUT_S, self._check_handshake)
        transport.get_extra_info("socket").setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)

    def data_received(self, data: bytes) -> None:
        """Take what a subscriber sends. Pings and messages are answered and ignored, as long as they are few."""
        if self.handshake_initiated and not self._may_send(len(data)):
            count_refused(cast(FastAPI, self.config.app).state, "face-flood")
            self.conn.fail(CloseCode.POLICY_VIOLATION, "a subscriber has nothing to send but a few pings")
            self.handle_parser_exception()
            self.transport.abort()
        else:
            super().data_received(data)
            if self.conn.handshake_exc is not None and not self.handshake_initiated:
                self._refuse_handshake()

    def _refuse_handshake(self) -> None:
        """Answer a handshake that websockets can't read. uvicorn sends no answer, and waits."""
        self.handshake_initiated = self.handshake_complete = True
        self.transport.write(b"".join(self.conn.data_to_send()) or BAD_REQUEST)
        self.transport.close()

    def _check_handshake(self) -> None:
        """End a handshake that nothing has answered, whatever the reason."""
        if not self.handshake_complete:
            count_refused(cast(FastAPI, self.config.app).state, "face-idle")
            self.transport.abort()

    def _may_send(self, data_bytes: int) -> bool:
        now_s = self.loop.time()
        allowed = min(self._allowed_bytes + (now_s - self._allowed_at_s) * SUBSCRIBER_BYTES_PER_S, SUBSCRIBER_BYTES)
        self._allowed_bytes, self._allowed_at_s = allowed - data_bytes, now_s
        return self._allowed_bytes >= 0

    def connection_lost(self, exc: Exception | None) -> None:
        self._handshake_timer.cancel()
        cast(FastAPI, self.config.app).state.places.remove(self.transport)
        super().connection_lost(exc)

    def handle_ping(self) -> None:
        """Answer, unless the subscriber does not read."""
        if self.writable.is_set():
            super().handle_ping()
        else:
            self.conn.data_to_send()

    async def send(self, message: ASGISendEvent) -> None:
        """Raise `ClientDisconnected` if this side has closed the connection meanwhile, as after a frame that can't be
        read: uvicorn calls that a fault of the handler, which has not heard of it yet."""
        if self.handshake_complete and self.close_sent:
            raise ClientDisconnected
        await super().send(message)

    async def run_asgi(self) -> None:
        """Run the handler. If it returns without a closing handshake, abort the connection.

        uvicorn would first wait until everything is written, which never happens if the peer has stopped reading.
        """
        await super().run_asgi()
        if self.close_timer is None:
            self.transport.abort()


class HttpProtocol(H11Protocol):
    """uvicorn's HTTP protocol, which ends idle and unread connections and limits their number.

    uvicorn itself waits without limit for the first request, for the rest of a request, and for a client that does not
    read its answer. `deconflict_connections_refused_total` counts by reason: `face-full`, `face-no-files`,
    `face-replaced`, `face-idle`, `face-unread`, `face-tls-failed`.
    """

    _timer: TimerHandle | None = None
    _write_timer: TimerHandle | None = None
    _last_check: tuple[object, bool] = None, True
    """The request at the last check, and whether it was answered."""

    def connection_made(self, transport: Transport) -> None:  # type: ignore[override]
        """Called when the connection is accepted, and with TLS once more after the handshake."""
        handshakes: TlsHandshakes | None = self._state.handshakes
        if handshakes is not None and transport.get_extra_info("sslcontext") is None:
            newcomers: Newcomers = self._state.newcomers
            if len(newcomers) >= min(self._state.places.most, MOST_HANDSHAKES):
                count_refused(self._state, "face-full")
                newcomers.end_one()
            newcomers.add(transport)
            handshakes.begin(transport, self).add_done_callback(lambda _: newcomers.remove(transport))
            return
        super().connection_made(transport)
        self._timer = self.loop.call_later(IDLE_TIMEOUT_S, self._check_idle)
        for replaced in self._state.places.add(transport, self.client):
            count_refused(self._state, "face-replaced")
            replaced.abort()

    def connection_lost(self, exc: Exception | None) -> None:
        self._stop_timers()
        self._state.places.remove(self.transport)
        super().connection_lost(exc)

    def handle_websocket_upgrade(self, event: Request) -> None:
        """Hand the handshake over, with no cookies but the session's: websockets takes lines up to 8 KiB only."""
        self._stop_timers()
        others = [header for header in self.headers if header[0] != b"cookie"]
        self.headers = [*others, *((b"cookie", session) for session in session_cookies(self.headers))]
        super().handle_websocket_upgrade(event)

    def handle_events(self) -> None:
        """Refuse a request that others on its way might read as two. h11 reads all of these."""
        if self.conn.their_state is h11.IDLE and is_ambiguous(self.conn.trailing_data[0]):
            self.send_400_response("Ambiguous HTTP request received.")
        else:
            super().handle_events()

    def pause_writing(self) -> None:
        super().pause_writing()
        self._await_reading()

    def resume_writing(self) -> None:
        super().resume_writing()
        if self._write_timer:
            self._write_timer.cancel()

    def _await_reading(self) -> None:
        unread_bytes = self.transport.get_write_buffer_size()
        self._write_timer = self.loop.call_later(WRITE_TIMEOUT_S, self._check_read, unread_bytes)

    def _check_read(self, unread_bytes: int) -> None:
        if self.transport.get_write_buffer_size() > unread_bytes - LEAST_READ_BYTES:
            self._refuse("face-unread")
        else:
            self._await_reading()

    @property
    def _state(self) -> Any:
        return cast(FastAPI, self.config.app).state

    def _check_idle(self) -> None:
        """End a connection without a new complete request since the last check."""
        cycle: Any = self.cycle
        answered = cycle is None or cycle.response_complete
        before, self._last_check = self._last_check, (cycle, answered)
        if before == self._last_check and (answered or cycle.more_body):
            self._refuse("face-idle")
            return
        self._timer = self.loop.call_later(IDLE_TIMEOUT_S, self._check_idle)

    def _stop_timers(self) -> None:
        for timer in (self._timer, self._write_timer):
            if timer:
                timer.cancel()

    def _refuse(self, reason: str) -> None:
        count_refused(self._state, reason)
        self.transport.abort()


def count_refused(state: Any, reason: str) -> None:
    state.measures.count("deconflict_connections_refused_total", reason)
