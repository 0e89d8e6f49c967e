"""Starts a NATS server and the processes of a cluster, all on this machine and in stretched time."""

import json
import os
import shutil
import subprocess
import sys
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from benchmarks import offer
from benchmarks.endtoend import Usage, free_ports, usage
from deconflict.roles.processes.role_process import MEMORY
from deconflict.settings.cluster_settings import Cluster
from deconflict.settings.hot_reload import SITE_FILE
from deconflict.settings.site import DEFAULT, Site
from ingest.settings import Datum, Vendor

SERVER = shutil.which("nats-server", path=os.environ.get("PATH", "") + os.pathsep + "/usr/sbin")
"""None if it is not installed."""
END_WITHIN_S = 60.0


@dataclass
class StartedCluster:
    """The processes of a cluster by role. Every machine has a folder of its own."""

    folder: Path
    stretch: float
    began_s: float
    """Wall time at which simulated time begins."""
    floors: list[int]
    """The number of robots on each floor. Each floor has an ingest."""
    calm: bool
    """Whether few robots meet."""
    tick_s: float
    processes: dict[str, list[subprocess.Popen[bytes]]] = field(default_factory=dict)
    cluster: Cluster = field(init=False)
    monitor: str = field(init=False)
    """Address at which the NATS server reports on itself."""
    face: str = field(init=False)
    """Address of the operator face."""
    _robots_ports: list[int] = field(default_factory=list)
    """By floor, the port for its robots."""

    def __post_init__(self) -> None:
        port, monitor_port, face_port = free_ports(3)
        self.cluster = Cluster(nats=(f"nats://127.0.0.1:{port}",))
        self.monitor, self.face = (f"http://127.0.0.1:{each}" for each in (monitor_port, face_port))
        server = [str(SERVER), "-a", "127.0.0.1", "-p", str(port), "-m", str(monitor_port), "-js"]
        self._start("nats", [*server, "-sd", str(self.folder / "nats")], self.folder / "nats.log")
        self._start_machine("face", self.site(face_port=face_port), "operator", "follower")

    def site(self, robots_port: int = 0, face_port: int = 0) -> Site:
        datums = tuple(Datum(id=offer.datum_of(floor), name=f"Floor {floor}") for floor in range(len(self.floors)))
        return DEFAULT.model_copy(
            update={
                "datums": datums,
                "vendors": tuple(Vendor(name=name) for name in offer.VENDORS),
                "receiver": DEFAULT.receiver.model_copy(update={"port": robots_port}),
                "operator": DEFAULT.operator.model_copy(update={"port": face_port}),
                "engine": DEFAULT.engine.model_copy(update={"tick_s": self.tick_s}),
                "cluster": self.cluster,
            }
        )

    def start_ingests(self) -> None:
        for floor in range(len(self.floors)):
            self._robots_ports += free_ports(1)
            self._start_machine(f"ingest-{floor}", self.site(self._robots_ports[-1]), "receiver", "feed")

    def start_loads(self) -> None:
        for floor, robots in enumerate(self.floors):
            url = f"ws://127.0.0.1:{self._robots_ports[floor]}"
            command = self._command("load", url, str(robots), str(floor), str(int(self.calm)))
            self._start("load", command, self.folder / f"load-{floor}.log")

    def start_engine(self) -> None:
        self._start_machine(f"engine-{len(self.processes.get('engine', []))}", self.site(), "engine")

    def usage(self) -> dict[str, list[Usage]]:
        """Processor time and memory of each live process, by role."""
        return {
            role: [usage(process.pid) for process in processes if process.poll() is None]
            for role, processes in self.processes.items()
        }

    def end_loads(self) -> list[dict[str, Any]]:
        """End the loads. Returns the figures of each."""
        loads = self.processes.pop("load", [])
        for process in loads:
            if process.stdin:
                process.stdin.close()
        for process in loads:
            process.wait(END_WITHIN_S)
        logs = [self.folder / f"load-{floor}.log" for floor in range(len(loads))]
        return [json.loads(log.read_text().splitlines()[-1]) for log in logs]

    def kill(self) -> None:
        """End every process, as if the machines lost their power."""
        for process in [process for processes in self.processes.values() for process in processes]:
            process.kill()
            process.communicate()

    def _start_machine(self, name: str, site: Site, *roles: str) -> None:
        home = self.folder / name
        home.mkdir()
        (home / SITE_FILE).write_text(site.model_dump_json())
        for role in roles:
            self._start(role, self._command(role, str(home), str(home)), home / f"{role}.log")

    def _command(self, *arguments: str) -> list[str]:
        module = [sys.executable, "-m", "benchmarks.slow_motion.stretched_role"]
        return [*module, repr(self.stretch), repr(self.began_s), *arguments]

    def _start(self, role: str, command: list[str], log: Path) -> None:
        with log.open("wb") as output:
            process = subprocess.Popen(
                command, stdin=subprocess.PIPE, stdout=output, stderr=output, env=MEMORY | os.environ
            )
        self.processes.setdefault(role, []).append(process)
