"""Work for the event loop in short turns, so that whatever else the loop has to do waits for one turn at most.

Of a thousand sockets that are ready at once asyncio serves all before anything else. Where their messages take longer
to work through than they take to come, a batch that the engine asked for would wait for seconds.
"""

import asyncio
import time
from collections import deque
from collections.abc import Callable

TURN_S = 0.01
MOST_WAITING = 2000
"""Calls that wait before those who bring more are to wait themselves, until half as many do."""


class Turns:
    """Calls in the order in which they are given, at once while there is time. Belongs to one event loop."""

    def __init__(self, turn_s: float = TURN_S) -> None:
        self._turn_s = turn_s
        self._waiting: deque[Callable[[], None]] = deque()
        self._until_s: float | None = None
        """When this turn ends; None between turns."""
        self._when_room: list[Callable[[], None]] = []

    def do(self, call: Callable[[], None]) -> None:
        """Call now, or in one of the next turns if this one is over or others wait already."""
        if self._until_s is None:
            self._begin()
        if self._waiting or time.monotonic() >= (self._until_s or 0.0):
            self._waiting.append(call)
        else:
            call()

    @property
    def full(self) -> bool:
        """Whether too many calls wait."""
        return len(self._waiting) > MOST_WAITING

    def when_room(self, call: Callable[[], None]) -> None:
        """Call once, as soon as there is room again."""
        self._when_room.append(call)

    def finish(self) -> None:
        """Do all that waits now."""
        while self._waiting:
            self._waiting.popleft()()

    def _begin(self) -> None:
        self._until_s = time.monotonic() + self._turn_s
        asyncio.get_running_loop().call_soon(self._next)

    def _next(self) -> None:
        """A turn of what waits; the loop has gone round since the last one."""
        self._until_s = None
        if not self._waiting:
            return
        self._begin()
        until_s = time.monotonic() + self._turn_s
        while True:
            self._waiting.popleft()()
            if self._when_room and len(self._waiting) <= MOST_WAITING // 2:
                waited, self._when_room = self._when_room, []
                for call in waited:
                    call()
            if not self._waiting or time.monotonic() >= until_s:
                return
