"""Stretched time for a process: its clocks run slower than the wall by a factor, and so does every wait of its loops.

In a simulated second a role does what it does in a real second: as many ticks, heartbeats and messages, with the same
leases. It only has more processor time for that. The NATS server's own clock is not stretched,
so ages that it is told are multiplied instead. `perf_counter`, `process_time` and `thread_time` still measure costs.
"""

import asyncio
import selectors
import time
from dataclasses import replace
from typing import Any

from nats.js.api import ConsumerConfig, StreamConfig
from nats.js.manager import JetStreamManager

from deconflict.cluster.nats import subscriptions


class StretchedSelector(selectors.DefaultSelector):
    """Waits `stretch` times as long as it is asked to."""

    def __init__(self, stretch: float) -> None:
        super().__init__()
        self._stretch = stretch

    def select(self, timeout: float | None = None) -> list[tuple[selectors.SelectorKey, int]]:
        return super().select(timeout * self._stretch if timeout and timeout > 0 else timeout)


class StretchedLoops(asyncio.DefaultEventLoopPolicy):
    """Makes event loops whose waits are stretched. Their time is `time.monotonic()`."""

    def __init__(self, stretch: float) -> None:
        super().__init__()
        self._stretch = stretch

    def new_event_loop(self) -> asyncio.AbstractEventLoop:
        return asyncio.SelectorEventLoop(StretchedSelector(self._stretch))


def stretch_time(stretch: float, began_s: float) -> None:
    """From now on time passes `stretch` times more slowly in this process.

    `began_s` is the wall time at which simulated and wall time are the same. Call this before the modules are imported
    that keep a reference to a clock.
    """
    wall, monotonic, sleep = time.time, time.monotonic, time.sleep
    stretched = {
        "time": lambda: began_s + (wall() - began_s) / stretch,
        "monotonic": lambda: monotonic() / stretch,
        "sleep": lambda seconds: sleep(seconds * stretch),
    }
    for name, function in stretched.items():
        setattr(time, name, function)
    asyncio.set_event_loop_policy(StretchedLoops(stretch))
    _stretch_server_ages(stretch)


def _stretch_server_ages(stretch: float) -> None:
    """Multiply every time that a client gives to the server, which knows only the wall's."""
    add_stream, update_stream, add_consumer = (
        JetStreamManager.add_stream,
        JetStreamManager.update_stream,
        JetStreamManager.add_consumer,
    )

    def aged(config: StreamConfig) -> StreamConfig:
        age_s, same_s = config.max_age or 0.0, config.duplicate_window or 0.0  # 0 is without a limit
        return replace(config, max_age=age_s * stretch, duplicate_window=same_s * stretch)

    async def add(self: JetStreamManager, config: StreamConfig) -> Any:
        return await add_stream(self, aged(config))

    async def update(self: JetStreamManager, config: StreamConfig) -> Any:
        return await update_stream(self, aged(config))

    async def consume(self: JetStreamManager, stream: str, config: ConsumerConfig) -> Any:
        beat_s = config.idle_heartbeat
        return await add_consumer(self, stream, replace(config, idle_heartbeat=beat_s * stretch if beat_s else None))

    for name, function in {"add_stream": add, "update_stream": update, "add_consumer": consume}.items():
        setattr(JetStreamManager, name, function)
    subscriptions.REPLAYED_S *= stretch
