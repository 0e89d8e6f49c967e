"""Ports that can't be used end a start with a sentence, and what lies in the working directory is not run."""

import signal
import socket
import subprocess
import sys
from pathlib import Path

import pytest

from deconflict.__main__ import parser
from deconflict.roles.processes.ports import PortTakenError, refuse_taken
from deconflict.roles.processes.supervisor import PORTS
from deconflict.runtime.command_parsers import MISUSED
from deconflict.settings.site import Operator, Site
from ingest.settings import ReceiverSettings
from tests.deconflict.roles.made_service import Served, free_ports, healthy
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
