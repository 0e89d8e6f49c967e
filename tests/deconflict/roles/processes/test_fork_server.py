"""The fork server in a process of its own, and the processes that it forks, as their supervisor sees them."""

import ctypes
import os
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path

import pytest

from deconflict.roles.processes.fork_server import SOCKET_FILE
from deconflict.roles.processes.forked_process import UNKNOWN_CODE, ForkedProcess, forked
from deconflict.roles.processes.role_process import RoleProcess, by_command
from deconflict.roles.processes.supervisor import Supervisor
from deconflict.settings.site import Site
from tests.deconflict.roles.processes.forking import LOADED
from tests.helpers.dependencies import ROOT
from tests.helpers.patience import PATIENCE_S

pytestmark = pytest.mark.skipif(not Path("/proc/self/comm").exists(), reason="needs Linux's /proc")


class Server:
    """A running fork server."""

    def __init__(self, runtime: Path, process: subprocess.Popen[bytes]) -> None:
        self.runtime, self.process = runtime, process
        self._forked: list[tuple[ForkedProcess, socket.socket]] = []

    def forked(self, role: str) -> tuple[ForkedProcess, socket.socket]:
        """A process of a role, and the supervisor's end of its standard input."""
        ours, theirs = socket.socketpair()
        until_s = time.monotonic() + PATIENCE_S
        while (process := forked(self.runtime, role, theirs)) is None:
            assert time.monotonic() < until_s, "the fork server does not answer"
            time.sleep(0.02)
        theirs.close()
        self._forked.append((process, ours))
        return process, ours

    def end(self) -> None:
        for process, ours in self._forked:
            ours.close()
            process.wait(PATIENCE_S)
        self.process.wait(PATIENCE_S)

    def running(self, role: str) -> tuple[ForkedProcess, socket.socket]:
        """The same, once the process is there and has the name of its role."""
        process, ours = self.forked(role)
        until_s = time.monotonic() + PATIENCE_S
        while process.pid is None or _name_of(process.pid) != role:
            assert (process.poll(), time.monotonic() < until_s) == (None, True), "people can tell the roles apart"
            time.sleep(0.02)
        return process, ours


def _name_of(pid: int) -> str:
    return Path(f"/proc/{pid}/comm").read_text().strip()


@contextmanager
def _server(runtime: Path, *roles: str) -> Iterator[Server]:
    module = [sys.executable, "-m", "tests.deconflict.roles.processes.forking"]
    ours, theirs = socket.socketpair()
    with subprocess.Popen([*module, str(runtime), *roles], stdin=theirs.fileno(), cwd=ROOT) as process:
        theirs.close()
        server = Server(runtime, process)
        try:
            yield server
        finally:
            process.send_signal(signal.SIGCONT)
            ours.close()
            server.end()


def test_the_exit_code_of_a_forked_process_is_known(tmp_path: Path) -> None:
    with _server(tmp_path) as server:
        ended, _ = server.forked("ends 7")
        waiting, ours = server.running("waits 1")
        assert ended.wait(PATIENCE_S) == 7
        assert waiting.poll() is None
        with pytest.raises(subprocess.TimeoutExpired):
            waiting.wait(0.01)
        killed, _ = server.running("waits 2")
        killed.kill()
        assert killed.wait(PATIENCE_S) == -signal.SIGKILL
        ours.close()
        assert waiting.wait(PATIENCE_S) == 1


def test_no_process_holds_the_standard_input_of_another_one(tmp_path: Path) -> None:
    with _server(tmp_path) as server:
        first, ours = server.running("waits 1")
        second, _ = server.running("waits 2")
        ours.close()
        assert first.wait(PATIENCE_S) == 1
        assert second.poll() is None


def test_code_is_loaded_once_and_ahead_of_requests(tmp_path: Path) -> None:
    with _server(tmp_path, "ends 1", "ends 2") as server:
        assert [server.forked(role)[0].wait(PATIENCE_S) for role in ("ends 2", "ends 2")] == [2, 2]
        until_s = time.monotonic() + PATIENCE_S
        while (loaded := (tmp_path / LOADED).read_text().splitlines()) != ["ends 2", "ends 1"]:
            assert (len(loaded) < 2, time.monotonic() < until_s) == (True, True), loaded
            time.sleep(0.05)


def test_without_a_fork_server_nothing_starts_and_nothing_counts_as_a_restart(tmp_path: Path) -> None:
    role = RoleProcess("engine", lambda heartbeats: forked(tmp_path, "ends 1", heartbeats))
    assert [role.ensure(now_s) for now_s in (0.0, 0.1, 0.2)] == [False] * 3
    assert (role.process, role.restarts, role.due_s) == (None, 0, float("-inf"))


def test_a_process_outlives_its_fork_server_and_its_end_is_seen(tmp_path: Path) -> None:
    with _server(tmp_path) as server:
        ending, ours = server.running("waits 1")
        hanging, _ = server.running("waits 2")
        server.process.kill()
        server.process.wait(PATIENCE_S)
        assert [ending.poll(), hanging.poll()] == [None, None]
        ours.close()
        assert ending.wait(PATIENCE_S) == UNKNOWN_CODE
        assert hanging.poll() is None
        hanging.kill()
        assert hanging.wait(PATIENCE_S) == UNKNOWN_CODE


def test_the_end_of_a_process_is_seen_although_its_fork_server_hangs(tmp_path: Path) -> None:
    with _server(tmp_path) as server:
        waiting, ours = server.running("waits 1")
        os.kill(server.process.pid, signal.SIGSTOP)
        ours.close()
        assert waiting.wait(PATIENCE_S) == UNKNOWN_CODE


def test_a_request_that_the_fork_server_takes_with_it_is_made_again(tmp_path: Path) -> None:
    with _server(tmp_path, "slow 1") as server:
        waiting, _ = server.forked("slow 1")
        while not (tmp_path / LOADED).exists():
            assert waiting.poll() is None
            time.sleep(0.02)
        server.process.kill()
        assert waiting.wait(PATIENCE_S) == UNKNOWN_CODE


def test_a_process_that_is_killed_before_it_is_there_ends_when_it_is(tmp_path: Path) -> None:
    with _server(tmp_path) as server:
        server.running("waits 1")[1].close()
        os.kill(server.process.pid, signal.SIGSTOP)
        waiting, ours = server.forked("waits 2")
        waiting.kill()
        assert waiting.poll() == UNKNOWN_CODE
        ours.close()
        os.kill(server.process.pid, signal.SIGCONT)
        after, _ = server.running("waits 3")
        children = Path(f"/proc/{server.process.pid}/task/{server.process.pid}/children")
        until_s = time.monotonic() + PATIENCE_S
        while children.read_text().split() != [str(after.pid)]:
            assert time.monotonic() < until_s, "the process that nobody wanted is there for ever"
            time.sleep(0.02)


@pytest.mark.parametrize("loaded", [(), ("slow 1",)])
def test_the_fork_server_ends_with_its_supervisor_also_while_it_loads(tmp_path: Path, loaded: tuple[str, ...]) -> None:
    command = [sys.executable, "-m", "tests.deconflict.roles.processes.forking", str(tmp_path), *loaded]
    role = RoleProcess("fork server", by_command(command))
    role.ensure(0.0)
    assert role.process
    until_s = time.monotonic() + PATIENCE_S
    while not (tmp_path / (LOADED if loaded else SOCKET_FILE)).exists():
        assert time.monotonic() < until_s
        time.sleep(0.02)
    role.stop()
    assert role.process.poll() == 0


def test_a_role_whose_code_is_still_loaded_stops_at_once(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    with _server(tmp_path, "slow 1") as server:
        role = RoleProcess("engine", lambda heartbeats: forked(server.runtime, "slow 1", heartbeats))
        while not role.process:
            role.ensure(time.monotonic())
        role.stop()
        assert role.process.poll() == UNKNOWN_CODE
        assert "did not stop" not in caplog.text, "people wait for it"


class FrozenServer(RoleProcess):
    """A fork server that goes on, with what it was asked for before, when it has been told to end."""

    def stop(self) -> None:
        assert self.process
        assert self.process.pid
        assert self.heartbeats
        self.heartbeats.close()
        os.kill(self.process.pid, signal.SIGCONT)
        super().stop()


def test_a_service_that_stops_while_it_starts_leaves_no_role_behind(tmp_path: Path) -> None:
    supervisor, stop = Supervisor(Site(), tmp_path / "data", tmp_path), threading.Event()
    command = [sys.executable, "-m", "tests.deconflict.roles.processes.forking", str(tmp_path)]
    server = supervisor.fork_server = FrozenServer("fork server", by_command(command))
    role = RoleProcess("goes_on 1", partial(forked, tmp_path, "goes_on 1"))
    supervisor.roles = [role]
    server.ensure(time.monotonic())
    until_s = time.monotonic() + PATIENCE_S
    while not (tmp_path / SOCKET_FILE).exists():
        assert time.monotonic() < until_s
        time.sleep(0.02)
    assert server.process
    pid = server.process.pid or 0
    os.kill(pid, signal.SIGSTOP)
    while not role.ensure(time.monotonic()):  # its socket was there, and nobody listened at it yet
        assert time.monotonic() < until_s
        os.kill(pid, signal.SIGCONT)
        time.sleep(0.02)
        os.kill(pid, signal.SIGSTOP)
    stop.set()
    supervisor.run(stop)
    assert (tmp_path / "goes_on 1").exists(), "it still runs, and its directory is removed now"


def test_a_role_that_was_forked_just_now_is_waited_for_when_it_stops(tmp_path: Path) -> None:
    with _server(tmp_path) as server:
        role = RoleProcess("engine", lambda heartbeats: forked(server.runtime, "waits 1", heartbeats))
        while not role.process:
            role.ensure(time.monotonic())
        children = Path(f"/proc/{server.process.pid}/task/{server.process.pid}/children")
        until_s = time.monotonic() + PATIENCE_S
        while not children.read_text():
            assert time.monotonic() < until_s
            time.sleep(0.02)
        server.running("waits 2")[1].close()  # answered in order, so the id of the first one has been sent
        role.stop()
        assert role.process.returncode == 1, "it holds its files and ports until it ends"


SET_CHILD_SUBREAPER = 36
"""For `prctl`."""


def test_process_1_of_a_container_leaves_no_zombie_of_a_dead_fork_server(tmp_path: Path) -> None:
    prctl = ctypes.CDLL(None).prctl
    assert prctl(SET_CHILD_SUBREAPER, 1, 0, 0, 0) == 0
    try:
        with _server(tmp_path) as server:
            ending, ours = server.running("waits 1")
            server.process.kill()
            server.process.wait(PATIENCE_S)
            ours.close()
            assert ending.wait(PATIENCE_S) == 1
            assert not Path(f"/proc/{ending.pid}").exists()
    finally:
        prctl(SET_CHILD_SUBREAPER, 0, 0, 0, 0)
