"""The uvicorn server of the operators' port, set up for subscribers that stay for days and some that hang."""

import socket
from asyncio import BaseTransport, TimerHandle, Transport
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from typing import Any, cast

import uvicorn
from fastapi import FastAPI
from h11 import Request
from uvicorn.protocols.http.h11_impl import H11Protocol
from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol

from ingest.port.connection_limits import max_open_files
from ingest.security.certificates import Certificates
from ingest.security.tls_handshakes import TlsHandshakes, abort_without_handshake

MOST_MESSAGE_BYTES = 4096
"""Largest message accepted from a subscriber; none is expected."""
SHUTDOWN_S = 2
IDLE_TIMEOUT_S = 10.0
"""A connection without a request for this long is ended."""
HANDSHAKE_S = 5.0
"""A TLS handshake that takes longer is ended."""
SPARE_FILES = 200
"""File descriptors that are kept free for everything except clients: store, other roles, outlets, black boxes."""


ACCEPTED_AT_ONCE = 100
"""Most connections that are accepted before the first of them can be refused. They use spare descriptors."""


class WebSocketProtocol(WebSocketsSansIOProtocol):
    """uvicorn's WebSocket protocol, without delays in sending and in closing."""

    def connection_made(self, transport: BaseTransport) -> None:
        """Send small messages at once.

        asyncio turns Nagle's algorithm off only if the listening socket has an explicit protocol number, which
        `socket.create_server` does not set. With Nagle's algorithm, messages arrive up to 40 ms late.
        """
        super().connection_made(transport)
        transport.get_extra_info("socket").setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)

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


class OperatorServer(uvicorn.Server):
    """Does not handle signals. Set `should_exit` to end it."""

    def __init__(self, config: uvicorn.Config, handshakes: TlsHandshakes | None) -> None:
        super().__init__(config)
        self._handshakes = handshakes

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        if self._handshakes is not None:
            self._handshakes.close()
        await super().shutdown(sockets)

    @contextmanager
    def capture_signals(self) -> Iterator[None]:
        yield


def create_server(app: FastAPI, certificates: Certificates | None = None) -> OperatorServer:
    """A server for `app`: `await create_server(app).serve([listening_socket])`.

    The server sends pings, so that the network stack notices a dead peer. An unanswered ping closes nothing, because a
    slow subscriber answers only after it has read everything before the ping. Messages are not compressed: advisories
    are small, and each would be compressed once for each reader.
    """
    app.state.most_connections = max(max_open_files() - SPARE_FILES, 1)
    handshakes = None
    if certificates:
        handshakes = TlsHandshakes(certificates, HANDSHAKE_S, partial(count_refused, app.state, "face-tls-failed"))
    app.state.handshakes = handshakes
    return OperatorServer(
        uvicorn.Config(
            app,
            http=HttpProtocol,
            ws=WebSocketProtocol,
            backlog=ACCEPTED_AT_ONCE,
            ws_max_size=MOST_MESSAGE_BYTES,
            ws_ping_timeout=None,
            ws_per_message_deflate=False,
            log_config=None,
            access_log=False,
            lifespan="off",
            timeout_graceful_shutdown=SHUTDOWN_S,
        ),
        handshakes,
    )
