"""The fork server: it loads the code of the roles, and becomes a role in a copy of its process at each request.

It forks with one thread only, and runs nothing else, so that a copy of it is safe. The supervisor connects to its
socket for each process that it wants, and sends the role and the connection for its heartbeats. It receives the process
id with a descriptor of the process, and at last the exit code.
"""

import gc
import os
import select
import selectors
import socket
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from threading import Thread

from deconflict.runtime.heartbeat import HEARTBEAT_S, LONG_SILENCE_LIMIT_S, Heartbeat

SOCKET_FILE = "fork-server"
"""In the runtime directory."""
MOST_BYTES = 100
"""No message is longer."""
COMM = Path("/proc/self/comm")
"""The name of this process for `ps`."""

Beat = Callable[[], None]
Load = Callable[[str, Beat], None]
"""Loads the code of a role. Calls the beat at least once in `LONG_SILENCE_LIMIT_S`."""


class ForkServer:
    """Forks a process for each request. `roles` are loaded ahead while there is nothing else to do."""

    def __init__(self, runtime: Path, roles: Sequence[str], load: Load) -> None:
        self._load, self._unloaded = load, [*roles]
        self._heartbeat = Heartbeat()
        self._selector = selectors.DefaultSelector()
        self._listener = _listener(runtime / SOCKET_FILE)
        self._selector.register(self._listener, selectors.EVENT_READ)
        self._selector.register(sys.stdin, selectors.EVENT_READ)

    def serve(self) -> str | None:
        """Serve until the supervisor ends, and return None. Returns the role, in each forked process."""
        while True:
            self._heartbeat.beat()
            events = self._selector.select(HEARTBEAT_S)
            for key, _ in events:
                if key.fileobj is sys.stdin:
                    return None
                if key.fileobj is not self._listener:
                    self._report_end(*key.data)
                elif role := self._fork():
                    return role
            if not events and self._unloaded:
                self._load_role(self._unloaded[0], self._heartbeat)

    def _fork(self) -> str | None:
        """Fork the process of the next request. Returns its role in that process, and None in this one."""
        connection, _ = self._listener.accept()
        message, (heartbeats_fd, *_), *_ = socket.recv_fds(connection, MOST_BYTES, 1)
        role, heartbeats = message.decode(), socket.socket(fileno=heartbeats_fd)
        self._load_role(role, Heartbeat(heartbeats))
        pid = os.fork()
        if pid == 0:
            self._become(role, heartbeats, connection)
            return role
        heartbeats.close()
        process = os.pidfd_open(pid)
        self._selector.register(process, selectors.EVENT_READ, (pid, process, connection))
        with suppress(OSError):  # the supervisor has ended, and the process ends as well
            socket.send_fds(connection, [b"%d" % pid], [process])
        return None

    def _load_role(self, role: str, pending: Heartbeat) -> None:
        """Load the code of a role, if it is not loaded. `pending` beats for the process that waits for it, if any."""

        def beat() -> None:
            self._heartbeat.beat(LONG_SILENCE_LIMIT_S)
            pending.beat(LONG_SILENCE_LIMIT_S)

        if role in self._unloaded:
            beat()
            with _ending_with_supervisor():
                self._load(role, beat)
            self._unloaded.remove(role)
            gc.collect()
            gc.freeze()  # a collection in a copy would write to these pages, and so would copy them

    def _become(self, role: str, heartbeats: socket.socket, connection: socket.socket) -> None:
        """Make this copy of the process a role: it keeps nothing of the fork server's connections."""
        os.setsid()
        os.dup2(heartbeats.fileno(), sys.stdin.fileno())
        for key in [*self._selector.get_map().values()]:
            if key.data:
                _, process, other = key.data
                os.close(process)
                other.close()
        for opened in (self._heartbeat, heartbeats, connection, self._listener, self._selector):
            opened.close()
        with suppress(OSError):
            COMM.write_text(role)

    def _report_end(self, pid: int, process: int, connection: socket.socket) -> None:
        """Take note that a process has ended, and send its exit code."""
        self._selector.unregister(process)
        os.close(process)
        _, status = os.waitpid(pid, 0)
        with suppress(OSError):
            connection.send(b"%d" % os.waitstatus_to_exitcode(status))
        connection.close()


@contextmanager
def _ending_with_supervisor() -> Iterator[None]:
    """If the supervisor ends in this block, end at once: compiling takes a minute, and there is nothing to save."""
    done, finish = socket.socketpair()

    def watch() -> None:
        if sys.stdin in select.select([sys.stdin, done], [], [])[0]:
            os._exit(0)

    thread = Thread(target=watch)
    thread.start()
    try:
        yield
    finally:
        finish.close()
        thread.join()
        done.close()


def _listener(path: Path) -> socket.socket:
    path.unlink(missing_ok=True)
    listener = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    listener.bind(str(path))
    listener.listen()
    return listener
