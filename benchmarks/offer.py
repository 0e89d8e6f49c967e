"""A load: robots of several vendors that report once a second with ten points of path, over real sockets.

If the floor has docks, each robot also announces when it will be at a dock, which it shares with nine others. It drives
on in any case, and then announces another time. Every tenth circle then touches its neighbour in a crossing for one
robot.

The load is open loop: a message is sent when it is due, even if the service is late. The generator reports its own
lateness, so that it is not mistaken for that of the service. The generator uses little processor time, because it may
share the cores of the service: every frame has the same length and is masked with zeros; for all due messages together
only the changed digits are written; and each frame is one call of `send`. Each message is sent on its own when it is
due, as from real robots.
"""

import asyncio
import json
import os
import socket
import struct
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from multiprocessing.connection import Connection as PipeConnection
from urllib.parse import urlsplit
from uuid import UUID, uuid5

import numpy as np
from numpy.typing import NDArray

from deconflict.settings.shared_places import Resource, Zone
from ingest.batch import Floats

DATUM = "0d6f4f0e-9d0c-4a6f-8a55-0c9f5f4a1b01"
ROBOTS = UUID("3f0d9a52-9a64-4f55-8a3c-4a8f4d1f7b10")
VENDORS = ("Alder", "Basalt", "Corvid", "Dune")
SPACING_M, RADIUS_M, MARGIN_M = 6.8, 3.0, 10.0
APART_M, PAIRS_EVERY = 8.5, 5
"""Spacing on a calm floor, where of so many circles in a row two nearly touch."""
SLICE_S = 0.02
ROBOTS_A_CONNECTION, OPENED_AT_ONCE = 10, 20
ROBOTS_A_DOCK, DOCK_EVERY_S, DOCKED_S = 10, 600.0, 30.0
"""Number of robots for each dock, how often each goes there, and for how long."""
CROSSING_M = 1.2
"""Half side of a crossing."""
RETRY_S, HANDSHAKE_S = 0.2, 10.0
HANDSHAKE = (
    "GET {path} HTTP/1.1\r\nHost: {host}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
    "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Version: 13\r\n\r\n"
)

Bytes = NDArray[np.uint8]

STAMP = b"2026-01-01T00:00:00.000Z"
METRES, UNITS = b"000.000", b" 0.000000"
_POSE = b'"x":%b,"y":%b,"angle":{"x":0,"y":0,"z":%b,"w":%b}' % (METRES, METRES, UNITS, UNITS)
POINTS = 10
_POINT = b'{"timestamp":"%b",%b,"planarDatumUUID":"%b"}' % (STAMP, _POSE, DATUM.encode())
STATUS = (
    b'{"uuid":"%b","timestamp":"%b","operationalState":"navigating","location":{%b,"planarDatum":"%b"},'
    b'"velocity":{"linear":%b},"path":[%b],"destinations":[%b]}'
    % (bytes(36), STAMP, _POSE, DATUM.encode(), METRES, b",".join([_POINT] * POINTS), _POINT)
)
"""The text of every status. Values that differ are written over it with the same length."""
_TEXT = np.frombuffer(STATUS, np.uint8)
_TEXT_WITHOUT_DOCKS = np.append(_TEXT[: STATUS.index(b',"destinations"')], _TEXT[-1])
_THREE = np.array([list(b"%03d" % n) for n in range(1000)], np.uint8)
_LEADING = np.array([list(b"%3d" % n) for n in range(1000)], np.uint8)


def _places(of: bytes) -> NDArray[np.int64]:
    """(f, w) columns of the f places in the status at which the text `of` stands, w characters long."""
    found, at = [], STATUS.find(of)
    while at >= 0:
        found.append(range(at, at + len(of)))
        at = STATUS.find(of, at + len(of))
    return np.array(found)


_UUID_AT, _STAMPS_AT, _METRES_AT, _UNITS_AT = map(_places, (bytes(36), STAMP, METRES, UNITS))
_DATUMS_AT = _places(DATUM.encode())
_SPEED_AT = _places(b'"linear":' + METRES)[:, len(b'"linear":') :]
_POSITIONS_AT = _METRES_AT[~np.isin(_METRES_AT, _SPEED_AT).any(axis=1)]
_DOCK_POSITION_AT, _DOCK_UNITS_AT = _POSITIONS_AT[-2:], _UNITS_AT[-2:]
_POSITIONS_AT, _UNITS_AT = _POSITIONS_AT[:-2], _UNITS_AT[:-2]
_DOCK_STAMP_AT, _STAMPS_AT = _STAMPS_AT[-1], _STAMPS_AT[:-1]


def datum_of(floor: int) -> str:
    """The datum of a floor by its number."""
    return str(uuid5(ROBOTS, f"floor {floor}")) if floor else DATUM


def vendor_of(robot: int) -> str:
    """The vendor of a robot. Each connection is of one vendor's robots and names it, so each vendor has its own
    limit."""
    return VENDORS[robot // ROBOTS_A_CONNECTION % len(VENDORS)]


@dataclass(slots=True)
class Offered:
    """The figures of a load. Times are in seconds."""

    connections: int = 0
    sent: int = 0
    broken: int = 0
    """Connections that the service closed. Each is opened again."""
    unsent: int = 0
    """Messages that were due while their connection was closed."""
    late_s: float = 0.0
    """The greatest delay of a message after it was due."""
    core_s: float = 0.0
    seconds: float = 0.0
    """Duration from the first due message."""


class Circling:
    """n robots, each on its own circle. The circles of neighbours nearly touch, so some robots always meet."""

    def __init__(self, robots: int, seed: int = 1, *, docks: bool = False, floor: int = 0, calm: bool = False) -> None:
        """`floor` is the number of their floor: robots of two floors have different names. On a calm one few meet."""
        rng = np.random.default_rng([seed, floor] if floor else seed)
        self.x, self.y = (calm_middles if calm else middles)(robots).T
        self.turn_radps = rng.uniform(0.15, 0.4, robots) * rng.choice([-1, 1], robots)
        self.angle = rng.uniform(0, 2 * np.pi, robots)
        self.due_s = rng.uniform(0, 1, robots)
        """(n,) time within each second at which a robot reports."""
        self.uuids = [str(uuid5(ROBOTS, f"{floor} {i}" if floor else str(i))) for i in range(robots)]
        self._docks = docks
        self._texts = (_TEXT if docks else _TEXT_WITHOUT_DOCKS)[None, :].repeat(robots, axis=0)
        self.length = self._texts.shape[1]
        """Length of a status in bytes."""
        self._texts[:, _DATUMS_AT if docks else _DATUMS_AT[:-1]] = list(datum_of(floor).encode())
        self._texts[:, _UUID_AT[0]] = [list(uuid.encode()) for uuid in self.uuids]
        self._texts[:, _SPEED_AT] = _metres(RADIUS_M * np.abs(self.turn_radps))[:, None]
        if docks:
            self._texts[:, _DOCK_POSITION_AT] = _metres(docks_m(robots)[np.arange(robots) // ROBOTS_A_DOCK])
            self._texts[:, _DOCK_UNITS_AT] = _units(np.array([0.0, 1.0]))
        self._docks_s = rng.uniform(0, DOCK_EVERY_S, robots)
        """(n,) when each robot will be at its dock, since the start."""
        self._unwritten = np.ones(robots, bool)
        """(n,) whether that time is not in its text yet."""

    def poses(self, robots: NDArray[np.int64], t_s: Floats) -> tuple[Floats, Floats, Floats]:
        """x, y and yaw of `robots` (m,) at `t_s` (k,), each (m, k)."""
        angle = self.angle[robots, None] + self.turn_radps[robots, None] * t_s
        yaw = angle + np.sign(self.turn_radps[robots, None]) * np.pi / 2
        x, y = self.x[robots, None] + RADIUS_M * np.cos(angle), self.y[robots, None] + RADIUS_M * np.sin(angle)
        return x, y, yaw

    def identity(self, robot: int) -> str:
        return json.dumps(
            {
                "uuid": self.uuids[robot],
                "timestamp": _stamp(time.time()),
                "manufacturerName": vendor_of(robot),
                "robotModel": "M1",
                "robotSerialNumber": f"R-{robot}",
                "baseRobotEnvelope": {"x": 1.0, "y": 0.6, "z": 1.0},
            }
        )

    def statuses(self, robots: NDArray[np.int64], began_s: float, now_s: float) -> list[bytes]:
        """A status of each robot, as of `now_s`, epoch seconds."""
        ahead_s = np.arange(POINTS + 1, dtype=np.float64)
        x, y, yaw = self.poses(robots, now_s - began_s + ahead_s)
        if self._docks:
            self._write_docks(robots, began_s, now_s)
        texts = self._texts[robots]
        texts[:, _STAMPS_AT] = [list(_stamp(now_s + after_s).encode()) for after_s in ahead_s]
        texts[:, _POSITIONS_AT] = _metres(np.stack([x, y], axis=2).reshape(len(robots), 2 * (POINTS + 1)))
        texts[:, _UNITS_AT] = _units(
            np.stack([np.sin(yaw / 2), np.cos(yaw / 2)], axis=2).reshape(len(robots), 2 * (POINTS + 1))
        )
        every, length = texts.tobytes(), self.length
        return [every[at : at + length] for at in range(0, len(every), length)]

    def _write_docks(self, robots: NDArray[np.int64], began_s: float, now_s: float) -> None:
        """Write the times at which robots will be at their docks, if they are new."""
        late = robots[began_s + self._docks_s[robots] <= now_s]
        self._docks_s[late] += DOCK_EVERY_S
        self._unwritten[late] = True
        new = robots[self._unwritten[robots]]
        self._unwritten[new] = False
        if len(new):
            stamps = [list(_stamp(began_s + docks_s).encode()) for docks_s in self._docks_s[new].tolist()]
            self._texts[new[:, None], _DOCK_STAMP_AT] = stamps


def places(robots: int) -> tuple[tuple[Resource, ...], tuple[Zone, ...]]:
    """The docks and crossings of a floor for `robots` robots."""
    docks = tuple(
        Resource(id=f"dock-{n}", kind="dock", datum=DATUM, polygon=_square(x, y, 0.25), service_s=DOCKED_S)
        for n, (x, y) in enumerate(docks_m(robots).tolist())
    )
    middles_m = middles(robots)[::ROBOTS_A_DOCK] + np.array([SPACING_M / 2, 0.0])
    crossings = tuple(
        Zone(id=f"crossing-{n}", kind="crossing", datum=DATUM, polygon=_square(x, y, CROSSING_M))
        for n, (x, y) in enumerate(middles_m.tolist())
    )
    return docks, crossings


def middles(robots: int) -> Floats:
    """(robots, 2) centres of their circles."""
    across, every = int(np.ceil(np.sqrt(robots))), np.arange(robots)
    return MARGIN_M + SPACING_M * np.column_stack([every % across, every // across]).astype(np.float64)


def calm_middles(robots: int) -> Floats:
    """The same for a floor on which a tenth as many circles nearly touch."""
    across, every = int(np.ceil(np.sqrt(robots))), np.arange(robots)
    columns, rows = every % across, every // across
    x_m = APART_M * columns - (APART_M - SPACING_M) * (columns // PAIRS_EVERY)
    return MARGIN_M + np.column_stack([x_m, APART_M * rows])


def docks_m(robots: int) -> Floats:
    """(docks, 2) positions of the docks along one wall."""
    count = -(-robots // ROBOTS_A_DOCK)
    return np.column_stack([np.linspace(1.0, MARGIN_M + SPACING_M * np.sqrt(robots), count), np.full(count, 2.0)])


def _square(x: float, y: float, half_m: float) -> tuple[tuple[float, float], ...]:
    return tuple((x + u * half_m, y + v * half_m) for u, v in ((-1, -1), (1, -1), (1, 1), (-1, 1)))


async def offer(url: str, world: Circling, seconds: float, ended: Callable[[], bool]) -> Offered:
    """Connect, send the identities, then send statuses for `seconds` or until `ended`."""
    offered, began_core_s, robots = Offered(), time.process_time(), len(world.uuids)
    groups = np.array_split(np.arange(robots), -(-robots // ROBOTS_A_CONNECTION))
    connections = [
        RobotConnection(f"{url}/{vendor_of(group[0])}", [world.identity(robot) for robot in group.tolist()], offered)
        for group in groups
    ]
    connection_of = [connection for connection, group in zip(connections, groups, strict=True) for _ in group]
    for at in range(0, len(connections), OPENED_AT_ONCE):
        await asyncio.gather(*(connection.open() for connection in connections[at : at + OPENED_AT_ONCE]))
    offered.connections = len(connections)
    began_s, done_s, head = time.time(), 0.0, frame_head(world.length)
    while done_s < seconds and not ended():
        await asyncio.sleep(max(began_s + done_s + SLICE_S - time.time(), 0.0))
        now_s = time.time()
        elapsed_s = min(now_s - began_s, seconds)
        due = np.flatnonzero(np.floor(elapsed_s - world.due_s) > np.floor(done_s - world.due_s))
        offered.late_s = max(offered.late_s, elapsed_s - done_s)
        for robot, status in zip(due.tolist(), world.statuses(due, began_s, now_s), strict=True):
            connection_of[robot].send(head + status)
        done_s = elapsed_s
    for connection in connections:
        connection.close()
    offered.core_s, offered.seconds = time.process_time() - began_core_s, time.time() - began_s
    return offered


class RobotConnection:
    """One connection. It is opened again after every loss, each time with the identities of its robots."""

    def __init__(self, url: str, identities: list[str], offered: Offered) -> None:
        parts = urlsplit(url)
        self._address = parts.hostname or "", parts.port or 0
        hello = HANDSHAKE.format(path=parts.path, host=parts.netloc).encode()
        self._hello, self._identities = (
            hello,
            b"".join(frame_head(len(identity)) + identity.encode() for identity in identities),
        )
        self._offered = offered
        self._socket: socket.socket | None = None
        self._held = b""
        """Bytes that the other end has not accepted yet."""
        self._opening: asyncio.Task[None] | None = None

    async def open(self) -> None:
        """Connect and send the identities, with as many attempts as needed."""
        while self._socket is None:
            new = socket.socket()
            new.setblocking(False)
            new.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            try:
                async with asyncio.timeout(HANDSHAKE_S):
                    await self._greet(new)
            except (OSError, TimeoutError):
                new.close()
                await asyncio.sleep(RETRY_S)
            else:
                self._socket, self._held = new, self._identities

    def send(self, frame: bytes) -> None:
        if self._socket is None:
            self._offered.unsent += 1
            return
        data = self._held + frame if self._held else frame
        try:
            self._held = data[self._socket.send(data) :]
        except BlockingIOError:
            self._held = data
        except OSError:
            self._offered.broken += 1
            self.close()
            self._opening = asyncio.create_task(self.open())
            return
        self._offered.sent += 1

    def close(self) -> None:
        if self._opening:
            self._opening.cancel()
        if self._socket:
            self._socket.close()
        self._socket = None

    async def _greet(self, new: socket.socket) -> None:
        loop = asyncio.get_running_loop()
        await loop.sock_connect(new, self._address)
        await loop.sock_sendall(new, self._hello)
        reply = await loop.sock_recv(new, 4096)
        if not reply.startswith(b"HTTP/1.1 101 "):
            raise ConnectionRefusedError(reply)


def serve(
    parent: PipeConnection, url: str, robots: int, seconds: float, core: int | None = None, *, docks: bool = False
) -> None:
    """Run the load in this process, to the end or until `parent` sends anything. Sends it the figures."""
    if core is not None:
        os.sched_setaffinity(0, {core})
    parent.send(asdict(asyncio.run(offer(url, Circling(robots, docks=docks), seconds, parent.poll))))


def frame_head(length: int) -> bytes:
    """The head of a client's text frame. The mask is zero, which leaves the text unchanged."""
    return struct.pack("!BBH4x", 0x81, 0x80 | 126, length)


def _stamp(t_s: float) -> str:
    return datetime.fromtimestamp(t_s, UTC).isoformat(timespec="milliseconds").replace("+00:00", "Z")


def _metres(values: Floats) -> Bytes:
    """(..., 7) characters of `values`, 0 to 999.999, with three decimals."""
    thousandths = np.rint(values * 1000).astype(np.int64)
    point = np.full((*values.shape, 1), ord("."), np.uint8)
    return np.concatenate([_LEADING[thousandths // 1000], point, _THREE[thousandths % 1000]], axis=-1)


def _units(values: Floats) -> Bytes:
    """(..., 9) characters of `values`, -1 to 1, with six decimals."""
    millionths = np.rint(np.abs(values) * 1e6).astype(np.int64)
    characters = np.empty((*values.shape, 9), np.uint8)
    characters[..., 0] = np.where(values < 0, ord("-"), ord(" "))
    characters[..., 1], characters[..., 2] = ord("0") + millionths // 1_000_000, ord(".")
    characters[..., 3:6], characters[..., 6:] = _THREE[millionths // 1000 % 1000], _THREE[millionths % 1000]
    return characters
