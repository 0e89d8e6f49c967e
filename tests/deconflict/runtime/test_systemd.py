"""What systemd would be told by `deconflict serve`, over a socket as it opens one."""

import os
import signal
import socket
from collections.abc import Iterator
from pathlib import Path

import pytest

from deconflict.runtime.systemd import Notifier
from tests.deconflict.roles.made_service import Served
from tests.helpers.patience import PATIENCE_S

LOOPBACK = "127.0.0.1"


@pytest.fixture
def manager(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Iterator[socket.socket]:
    path = str(tmp_path / "notify")
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as listening:
        listening.bind(path)
        listening.settimeout(PATIENCE_S)
        monkeypatch.setenv("NOTIFY_SOCKET", path)
        monkeypatch.setenv("WATCHDOG_USEC", "2000000")
        monkeypatch.delenv("WATCHDOG_PID", raising=False)
        yield listening


def heard(manager: socket.socket, wanted: str) -> set[str]:
    """What is said before a message that begins like this."""
    before = set[str]()
    while not (said := manager.recv(4096).decode()).startswith(wanted):
        before.add(said)
    return before


def test_systemd_is_told_when_both_ports_are_open_that_it_goes_on_of_a_reload_and_of_the_end(
    tmp_path: Path, manager: socket.socket
) -> None:
    site = tmp_path / "site.toml"
    site.write_text("")
    service = Served(tmp_path / "data", site)
    with service.running() as pid:
        assert heard(manager, "READY=1") <= {"WATCHDOG=1"}
        for port in (service.robots_port, service.operator_port):
            socket.create_connection((LOOPBACK, port)).close()
        for _ in range(3):
            assert heard(manager, "WATCHDOG=1") == set()
        os.kill(pid, signal.SIGHUP)
        assert heard(manager, "RELOADING=1\nMONOTONIC_USEC=") <= {"WATCHDOG=1"}
        assert heard(manager, "READY=1") <= {"WATCHDOG=1"}
    assert heard(manager, "STOPPING=1") <= {"WATCHDOG=1"}
    manager.setblocking(False)
    with pytest.raises(BlockingIOError):
        heard(manager, "nothing more")


def test_it_is_said_four_times_within_what_is_asked_for(manager: socket.socket) -> None:
    one = Notifier(os.environ)
    for tick in range(41):
        one.goes_on(tick / 10)
    one.say("READY=1")
    for _ in range(9):
        assert heard(manager, "WATCHDOG=1") == set()
    assert heard(manager, "READY=1") == set()


def test_what_is_meant_for_another_process_is_not_said(manager: socket.socket, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("WATCHDOG_PID", str(os.getppid()))
    one = Notifier(os.environ)
    one.goes_on(1000.0)
    one.say("READY=1")
    assert heard(manager, "READY=1") == set()


def test_a_manager_that_is_gone_or_named_without_a_path_disturbs_nobody(tmp_path: Path) -> None:
    Notifier({"NOTIFY_SOCKET": str(tmp_path / "gone")}).say("READY=1")
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as listening:
        name = f"deconflict-{os.getpid()}"
        listening.bind(f"\0{name}")
        listening.settimeout(PATIENCE_S)
        Notifier({"NOTIFY_SOCKET": f"@{name}"}).say("READY=1")
        assert listening.recv(100) == b"READY=1"
