"""A NATS server and the roles of a cluster, each in a process of its own but for the face."""

import asyncio
import os
import shutil
import subprocess
import sys
import time
from collections import Counter
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import AsyncExitStack, asynccontextmanager, suppress
from pathlib import Path
from typing import Any

import pytest

from deconflict.cluster.engine_member import LISTEN_S
from deconflict.cluster.ingest_feed import IngestFeed
from deconflict.cluster.nats.bus import Bus
from deconflict.cluster.nats.nats_tasks import open_bus
from deconflict.cluster.store_follower import StoreFollower
from deconflict.cluster.tiles.tile_owners import OwnerTable
from deconflict.roles.operator_role import OperatorRole
from deconflict.roles.receiver_role import ReceiverRole
from deconflict.roles.service import Role, runtime_directory
from deconflict.settings.cluster_settings import Cluster
from deconflict.settings.hot_reload import SITE_FILE
from deconflict.settings.site import Operator, Site
from deconflict_client.situations import REVISION, AnyRevision
from ingest.batch import FloorPoint
from ingest.settings import ReceiverSettings
from metrics.monitoring.exposition import render
from tests.deconflict.roles.made_service import free_ports
from tests.helpers.made_advisories import KEEPING
from tests.helpers.patience import PATIENCE_S
from tests.helpers.plain_http import http_client
from tests.helpers.saying import HALL

SERVER = shutil.which("nats-server", path=os.environ.get("PATH", "") + os.pathsep + "/usr/sbin")
needs_server = pytest.mark.skipif(SERVER is None, reason="needs nats-server, which Debian has as a package")


def busy_s(process: int) -> float:
    """How long its main thread has run or waited for a processor: https://docs.kernel.org/scheduler/sched-stats.html."""
    run_ns, wait_ns, _ = Path(f"/proc/{process}/schedstat").read_text().split()
    return 1e-9 * (int(run_ns) + int(wait_ns))


class Broker:
    """A NATS server that keeps its store and its port when it is started again."""

    def __init__(self, folder: Path, *options: str) -> None:
        (port,) = free_ports(1)
        self.address = f"nats://127.0.0.1:{port}"
        self._folder = folder
        self._command = [str(SERVER), "-a", "127.0.0.1", "-p", str(port), "-js", "-sd", str(folder), *options]
        self.start()

    def start(self) -> None:
        self._process = subprocess.Popen(self._command, stderr=subprocess.DEVNULL)

    def kill(self) -> None:
        """As a machine that loses its power."""
        self._process.kill()
        self._process.wait(PATIENCE_S)

    def signal(self, number: int) -> None:
        self._process.send_signal(number)

    def empty(self) -> None:
        """Put another machine in its place, which has nothing."""
        self.kill()
        shutil.rmtree(self._folder)
        self.start()


@asynccontextmanager
async def buses(broker: Broker, count: int, keep_days: float = 1.0) -> AsyncIterator[list[Bus]]:
    """So many connections to a server, which ends with them."""
    opened = [Bus(Cluster(nats=(broker.address,)), keep_days) for _ in range(count)]
    try:
        for bus in opened:
            assert await open_bus(bus, asyncio.Event())
        yield opened
    finally:
        for bus in opened:
            await bus.close()
        broker.kill()


REFUSALS = 5


class Faltering(Bus):
    """In touch with a real server, where channels take a while to be begun and "refused" is so a few times."""

    def __init__(self, settings: Cluster) -> None:
        super().__init__(settings, 1.0)
        self.begun = Counter[str]()

    async def follow_channel(self, channel: str, take: Callable[[bytes], None]) -> Callable[[], Awaitable[None]]:
        self.begun[channel] += 1
        if channel == "refused" and self.begun[channel] <= REFUSALS:
            raise TimeoutError
        await asyncio.sleep(4 * LISTEN_S)
        return await super().follow_channel(channel, take)


RUN_ROLE = """
import sys
from pathlib import Path
from deconflict.roles.__main__ import begin, run
begin()
sys.exit(run(sys.argv[1], *map(Path, sys.argv[2:])))
"""
"""One role, without a supervisor and a fork server."""


class Machines:
    """Roles that were started, each as a machine of its own: with a runtime directory and data of its own."""

    def __init__(self, folder: Path, broker: Broker, site: Site | None = None, **settings: Any) -> None:
        self.broker = broker
        self.settings = Cluster(**{"nats": (broker.address,), "tile_m": 32.0} | settings)
        self._folder, self._site = folder, site or Site()
        self._processes: dict[tuple[str, str], subprocess.Popen[bytes]] = {}

    def site(self, robots_port: int = 0) -> Site:
        changed = {
            "cluster": self.settings,
            "receiver": ReceiverSettings(port=robots_port),
            "operator": Operator(port=0),
            "store": KEEPING,
        }
        return self._site.model_copy(update=changed)

    def start(self, machine: str, *roles: str) -> int:
        """The port for robots of that machine."""
        (robots_port,) = free_ports(1)
        home = self._folder / machine
        home.mkdir()
        (home / SITE_FILE).write_text(self.site(robots_port).model_dump_json())
        for role in roles:
            command = [sys.executable, "-c", RUN_ROLE, role, str(home), str(home)]
            with (home / f"{role}.log").open("wb") as log:
                self._processes[machine, role] = subprocess.Popen(command, stdin=subprocess.PIPE, stderr=log)
        return robots_port

    def kill(self, machine: str, role: str) -> None:
        """As a machine that loses its power."""
        process = self._processes.pop((machine, role))
        process.kill()
        process.communicate()

    def stop(self, machine: str, role: str) -> None:
        """As its supervisor does in order."""
        process = self._processes.pop((machine, role))
        process.communicate(timeout=PATIENCE_S)
        assert process.returncode == 0

    def idle_s_of_stop(self, machine: str, role: str) -> float:
        """Stop it as well. Returns how long its main thread then waited for something else than a processor."""
        process = self._processes[machine, role]
        began_s, before_s = time.monotonic(), busy_s(process.pid)
        assert process.stdin
        process.stdin.close()
        while not os.waitid(os.P_PID, process.pid, os.WEXITED | os.WNOWAIT | os.WNOHANG):
            assert time.monotonic() - began_s < PATIENCE_S, f"the {role} does not stop"
            time.sleep(0.01)
        idle_s = time.monotonic() - began_s - (busy_s(process.pid) - before_s)
        del self._processes[machine, role]
        assert process.wait() == 0
        return idle_s

    def process_of(self, machine: str, role: str) -> int:
        return self._processes[machine, role].pid

    def machine_of(self, process: int) -> str:
        """The machine with a process of this number."""
        return next(machine for (machine, _), each in self._processes.items() if each.pid == process)

    def signal(self, machine: str, role: str, number: int) -> None:
        self._processes[machine, role].send_signal(number)

    def end(self) -> None:
        for process in self._processes.values():
            if process.stdin:
                process.stdin.close()
        for process in self._processes.values():
            try:
                process.wait(PATIENCE_S)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()


@asynccontextmanager
async def face(machines: Machines, data: Path) -> AsyncIterator[OperatorRole]:
    """An operator face of the cluster, in this process."""
    with runtime_directory() as runtime:
        stop, site = asyncio.Event(), machines.site()
        operator = OperatorRole(site, Path(runtime), data, render)
        follower = StoreFollower(site, machines.settings, Path(runtime))
        tasks = [asyncio.create_task(coroutine) for coroutine in (operator.run(stop), follower.run(stop))]
        try:
            await operator.ready.wait()
            yield operator
        finally:
            stop.set()
            await asyncio.gather(*tasks)


@asynccontextmanager
async def ingest(machines: Machines, data: Path, port: int = 0) -> AsyncIterator[str]:
    """An ingest of the cluster, in this process: the address for its robots."""
    with runtime_directory() as runtime:
        site = machines.site(port)
        receiver, feed = (
            ReceiverRole(site, Path(runtime), data / "log"),
            IngestFeed(site, machines.settings, Path(runtime), data / "log"),
        )
        async with running(receiver), running(feed):
            await receiver.ready.wait()
            yield f"ws://127.0.0.1:{receiver.receiver.port}"


@asynccontextmanager
async def running(role: Role) -> AsyncIterator[asyncio.Task[None]]:
    """A role in this process until it is cancelled, which is its death, or the end."""
    stop = asyncio.Event()
    task = asyncio.create_task(role.run(stop))
    try:
        yield task
    finally:
        stop.set()
        with suppress(asyncio.CancelledError):
            await task


async def table(settings: Cluster) -> dict[str, Any]:
    """Who owns what, as the members have agreed."""
    bus = Bus(settings, 1)
    await bus.open()
    _, document = await bus.state.table()
    await bus.close()
    return document or OwnerTable().document()


@asynccontextmanager
async def cluster(
    folder: Path, site: Site | None = None, **settings: Any
) -> AsyncIterator[tuple[Machines, OperatorRole]]:
    """A server and a face, and yet no other machine."""
    async with AsyncExitStack() as stack:
        broker = Broker(folder / "nats")
        stack.callback(broker.kill)
        machines = Machines(folder, broker, site, **settings)
        stack.callback(machines.end)
        yield machines, await stack.enter_async_context(face(machines, folder / "face"))


async def until(base: str, path: str, wanted: Callable[[Any], bool]) -> Any:
    """The JSON at `path` once it is as wanted, whatever the status."""
    async with http_client() as client, asyncio.timeout(300):
        while not wanted(answer := (await client.get(base + path)).json()):
            await asyncio.sleep(0.1)
        return answer


async def lives(base: str, of: str = "advisories") -> list[list[AnyRevision]]:
    """Every revision of each advisory or situation, in order."""
    async with http_client() as client:
        listed = (await client.get(f"{base}/{of}?state=all&limit=1000")).json()[of]
        document = [(await client.get(f"{base}/{of}/{each['id']}")).json()[of] for each in listed]
    return [[REVISION.validate_python(each) for each in life] for life in document]


HOME = FloorPoint(HALL, 1.0, 2.0)
