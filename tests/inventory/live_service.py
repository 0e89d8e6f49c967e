"""What a running service offers: who may use what, fields of its answers, its scrape, and what it has written."""

import json
import re
import signal
import socket
import subprocess
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

import httpx
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

from tests.helpers.patience import PATIENCE_S
from tests.helpers.plain_http import NO_AUTHORITIES
from tests.helpers.saying import status
from tests.inventory import surface
from tests.inventory.written_files import json_paths, written_lines

ROLES = ("read", "acknowledge", "administer")
"""From the least to the most."""
PAGES = ("/healthz", "/robots", "/vendors", "/site", "/presence", "/quarantine", "/blackboxes", "/recorded")
WRONG_STREAMS = ("after=x", "kinds=x", "after=999999999999")
SITE = "".join(f'[[operator.people]]\nname = "{role}"\nrole = "{role}"\ntoken = "env:TOKEN_{role}"\n' for role in ROLES)
LOOK_S, LONGEST_S = 1.0, 40.0
LOOKS = 12


@dataclass
class Service:
    """A running service with simulated robots."""

    port: int
    """Of the operators."""
    robots_port: int

    def get(self, path: str) -> httpx.Response:
        return self.ask("GET", path, ROLES[-1])

    def ask(self, method: str, path: str, role: str = "") -> httpx.Response:
        headers = {"Authorization": f"Bearer {_token(role)}"} if role else {}
        url = f"http://127.0.0.1:{self.port}{path}"
        return httpx.request(method, url, headers=headers, timeout=PATIENCE_S, trust_env=False, verify=NO_AUTHORITIES)

    def is_busy(self) -> bool:
        """Whether robots are known and there was an advisory."""
        with suppress(httpx.TransportError):
            return bool(self.get("/robots").json()["robots"] and self.get("/advisories").json()["advisories"])
        return False


def live_lines(wanted: set[str]) -> set[str]:
    """Look at a service a dozen times, and on until everything wanted was seen, but no longer than `LONGEST_S`.

    What it has written is looked at when it has ended. Raises `AssertionError` if the service does not come to work.
    """
    wanted = {line for line in wanted if not line.startswith(("live file ", "live output "))}
    with tempfile.TemporaryDirectory() as folder:
        data = Path(folder) / "data"
        with _running(Path(folder)) as service:
            _wait(service.is_busy)
            seen = {*_roles(service), *_close_codes(service)}
            _report_at_once(service)
            end_s, looks = time.monotonic() + LONGEST_S, 0
            while looks < LOOKS or (wanted - seen and time.monotonic() < end_s):
                seen |= {*_answers(service), *_scrape(service)}
                looks += 1
                time.sleep(LOOK_S)
        return seen | set(written_lines(data, Path(folder)))


def _token(role: str) -> str:
    return f"the-token-of-{role}-is-long-enough"


@contextmanager
def _running(folder: Path) -> Iterator[Service]:
    with socket.socket() as first, socket.socket() as second:
        first.bind(("127.0.0.1", 0))
        second.bind(("127.0.0.1", 0))
        robots, people = first.getsockname()[1], second.getsockname()[1]
    site, data = folder / "site.toml", folder / "data"
    site.write_text(SITE, encoding="utf-8")
    ports = ["--data", str(data), "--robots-port", str(robots), "--operator-port", str(people)]
    with (
        _process(folder, "serve", str(site), *ports),
        _process(folder, "simulate", "--url", f"ws://127.0.0.1:{robots}", "--robots", "40"),
    ):
        yield Service(people, robots)


@contextmanager
def _process(folder: Path, *arguments: str) -> Iterator[None]:
    with (folder / f"{arguments[0]}.txt").open("w", encoding="utf-8") as log:
        environment = surface.environment() | {f"TOKEN_{role}": _token(role) for role in ROLES}
        process = subprocess.Popen(
            surface.command(*arguments), stdout=log, stderr=log, env=environment, cwd=surface.ROOT
        )
        try:
            yield
        finally:
            process.send_signal(signal.SIGTERM)
            process.wait(PATIENCE_S)


def _wait(happened: Callable[[], bool]) -> None:
    end_s = time.monotonic() + PATIENCE_S
    while not happened():
        assert time.monotonic() < end_s, "the service has no robots and advisories; start `deconflict demo` and look"
        time.sleep(LOOK_S)


def _report_at_once(service: Service) -> None:
    """Send statuses of one robot faster than the engine reads them. Simulated robots report once a second."""
    with connect(f"ws://127.0.0.1:{service.robots_port}/Corvid", proxy=None) as robot:
        for _ in range(5):
            robot.send(status("C-99", time.time()))


def _roles(service: Service) -> Iterator[str]:
    """The least role that may use each endpoint."""
    for route in surface.routes():
        for method in getattr(route, "methods", None) or ():
            path = re.sub(r"\{[^}]*\}", "x", route.path)
            able = (role for role in ("", *ROLES) if service.ask(method, path, role).status_code not in (401, 403))
            yield f"live http {method} {route.path} role: {next(able, 'none') or 'everybody'}"


def _close_codes(service: Service) -> Iterator[str]:
    headers = {"Authorization": f"Bearer {_token('read')}"}
    for question in WRONG_STREAMS:
        address = f"ws://127.0.0.1:{service.port}/advisories/stream?{question}"
        with connect(address, additional_headers=headers, proxy=None) as stream:
            try:
                stream.recv(timeout=PATIENCE_S)
            except ConnectionClosed as closed:
                yield f"live stream ?{question} closes with {closed.rcvd.code if closed.rcvd else None}"


def _answers(service: Service) -> Iterator[str]:
    """The fields of answers, also of those that OpenAPI does not describe, and of what the page is sent."""
    for path in PAGES:
        yield from (f"live http GET {path} {line}" for line in json_paths(service.get(path).json()))
    robots = service.get("/robots").json()["robots"]
    for robot in robots[:: max(1, len(robots) // 5)]:
        document = service.get(f"/robots/{robot['uuid']}").json()
        yield from (f"live http GET /robots/{{uuid}} {line}" for line in json_paths(document))
    headers = {"Authorization": f"Bearer {_token('read')}"}
    with connect(f"ws://127.0.0.1:{service.port}/live", additional_headers=headers, proxy=None) as page:
        for _ in range(3):
            message = page.recv(timeout=PATIENCE_S)
            yield from (f"live /live {line}" for line in json_paths(json.loads(message)))


def _scrape(service: Service) -> Iterator[str]:
    """The metrics as Prometheus reads them."""
    for line in service.get("/metrics").text.splitlines():
        if line.startswith("# TYPE "):
            yield f"live metric {line.removeprefix('# TYPE ')}"
        elif sample := re.match(r"(\w+)\{(.*)\} ", line):
            labels = ", ".join(re.findall(r'(\w+)="', sample[2]))
            yield f"live metric {sample[1]} labels {labels}"
