"""Attackers that send what no robot sends, each in a process of its own, with plain sockets for speed."""

import json
import socket
import time
from collections.abc import Callable
from contextlib import AbstractContextManager, suppress
from dataclasses import dataclass
from multiprocessing.synchronize import Event

from websockets.frames import Frame, Opcode

from benchmarks.attack.courses import CROWD_VENDOR
from benchmarks.attack.own_process import in_own_process
from tests.helpers.saying import status

MOST_CONNECTIONS = 850
BYTES_PER_S = 2_000_000
"""How fast pings are sent."""
STEP_S = 0.02
LONG_BYTES = 60_000
HANDSHAKE = (
    "GET {path} HTTP/1.1\r\nHost: {host}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
    "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Version: 13\r\n\r\n"
)


@dataclass(frozen=True, slots=True)
class Target:
    """The two ports of a service, as HOST:PORT."""

    robots: str
    face: str


def control(_: Target, stop: Event) -> None:
    """Burn as much processor time as the others, and send nothing."""
    while not stop.is_set():
        sum(range(10_000))


def pings_to_the_stream(target: Target, stop: Event) -> None:
    """Small pings to the advisory stream, whose pongs are not read."""
    _flood(lambda: _web_socket(target.face, "/advisories/stream"), Frame(Opcode.PING, b"ping"), stop)


def pings_to_the_robots_port(target: Target, stop: Event) -> None:
    """The same to the robots' port."""
    _flood(lambda: _web_socket(target.robots, f"/{CROWD_VENDOR}"), Frame(Opcode.PING, b"ping"), stop)


def small_messages(target: Target, stop: Event) -> None:
    """Empty messages."""
    _flood(lambda: _web_socket(target.robots, f"/{CROWD_VENDOR}"), Frame(Opcode.TEXT, b""), stop)


def rejected_messages(target: Target, stop: Event) -> None:
    """Long messages that are no JSON, as fast as they are taken."""
    _send_messages(target, stop, lambda _: b"x" * LONG_BYTES)


def error_codes(target: Target, stop: Event) -> None:
    """Valid statuses with as many error codes as fit, as fast as they are taken."""
    _send_messages(target, stop, lambda t_s: status("codes", t_s, 400.0, 400.0, errorCodes=["a"] * 12_000))


def unknown_arrays(target: Target, stop: Event) -> None:
    """Valid statuses with an unknown key that holds thousands of arrays, as fast as they are taken."""
    arrays = json.loads("[" + ",".join(["[]"] * 14_000) + "]")
    _send_messages(target, stop, lambda t_s: status("arrays", t_s, 400.0, 400.0, more=arrays))


def unread_answers(target: Target, stop: Event) -> None:
    """Connections that ask for pages one after the other, and read nothing."""
    request = f"GET /openapi.json HTTP/1.1\r\nHost: {target.face}\r\n\r\n".encode() * 50
    held: list[socket.socket] = []
    while not stop.is_set():
        held = [connection for connection in held if _is_sent(connection, request)]
        while len(held) < MOST_CONNECTIONS and not stop.is_set():
            with suppress(OSError):
                held.append(_connected(target.face))
        time.sleep(STEP_S)


def many_connections(target: Target, stop: Event) -> None:
    """Robots' connections, as many as there are files, which send nothing."""
    held: list[socket.socket] = []
    while not stop.is_set():
        with suppress(OSError):
            held.append(_web_socket(target.robots, f"/{CROWD_VENDOR}"))
        if len(held) >= MOST_CONNECTIONS:
            held.pop(0).close()


def half_open_connections(target: Target, stop: Event) -> None:
    """Connections to the robots' port that never say a byte, opened again when they are ended."""
    held: list[socket.socket] = []
    while not stop.is_set():
        held = [connection for connection in held if _is_open(connection)]
        while len(held) < MOST_CONNECTIONS and not stop.is_set():
            with suppress(OSError):
                held.append(_connected(target.robots))
        time.sleep(STEP_S)


def quoted_cookies(target: Target, stop: Event) -> None:
    """Requests with a long cookie of quoted backslashes, one after the other."""
    cookie = 'deconflict_session="' + LONG_BYTES // 2 * "\\" + '"'
    request = f"GET /healthz HTTP/1.1\r\nHost: {target.face}\r\nCookie: {cookie}\r\n\r\n".encode()
    while not stop.is_set():
        with suppress(OSError), _connected(target.face) as connection:
            connection.settimeout(1.0)
            connection.sendall(request)
            connection.recv(4096)
        time.sleep(STEP_S)


FLOODS: dict[str, Callable[[Target, Event], None]] = {
    "control": control,
    "pings-stream": pings_to_the_stream,
    "pings-port": pings_to_the_robots_port,
    "small-messages": small_messages,
    "rejected": rejected_messages,
    "error-codes": error_codes,
    "unknown-arrays": unknown_arrays,
    "unread-answers": unread_answers,
    "connections": many_connections,
    "half-open": half_open_connections,
    "cookies": quoted_cookies,
}


def flooding(target: Target, attack: str, core: int | None = None) -> AbstractContextManager[None]:
    """Run an attack until the block ends."""
    return in_own_process(FLOODS[attack], target, core=core)


def _flood(opened: Callable[[], socket.socket], frame: Frame, stop: Event) -> None:
    """Send a frame again and again at `BYTES_PER_S`. A connection that is ended is opened again."""
    frame_bytes = frame.serialize(mask=True)
    data = frame_bytes * int(BYTES_PER_S * STEP_S / len(frame_bytes))
    while not stop.is_set():
        with suppress(OSError), opened() as connection:
            while not stop.is_set():
                connection.sendall(data)
                time.sleep(STEP_S)


def _send_messages(target: Target, stop: Event, message: Callable[[float], bytes]) -> None:
    while not stop.is_set():
        with suppress(OSError), _web_socket(target.robots, f"/{CROWD_VENDOR}") as connection:
            while not stop.is_set():
                connection.sendall(Frame(Opcode.TEXT, message(time.time())).serialize(mask=True))


def _connected(address: str) -> socket.socket:
    host, _, port = address.partition(":")
    connection = socket.create_connection((host, int(port)), timeout=1.0)
    connection.settimeout(0.2)
    return connection


def _web_socket(address: str, path: str) -> socket.socket:
    """A connection that has shaken hands."""
    connection = _connected(address)
    connection.settimeout(1.0)
    connection.sendall(HANDSHAKE.format(path=path, host=address).encode())
    answer = connection.recv(4096)
    if b" 101 " not in answer:
        connection.close()
        raise OSError(answer[:80])
    return connection


def _is_open(connection: socket.socket) -> bool:
    """False, and closed, if the other end has ended the connection."""
    connection.setblocking(False)
    try:
        if connection.recv(1):
            return True
    except BlockingIOError:
        return True
    except OSError:
        pass
    connection.close()
    return False


def _is_sent(connection: socket.socket, data: bytes) -> bool:
    """Send as much as the other end takes at once. False, and closed, if it has ended the connection."""
    connection.setblocking(False)
    try:
        connection.send(data)
    except BlockingIOError:
        return True
    except OSError:
        connection.close()
        return False
    return True
