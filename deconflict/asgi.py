"""How the operator face is served: uvicorn, set up for subscribers that stay for days and some that get stuck."""

from collections.abc import Iterator
from contextlib import contextmanager

import uvicorn
from fastapi import FastAPI
from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol

MAX_SAID_BYTES = 4096
"""Largest message accepted from a subscriber; none is expected."""
SHUTDOWN_S = 2


class AbortingWebSocket(WebSocketsSansIOProtocol):
    """Ends a connection whose handler has returned without a closing handshake.

    uvicorn closes it once everything is written, which a peer that has stopped reading never lets happen.
    """

    async def run_asgi(self) -> None:
        await super().run_asgi()
        if self.close_timer is None:
            self.transport.abort()


class FaceServer(uvicorn.Server):
    """Leaves signals to the process it runs in; set `should_exit` to end it."""

    @contextmanager
    def capture_signals(self) -> Iterator[None]:
        yield


def face_server(app: FastAPI) -> FaceServer:
    """A server for `app`: `await face_server(app).serve([listening_socket])`.

    Pings go out and show a dead peer to the network stack; an unanswered one closes nothing, because a slow
    subscriber answers only when it has read what lies before it. Advisories are small and many readers would each
    have them compressed anew, so they are not compressed.
    """
    return FaceServer(
        uvicorn.Config(
            app,
            ws=AbortingWebSocket,
            ws_max_size=MAX_SAID_BYTES,
            ws_ping_timeout=None,
            ws_per_message_deflate=False,
            log_config=None,
            access_log=False,
            lifespan="off",
            timeout_graceful_shutdown=SHUTDOWN_S,
        )
    )
