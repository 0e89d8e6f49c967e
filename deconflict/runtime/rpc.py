"""Calls between the service's own processes, over Unix sockets in a directory that only its user can enter.

A frame is a length of four bytes, big-endian, and that many bytes. A request is a name, a newline and a payload. The
reply is a payload. Calls on one connection are answered in order.
"""

import asyncio
import logging
import socket
import struct
from collections.abc import AsyncIterator, Awaitable, Callable, Mapping
from contextlib import asynccontextmanager
from pathlib import Path

log = logging.getLogger(__name__)

HEADER = struct.Struct(">I")
CALL_TIMEOUT_S = 10.0
SEND_BUFFER_BYTES = 1 << 22
"""Size of the kernel's send buffer, as far as net.core.wmem_max allows. The rest of a reply waits for the next
iterations of the event loop, which are slow in a role under load."""
ACCEPTING_STEPS = 3
"""So many steps of the event loop after a connection was accepted it is begun."""

Handler = Callable[[bytes], Awaitable[bytes]]


class LinkDownError(ConnectionError):
    """The called role does not answer."""

    def __init__(self, role: str) -> None:
        super().__init__(f"the {role} does not answer")
        self.role = role


@asynccontextmanager
async def listening(path: Path, handlers: Mapping[str, Handler]) -> AsyncIterator[None]:
    """Answer calls at `path`, and replace the socket of an earlier process. Ends all connections at exit."""
    connections: dict[asyncio.Task[None], asyncio.StreamWriter] = {}

    def begin_connection(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        task = asyncio.create_task(_serve_connection(reader, writer, handlers))
        connections[task] = writer
        task.add_done_callback(end_connection)

    def end_connection(task: asyncio.Task[None]) -> None:
        connections.pop(task).close()  # here, as a task that ends before it runs closes nothing

    path.unlink(missing_ok=True)
    server = await asyncio.start_unix_server(begin_connection, path)
    try:
        yield
    finally:
        for listener in server.sockets:
            asyncio.get_running_loop().remove_reader(listener)
        for _ in range(ACCEPTING_STEPS):  # a server that is closed before leaves them open
            await asyncio.sleep(0)
        server.close()
        await _end_connections(connections)


async def _serve_connection(
    reader: asyncio.StreamReader, writer: asyncio.StreamWriter, handlers: Mapping[str, Handler]
) -> None:
    writer.get_extra_info("socket").setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SEND_BUFFER_BYTES)
    try:
        while True:
            name, _, payload = (await _read(reader)).partition(b"\n")
            reply = await handlers[name.decode()](payload)
            writer.write(HEADER.pack(len(reply)) + reply)
            await writer.drain()
    except (asyncio.IncompleteReadError, ConnectionError, asyncio.CancelledError):
        pass  # the caller has disconnected, or this role ends
    except Exception:
        log.exception("a call failed; its caller will try again")


async def _end_connections(connections: Mapping[asyncio.Task[None], asyncio.StreamWriter]) -> None:
    writers = list(connections.values())
    for task in connections:
        task.cancel()
    await asyncio.gather(*connections, return_exceptions=True)
    for writer in writers:
        writer.transport.abort()  # a caller that reads no more delays no end
    await asyncio.gather(*(writer.wait_closed() for writer in writers), return_exceptions=True)


async def _read(reader: asyncio.StreamReader) -> bytes:
    (length,) = HEADER.unpack(await reader.readexactly(HEADER.size))
    return await reader.readexactly(length)


class Caller:
    """Blocking calls to a role. Connects at the first call, and again after a failure."""

    def __init__(self, directory: Path, role: str) -> None:
        self._path, self._role = socket_path(directory, role), role
        self._socket: socket.socket | None = None

    def call(self, name: str, payload: bytes = b"") -> bytes:
        """Raises `LinkDownError`. The role may have carried out a call that failed."""
        try:
            if self._socket is None:
                self._socket = socket.socket(socket.AF_UNIX)
                self._socket.settimeout(CALL_TIMEOUT_S)
                self._socket.connect(str(self._path))
            body = name.encode() + b"\n" + payload
            self._socket.sendall(HEADER.pack(len(body)) + body)
            (length,) = HEADER.unpack(self._receive(self._socket, HEADER.size))
            return self._receive(self._socket, length)
        except OSError as error:
            self.close()
            raise LinkDownError(self._role) from error

    def close(self) -> None:
        if self._socket:
            self._socket.close()
        self._socket = None

    def _receive(self, connected: socket.socket, length: int) -> bytes:
        received = bytearray()
        while len(received) < length:
            part = connected.recv(min(length - len(received), 1 << 20))
            if not part:
                raise ConnectionResetError
            received += part
        return bytes(received)


class AsyncCaller:
    """The same for an event loop. Each call has a connection of its own."""

    def __init__(self, directory: Path, role: str) -> None:
        self._path, self._role = socket_path(directory, role), role

    async def call(self, name: str, payload: bytes = b"", within_s: float = CALL_TIMEOUT_S) -> bytes:
        """Raises `LinkDownError`."""
        try:
            async with asyncio.timeout(within_s):
                reader, writer = await asyncio.open_unix_connection(self._path)
                try:
                    body = name.encode() + b"\n" + payload
                    writer.write(HEADER.pack(len(body)) + body)
                    return await _read(reader)
                finally:
                    writer.close()
        except (OSError, TimeoutError, asyncio.IncompleteReadError) as error:
            raise LinkDownError(self._role) from error


def socket_path(directory: Path, role: str) -> Path:
    return directory / f"{role}.sock"
