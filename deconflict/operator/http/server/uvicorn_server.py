"""The uvicorn server of the operators' port, set up for subscribers that stay for days and some that hang."""

import socket
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial

import uvicorn
from fastapi import FastAPI

from deconflict.operator.http.server.server_protocols import HttpProtocol, WebSocketProtocol, count_refused
from ingest.port.connection_limits import max_open_files
from ingest.port.connection_shares import Newcomers
from ingest.security.certificates import Certificates
from ingest.security.tls_handshakes import TlsHandshakes

MOST_MESSAGE_BYTES = 4096
"""Largest message accepted from a subscriber; none is expected."""
MOST_HEAD_BYTES = 1 << 16
"""Largest head of a request that comes in pieces. A browser sends the cookies of all services of the host."""
SHUTDOWN_S = 2
HANDSHAKE_S = 5.0
"""A TLS handshake that takes longer is ended."""
SPARE_FILES = 200
"""File descriptors that are kept free for everything except clients: store, other roles, outlets, black boxes."""


ACCEPTED_AT_ONCE = 100
"""Most connections that are accepted before the first of them can be refused. They use spare descriptors."""


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
    app.state.places.most = max(max_open_files() - SPARE_FILES, 1)
    handshakes = None
    if certificates:
        handshakes = TlsHandshakes(certificates, HANDSHAKE_S, partial(count_refused, app.state, "face-tls-failed"))
    app.state.handshakes, app.state.newcomers = handshakes, Newcomers()
    return OperatorServer(
        uvicorn.Config(
            app,
            http=HttpProtocol,
            ws=WebSocketProtocol,
            backlog=ACCEPTED_AT_ONCE,
            h11_max_incomplete_event_size=MOST_HEAD_BYTES,
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
