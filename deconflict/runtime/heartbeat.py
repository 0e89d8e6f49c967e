"""The connection between the supervisor and a role, on the role's standard input.

Each side sees by it when the other ends, so that no role outlives its supervisor. A live role sends heartbeats: one
byte each, the number of seconds that it may be silent from now. A role that hangs sends nothing. A role that has opened
its port sends one zero.
"""

import asyncio
import os
import socket
import sys
import threading
from collections.abc import Callable
from contextlib import suppress

SILENCE_LIMIT_S = 20
"""A role may be silent for this long. It sends each second, except while it waits at most ten seconds for a call."""
LONG_SILENCE_LIMIT_S = 240
"""The same while a role starts, and before work that may take long."""
PORT_OPEN = 0
HEARTBEAT_S = 1.0
MOST_GAP_S = 1.0
"""Silence between two checks counts for at most this long: no role hangs because the supervisor itself was stopped."""


class HeartbeatMonitor:
    """The supervisor's side."""

    def __init__(self, now_s: float) -> None:
        """`now_s` is monotonic time, as in `hangs`."""
        self._ours, self.theirs = socket.socketpair()
        self._ours.setblocking(False)
        self._checked_s, self._silent_s, self._allowed_s = now_s, 0.0, LONG_SILENCE_LIMIT_S
        self.port_is_open = False
        """As of the last check."""

    def hangs(self, now_s: float) -> bool:
        """True once each time the silence limit passes."""
        self._silent_s += min(now_s - self._checked_s, MOST_GAP_S)
        self._checked_s = now_s
        received = self._received()
        self.port_is_open |= PORT_OPEN in received
        if allowed := received.replace(bytes([PORT_OPEN]), b""):
            self._silent_s, self._allowed_s = 0.0, allowed[-1]
        if self._silent_s <= self._allowed_s:
            return False
        self._silent_s = 0.0
        return True

    def close(self) -> None:
        self.theirs.close()
        self._ours.close()

    def _received(self) -> bytes:
        try:
            return self._ours.recv(4096)
        except OSError:
            return b""


class Heartbeat:
    """The role's side. Without a supervisor, when standard input is not a socket, nothing is sent."""

    def __init__(self, connection: socket.socket | None = None) -> None:
        """`connection` is another one than standard input."""
        self._socket: socket.socket | None
        try:
            self._socket = connection or socket.socket(fileno=os.dup(sys.stdin.fileno()))
        except OSError:
            self._socket = None

    def close(self) -> None:
        """Close the connection, but not standard input."""
        if self._socket:
            self._socket.close()

    def at_end(self, callback: Callable[[], object]) -> None:
        """Call `callback`, on a thread of its own, once the supervisor closes the connection or ends."""

        def wait() -> None:
            with suppress(OSError):  # the supervisor ended and left our last bytes unread
                while os.read(sys.stdin.fileno(), 4096):
                    pass
            callback()

        threading.Thread(target=wait, daemon=True).start()

    def beat(self, silence_limit_s: int = SILENCE_LIMIT_S) -> None:
        """Report that this role is alive, and for how long it may be silent now, at most 255 s."""
        self._send(silence_limit_s)

    def report_port_open(self) -> None:
        self._send(PORT_OPEN)

    def _send(self, byte: int) -> None:
        try:
            if self._socket:
                self._socket.send(bytes([byte]), socket.MSG_DONTWAIT)
        except OSError:
            return  # the supervisor does not read, or has ended, which `at_end` reports

    async def keep_beating(self) -> None:
        """Beat for as long as the event loop runs."""
        while True:
            self.beat()
            await asyncio.sleep(HEARTBEAT_S)
