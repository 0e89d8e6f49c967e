"""The simulated vendors' real sockets: everybody reports to a service as the world goes on, come what may."""

import asyncio
import time
from collections import Counter
from collections.abc import AsyncIterator, Sequence
from contextlib import AsyncExitStack, asynccontextmanager

import numpy as np
from websockets.asyncio.client import ClientConnection, connect
from websockets.asyncio.connection import Connection
from websockets.asyncio.server import serve
from websockets.exceptions import ConnectionClosed, WebSocketException

from deconflict.simulation.annex import Annex, split
from deconflict.simulation.cast import Member, VendorName, cast
from deconflict.simulation.driving.traffic import World
from deconflict.simulation.floor_layout import layout_for
from deconflict.simulation.robot_state import some_robots
from deconflict.simulation.vendors.dialects import DIALECTS
from ingest.batch import Ints

STEP_S = 0.1
BACKOFF_S = (0.25, 5.0)
"""First and longest wait before a lost connection is sought again."""
MOST_UNSENT = 2000
"""Messages that wait for a slow connection; beyond them new ones are forgotten."""
LATE_S = 2.0
"""A world that lags behind the clock by more than this does not try to catch up."""
SHY_S = 5.0
"""How long every other person's device says nothing of who it is."""
OWN_PATH = (VendorName.CORVID, VendorName.WALKERS)
"""Vendors that connect to a path of their name, so that they are known before any identity."""
PONG = 0x8A
"""First byte of a pong frame: final, opcode 10 (RFC 6455, 5.2)."""


class Unanswering(ClientConnection):
    """A client that never answers a ping, as the official sample sender does not."""

    def send_data(self) -> None:
        self.protocol.writes = [data for data in self.protocol.writes if data[:1] != bytes([PONG])]
        super().send_data()


class Line:
    """What one connection, or one listening fleet manager, has to send."""

    def __init__(self, vendor: VendorName) -> None:
        self.vendor = vendor
        self.introduced: set[int] = set()
        """Rows that have said who they are on this connection; in Corvid's case, ever."""
        self.sent = 0
        self._queues: set[asyncio.Queue[bytes]] = set()

    @property
    def up(self) -> bool:
        return bool(self._queues)

    def put(self, messages: Sequence[bytes]) -> None:
        """Send these to whoever is connected."""
        for queue in self._queues:
            for message in messages[: max(MOST_UNSENT - queue.qsize(), 0)]:
                queue.put_nowait(message)

    async def send_over(self, connection: Connection) -> None:
        """Send all that comes until the connection is lost."""
        queue: asyncio.Queue[bytes] = asyncio.Queue()
        self._queues.add(queue)
        if self.vendor is not VendorName.CORVID:
            self.introduced.clear()
        try:
            async with asyncio.TaskGroup() as both:
                heard = both.create_task(_hear(connection))
                sending = both.create_task(self._send(queue, connection))
                await asyncio.wait({heard, sending}, return_when=asyncio.FIRST_COMPLETED)
                heard.cancel()
                sending.cancel()
        finally:
            self._queues.discard(queue)

    async def _send(self, queue: asyncio.Queue[bytes], connection: Connection) -> None:
        try:
            while True:
                await connection.send((await queue.get()).decode())
                self.sent += 1
        except ConnectionClosed:
            return


async def _hear(connection: Connection) -> None:
    """Until the other side closes; whatever it says is of no interest."""
    try:
        async for _ in connection:
            pass
    except ConnectionClosed:
        return


async def call(url: str, line: Line, rng: np.random.Generator) -> None:
    """Keep a line to a service; wait longer after each attempt that fails. Ends only when cancelled."""
    wait_s = BACKOFF_S[0]
    kind = Unanswering if line.vendor is VendorName.CORVID else ClientConnection
    while True:
        try:
            async with connect(
                url, create_connection=kind, compression=None, ping_interval=None, proxy=None, close_timeout=1.0
            ) as connection:
                wait_s = BACKOFF_S[0]
                try:
                    await line.send_over(connection)
                finally:
                    await connection.close()
        except (OSError, WebSocketException):
            pass
        await asyncio.sleep(wait_s * rng.uniform(0.5, 1.0))
        wait_s = min(2 * wait_s, BACKOFF_S[1])


@asynccontextmanager
async def listening(line: Line, port: int) -> AsyncIterator[None]:
    """A fleet manager that services dial."""
    async with serve(line.send_over, "127.0.0.1", port, compression=None, ping_interval=None):
        yield


async def simulate(
    url: str,
    robots: int,
    seconds: float | None,
    seed: int,
    *,
    speed: float = 1.0,
    fleet_port: int | None = None,
    stop: asyncio.Event,
) -> dict[str, int]:
    """Run so many robots of four vendors against a service until `stop`, or for `seconds` of their own time.

    `speed` is the world's seconds a second; other than at 1 the senders' clocks run fast or slow. With `fleet_port`
    Basalt's fleet manager does not connect but waits there to be dialled. Returns messages sent by vendor.
    """
    rng = np.random.default_rng(seed)
    members, annex = split(cast(robots))
    world = World(layout_for(robots), members, rng)
    lines = _lines([*members, *annex.members])
    tasks: list[asyncio.Task[None]] = []
    async with AsyncExitStack() as servers:
        for line in dict.fromkeys(lines):
            if line.vendor is VendorName.BASALT and fleet_port is not None:
                await servers.enter_async_context(listening(line, fleet_port))
                continue
            path = f"/{line.vendor}" if line.vendor in OWN_PATH else ""
            tasks.append(asyncio.create_task(call(url.rstrip("/") + path, line, rng)))
        try:
            await _go_on(world, annex, lines, seconds, speed, stop)
        finally:
            for task in tasks:
                task.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)
    sent = Counter({vendor.value: 0 for vendor in VendorName})
    for line in dict.fromkeys(lines):
        sent[line.vendor.value] += line.sent
    return dict(sent)


def _lines(members: Sequence[Member]) -> list[Line]:
    """The line of each row: Basalt's fleet manager speaks for all its robots, everybody else for themselves."""
    fleet = Line(VendorName.BASALT)
    vendors = [member.make.vendor for member in members]
    return [fleet if vendor is VendorName.BASALT else Line(vendor) for vendor in vendors]


async def _go_on(
    world: World, annex: Annex, lines: Sequence[Line], seconds: float | None, speed: float, stop: asyncio.Event
) -> None:
    """Step the world by the clock and let everybody report in turn; the players of the annex come last."""
    every_s = np.array([member.make.report_every_s for member in (*world.members, *annex.members)])
    phase_s = every_s * (np.arange(len(every_s)) * 0.618 % 1.0)
    start_s = time.time() - world.t_s
    while not stop.is_set() and (seconds is None or world.t_s < seconds):
        late_s = (time.time() - start_s) * speed - world.t_s
        if late_s < STEP_S:
            await _unless(stop, (STEP_S - late_s) / speed)
            continue
        if late_s > LATE_S:
            start_s += (late_s - STEP_S) / speed
        before = np.floor((world.t_s + phase_s) / every_s)
        world.step(STEP_S)
        due = np.flatnonzero(np.floor((world.t_s + phase_s) / every_s) > before)
        now_s = start_s + world.t_s
        _report(world, annex, due, lines, now_s)
        await asyncio.sleep(0)


async def _unless(stop: asyncio.Event, seconds: float) -> None:
    try:
        async with asyncio.timeout(seconds):
            await stop.wait()
    except TimeoutError:
        return


def _report(world: World, annex: Annex, due: Ints, lines: Sequence[Line], now_s: float) -> None:
    rows = np.array([row for row in due if lines[row].up], np.int64)
    players = [annex.robot(row - len(world), world.t_s) for row in rows.tolist() if row >= len(world)]
    robots = [*some_robots(world, rows[rows < len(world)]), *players]
    for row, robot in zip(rows.tolist(), robots, strict=True):
        line = lines[row]
        shy = robot.member.make.person and robot.member.number % 2 == 0 and world.t_s < SHY_S
        introduce = row not in line.introduced and not shy
        if introduce:
            line.introduced.add(row)
        line.put(DIALECTS[line.vendor].messages(robot, now_s, introduce=introduce))
