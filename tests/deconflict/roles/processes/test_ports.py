"""Ports that can't be used end a start with a sentence, and what lies in the working directory is not run."""

import asyncio
import json
import os
import signal
import socket
import subprocess
import sys
import time
from contextlib import suppress
from functools import partial
from pathlib import Path

import pytest
from pydantic_core import to_json

from deconflict.__main__ import parser
from deconflict.roles.operator_role import OperatorRole
from deconflict.roles.processes.ports import PortTakenError, refuse_taken
from deconflict.roles.processes.supervisor import PORTS
from deconflict.roles.service import runtime_directory
from deconflict.runtime.command_parsers import MISUSED
from deconflict.runtime.parcels import STORED, packed_parcel
from deconflict.runtime.rpc import AsyncCaller
from deconflict.settings.outlet_settings import Webhook
from deconflict.settings.site import Operator, Site
from ingest.settings import ReceiverSettings
from metrics.monitoring.exposition import render
from tests.deconflict.operator.http.served_face import until
from tests.deconflict.operator.outlets.made_outlets import SECRET, heard, hearing
from tests.deconflict.roles.made_service import Served, free_ports, healthy
from tests.deconflict.roles.role_processes import children, fork_servers
from tests.helpers.made_advisories import made
from tests.helpers.patience import PATIENCE_S

NEVER = "2001:db8::1"
"""An address of documentation, which no machine has."""


def started(directory: Path, *arguments: str) -> tuple[int, str]:
    """The exit code of a start that is refused, and the last line that it says."""
    command = [sys.executable, "-m", "deconflict", *arguments, "--data", str(directory)]
    done = subprocess.run(command, stderr=subprocess.PIPE, text=True, check=False, timeout=PATIENCE_S)
    return done.returncode, done.stderr.splitlines()[-1]


@pytest.mark.parametrize("section", ["robots", "operator"])
def test_a_service_does_not_start_where_a_port_is_in_use(section: str, tmp_path: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as other:
        port = other.getsockname()[1]
        code, sentence = started(tmp_path, "serve", f"--{section}-port", str(port))
    assert code == MISUSED
    assert f"127.0.0.1:{port}" in sentence
    assert {"robots": "receiver.port", "operator": "operator.port"}[section] in sentence
    assert f"(--{section}-port)" in sentence


def test_two_ports_of_one_service_are_two_numbers(tmp_path: Path) -> None:
    code, sentence = started(tmp_path, "serve", "--robots-port", "8080", "--operator-port", "8080")
    assert code == MISUSED
    assert "can't listen on 127.0.0.1:8080: operator.port is the same port. Set another receiver.port (" in sentence


def test_two_ports_at_two_addresses_may_have_one_number() -> None:
    (port,) = free_ports(1)
    receiver = ReceiverSettings(host="127.0.0.2", port=port)
    operator = Operator(host="127.0.0.1", port=port)
    refuse_taken(Site(receiver=receiver, operator=operator), ("receiver", "operator"))
    with pytest.raises(PortTakenError, match=r"operator\.port"):
        refuse_taken(Site(receiver=receiver.model_copy(update={"host": "127.0.0.1"}), operator=operator), PORTS)


@pytest.mark.parametrize("command", ["serve", "demo"])
def test_a_service_does_not_start_at_an_address_of_another_machine(command: str, tmp_path: Path) -> None:
    code, sentence = started(tmp_path, command, "--open", "--host", NEVER)
    assert code == MISUSED
    assert NEVER in sentence
    assert ".host" in sentence


@pytest.mark.parametrize("option", ["--robots-port", "--operator-port"])
@pytest.mark.parametrize("command", ["serve", "demo"])
@pytest.mark.parametrize("port", ["65536", "-1", "http", "1e3", "²"])
def test_a_port_is_a_number_that_ports_have(
    command: str, option: str, port: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as ended:
        parser().parse_args([command, f"{option}={port}"])
    assert ended.value.code == MISUSED
    assert f"{port!r} is not in range: give a whole number from 0 to 65535" in capsys.readouterr().err


async def test_a_service_runs_nothing_of_the_working_directory(tmp_path: Path) -> None:
    work, service = tmp_path / "work", Served(tmp_path / "data")
    work.mkdir()
    for module in ("click", "numpy", "pydantic", "json"):
        (work / f"{module}.py").write_text(f"open({str(work / 'was_run')!r}, 'a').write({module!r})")
    ports = [f"--robots-port={service.robots_port}", f"--operator-port={service.operator_port}"]
    command = [sys.executable, "-P", "-m", "deconflict", "serve", "--data", str(tmp_path / "data"), *ports]
    with subprocess.Popen(command, cwd=work, stderr=subprocess.DEVNULL) as process:
        try:
            await service.until("/healthz", healthy)
        finally:
            process.send_signal(signal.SIGTERM)
            process.wait(PATIENCE_S)
    assert not (work / "was_run").exists()


ROBOTS_PORT = "attempts to open the robots' port failed"


def is_said(log: Path, words: str) -> bool:
    return words in log.read_text()


def taken_over(service: int, role: str, port: int) -> socket.socket:
    """Kills a role, and listens at its port before it starts again."""
    (server,), killed = fork_servers(service), children(service)[role]
    os.kill(server, signal.SIGSTOP)
    try:
        os.kill(killed, signal.SIGKILL)
        deadline_s = time.monotonic() + PATIENCE_S
        while time.monotonic() < deadline_s:
            with suppress(OSError):
                return socket.create_server(("127.0.0.1", port))
            time.sleep(0.01)
        raise AssertionError(f"{port} is not free")
    finally:
        os.kill(server, signal.SIGCONT)


async def test_a_role_that_finds_its_port_taken_when_it_starts_again_says_so_and_goes_on_without_it(
    tmp_path: Path,
) -> None:
    """The other program listens there from the death of the role until robots have been warned of."""
    log = tmp_path / "log.txt"
    served = Served(tmp_path / "data", log=log)
    with served.running() as pid:
        await served.until("/healthz", healthy)
        for role, port in (("receiver", served.robots_port), ("operator", served.operator_port)):
            other = taken_over(pid, role, port)
            await until(partial(is_said, log, f"can't listen on 127.0.0.1:{port}"))
            if role == "receiver":
                await served.until("/healthz", lambda health: ROBOTS_PORT in json.dumps(health["refused_or_lost"]))
            other.close()
            await until(partial(is_said, log, f"listening on 127.0.0.1:{port} again"))
            await served.until("/healthz", lambda health: all(up == "up" for up in health["roles"].values()))
    assert log.read_text().count("and all that needs no port goes on") == 2


async def test_webhooks_are_told_while_another_program_has_the_port_of_the_operator_face(tmp_path: Path) -> None:
    (tmp_path / "secret").write_text(SECRET)
    with socket.create_server(("127.0.0.1", 0)) as other, runtime_directory() as runtime, hearing() as other_end:
        hook = Webhook(name="mes", url=other_end.url, secret=f"file:{tmp_path / 'secret'}", kinds=("advisory",))
        site = Site(operator=Operator(port=other.getsockname()[1]), webhooks=(hook,))
        role, stop = OperatorRole(site, Path(runtime), tmp_path, render), asyncio.Event()
        running = asyncio.create_task(role.run(stop))
        engine = AsyncCaller(Path(runtime), "operator")
        await until((Path(runtime) / "operator.sock").exists)
        assert await engine.call("publish", packed_parcel({}, [to_json(made(1))])) == STORED
        await heard(other_end, 1)
        assert not role.ready.is_set()
        stop.set()
        await asyncio.wait_for(running, PATIENCE_S)
