import asyncio
import logging
from contextlib import suppress
from random import Random

import pytest
from websockets.asyncio.server import ServerConnection, serve

from ingest.measures.measures import Measures
from ingest.port.connection import Connection
from ingest.port.dialer import STEADY_S, Dialer
from ingest.port.receiver import Receiver
from ingest.security.vendor_credentials import VendorCredentials
from ingest.settings import ReceiverSettings
from tests.helpers.patience import PATIENCE_S


class Clock:
    """Time that a test moves."""

    now_s = 0.0

    def __call__(self) -> float:
        return self.now_s


class Dialled:
    """A dialer with a receiver that is told to by nobody else."""

    def __init__(self, url: str, **settings: object) -> None:
        self.delivered: list[tuple[bytes, Connection]] = []
        self.measures, self.clock = Measures(), Clock()
        given = ReceiverSettings.model_validate({"dial_backoff_s": (0.01, 0.05)} | settings)
        self.receiver = Receiver(
            given,
            VendorCredentials(()),
            self.deliver,
            lambda *_: None,
            lambda _: None,
            overtaken=lambda *_: None,
            measures=self.measures,
            clock=self.clock,
        )
        self.dialer = Dialer(self.receiver, url, "Alder", self.clock, Random(1))

    def deliver(self, raw: bytes, _: float, connection: Connection) -> None:
        self.delivered.append((raw, connection))
        if raw == b"poison":
            raise ZeroDivisionError

    async def until(self, messages: int) -> None:
        """Dial until so many messages have come."""
        task = asyncio.create_task(self.dialer.run())
        try:
            async with asyncio.timeout(PATIENCE_S):
                while len(self.delivered) < messages and not task.done():
                    await asyncio.sleep(0.005)
        finally:
            task.cancel()
            with suppress(asyncio.CancelledError):
                await task


def port_of(server: object) -> int:
    return int(next(iter(server.sockets)).getsockname()[1])  # type: ignore[attr-defined]


async def test_a_fleet_manager_that_hangs_up_is_dialled_again(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.INFO, "ingest")
    for proxy in ("http_proxy", "https_proxy", "all_proxy"):
        monkeypatch.setenv(proxy, "http://127.0.0.1:9")
    monkeypatch.delenv("no_proxy", raising=False)
    monkeypatch.delenv("NO_PROXY", raising=False)

    async def hello_and_goodbye(socket: ServerConnection) -> None:
        await socket.send("hello")

    async with serve(hello_and_goodbye, "127.0.0.1", 0) as server:
        url = f"ws://127.0.0.1:{port_of(server)}/robots"
        dialled = Dialled(url)
        await dialled.until(3)
    assert {raw for raw, _ in dialled.delivered} == {b"hello"}
    assert {(connection.vendor, connection.peer) for _, connection in dialled.delivered} == {("Alder", url)}
    assert {connection.source for _, connection in dialled.delivered} == {"vendor Alder"}
    assert len({connection.id for _, connection in dialled.delivered}) == 3
    assert [record.getMessage() for record in caplog.records].count(
        f"the connection to Alder at {url} is lost; dialling again"
    ) == 1, "a fleet manager that flaps is logged once"


async def test_a_fleet_manager_that_comes_late_is_reached_and_its_absence_told_once(
    caplog: pytest.LogCaptureFixture,
) -> None:
    async def hello(socket: ServerConnection) -> None:
        await socket.send("hello")
        await socket.wait_closed()

    caplog.set_level(logging.INFO, "ingest")
    async with serve(hello, "127.0.0.1", 0) as server:
        port = port_of(server)
    dialled = Dialled(f"ws://127.0.0.1:{port}")
    dialling = asyncio.create_task(dialled.until(1))
    async with asyncio.timeout(PATIENCE_S):
        while dialled.dialer.failures < 3:
            await asyncio.sleep(0.005)
    assert dialled.delivered == []
    async with serve(hello, "127.0.0.1", port):
        await dialling
    log_records = [record for record in caplog.records if record.levelno >= logging.WARNING]
    assert len(log_records) == 1
    assert "Alder" in log_records[0].getMessage()
    assert "connected to Alder" in caplog.text, "that it came is logged, too"


async def test_the_loss_of_a_fleet_manager_that_came_late_and_stayed_is_logged(
    caplog: pytest.LogCaptureFixture,
) -> None:
    dialled = Dialled("")

    async def stay(socket: ServerConnection) -> None:
        await socket.send("hello")
        dialled.clock.now_s += STEADY_S + 1

    async with serve(stay, "127.0.0.1", 0) as server:
        port = port_of(server)
    dialled = Dialled(f"ws://127.0.0.1:{port}")
    dialling = asyncio.create_task(dialled.until(2))
    async with asyncio.timeout(PATIENCE_S):
        while dialled.dialer.failures < 3:
            await asyncio.sleep(0.005)
        async with serve(stay, "127.0.0.1", port):
            await dialling
    assert f"the connection to Alder at ws://127.0.0.1:{port} is lost" in caplog.text


async def test_a_silent_fleet_manager_is_dialled_again() -> None:
    calls = 0

    async def say_little(socket: ServerConnection) -> None:
        nonlocal calls
        calls += 1
        await socket.send("hello")
        await socket.wait_closed()

    async with serve(say_little, "127.0.0.1", 0) as server:
        dialled = Dialled(f"ws://127.0.0.1:{port_of(server)}", idle_timeout_s=0.1, port=0)
        await dialled.receiver.start()
        await dialled.until(2)
        await dialled.receiver.close()
    assert calls == 2
    assert dialled.measures.values["deconflict_connections_refused_total"][("idle",)] == 1


async def test_a_message_that_breaks_the_reader_does_not_end_the_dialling(caplog: pytest.LogCaptureFixture) -> None:
    async def poison(socket: ServerConnection) -> None:
        await socket.send("poison")
        await socket.wait_closed()

    async with serve(poison, "127.0.0.1", 0) as server:
        dialled = Dialled(f"ws://127.0.0.1:{port_of(server)}")
        await dialled.until(2)
    assert "ZeroDivisionError" in caplog.text


async def test_an_invalid_address_is_logged_and_given_up(caplog: pytest.LogCaptureFixture) -> None:
    dialled = Dialled("http://fleet.example")
    async with asyncio.timeout(PATIENCE_S):
        await dialled.dialer.run()
    assert "mend the dial address of Alder" in caplog.text


def test_waits_double_from_the_first_to_the_longest() -> None:
    dialled = Dialled("ws://fleet.example", dial_backoff_s=(0.5, 30.0))
    longest = []
    for failures in (0, 1, 2, 3, 7, 5000):
        dialled.dialer.failures = failures
        waits = [dialled.dialer.wait_s() for _ in range(300)]
        assert min(waits) >= max(waits) / 2.1
        longest.append(max(waits))
    assert longest == pytest.approx([0.5, 0.5, 1.0, 2.0, 30.0, 30.0], rel=0.02)


async def test_a_connection_that_lasted_resets_the_back_off() -> None:
    async def say_long(socket: ServerConnection) -> None:
        await socket.send("hello")
        dialled.clock.now_s += STEADY_S + 1

    async with serve(say_long, "127.0.0.1", 0) as server:
        dialled = Dialled(f"ws://127.0.0.1:{port_of(server)}")
        dialled.dialer.failures = 7
        await dialled.until(2)
    assert dialled.dialer.failures == 0
