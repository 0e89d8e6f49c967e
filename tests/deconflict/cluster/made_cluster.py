"""A NATS server and the roles of a cluster, each in a process of its own but for the face."""

import asyncio
import os
import shutil
import subprocess
import sys
from collections.abc import AsyncIterator, Iterator
from contextlib import AsyncExitStack, asynccontextmanager, contextmanager
from pathlib import Path

import pytest

from deconflict.cluster.follower import Follower
from deconflict.cluster.settings import Cluster
from deconflict.reloading import SITE_FILE
from deconflict.roles.operator import OperatorRole
from deconflict.service import runtime_directory
from deconflict.site import Operator, Site
from ingest.settings import Receiver
from metrics.exposition import render
from tests.deconflict.test_supervisor import free_ports

SERVER = shutil.which("nats-server", path=os.environ.get("PATH", "") + os.pathsep + "/usr/sbin")
needs_server = pytest.mark.skipif(SERVER is None, reason="needs nats-server, which Debian has as a package")


@contextmanager
def nats_server(folder: Path) -> Iterator[str]:
    """Its address."""
    (port,) = free_ports(1)
    command = [str(SERVER), "-a", "127.0.0.1", "-p", str(port), "-js", "-sd", str(folder)]
    with subprocess.Popen(command, stderr=subprocess.DEVNULL) as process:
        try:
            yield f"nats://127.0.0.1:{port}"
        finally:
            process.terminate()
            process.wait(20)


class Machines:
    """Roles that were started, each as a machine of its own: with a runtime directory and data of its own."""

    def __init__(self, folder: Path, settings: Cluster) -> None:
        self.settings, self._folder = settings, folder
        self._processes: dict[tuple[str, str], subprocess.Popen[bytes]] = {}

    def site(self, robots_port: int = 0) -> Site:
        return Site(cluster=self.settings, receiver=Receiver(port=robots_port), operator=Operator(port=0))

    def start(self, machine: str, *roles: str) -> int:
        """The port for robots of that machine."""
        (robots_port,) = free_ports(1)
        home = self._folder / machine
        home.mkdir()
        (home / SITE_FILE).write_text(self.site(robots_port).model_dump_json())
        for role in roles:
            command = [sys.executable, "-m", "deconflict", "role", role, str(home), str(home)]
            with (home / f"{role}.log").open("wb") as log:
                self._processes[machine, role] = subprocess.Popen(command, stdin=subprocess.PIPE, stderr=log)
        return robots_port

    def kill(self, machine: str, role: str) -> None:
        """As a machine that loses its power."""
        process = self._processes.pop((machine, role))
        process.kill()
        process.communicate()

    def end(self) -> None:
        for process in self._processes.values():
            if process.stdin:
                process.stdin.close()
        for process in self._processes.values():
            try:
                process.wait(15)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()


@asynccontextmanager
async def face(machines: Machines, data: Path) -> AsyncIterator[OperatorRole]:
    """An operator face of the cluster, in this process."""
    with runtime_directory() as runtime:
        stop, site = asyncio.Event(), machines.site()
        operator = OperatorRole(site, Path(runtime), data, render)
        follower = Follower(site, machines.settings, Path(runtime))
        tasks = [asyncio.create_task(one) for one in (operator.run(stop), follower.run(stop))]
        try:
            await operator.ready.wait()
            yield operator
        finally:
            stop.set()
            await asyncio.gather(*tasks)


@asynccontextmanager
async def cluster(folder: Path) -> AsyncIterator[tuple[Machines, OperatorRole]]:
    """A server and a face, and yet no other machine."""
    async with AsyncExitStack() as stack:
        address = stack.enter_context(nats_server(folder / "nats"))
        machines = Machines(folder, Cluster(nats=(address,), tile_m=32.0))
        stack.callback(machines.end)
        yield machines, await stack.enter_async_context(face(machines, folder / "face"))
