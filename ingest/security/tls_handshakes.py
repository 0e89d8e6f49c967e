"""TLS handshakes of a port: held within its connections, ended when they take too long, and counted where they fail.

asyncio alone tells a protocol of no handshake that does not end, and waits a minute for it.
"""

import asyncio
from collections.abc import Callable

from ingest.security.certificates import Certificates


class TlsHandshakes:
    """Those that go on at one port. Each ends in a connection, or in `failed`."""

    def __init__(self, certificates: Certificates, within_s: float, failed: Callable[[], None]) -> None:
        self._certificates, self._within_s, self._failed = certificates, within_s, failed
        self._tasks: set[asyncio.Task[None]] = set()

    def __len__(self) -> int:
        return len(self._tasks)

    def awaited(self, transport: asyncio.BaseTransport) -> bool:
        """Whether a connection is as it was accepted, so that its handshake is yet to begin."""
        return transport.get_extra_info("sslcontext") is None

    def begin(self, transport: asyncio.Transport, protocol: asyncio.Protocol) -> None:
        """Make `protocol` a connection once hands are shaken; until then it is told nothing."""
        early = _Early()
        transport.set_protocol(early)
        transport.pause_reading()
        task = asyncio.create_task(self._shake(transport, early, protocol))
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    def close(self) -> None:
        """End those that go on."""
        for task in self._tasks:
            task.cancel()

    async def _shake(self, transport: asyncio.Transport, early: "_Early", protocol: asyncio.Protocol) -> None:
        try:
            encrypted = await asyncio.get_running_loop().start_tls(
                transport,
                early,
                self._certificates.context,
                server_side=True,
                ssl_handshake_timeout=self._within_s,
            )
        except OSError:
            encrypted = None
        if encrypted is None:
            self._failed()
        elif not early.ended:
            encrypted.set_protocol(protocol)
            protocol.connection_made(encrypted)
            for data in early.data:
                protocol.data_received(data)


class _Early(asyncio.Protocol):
    """Keeps what comes with the end of a handshake for who is told a moment later."""

    def __init__(self) -> None:
        self.data: list[bytes] = []
        self.ended = False

    def data_received(self, data: bytes) -> None:
        self.data.append(data)

    def connection_lost(self, _: Exception | None) -> None:
        self.ended = True


def turn_away(transport: asyncio.Transport) -> None:
    """End a connection whose handshake was not begun; its protocol is told nothing."""
    transport.set_protocol(_Early())
    transport.abort()
