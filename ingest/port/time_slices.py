"""Runs work in short slices of the event loop, so that everything else on the loop waits for one slice at most.

If a thousand sockets are ready at once, asyncio serves all of them before anything else. If their messages take longer
to process than to arrive, a batch that the engine asked for would wait for seconds.
"""

import asyncio
import time
from collections import deque
from collections.abc import Callable

SLICE_S = 0.004
MOST_SLICES = 12
"""Under overload a slice lasts at most this many times its usual length."""
MOST_WAITING, MOST_WEIGHT = 20_000, 64 << 20
"""Waiting calls, and their weight, at which the queue is full. There is room again once it has half of that."""


class TimeSlices:
    """Runs calls in the order in which they are given, at once if there is time. Belongs to one event loop."""

    def __init__(self, slice_s: float = SLICE_S, clock: Callable[[], float] = time.monotonic) -> None:
        self._slice_s, self._clock = slice_s, clock
        self._waiting: deque[tuple[Callable[[], None], int]] = deque()
        """Calls and their weights."""
        self._weight = 0
        """Of all waiting calls."""
        self._until_s: float | None = None
        """When this slice ends; None between slices."""
        self._iteration_s = 0.0
        """When the present iteration of the loop began."""
        self._when_room: list[Callable[[], None]] = []

    def run(self, call: Callable[[], None], weight: int = 0) -> None:
        """Call now, or in a later slice if this one is over or others wait already."""
        if self.is_free():
            call()
        else:
            self._waiting.append((call, weight))
            self._weight += weight

    def is_free(self) -> bool:
        """Whether a call need not wait. The caller may then make it directly."""
        if self._until_s is None:
            self._begin()
        return not self._waiting and self._clock() < (self._until_s or 0.0)

    def add_weight(self, change: int) -> None:
        """Add to the weight of the waiting calls. `change` may be negative."""
        self._weight += change

    @property
    def full(self) -> bool:
        """Whether too much waits."""
        return len(self._waiting) > MOST_WAITING or self._weight > MOST_WEIGHT

    def when_room(self, call: Callable[[], None]) -> None:
        """Call once, as soon as there is room again."""
        self._when_room.append(call)

    def finish(self) -> None:
        """Run everything that waits, now."""
        while self._waiting:
            self._call_first()

    def _begin(self) -> None:
        self._iteration_s = self._clock()
        self._until_s = self._iteration_s + self._slice_s
        asyncio.get_running_loop().call_soon(self._next)

    def _next(self) -> None:
        """Run waiting calls for one slice. One iteration of the loop has passed since the last slice.

        Under overload the slice lasts as long as that iteration, at most `MOST_SLICES` times its usual length.
        Otherwise a service that accepts more than it can process would do nothing but accept.
        """
        self._until_s = None
        if not self._waiting:
            return
        took_s = self._clock() - self._iteration_s
        self._begin()
        until_s = self._iteration_s + min(max(took_s, self._slice_s), MOST_SLICES * self._slice_s)
        while self._waiting:
            self._grant_room()
            self._call_first()
            self._iteration_s = self._clock()
            if self._iteration_s >= until_s:
                return

    def _grant_room(self) -> None:
        if self._when_room and len(self._waiting) <= MOST_WAITING // 2 and self._weight <= MOST_WEIGHT // 2:
            calls, self._when_room = self._when_room, []
            for call in calls:
                call()

    def _call_first(self) -> None:
        call, weight = self._waiting.popleft()
        self._weight -= weight
        call()
