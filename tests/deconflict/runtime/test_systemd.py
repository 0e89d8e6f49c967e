"""What `deconflict serve` sends to systemd, received on a socket like systemd's."""

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


def received_before(manager: socket.socket, prefix: str) -> set[str]:
    """The messages before the first that begins with a prefix."""
    before = set[str]()
    while not (message := manager.recv(4096).decode()).startswith(prefix):
        before.add(message)
    return before


def test_systemd_hears_of_open_ports_of_life_of_a_reload_and_of_the_end(tmp_path: Path, manager: socket.socket) -> None:
    site = tmp_path / "site.toml"
    site.write_text("")
    service = Served(tmp_path / "data", site)
    with service.running() as pid:
        assert received_before(manager, "READY=1") <= {"WATCHDOG=1"}
        for port in (service.robots_port, service.operator_port):
            socket.create_connection((LOOPBACK, port)).close()
        for _ in range(3):
            assert received_before(manager, "WATCHDOG=1") == set()
        os.kill(pid, signal.SIGHUP)
        assert received_before(manager, "RELOADING=1\nMONOTONIC_USEC=") <= {"WATCHDOG=1"}
        assert received_before(manager, "READY=1") <= {"WATCHDOG=1"}
    assert received_before(manager, "STOPPING=1") <= {"WATCHDOG=1"}
    manager.setblocking(False)
    with pytest.raises(BlockingIOError):
        received_before(manager, "nothing more")


def test_four_watchdog_messages_are_sent_in_each_interval(manager: socket.socket) -> None:
    notifier = Notifier(os.environ)
    for tick in range(41):
        notifier.send_watchdog(tick / 10)
    notifier.send("READY=1")
    for _ in range(9):
        assert received_before(manager, "WATCHDOG=1") == set()
    assert received_before(manager, "READY=1") == set()


def test_a_watchdog_for_another_process_is_not_served(manager: socket.socket, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("WATCHDOG_PID", str(os.getppid()))
    notifier = Notifier(os.environ)
    notifier.send_watchdog(1000.0)
    notifier.send("READY=1")
    assert received_before(manager, "READY=1") == set()


def test_a_missing_manager_is_no_error_and_an_abstract_socket_works(tmp_path: Path) -> None:
    Notifier({"NOTIFY_SOCKET": str(tmp_path / "gone")}).send("READY=1")
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as listening:
        name = f"deconflict-{os.getpid()}"
        listening.bind(f"\0{name}")
        listening.settimeout(PATIENCE_S)
        Notifier({"NOTIFY_SOCKET": f"@{name}"}).send("READY=1")
        assert listening.recv(100) == b"READY=1"
