"""Limits on the connections of a port: by open files, before a connection is admitted, and by TCP keepalive."""

import asyncio
import errno
import logging
import resource
import socket as sockets
from collections.abc import Callable
from typing import Any, cast

from ingest.port.connection_shares import Newcomers
from ingest.port.frame_cutter import FrameCuttingConnection, FrameCuttingServer
from ingest.security.tls_handshakes import TlsHandshakes, abort_without_handshake

SPARE_FILES = 200
"""File descriptors left for everything but robots."""
HANDSHAKE_FILES = 80
"""Of those, descriptors for connections that are not yet admitted or refused. An accept takes up to 100 at once."""

UNREAD_BYTES = 1 << 17
"""The kernel keeps about twice as much for a connection that is not read. By default it is some megabytes: a flood of
small messages would have to be read for minutes after its end."""
KEEPALIVE = {"TCP_KEEPIDLE": 30, "TCP_KEEPINTVL": 10, "TCP_KEEPCNT": 6}
"""Seconds until the first probe of a silent peer, seconds between probes, and unanswered probes to give up after."""

log = logging.getLogger(__name__)


class BoundedConnection(FrameCuttingServer):
    """Ends another handshake, or itself, if there are `most` TCP connections: accepting never runs out of descriptors.

    If it did, asyncio would log a traceback for each waiting connection and try again every second.
    """

    def __init__(
        self,
        *args: Any,
        most: Callable[[], int],
        refused: Callable[[], None],
        newcomers: Newcomers,
        handshakes: TlsHandshakes | None,
        **kwargs: Any,
    ) -> None:
        super().__init__(*args, **kwargs)
        self._most, self._refused, self._newcomers, self._handshakes = most, refused, newcomers, handshakes
        self._accepted: asyncio.Transport | None = None

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Called when the connection is accepted. With TLS it is called again after the handshake."""
        accepted, handshakes = cast(asyncio.Transport, transport), self._handshakes
        if self._accepted is not None:
            super().connection_made(accepted)
            return
        self._accepted = accepted
        has_room = self._has_room()
        if handshakes is not None and not has_room:
            abort_without_handshake(accepted)
            return
        self._newcomers.add(accepted)
        if handshakes is not None:
            handshakes.begin(accepted, self).add_done_callback(self._handshake_done)
            return
        super().connection_made(accepted)
        if not has_room:
            accepted.abort()

    def connection_lost(self, exc: Exception | None) -> None:
        self._end_as_newcomer()
        super().connection_lost(exc)

    def listen(self, listener: Callable[[bytes], None], read: Callable[[bytes], None] | None = None) -> None:
        self._end_as_newcomer()
        super().listen(listener, read)

    def _end_as_newcomer(self) -> None:
        if self._accepted is not None:
            self._newcomers.remove(self._accepted)

    def _handshake_done(self, _: object) -> None:
        if not hasattr(self, "transport"):  # it failed
            self._end_as_newcomer()

    def _has_room(self) -> bool:
        """Whether there is room for this connection, perhaps because another handshake has made it."""
        if len(self.server.handler_tasks) + len(self._handshakes or ()) < self._most():
            return True
        self._refused()
        return self._newcomers.end_one()


def connection_limit(wanted: int) -> int:
    """How many connections there may be: as many as wanted, but fewer if the limit of open files is lower."""
    files = max_open_files()
    limit = max(min(wanted, files - SPARE_FILES), 1)
    if limit < wanted:
        log.warning("at most %d connections, because %d files may be open; raise the limit of open files", limit, files)
    return limit


def max_open_files() -> int:
    """How many files this process may open, after raising its limit as far as it may."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    wanted = hard if hard != resource.RLIM_INFINITY else max(soft, 1 << 16)
    try:
        resource.setrlimit(resource.RLIMIT_NOFILE, (wanted, hard))
    except (ValueError, OSError):
        return soft
    return wanted


def count_failed_accepts(failed: Callable[[], None]) -> None:
    """Call `failed` each time the running event loop can't accept a connection for want of open files: each second."""
    logged: list[OSError] = []

    def handle(loop: asyncio.AbstractEventLoop, context: dict[str, Any]) -> None:
        error = context.get("exception")
        if not (isinstance(error, OSError) and error.errno in (errno.EMFILE, errno.ENFILE) and "socket" in context):
            loop.default_exception_handler(context)
            return
        failed()
        if not logged:
            logged.append(error)
            log.error("nobody can connect: %s; raise the limit of open files, this is logged once", error)

    asyncio.get_running_loop().set_exception_handler(handle)


def set_options(socket: FrameCuttingConnection) -> None:
    """Find a peer that has vanished without a word, and let one that is not read wait soon."""
    raw: sockets.socket | None = socket.transport.get_extra_info("socket")
    if raw is None or raw.fileno() < 0:
        return
    raw.setsockopt(sockets.SOL_SOCKET, sockets.SO_RCVBUF, UNREAD_BYTES)
    raw.setsockopt(sockets.SOL_SOCKET, sockets.SO_KEEPALIVE, 1)
    for name, value in KEEPALIVE.items():
        if option := getattr(sockets, name, None):
            raw.setsockopt(sockets.IPPROTO_TCP, option, value)
