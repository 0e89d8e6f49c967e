"""How the operator face is served: uvicorn, set up for subscribers that stay for days and some that get stuck."""

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

MAX_SAID_BYTES = 4096
"""Largest message accepted from a subscriber; none is expected."""
SHUTDOWN_S = 2
ASKED_WITHIN_S = 10.0
"""A connection on which nothing was asked for so long is ended."""
HANDSHAKE_S = 5.0
"""A handshake of TLS that takes longer is ended."""
SPARE_FILES = 200
"""File descriptors left for everything but who asks: the store, the other roles, outlets, black boxes."""


ACCEPTED_AT_ONCE = 100
"""Of those spare ones, taken by connections before the first of them can be refused."""


class StreamProtocol(WebSocketsSansIOProtocol):
    """uvicorn's WebSocket, prompt in sending and in ending."""

    def connection_made(self, transport: BaseTransport) -> None:
        """Send small messages at once.

        asyncio turns Nagle's algorithm off by itself only where the listening socket was made with an explicit
        protocol number, which `socket.create_server` does not do; a subscriber then hears up to 40 ms late.
        """
        super().connection_made(transport)
        transport.get_extra_info("socket").setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)

    async def run_asgi(self) -> None:
        """Run the handler; end a connection whose handler has returned without a closing handshake.

        uvicorn would close it once everything is written, which a peer that has stopped reading never lets happen.
        """
        await super().run_asgi()
        if self.close_timer is None:
            self.transport.abort()


class FaceProtocol(H11Protocol):
    """uvicorn's HTTP, which ends connections that ask for nothing, and takes no more than there are files for.

    uvicorn itself waits for ever for a first request, and as long for the rest of one that has begun.
    `deconflict_connections_refused_total` counts by reason: `face-full`, `face-idle`, `face-tls-failed`.
    """

    _looking: TimerHandle | None = None
    _seen: tuple[object, bool] = None, True
    """The last request at the last look, and whether it was answered."""

    def connection_made(self, transport: Transport) -> None:  # type: ignore[override]
        """That it was accepted, and with TLS once more that hands are shaken."""
        shaking: TlsHandshakes | None = self._state.handshakes
        if shaking is not None and shaking.awaited(transport):
            if len(self.connections) + len(shaking) >= self._state.most_connections:
                count_refused(self._state, "face-full")
                abort_without_handshake(transport)
            else:
                shaking.begin(transport, self)
            return
        super().connection_made(transport)
        if len(self.connections) > self._state.most_connections:
            self._refuse("face-full")
        else:
            self._looking = self.loop.call_later(ASKED_WITHIN_S, self._look)

    def connection_lost(self, exc: Exception | None) -> None:
        self._stop_looking()
        super().connection_lost(exc)

    def handle_websocket_upgrade(self, event: Request) -> None:
        self._stop_looking()
        super().handle_websocket_upgrade(event)

    @property
    def _state(self) -> Any:
        return cast(FastAPI, self.config.app).state

    def _look(self) -> None:
        """End a connection on which nothing was asked, or not to the end, since the last look."""
        cycle: Any = self.cycle
        answered = cycle is None or cycle.response_complete
        seen, self._seen = self._seen, (cycle, answered)
        if seen == self._seen and (answered or cycle.more_body):
            self._refuse("face-idle")
            return
        self._looking = self.loop.call_later(ASKED_WITHIN_S, self._look)

    def _stop_looking(self) -> None:
        if self._looking:
            self._looking.cancel()

    def _refuse(self, reason: str) -> None:
        count_refused(self._state, reason)
        self.transport.abort()


def count_refused(state: Any, reason: str) -> None:
    state.measures.count("deconflict_connections_refused_total", reason)


class FaceServer(uvicorn.Server):
    """Leaves signals to the process it runs in; set `should_exit` to end it."""

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


def face_server(app: FastAPI, certificates: Certificates | None = None) -> FaceServer:
    """A server for `app`: `await face_server(app).serve([listening_socket])`.

    Pings go out and show a dead peer to the network stack; an unanswered one closes nothing, because a slow
    subscriber answers only when it has read what lies before it. Advisories are small and many readers would each
    have them compressed anew, so they are not compressed.
    """
    app.state.most_connections = max(max_open_files() - SPARE_FILES, 1)
    handshakes = None
    if certificates:
        handshakes = TlsHandshakes(certificates, HANDSHAKE_S, partial(count_refused, app.state, "face-tls-failed"))
    app.state.handshakes = handshakes
    return FaceServer(
        uvicorn.Config(
            app,
            http=FaceProtocol,
            ws=StreamProtocol,
            backlog=ACCEPTED_AT_ONCE,
            ws_max_size=MAX_SAID_BYTES,
            ws_ping_timeout=None,
            ws_per_message_deflate=False,
            log_config=None,
            access_log=False,
            lifespan="off",
            timeout_graceful_shutdown=SHUTDOWN_S,
        ),
        handshakes,
    )
