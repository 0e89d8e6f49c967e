"""The simulated vendors over real sockets: who pings in vain, who comes back, who is called."""

import asyncio
import json
from collections import defaultdict
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager
from functools import partial

import numpy as np
import pytest
from websockets.asyncio.client import connect
from websockets.asyncio.server import Server, ServerConnection, serve
from websockets.exceptions import ConnectionClosed
from websockets.frames import Frame, Opcode
from websockets.protocol import Event

from deconflict.simulation.participants import VendorName
from deconflict.simulation.vendors.senders import RobotFloor, Sender, call, simulate, warehouse
from tests.helpers.patience import PATIENCE_S


class Service:
    """A service that keeps all it is told, by the path of the connection."""

    def __init__(self) -> None:
        self.messages: dict[str, list[bytes]] = defaultdict(list)
        self.connections: list[ServerConnection] = []
        self.changed = asyncio.Event()

    async def take(self, connection: ServerConnection) -> None:
        assert connection.request is not None
        self.connections.append(connection)
        try:
            async for message in connection:
                self.messages[connection.request.path].append(str(message).encode())
                self.changed.set()
        except ConnectionClosed:
            pass

    async def until(self, holds: Callable[[], bool]) -> None:
        async with asyncio.timeout(PATIENCE_S):
            while not holds():
                self.changed.clear()
                await self.changed.wait()

    def has(self, messages: int) -> bool:
        return sum(map(len, self.messages.values())) >= messages

    @property
    def vendors(self) -> set[str]:
        documents = [json.loads(message) for messages in self.messages.values() for message in messages]
        return {document["manufacturerName"] for document in documents if "manufacturerName" in document}


@asynccontextmanager
async def background(work: Awaitable[object]) -> AsyncIterator[asyncio.Future[object]]:
    task = asyncio.ensure_future(work)
    try:
        yield task
    finally:
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)


def port_of(server: Server) -> int:
    return server.sockets[0].getsockname()[1]


async def test_all_four_vendors_report_and_are_counted() -> None:
    service, stop = Service(), asyncio.Event()
    async with serve(service.take, "127.0.0.1", 0) as server:
        running = asyncio.create_task(
            simulate(f"ws://127.0.0.1:{port_of(server)}", RobotFloor(*warehouse(8, 1)), None, speed=5.0, stop=stop)
        )
        await service.until(lambda: service.vendors == set(VendorName))
        await service.until(lambda: sum(map(len, service.messages.values())) > 100)
        stop.set()
        sent = await running
        assert service.messages.keys() == {"/", "/Corvid", "/Walkers"}
        assert len(service.connections) == 7
    assert sent.keys() == set(VendorName)
    assert min(sent.values()) > 0
    assert sum(sent.values()) >= sum(map(len, service.messages.values()))


async def test_the_simulation_ends_after_the_given_seconds() -> None:
    service = Service()
    async with serve(service.take, "127.0.0.1", 0) as server, asyncio.timeout(PATIENCE_S):
        url = f"ws://127.0.0.1:{port_of(server)}"
        sent = await simulate(url, RobotFloor(*warehouse(4, 1)), 20.0, speed=10.0, stop=asyncio.Event())
        await until(lambda: all(connection.close_code == 1000 for connection in service.connections))
    assert 10 <= sent[VendorName.ALDER] <= 21
    assert sent[VendorName.WALKERS] <= 12


@pytest.mark.parametrize(("vendor", "answers"), [(VendorName.CORVID, 0), (VendorName.ALDER, 5)])
async def test_only_corvid_does_not_answer_pings(vendor: VendorName, answers: int) -> None:
    """Frames are answered in their order, so the answer to a close shows that the pings before it were read."""
    pongs: list[bytes] = []
    closed = asyncio.Event()

    class Watching(ServerConnection):
        def process_event(self, event: Event) -> None:
            if isinstance(event, Frame) and event.opcode is Opcode.PONG:
                pongs.append(bytes(event.data))
            super().process_event(event)

    async def ping(connection: ServerConnection) -> None:
        if not closed.is_set():
            for number in range(5):
                await connection.ping(str(number))
            await connection.close()
            assert connection.close_code == 1000
            closed.set()

    async with (
        serve(ping, "127.0.0.1", 0, ping_interval=None, create_connection=Watching) as server,
        background(call(f"ws://127.0.0.1:{port_of(server)}", Sender(vendor), np.random.default_rng(1))),
        asyncio.timeout(PATIENCE_S),
    ):
        await closed.wait()
        assert len(pongs) == answers


async def test_a_sender_that_never_answers_pings_stays_connected() -> None:
    line, service = Sender(VendorName.CORVID), Service()
    async with (
        serve(service.take, "127.0.0.1", 0, ping_interval=0.02, ping_timeout=None) as server,
        background(call(f"ws://127.0.0.1:{port_of(server)}", line, np.random.default_rng(1))),
    ):
        await until(lambda: line.up)
        for number in range(20):
            line.enqueue([str(number).encode()])
            await service.until(partial(service.has, number + 1))
            await asyncio.sleep(0.02)
        assert len(service.connections) == 1
        assert service.connections[0].latency == 0.0


async def test_a_sender_reconnects_when_the_service_is_back() -> None:
    line, service = Sender(VendorName.ALDER), Service()
    async with serve(service.take, "127.0.0.1", 0) as server:
        port = port_of(server)
        calling = asyncio.ensure_future(call(f"ws://127.0.0.1:{port}", line, np.random.default_rng(1)))
        await until(lambda: line.up)
        line.introduced.add(0)
    await until(lambda: not line.up)
    async with serve(service.take, "127.0.0.1", port, reuse_address=True), background(calling):
        await until(lambda: line.up)
        assert not line.introduced
        line.enqueue([b"again"])
        await service.until(lambda: service.messages["/"] == [b"again"])


async def test_corvid_sends_its_identity_only_once() -> None:
    line, service = Sender(VendorName.CORVID), Service()
    async with (
        serve(service.take, "127.0.0.1", 0) as server,
        background(call(f"ws://127.0.0.1:{port_of(server)}", line, np.random.default_rng(1))),
    ):
        await until(lambda: line.up)
        line.introduced.add(0)
        await service.connections[0].close()
        await until(lambda: len(service.connections) == 2 and line.up)
        assert line.introduced == {0}


async def test_the_service_can_connect_to_basalts_fleet_manager(unused_tcp_port: int) -> None:
    service, stop = Service(), asyncio.Event()
    async with serve(service.take, "127.0.0.1", 0) as server:
        url = f"ws://127.0.0.1:{port_of(server)}"
        work = simulate(url, RobotFloor(*warehouse(8, 1)), None, speed=5.0, fleet_port=unused_tcp_port, stop=stop)
        async with background(work) as running:
            await service.until(lambda: len(service.vendors) == 3)
            async with asyncio.timeout(PATIENCE_S), connect(f"ws://127.0.0.1:{unused_tcp_port}") as dialled:
                document = [json.loads(await dialled.recv()) for _ in range(8)]
            stop.set()
            await running
    names = {row["manufacturerName"] for row in document if "manufacturerName" in row}
    assert names == {"Basalt"}
    assert len({row["uuid"] for row in document}) == 2
    assert "Basalt" not in service.vendors


async def until(holds: Callable[[], bool]) -> None:
    """Look again and again, up to a deadline."""
    async with asyncio.timeout(PATIENCE_S):
        while not holds():
            await asyncio.sleep(0.01)
