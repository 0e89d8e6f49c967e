import asyncio
import logging
import socket as sockets
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, suppress
from random import Random
from typing import Any

import pytest
from websockets.asyncio.server import ServerConnection, serve
from websockets.datastructures import Headers
from websockets.http11 import Request, Response

from ingest.measures.measures import Measures
from ingest.measures.outages import STEADY_S
from ingest.port import dialer
from ingest.port.connection import Connection
from ingest.port.dialer import Dialer
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
        self.dialer = Dialer(self.receiver, self.measures, url, "Alder", self.clock, Random(1))

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
    assert dialled.measures.values["deconflict_dial_failures_total"]["Alder",] >= 3


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
    assert calls >= 2
    assert dialled.measures.values["deconflict_connections_refused_total"][("idle",)] in (calls - 1, calls)


async def test_a_message_that_breaks_the_reader_does_not_end_the_dialling(caplog: pytest.LogCaptureFixture) -> None:
    async def poison(socket: ServerConnection) -> None:
        await socket.send("poison")
        await socket.send("hello")
        await socket.wait_closed()

    async with serve(poison, "127.0.0.1", 0) as server:
        dialled = Dialled(f"ws://127.0.0.1:{port_of(server)}")
        await dialled.until(2)
    assert dialled.delivered[-1][0] == b"hello"
    assert "ZeroDivisionError" in caplog.text


async def test_an_invalid_address_is_logged_and_given_up(caplog: pytest.LogCaptureFixture) -> None:
    dialled = Dialled("http://fleet.example")
    async with asyncio.timeout(PATIENCE_S):
        await dialled.dialer.run()
    assert "mend the dial address of Alder" in caplog.text


async def test_waits_follow_the_setting_and_the_failures_in_a_row(monkeypatch: pytest.MonkeyPatch) -> None:
    waits: list[tuple[tuple[float, float], int]] = []

    def recorded(bounds_s: tuple[float, float], failures: int, _: Random) -> float:
        waits.append((bounds_s, failures))
        return 0.0

    async def hang_up(socket: ServerConnection) -> None:
        await socket.send("hello")

    monkeypatch.setattr(dialer, "backoff_s", recorded)
    async with serve(hang_up, "127.0.0.1", 0) as server:
        await Dialled(f"ws://127.0.0.1:{port_of(server)}").until(4)
    assert waits[:3] == [((0.01, 0.05), failures) for failures in (1, 2, 3)]


async def test_a_connection_that_lasted_resets_the_back_off() -> None:
    async def say_long(socket: ServerConnection) -> None:
        await socket.send("hello")
        dialled.clock.now_s += STEADY_S + 1

    async with serve(say_long, "127.0.0.1", 0) as server:
        dialled = Dialled(f"ws://127.0.0.1:{port_of(server)}")
        dialled.dialer.failures = 7
        await dialled.until(2)
    assert dialled.dialer.failures == 0


@asynccontextmanager
async def redirecting(*locations: str, asked: list[Request] | None = None) -> AsyncIterator[int]:
    """The port of a fleet manager that answers every handshake with a redirect."""

    def redirect(_: ServerConnection, request: Request) -> Response:
        if asked is not None:
            asked.append(request)
        return Response(302, "Found", Headers([("Location", location) for location in locations]), b"")

    async def never(_: ServerConnection) -> None:
        pytest.fail("nobody is let in here")

    async with serve(never, "127.0.0.1", 0, process_request=redirect) as server:
        yield port_of(server)


@asynccontextmanager
async def other_server(asked: list[Request], host: str = "127.0.0.1", port: int = 0) -> AsyncIterator[int]:
    """The port of a server that has robots, too."""

    async def hello(socket: ServerConnection) -> None:
        assert socket.request is not None
        asked.append(socket.request)
        await socket.send("hello")
        await socket.wait_closed()

    async with serve(hello, host, port) as server:
        yield port_of(server)


async def until_failed(dialled: Dialled, failures: int = 3) -> None:
    dialling = asyncio.create_task(dialled.dialer.run())
    async with asyncio.timeout(PATIENCE_S):
        while dialled.dialer.failures < failures and not dialling.done():
            await asyncio.sleep(0.005)
    assert not dialling.done(), "it goes on dialling"
    dialling.cancel()


async def test_a_redirect_to_another_host_is_not_followed_and_the_log_names_it(
    caplog: pytest.LogCaptureFixture,
) -> None:
    asked: list[Request] = []
    async with other_server(asked) as elsewhere, redirecting(f"ws://localhost:{elsewhere}/robots") as port:
        dialled = Dialled(f"ws://127.0.0.1:{port}")
        await until_failed(dialled)
    assert (asked, dialled.delivered) == ([], [])
    assert f"redirects to another host, 'ws://localhost:{elsewhere}/robots'" in caplog.text


async def test_a_redirect_to_the_same_host_is_followed_without_credentials_and_the_log_names_it(
    caplog: pytest.LogCaptureFixture,
) -> None:
    caplog.set_level(logging.INFO)
    asked: list[Request] = []
    async with other_server(asked) as elsewhere, redirecting(f"//127.0.0.1:{elsewhere}/a", asked=asked) as port:
        dialled = Dialled(f"ws://someone:a-password-of-theirs@127.0.0.1:{port}")
        await dialled.until(1)
    assert ["Authorization" in request.headers for request in asked] == [True, False]
    assert f"connected to Alder at ws://127.0.0.1:{port}, which redirects to 'ws://127.0.0.1:{elsewhere}/a'" in (
        caplog.text
    )
    assert "a-password-of-theirs" not in caplog.text
    assert "a-password-of-theirs" not in dialled.delivered[0][1].peer


async def test_a_redirect_is_followed_at_the_network_address_that_was_dialled(monkeypatch: pytest.MonkeyPatch) -> None:
    """The owner of a name can make it mean another machine between two connections."""
    known, look_up, looked_up = iter(["127.0.0.1"]), sockets.getaddrinfo, []

    def rebound(host: Any, *rest: Any, **named: Any) -> Any:
        if host == "fleet.example":
            looked_up.append(host)
            return look_up(next(known, "127.0.0.2"), *rest, **named)
        return look_up(host, *rest, **named)

    monkeypatch.setattr(sockets, "getaddrinfo", rebound)
    good: list[Request] = []
    bad: list[Request] = []
    async with (
        other_server(good) as port,
        other_server(bad, "127.0.0.2", port),
        redirecting(f"//fleet.example:{port}/") as first,
    ):
        await Dialled(f"ws://fleet.example:{first}").until(1)
    assert (len(good), bad) == (1, [])


@pytest.mark.parametrize(
    "locations",
    [
        ("http://127.0.0.1/",),
        ("ws://[",),
        ("ws://127.0.0.1:99999/",),
        ("ws://127.0.0.1:9/#part",),
        ("ws://a@127.0.0.1:9/",),
        ("ws:///",),
        ("/a", "/b"),
        ("/again",),
        ("x\u00e9://\u00ff",),
    ],
)
async def test_a_redirect_that_leads_nowhere_is_told_in_a_sentence_and_dialling_goes_on(
    locations: tuple[str, ...], caplog: pytest.LogCaptureFixture
) -> None:
    async with redirecting(*locations) as port:
        await until_failed(Dialled(f"ws://127.0.0.1:{port}"))
    [warning] = [record for record in caplog.records if record.levelno >= logging.WARNING]
    assert warning.getMessage().startswith(f"Alder at ws://127.0.0.1:{port} can't be reached: ")
    assert warning.exc_info is None
