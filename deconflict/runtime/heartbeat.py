"""The line between the supervisor and a role, on the role's standard input.

Either end sees the other's end by it, so that no role outlives its supervisor. A role that goes on says so, a byte each
time: for how many seconds it may be silent from now. One that hangs says nothing. One that has opened its port says so
once, by a zero.
"""

import asyncio
import os
import socket
import sys
import threading
from collections.abc import Callable
from contextlib import suppress

SILENT_S = 20
"""For so long a role may be silent. Its calls to others end within ten seconds, and it speaks each second otherwise."""
LONG_S = 240
"""The same while it begins, and before what may take long."""
SERVES = 0
SPEAK_EVERY_S = 1.0
GAP_S = 1.0
"""Silence between two looks counts for no more: where the supervisor itself stood still, nobody hangs."""


class Watching:
    """The supervisor's end."""

    def __init__(self, now_s: float) -> None:
        """`now_s` is of a clock that is never set, as in `hangs`."""
        self._ours, self.theirs = socket.socketpair()
        self._ours.setblocking(False)
        self._looked_s, self._silent_s, self._allowed_s = now_s, 0.0, LONG_S
        self.serves = False
        """Whether its port was open at the last look."""

    def hangs(self, now_s: float) -> bool:
        """Whether the role has been silent for longer than it may; told once, and then counted anew."""
        self._silent_s += min(now_s - self._looked_s, GAP_S)
        self._looked_s = now_s
        said = self._said()
        self.serves |= SERVES in said
        if allowed := said.replace(bytes([SERVES]), b""):
            self._silent_s, self._allowed_s = 0.0, allowed[-1]
        if self._silent_s <= self._allowed_s:
            return False
        self._silent_s = 0.0
        return True

    def close(self) -> None:
        self.theirs.close()
        self._ours.close()

    def _said(self) -> bytes:
        try:
            return self._ours.recv(4096)
        except OSError:
            return b""


class Lifeline:
    """The role's end. Where standard input is no such line, as of a role without a supervisor, nobody is told."""

    def __init__(self) -> None:
        try:
            self._line: socket.socket | None = socket.socket(fileno=sys.stdin.fileno())
        except OSError:
            self._line = None

    def at_end(self, then: Callable[[], object]) -> None:
        """Call `then`, on a thread of its own, once the supervisor ends the line or is gone."""

        def wait() -> None:
            with suppress(ConnectionResetError):  # what was said last is not heard any more
                while os.read(sys.stdin.fileno(), 4096):
                    pass
            then()

        threading.Thread(target=wait, daemon=True).start()

    def goes_on(self, silent_s: int = SILENT_S) -> None:
        """Say that this role goes on, and for how long it may be silent now, at most 255 s."""
        self._say(silent_s)

    def serves(self) -> None:
        """Say that this role's port is open."""
        self._say(SERVES)

    def _say(self, byte: int) -> None:
        try:
            if self._line:
                self._line.send(bytes([byte]), socket.MSG_DONTWAIT)
        except OSError:
            return  # a supervisor that does not listen, or is gone, which `at_end` tells

    async def speaking(self) -> None:
        """Say so for as long as the event loop goes round."""
        while True:
            self.goes_on()
            await asyncio.sleep(SPEAK_EVERY_S)
