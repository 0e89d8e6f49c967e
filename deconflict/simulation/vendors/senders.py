"""The real sockets of the simulated vendors: all robots report to a service while the world advances."""

import asyncio
import time
from collections import Counter
from collections.abc import Callable, Sequence
from contextlib import AsyncExitStack, suppress

import numpy as np
from websockets.asyncio.client import ClientConnection, connect
from websockets.asyncio.connection import Connection
from websockets.asyncio.server import serve
from websockets.exceptions import ConnectionClosed, WebSocketException

from deconflict.simulation.driving.traffic import World
from deconflict.simulation.floor_layout import layout_for
from deconflict.simulation.participants import Participant, VendorName, participants
from deconflict.simulation.robot_state import RobotState, robot_states
from deconflict.simulation.scripted_annex import Annex, split
from deconflict.simulation.vendors.broker_sender import ON_BROKERS, BrokerSender
from deconflict.simulation.vendors.dialects import DIALECTS
from ingest.batch import Ints

STEP_S = 0.1
BACKOFF_S = (0.25, 5.0)
"""First and longest wait before a reconnection."""
MOST_UNSENT = 2000
"""Messages that wait for a slow connection. Further messages are dropped."""
LATE_S = 2.0
"""If the world lags behind the clock by more than this, it does not catch up."""
SHY_S = 5.0
"""How long every second person's device does not send its identity."""
OWN_PATH = (VendorName.CORVID, VendorName.WALKERS)
"""Vendors that connect to a URL path with their name, so that they are known before any identity."""
PONG = 0x8A
"""First byte of a pong frame: final, opcode 10 (RFC 6455, 5.2)."""


class PongLessClient(ClientConnection):
    """A client that never answers a ping, as the official sample sender does not."""

    def send_data(self) -> None:
        self.protocol.writes = [data for data in self.protocol.writes if data[:1] != bytes([PONG])]
        super().send_data()


class Sender:
    """The messages of one connection, or of one listening fleet manager."""

    def __init__(self, vendor: VendorName) -> None:
        self.vendor = vendor
        self.introduced: set[int] = set()
        """Rows whose identity was sent on this connection; for Corvid, on any connection."""
        self.sent = 0
        self._queues: set[asyncio.Queue[bytes]] = set()

    @property
    def up(self) -> bool:
        return bool(self._queues)

    def enqueue(self, messages: Sequence[bytes]) -> None:
        """Queue messages for every open connection."""
        for queue in self._queues:
            for message in messages[: max(MOST_UNSENT - queue.qsize(), 0)]:
                queue.put_nowait(message)

    def report(self, robot: RobotState, now_s: float, *, introduce: bool) -> None:
        """Queue what a robot says."""
        self.enqueue(DIALECTS[self.vendor].messages(robot, now_s, introduce=introduce))

    async def send_over(self, connection: Connection) -> None:
        """Send queued messages until the connection is lost."""
        queue: asyncio.Queue[bytes] = asyncio.Queue()
        self._queues.add(queue)
        if self.vendor is not VendorName.CORVID:
            self.introduced.clear()
        try:
            async with asyncio.TaskGroup() as tasks:
                receiving = tasks.create_task(_discard_received(connection))
                sending = tasks.create_task(self._send(queue, connection))
                await asyncio.wait({receiving, sending}, return_when=asyncio.FIRST_COMPLETED)
                receiving.cancel()
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


AnySender = Sender | BrokerSender


async def _discard_received(connection: Connection) -> None:
    """Read and discard messages until the other side closes."""
    try:
        async for _ in connection:
            pass
    except ConnectionClosed:
        return


async def call(url: str, line: Sender, rng: np.random.Generator) -> None:
    """Keep a connection to a service. Waits longer after each failed attempt. Ends only when cancelled."""
    wait_s = BACKOFF_S[0]
    kind = PongLessClient if line.vendor is VendorName.CORVID else ClientConnection
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


class RobotFloor:
    """Simulated robots: those of the halls, and those of the annex."""

    def __init__(self, world: World, annex: Annex) -> None:
        self.world, self.annex = world, annex
        self.world.spread_start()

    def step(self) -> None:
        """Advance by `STEP_S`."""
        self.world.step(STEP_S)


def warehouse(robots: int, seed: int) -> tuple[World, Annex]:
    """The halls of the warehouse, and its annex."""
    members, annex = split(participants(robots))
    return World(layout_for(robots), members, np.random.default_rng(seed)), annex


async def simulate(
    url: str,
    floor: RobotFloor,
    seconds: float | None,
    *,
    speed: float = 1.0,
    fleet_port: int | None = None,
    on_broker: Callable[[VendorName], BrokerSender] | None = None,
    stop: asyncio.Event,
) -> dict[str, int]:
    """Run the robots of a floor against a service until `stop`, or for `seconds` of their own time.

    `speed` is the world's time per real time. If it is not 1, the senders' clocks run fast or slow. With `fleet_port`
    Basalt's fleet manager does not connect but listens on this port. With `on_broker`, Basalt speaks VDA 5050 and Alder
    ISO 21423, by the senders that it makes. Returns the number of sent messages by vendor.
    """
    rng = np.random.default_rng()
    senders = _senders([*floor.world.members, *floor.annex.members], on_broker)
    tasks: list[asyncio.Task[None]] = []
    async with AsyncExitStack() as servers:
        for sender in dict.fromkeys(senders):
            if isinstance(sender, BrokerSender):
                tasks.append(asyncio.create_task(sender.send()))
            elif sender.vendor is VendorName.BASALT and fleet_port is not None:
                listening = serve(sender.send_over, "127.0.0.1", fleet_port, compression=None, ping_interval=None)
                await servers.enter_async_context(listening)
            else:
                path = f"/{sender.vendor}" if sender.vendor in OWN_PATH else ""
                tasks.append(asyncio.create_task(call(url.rstrip("/") + path, sender, rng)))
        try:
            await _run(floor, senders, seconds, speed, stop)
        finally:
            for task in tasks:
                task.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)
    return _sent(senders)


def _sent(senders: Sequence[AnySender]) -> dict[str, int]:
    """Messages sent by vendor."""
    sent = Counter({vendor.value: 0 for vendor in VendorName})
    for sender in dict.fromkeys(senders):
        sent[sender.vendor.value] += sender.sent
    return dict(sent)


def _senders(members: Sequence[Participant], on_broker: Callable[[VendorName], BrokerSender] | None) -> list[AnySender]:
    """The sender of each row. Basalt's fleet manager sends for all its robots; every other robot has its own sender.

    If there is a broker, each vendor that reports to it has one sender.
    """
    shared: dict[VendorName, AnySender] = {VendorName.BASALT: Sender(VendorName.BASALT)}
    if on_broker:
        shared |= {vendor: on_broker(vendor) for vendor in ON_BROKERS}
    vendors = [member.make.vendor for member in members]
    return [shared.get(vendor) or Sender(vendor) for vendor in vendors]


async def _run(
    floor: RobotFloor, senders: Sequence[AnySender], seconds: float | None, speed: float, stop: asyncio.Event
) -> None:
    """Advance the world with the clock and let the robots report in turn. The robots of the annex come last."""
    world, annex = floor.world, floor.annex
    every_s = np.array([member.make.report_every_s for member in (*world.members, *annex.members)])
    phase_s = every_s * (np.arange(len(every_s)) * 0.618 % 1.0)
    start_s = time.time() - world.t_s
    while not stop.is_set() and (seconds is None or world.t_s < seconds):
        late_s = (time.time() - start_s) * speed - world.t_s
        if late_s < STEP_S:
            with suppress(TimeoutError):
                async with asyncio.timeout((STEP_S - late_s) / speed):
                    await stop.wait()
            continue
        if late_s > LATE_S:
            start_s += (late_s - STEP_S) / speed
        before = np.floor((world.t_s + phase_s) / every_s)
        floor.step()
        due = np.flatnonzero(np.floor((world.t_s + phase_s) / every_s) > before)
        now_s = start_s + world.t_s
        _report(world, annex, due, senders, now_s)
        await asyncio.sleep(0)


def _report(world: World, annex: Annex, due: Ints, senders: Sequence[AnySender], now_s: float) -> None:
    rows = np.array([row for row in due if senders[row].up], np.int64)
    players = [annex.robot(row - len(world), world.t_s) for row in rows.tolist() if row >= len(world)]
    robots = [*robot_states(world, rows[rows < len(world)]), *players]
    for row, robot in zip(rows.tolist(), robots, strict=True):
        sender = senders[row]
        hides_identity = robot.member.make.person and robot.member.number % 2 == 0 and world.t_s < SHY_S
        introduce = row not in sender.introduced and not hides_identity
        if introduce:
            sender.introduced.add(row)
        sender.report(robot, now_s, introduce=introduce)
