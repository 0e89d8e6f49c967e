"""The protocols of the operators' port: uvicorn's, with limits on what a client may hold and send."""

import socket
from asyncio import BaseTransport, TimerHandle, Transport
from typing import Any, cast

from fastapi import FastAPI
from h11 import Request
from uvicorn.protocols.http.h11_impl import H11Protocol
from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol
from websockets.frames import CloseCode

from ingest.security.tls_handshakes import TlsHandshakes, abort_without_handshake

IDLE_TIMEOUT_S = 10.0
"""A connection without a request for this long is ended."""
SUBSCRIBER_BYTES, SUBSCRIBER_BYTES_PER_S = 8192, 256
"""What a subscriber may send at once, and then in a second. No message is expected."""


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

    def _may_send(self, data_bytes: int) -> bool:
        now_s = self.loop.time()
        allowed = min(self._allowed_bytes + (now_s - self._allowed_at_s) * SUBSCRIBER_BYTES_PER_S, SUBSCRIBER_BYTES)
        self._allowed_bytes, self._allowed_at_s = allowed - data_bytes, now_s
        return self._allowed_bytes >= 0

    def handle_ping(self) -> None:
        """Answer, unless the subscriber does not read."""
        if self.writable.is_set():
            super().handle_ping()
        else:
            self.conn.data_to_send()

    async def run_asgi(self) -> None:
        """Run the handler. If it returns without a closing handshake, abort the connection.

        uvicorn would first wait until everything is written, which never happens if the peer has stopped reading.
        """
        await super().run_asgi()
        if self.close_timer is None:
            self.transport.abort()


class HttpProtocol(H11Protocol):
    """uvicorn's HTTP protocol, which ends idle connections and limits their number to the file descriptors.

    uvicorn itself waits without limit for the first request, and for the rest of a request.
    `deconflict_connections_refused_total` counts by reason: `face-full`, `face-idle`, `face-tls-failed`.
    """

    _timer: TimerHandle | None = None
    _last_check: tuple[object, bool] = None, True
    """The request at the last check, and whether it was answered."""

    def connection_made(self, transport: Transport) -> None:  # type: ignore[override]
        """Called when the connection is accepted, and with TLS once more after the handshake."""
        handshakes: TlsHandshakes | None = self._state.handshakes
        if handshakes is not None and handshakes.awaited(transport):
            if len(self.connections) + len(handshakes) >= self._state.most_connections:
                count_refused(self._state, "face-full")
                abort_without_handshake(transport)
            else:
                handshakes.begin(transport, self)
            return
        super().connection_made(transport)
        if len(self.connections) > self._state.most_connections:
            self._refuse("face-full")
        else:
            self._timer = self.loop.call_later(IDLE_TIMEOUT_S, self._check_idle)

    def connection_lost(self, exc: Exception | None) -> None:
        self._stop_timer()
        super().connection_lost(exc)

    def handle_websocket_upgrade(self, event: Request) -> None:
        self._stop_timer()
        super().handle_websocket_upgrade(event)

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

    def _stop_timer(self) -> None:
        if self._timer:
            self._timer.cancel()

    def _refuse(self, reason: str) -> None:
        count_refused(self._state, reason)
        self.transport.abort()


def count_refused(state: Any, reason: str) -> None:
    state.measures.count("deconflict_connections_refused_total", reason)
