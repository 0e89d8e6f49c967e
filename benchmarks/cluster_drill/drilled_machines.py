"""Three machines with a NATS server each, from the files of `deploy/cluster`, all on this machine."""

import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Iterable, Iterator
from contextlib import suppress
from pathlib import Path

import trustme

from benchmarks.endtoend import free_ports
from deconflict.roles.processes.role_process import MEMORY

FILES = Path(__file__).parents[2] / "deploy" / "cluster"
MACHINES = (1, 2, 3)
HOST = "127.0.0.1"
TOKENS = {
    name: f"drill-{name.lower()}-0123456789"
    for name in ("NATS_PASSWORD", "CONTROL_ROOM_TOKEN", "ALDER_TOKEN", "CORVID_TOKEN")
}
"""By the name in the environment that the files ask for."""
ENDS_WITHIN_S = 60.0


def program(name: str) -> str:
    """Where a server is installed. Exits if it is not."""
    found = shutil.which(name, path=os.environ.get("PATH", "") + os.pathsep + "/usr/sbin:/usr/local/sbin")
    if found is None:
        raise SystemExit(f"install {name}: the drill needs it")
    return found


class DrilledMachines:
    """Their processes by name: `nats 1` to `nats 3`, `machine 1` to `machine 3`, and `broker`."""

    def __init__(self, folder: Path) -> None:
        self._folder, self._processes = folder, dict[str, subprocess.Popen[bytes]]()
        ports = iter(free_ports(4 * len(MACHINES) + 1))
        self._nats_ports, self._route_ports, self._robots_ports, self._face_ports = (
            {machine: next(ports) for machine in MACHINES} for _ in range(4)
        )
        self.broker_port = next(ports)
        self.ca, self.nats_ca = str(folder / "ca.pem"), str(folder / "nats-ca.pem")
        """Authorities of the machines and the broker, and of the NATS servers."""
        self._write()

    def robots_address(self, machine: int) -> str:
        return f"wss://{HOST}:{self._robots_ports[machine]}"

    def face_address(self, machine: int) -> str:
        return f"{HOST}:{self._face_ports[machine]}"

    def nats_address(self, server: int) -> str:
        return f"tls://{HOST}:{self._nats_ports[server]}"

    def site_file(self, machine: int) -> Path:
        return self._folder / f"machine-{machine}" / "site.toml"

    def start_servers(self) -> None:
        self.start_broker()
        for server in MACHINES:
            self.start_nats(server)

    def start_broker(self) -> None:
        self._start("broker", [program("mosquitto"), "-c", str(self._folder / "mosquitto.conf")], {})

    def start_nats(self, server: int) -> None:
        command = [program("nats-server"), "-c", str(self._folder / f"nats-{server}" / "nats.conf")]
        self._start(f"nats {server}", command, {"NATS_SERVER": f"nats-{server}"})

    def start_machine(self, machine: int) -> None:
        home = self._folder / f"machine-{machine}"
        ports = {"--robots-port": self._robots_ports[machine], "--operator-port": self._face_ports[machine]}
        options = [text for option, port in ports.items() for text in (option, str(port))]
        command = [sys.executable, "-m", "deconflict", "serve", "site.toml", "--data", "data", "--host", HOST]
        self._start(f"machine {machine}", [*command, *options], MEMORY, home)

    def kill_nats(self, server: int) -> None:
        self._kill(f"nats {server}")

    def kill_machine(self, machine: int) -> None:
        """All of its processes but its NATS server."""
        process = self._processes[f"machine {machine}"]
        process.send_signal(signal.SIGSTOP)
        _kill_all(pid for pid, _ in _descendants(process.pid))
        self._kill(f"machine {machine}")

    def kill_roles(self, machine: int, *roles: str) -> None:
        """They stay dead until `revive`, since their supervisor stands still."""
        process = self._processes[f"machine {machine}"]
        process.send_signal(signal.SIGSTOP)
        _kill_all(pid for pid, name in _descendants(process.pid) if name in roles)

    def revive(self, machine: int) -> None:
        self._processes[f"machine {machine}"].send_signal(signal.SIGCONT)

    def ended(self) -> list[str]:
        """What does not run, with what it logged last."""
        return [
            f"{name} ended: {(self._folder / f'{name}.log').read_text()[-500:]}"
            for name, process in self._processes.items()
            if process.poll() is not None
        ]

    def end(self) -> None:
        """Machines first, while the servers are there."""
        machines = {name: process for name, process in self._processes.items() if name.startswith("machine")}
        for process in machines.values():
            process.send_signal(signal.SIGCONT)
            process.terminate()
        for name, process in machines.items():
            with suppress(subprocess.TimeoutExpired):
                process.wait(ENDS_WITHIN_S)
            _kill_all(pid for pid, _ in _descendants(process.pid))
            self._kill(name)
        for name in self._processes.keys() - machines.keys():
            self._kill(name)

    def _start(self, name: str, command: list[str], environment: dict[str, str], home: Path | None = None) -> None:
        with (self._folder / f"{name}.log").open("ab") as log:
            self._processes[name] = subprocess.Popen(
                command,
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=log,
                env=os.environ | TOKENS | environment,
                cwd=home,
            )

    def _kill(self, name: str) -> None:
        self._processes[name].kill()
        self._processes[name].wait()

    def _write(self) -> None:
        """The files of the documents, with this machine's addresses."""
        authority, nats_authority = trustme.CA(), trustme.CA()
        authority.cert_pem.write_to_path(self.ca)
        nats_authority.cert_pem.write_to_path(self.nats_ca)
        for machine in MACHINES:
            nats, home = self._folder / f"nats-{machine}", self._folder / f"machine-{machine}"
            _certify(nats_authority, nats, "server")
            _certify(authority, home / "tls", "machine")
            nats_authority.cert_pem.write_to_path(str(home / "tls" / "nats-ca.pem"))
            (nats / "nats.conf").write_text(self._adapted("nats.conf", self._nats_places(machine, nats)))
            (home / "site.toml").write_text(self._adapted("site.toml", self._site_places()))
        files = self._folder / "machine-1" / "tls"
        (self._folder / "mosquitto.conf").write_text(
            f"listener {self.broker_port} {HOST}\nallow_anonymous true\n"
            f"certfile {files}/machine.pem\nkeyfile {files}/machine.key\nuser root\n"
        )

    def _nats_places(self, server: int, folder: Path) -> dict[str, str]:
        listen = {
            "0.0.0.0:4222": f"{HOST}:{self._nats_ports[server]}",
            "0.0.0.0:6222": f"{HOST}:{self._route_ports[server]}",
        }
        routes = {f"nats-{each}.example:6222": f"{HOST}:{port}" for each, port in self._route_ports.items()}
        return listen | routes | {"/etc/nats": str(folder), "/var/lib/nats": str(folder / "store")}

    def _site_places(self) -> dict[str, str]:
        servers = {f"nats-{each}.example:4222": f"{HOST}:{port}" for each, port in self._nats_ports.items()}
        return servers | {"broker.example": HOST, "port = 8883": f"port = {self.broker_port}"}

    @staticmethod
    def _adapted(name: str, places: dict[str, str]) -> str:
        """A file of the documents with other places. Exits if the file does not have one of them."""
        text = (FILES / name).read_text()
        for place, other in places.items():
            if place not in text:
                raise SystemExit(f"{FILES / name} does not have {place}, which the drill puts elsewhere")
            text = text.replace(place, other)
        return text


def _certify(authority: trustme.CA, folder: Path, name: str) -> None:
    """Put a new certificate, its key and the authority into a new directory."""
    folder.mkdir(parents=True)
    certificate = authority.issue_cert(HOST)
    authority.cert_pem.write_to_path(str(folder / "ca.pem"))
    certificate.cert_chain_pems[0].write_to_path(str(folder / f"{name}.pem"))
    certificate.private_key_pem.write_to_path(str(folder / f"{name}.key"))


def _descendants(pid: int) -> Iterator[tuple[int, str]]:
    """Number and name of each process that a process has started, and of those that these have."""
    for line in _children(pid):
        child = int(line)
        yield from _descendants(child)
        with suppress(OSError):
            yield child, Path(f"/proc/{child}/comm").read_text().strip()


def _children(pid: int) -> list[str]:
    with suppress(OSError):
        return [line for tasks in Path(f"/proc/{pid}/task").glob("*/children") for line in tasks.read_text().split()]
    return []


def _kill_all(pids: Iterable[int]) -> None:
    for pid in list(pids):
        with suppress(ProcessLookupError):
            os.kill(pid, signal.SIGKILL)
