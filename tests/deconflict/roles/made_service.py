"""A service in processes of its own, and robots that report to it."""

import asyncio
import json
import signal
import socket
import subprocess
import sys
import time
from collections.abc import AsyncIterator, Callable, Iterator, Sequence
from contextlib import asynccontextmanager, contextmanager, suppress
from math import pi
from os import devnull
from pathlib import Path
from typing import Any

import httpx
from websockets.asyncio.client import connect

from deconflict.roles.operator_role import OperatorRole
from deconflict.roles.receiver_role import ReceiverRole
from deconflict.roles.service import run_in_one_process
from deconflict.settings.site import Conflict, Operator, Site
from ingest.settings import Datum, ReceiverSettings
from metrics.monitoring.exposition import render
from tests.helpers.patience import PATIENCE_S
from tests.helpers.plain_http import http_client
from tests.helpers.saying import HALL, identity, points, status

Course = Callable[[float], tuple[float, float, float]]
MEETING: dict[str, Course] = {"A-1": lambda t: (-30.0 + t, 0.0, 0.0), "B-1": lambda t: (30.0 - t, 0.0, pi)}
"""Head-on after thirty seconds."""


async def answered(
    client: httpx.AsyncClient, url: str, wanted: Callable[[httpx.Response], bool], within_s: float = PATIENCE_S
) -> httpx.Response:
    """The answer once it is as wanted. Otherwise the error has the last answer, which says why it never was."""
    last = "nobody answered"
    try:
        async with asyncio.timeout(within_s):
            while True:
                with suppress(httpx.TransportError, json.JSONDecodeError):
                    answer = await client.get(url)
                    last = answer.text
                    if wanted(answer):
                        return answer
                await asyncio.sleep(0.1)
    except TimeoutError:
        raise AssertionError(f"{url} was not as wanted within {within_s:.0f} s, but: {last}") from None


def free_ports(count: int) -> list[int]:
    sockets = [socket.create_server(("127.0.0.1", 0)) for _ in range(count)]
    ports = [socket.getsockname()[1] for socket in sockets]
    for sock in sockets:
        sock.close()
    return ports


class Served:
    """A service in processes of its own."""

    def __init__(
        self, data: Path, site: Path | None = None, log: Path = Path(devnull), prefix: Sequence[str] = ()
    ) -> None:
        """`log` gets what the service logs. `prefix` is a program that starts it."""
        self.robots_port, self.operator_port = free_ports(2)
        self._data, self._site, self._log, self._prefix = data, site, log, prefix
        self.process: subprocess.Popen[bytes] | None = None

    @contextmanager
    def running(self) -> Iterator[int]:
        command = [
            *self._prefix,
            sys.executable,
            "-m",
            "deconflict",
            "serve",
            *([str(self._site)] if self._site else []),
        ]
        command += ["--data", str(self._data)]
        ports = ["--robots-port", str(self.robots_port), "--operator-port", str(self.operator_port)]
        with self._log.open("ab") as log, subprocess.Popen([*command, *ports], stderr=log) as process:
            try:
                yield process.pid
            finally:
                process.send_signal(signal.SIGTERM)
                process.wait(PATIENCE_S)

    @property
    def face_url(self) -> str:
        return f"http://127.0.0.1:{self.operator_port}"

    @property
    def robots_url(self) -> str:
        return f"ws://127.0.0.1:{self.robots_port}"

    async def until(self, path: str, wanted: Any, within_s: float = PATIENCE_S) -> Any:
        """The JSON at `path` once it is as wanted, whatever the status."""
        async with http_client() as client:
            return (
                await answered(client, f"{self.face_url}{path}", lambda answer: wanted(answer.json()), within_s)
            ).json()

    @asynccontextmanager
    async def with_robots(self, start_s: float) -> AsyncIterator[None]:
        driving = asyncio.create_task(drive(self.robots_url, MEETING, 120, start_s))
        try:
            yield
        finally:
            driving.cancel()
            await asyncio.gather(driving, return_exceptions=True)


def healthy(health: dict[str, Any]) -> bool:
    return bool(health.get("status") == "ok")


SITE = Site(
    name="Test hall",
    datums=(Datum(id=HALL, name="Hall"),),
    receiver=ReceiverSettings(port=0),
    operator=Operator(port=0),
    conflict=Conflict(clear_after_s=1.0),
)


CROSSING: dict[str, Course] = {
    "A-1": lambda t: (-3.0 + t, 0.0, 0.0),
    "B-1": lambda t: (0.0, -3.0 + t, pi / 2),
}


class Running:
    """A service in this process, and where to find it."""

    def __init__(self, receiver: ReceiverRole, operator: OperatorRole) -> None:
        self.robots_url = f"ws://127.0.0.1:{receiver.receiver.port}"
        self.face = f"127.0.0.1:{operator.port}"

    async def get(self, path: str) -> httpx.Response:
        async with http_client() as client:
            return await client.get(f"http://{self.face}{path}")

    async def until(self, path: str, wanted: Callable[[Any], bool]) -> Any:
        """The answer at `path` once it is as wanted."""
        return await self._once(path, lambda answer: answer.status_code == 200 and wanted(answer.json()))

    async def health(self, wanted: Callable[[Any], bool]) -> Any:
        """The health once it is as wanted."""
        return await self._once("/healthz", lambda answer: wanted(answer.json()))

    async def _once(self, path: str, wanted: Callable[[httpx.Response], bool]) -> Any:
        async with http_client() as client:
            return (await answered(client, f"http://{self.face}{path}", wanted)).json()

    async def metrics_with(self, name: str) -> str:
        """The scrape once it has a series that begins so."""
        async with asyncio.timeout(PATIENCE_S):
            while f"\n{name}" not in (text := (await self.get("/metrics")).text):
                await asyncio.sleep(0.05)
        return text


@asynccontextmanager
async def running(data: Path, site: Site = SITE, wall: Callable[[], float] = time.time) -> AsyncIterator[Running]:
    async with run_in_one_process(site, data, render, wall) as (receiver, operator):
        yield Running(receiver, operator)


async def drive(url: str, courses: dict[str, Course], seconds: float, start_s: float | None = None) -> None:
    """Robots that report twice a second, at their word."""
    began_s = time.time() if start_s is None else start_s
    async with connect(url) as socket:
        for name in courses:
            await socket.send(identity(name, began_s))
        while (now_s := time.time()) < began_s + seconds:
            for name, course in courses.items():
                t = now_s - began_s
                x, y, yaw = course(t)
                path = points(*((now_s + i, *course(t + i)) for i in range(1, 11)))
                await socket.send(status(name, now_s, x, y, yaw, path=path))
            await asyncio.sleep(0.5)


async def wait_behind_another(url: str, from_x_m: float = 0.0) -> None:
    """A robot drives from here for 4 s and stops behind another one for 3 s, although by its path it goes on. Then both
    go on, until this is cancelled."""
    stops_s, goes_s, start_s = 4.0, 7.0, time.time()
    async with connect(url) as socket:
        while (now_s := time.time()) < start_s + PATIENCE_S:
            t = now_s - start_s
            gone_m, waits_s = max(t - goes_s, 0.0), max(goes_s - t, 0.0)
            robots = ("A-1", min(t, stops_s) + gone_m, 0.0), ("B-1", stops_s + 2.0 + gone_m, waits_s)
            for name, x, stays_s in robots:
                ways_m = ((i, from_x_m + x + max(i - stays_s, 0.0)) for i in range(1, 11))
                path = points(*((now_s + i, way_m, 0.0, 0.0) for i, way_m in ways_m))
                await socket.send(status(name, now_s, from_x_m + x, path=path))
            await asyncio.sleep(0.5)
