"""When the engine's ticks happen: as soon as something has arrived, but not within `engine.tick_s` of the last one."""

import asyncio
from collections.abc import Callable
from contextlib import suppress

from ingest.recording.recorder import quantise

IDLE_TICK_S = 0.25
"""Passes are this far apart while nothing arrives."""


class TickTimes:
    """The ticks of the engine that asks for batches. A replay takes the times from the recording."""

    def __init__(self, shortest_s: float, clock: Callable[[], float]) -> None:
        """`clock` is the service's clock."""
        self._clock = clock
        self.shortest_s = shortest_s
        """The shortest time between two ticks; it may change."""
        self._tick_s = 0.0
        """The time of the last tick."""
        self._news = asyncio.Event()

    def note_message(self) -> None:
        """A message was accepted, which the next tick is for."""
        self._news.set()

    async def next_s(self) -> float:
        """The time of the next tick, once it has come. Ask for it when the pass of the last tick is over."""
        early_s = self._tick_s + self.shortest_s - self._clock()
        if early_s > 0:  # even sleep(0) costs one iteration of the event loop
            await asyncio.sleep(early_s)
        idle_s = self._tick_s + max(self.shortest_s, IDLE_TICK_S) - self._clock()
        if idle_s > 0 and not self._news.is_set():
            with suppress(TimeoutError):
                async with asyncio.timeout(idle_s):
                    await self._news.wait()
        self._news.clear()
        self._tick_s = quantise(max(self._clock(), self._tick_s))
        return self._tick_s
