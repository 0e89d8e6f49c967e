"""A process that the fork server made, as its supervisor sees it."""

import os
import select
import signal
import socket
import subprocess
import time
from contextlib import suppress
from math import inf
from pathlib import Path

from deconflict.roles.processes.fork_server import MOST_BYTES, SOCKET_FILE

UNKNOWN_CODE = 255
"""The exit code of a process whose fork server does not send one."""
CODE_WITHIN_S = 0.5
"""The fork server sends the exit code so soon after the end of a process."""


class ForkedProcess:
    """The part of `subprocess.Popen` that a supervisor uses, for a process that another one forks."""

    def __init__(self, role: str, connection: socket.socket) -> None:
        """`connection` is one to the fork server, which has the request."""
        self._role, self._connection = role, connection
        self.pid: int | None = None
        """None while the fork server still loads the code."""
        self._process = -1
        """A descriptor of the process, once there is one; it becomes readable when the process ends."""
        self.returncode: int | None = None

    def poll(self) -> int | None:
        """The exit code; None while the process runs."""
        while self.returncode is None and self._is_news(0.0):
            self._receive()
        return self.returncode

    def wait(self, timeout: float | None = None) -> int:
        """The exit code, once the process has ended. Raises `subprocess.TimeoutExpired` after `timeout` seconds."""
        until_s = time.monotonic() + (inf if timeout is None else timeout)
        while (code := self.poll()) is None:
            left_s = until_s - time.monotonic()
            if left_s <= 0.0:
                raise subprocess.TimeoutExpired(self._role, timeout or 0.0)
            self._is_news(min(left_s, 1.0))
        return code

    def kill(self) -> None:
        """End the process. One that was not forked yet ends as soon as it is, since nobody holds its heartbeats."""
        if self._process < 0:
            self._end(UNKNOWN_CODE)
            return
        with suppress(ProcessLookupError):
            signal.pidfd_send_signal(self._process, signal.SIGKILL)

    def _is_news(self, timeout_s: float) -> bool:
        """Whether the fork server has sent something, or the process has ended."""
        return _is_readable(timeout_s, self._connection.fileno(), self._process)

    def _receive(self) -> None:
        """Take what the fork server sent. If it sends nothing, the process has ended."""
        if not _is_readable(CODE_WITHIN_S, self._connection.fileno()):
            self._end(_orphan_code(self._process))
            return
        try:
            message, descriptors, *_ = socket.recv_fds(self._connection, MOST_BYTES, 1)
        except OSError:
            message, descriptors = b"", []
        if descriptors:
            self.pid, (self._process,) = int(message), descriptors
        elif message:
            self._end(int(message))
        elif self._process < 0:
            self._end(UNKNOWN_CODE)
        else:
            self._connection.close()

    def _end(self, code: int) -> None:
        self.returncode = code
        self._connection.close()
        if self._process >= 0:
            os.close(self._process)
            self._process = -1


def _orphan_code(process: int) -> int:
    """Reap a process that has ended, and return its exit code. In a container the supervisor is process 1, so it gets
    the processes of a fork server that is dead."""
    with suppress(ChildProcessError):
        if ended := os.waitid(os.P_PIDFD, process, os.WEXITED | os.WNOHANG):
            return ended.si_status if ended.si_code == os.CLD_EXITED else -ended.si_status
    return UNKNOWN_CODE


def _is_readable(timeout_s: float, *descriptors: int) -> bool:
    """Whether one of the descriptors is readable, or becomes so in time. Negative ones are closed."""
    opened = [descriptor for descriptor in descriptors if descriptor >= 0]
    return bool(opened and select.select(opened, [], [], timeout_s)[0])


def forked(runtime: Path, role: str, heartbeats: socket.socket) -> ForkedProcess | None:
    """A process of a role, with `heartbeats` as its standard input; None if there is no fork server at present."""
    connection = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    try:
        connection.connect(str(runtime / SOCKET_FILE))
        socket.send_fds(connection, [role.encode()], [heartbeats.fileno()])
    except OSError:
        connection.close()
        return None
    return ForkedProcess(role, connection)
