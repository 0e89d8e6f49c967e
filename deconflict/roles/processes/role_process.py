"""One process of the service: started, watched, and started again after it ended."""

import logging
import os
import signal
import socket
import subprocess
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Protocol

from deconflict.runtime.heartbeat import HeartbeatMonitor

log = logging.getLogger(__name__)

STOP_TIMEOUT_S = 10.0
CRASHES = tuple(-number for number in (signal.SIGSEGV, signal.SIGBUS, signal.SIGABRT, signal.SIGILL, signal.SIGFPE))
"""Exit codes of processes that their own code has ended. So do positive ones."""
BACKOFF_S = (0.2, 10.0)
"""First and longest wait before a role that ends repeatedly is restarted. The first restart is at once."""
STEADY_S = 10.0
"""A role that ran for this long does not end repeatedly."""
MEMORY = {"MALLOC_ARENA_MAX": "2"}
"""Default environment of the roles. glibc gives threads heaps of their own, up to eight for each core, and each heap
keeps its largest size. With this setting all threads share one heap."""


class ChildProcess(Protocol):
    """The part of `subprocess.Popen` that is used here."""

    @property
    def pid(self) -> int | None: ...

    @property
    def returncode(self) -> int | None: ...

    def poll(self) -> int | None: ...

    def wait(self, timeout: float | None = None) -> int: ...

    def kill(self) -> None: ...


Start = Callable[[socket.socket], ChildProcess | None]
"""Starts a process with this socket as its standard input; None if that is not possible yet."""


def by_command(command: Sequence[str]) -> Start:
    """Starts a process by a command."""

    def start(heartbeats: socket.socket) -> ChildProcess:
        return subprocess.Popen(command, stdin=heartbeats.fileno(), start_new_session=True, env=MEMORY | os.environ)  # noqa: S603

    return start


@dataclass(slots=True, eq=False)
class RoleProcess:
    """One role's process. It ends when its heartbeat connection closes, so it never outlives its supervisor."""

    role: str
    start: Start
    process: ChildProcess | None = None
    """None while it does not run."""
    heartbeats: HeartbeatMonitor | None = None
    """Of the running process, or of the last one."""
    restarts: int = 0
    started_s: float = field(default=float("-inf"))
    """When the process was last started. Times are of the monotonic clock."""
    backoff_s: float = 0.0
    """How long the next restart waits."""
    due_s: float = float("-inf")
    """No start before this time."""
    failed_after_s: float | None = None
    """How long the last process ran, if it crashed or hung; None if it ended in another way."""
    hung: bool = False
    """Whether the process was killed because it hung."""

    def ensure(self, now_s: float) -> bool:
        """Start the process if it does not run and is due; kill it if it hangs. Returns whether it ended or started."""
        if self.process and self.heartbeats and self.process.poll() is None:
            if self.heartbeats.hangs(now_s):
                log.error("the %s hangs and is killed", self.role)
                self.hung = True
                self.process.kill()
            return False
        ended = self.note_end(now_s)
        if now_s < self.due_s:
            return ended
        heartbeats = HeartbeatMonitor(now_s)
        self.process = self.start(heartbeats.theirs)
        heartbeats.theirs.close()
        if self.process is None:
            heartbeats.close()
            return ended
        self.heartbeats, self.started_s = heartbeats, now_s
        return True

    def note_end(self, now_s: float) -> bool:
        """Take note of it if the process has ended. Returns whether it has."""
        if self.process is None or self.process.poll() is None:
            return False
        self._note_end(now_s, self.process)
        return True

    def _note_end(self, now_s: float, process: ChildProcess) -> None:
        crashed = process.returncode in CRASHES or (process.returncode or 0) > 0
        self.failed_after_s = now_s - self.started_s if crashed or self.hung else None
        self.hung = False
        if now_s - self.started_s > STEADY_S:
            self.backoff_s = 0.0
        log.warning(
            "the %s ended with code %s and is restarted in %.1f s", self.role, process.returncode, self.backoff_s
        )
        self.due_s = now_s + self.backoff_s
        self.backoff_s = min(max(2 * self.backoff_s, BACKOFF_S[0]), BACKOFF_S[1])
        self.restarts += 1
        if self.heartbeats:
            self.heartbeats.close()
        self.process = None

    @property
    def pid(self) -> int | None:
        """None while it does not run, or is still loaded."""
        return self.process.pid if self.process else None

    def document(self) -> dict[str, float | None]:
        """The number of restarts, since when the process runs, None if it does not run, and `failed_after_s`."""
        since_s = self.started_s if self.process else None
        return {"restarts": self.restarts, "since_s": since_s, "failed_after_s": self.failed_after_s}

    def stop(self) -> None:
        if self.process is None:
            return
        if self.heartbeats:
            self.heartbeats.close()
        if self.process.poll() is None and self.pid is None:
            self.process.kill()
        try:
            self.process.wait(STOP_TIMEOUT_S)
        except subprocess.TimeoutExpired:
            log.warning("the %s did not stop in %s s and is killed", self.role, STOP_TIMEOUT_S)
            self.process.kill()
            self.process.wait()
