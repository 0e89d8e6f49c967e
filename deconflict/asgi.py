"""How the operator face is served: uvicorn, set up for subscribers that stay for days and some that get stuck."""

import socket
from asyncio import BaseTransport
from collections.abc import Iterator
from contextlib import contextmanager

import uvicorn
from fastapi import FastAPI
from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol

from ingest.certificates import Certificates

MAX_SAID_BYTES = 4096
"""Largest message accepted from a subscriber; none is expected."""
SHUTDOWN_S = 2


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


class FaceServer(uvicorn.Server):
    """Leaves signals to the process it runs in; set `should_exit` to end it."""

    @contextmanager
    def capture_signals(self) -> Iterator[None]:
        yield


def face_server(app: FastAPI, certificates: Certificates | None = None) -> FaceServer:
    """A server for `app`: `await face_server(app).serve([listening_socket])`.

    Pings go out and show a dead peer to the network stack; an unanswered one closes nothing, because a slow
    subscriber answers only when it has read what lies before it. Advisories are small and many readers would each
    have them compressed anew, so they are not compressed.
    """
    return FaceServer(
        uvicorn.Config(
            app,
            ws=StreamProtocol,
            ws_max_size=MAX_SAID_BYTES,
            ws_ping_timeout=None,
            ws_per_message_deflate=False,
            log_config=None,
            access_log=False,
            lifespan="off",
            ssl_context_factory=(lambda *_: certificates.context) if certificates else None,
            timeout_graceful_shutdown=SHUTDOWN_S,
        )
    )
