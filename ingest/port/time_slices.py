"""Work for the event loop in short turns, so that whatever else the loop has to do waits for one turn at most.

Of a thousand sockets that are ready at once asyncio serves all before anything else. Where their messages take longer
to work through than they take to come, a batch that the engine asked for would wait for seconds.
"""

import asyncio
import time
from collections import deque
from collections.abc import Callable

TURN_S = 0.004
MOST_TURNS = 12
"""Of the usual length, that one may last where the loop is as busy with other things."""
MOST_WAITING, MOST_WEIGHT = 20_000, 64 << 20
"""Calls that wait, and what they weigh, before those who bring more are to wait themselves, until half is left."""


class TimeSlices:
    """Calls in the order in which they are given, at once while there is time. Belongs to one event loop."""

    def __init__(self, turn_s: float = TURN_S, clock: Callable[[], float] = time.monotonic) -> None:
        self._turn_s, self._clock = turn_s, clock
        self._waiting: deque[tuple[Callable[[], None], int]] = deque()
        self._weight = 0
        self._until_s: float | None = None
        """When this turn ends; None between turns."""
        self._round_s = 0.0
        """Since when the loop goes round."""
        self._when_room: list[Callable[[], None]] = []

    def do(self, call: Callable[[], None], weight: int = 0) -> None:
        """Call now, or in one of the next turns if this one is over or others wait already."""
        if self.at_once():
            call()
        else:
            self._waiting.append((call, weight))
            self._weight += weight

    def at_once(self) -> bool:
        """Whether a call need not wait; it may then be made without more ado."""
        if self._until_s is None:
            self._begin()
        return not self._waiting and self._clock() < (self._until_s or 0.0)

    def reweigh(self, by: int) -> None:
        """What waits has become heavier by so much."""
        self._weight += by

    @property
    def full(self) -> bool:
        """Whether too much waits."""
        return len(self._waiting) > MOST_WAITING or self._weight > MOST_WEIGHT

    def when_room(self, call: Callable[[], None]) -> None:
        """Call once, as soon as there is room again."""
        self._when_room.append(call)

    def finish(self) -> None:
        """Do all that waits now."""
        while self._waiting:
            self._call_first()

    def _begin(self) -> None:
        self._round_s = self._clock()
        self._until_s = self._round_s + self._turn_s
        asyncio.get_running_loop().call_soon(self._next)

    def _next(self) -> None:
        """A turn of what waits; the loop has gone round since the last one.

        It lasts for as long as that took if need be, so that who takes in more than can be done does not do nothing
        else; at most `MOST_TURNS` of the usual length.
        """
        self._until_s = None
        if not self._waiting:
            return
        took_s = self._clock() - self._round_s
        self._begin()
        until_s = self._round_s + min(max(took_s, self._turn_s), MOST_TURNS * self._turn_s)
        while self._waiting:
            self._grant_room()
            self._call_first()
            self._round_s = self._clock()
            if self._round_s >= until_s:
                return

    def _grant_room(self) -> None:
        if self._when_room and len(self._waiting) <= MOST_WAITING // 2 and self._weight <= MOST_WEIGHT // 2:
            waited, self._when_room = self._when_room, []
            for call in waited:
                call()

    def _call_first(self) -> None:
        call, weight = self._waiting.popleft()
        self._weight -= weight
        call()
