"""The TLS handshakes of a port: counted as connections, ended when they take too long, and counted when they fail.

asyncio alone does not tell a protocol of a handshake that does not end, and waits a minute for it.
"""

import asyncio
from collections.abc import Callable

from ingest.security.certificates import Certificates
from ingest.security.refused_clients import RefusedClients


class TlsHandshakes:
    """The handshakes in progress. Each ends in a connection or in a call of `failed`."""

    def __init__(self, certificates: Certificates, within_s: float, failed: Callable[[], None]) -> None:
        self._certificates, self._within_s, self._failed = certificates, within_s, failed
        self._refused = RefusedClients()
        self._tasks: set[asyncio.Task[None]] = set()

    def __len__(self) -> int:
        return len(self._tasks)

    def begin(self, transport: asyncio.Transport, protocol: asyncio.Protocol) -> asyncio.Task[None]:
        """Begin a handshake. After it `protocol` gets the connection; before, it is not called."""
        early = _EarlyData()
        transport.set_protocol(early)
        transport.pause_reading()
        task = asyncio.create_task(self._perform(transport, early, protocol))
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)
        return task

    def close(self) -> None:
        """Cancel the handshakes in progress."""
        for task in self._tasks:
            task.cancel()

    async def _perform(self, transport: asyncio.Transport, early: "_EarlyData", protocol: asyncio.Protocol) -> None:
        try:
            encrypted = await asyncio.get_running_loop().start_tls(
                transport,
                early,
                self._certificates.context,
                server_side=True,
                ssl_handshake_timeout=self._within_s,
            )
        except OSError as error:
            encrypted = None
            address = (transport.get_extra_info("peername") or ("",))[0]
            self._refused.note(str(address), f"the TLS handshake failed: {error or type(error).__name__}")
        if encrypted is None:
            self._failed()
        elif not early.ended:
            encrypted.set_protocol(protocol)
            protocol.connection_made(encrypted)
            for data in early.data:
                protocol.data_received(data)


class _EarlyData(asyncio.Protocol):
    """Keeps the data that arrives together with the end of a handshake, until the protocol gets the connection."""

    def __init__(self) -> None:
        self.data: list[bytes] = []
        self.ended = False

    def data_received(self, data: bytes) -> None:
        self.data.append(data)

    def connection_lost(self, _: Exception | None) -> None:
        self.ended = True


def abort_without_handshake(transport: asyncio.Transport) -> None:
    """End a connection whose handshake has not begun. Its protocol is not called."""
    transport.set_protocol(_EarlyData())
    transport.abort()
