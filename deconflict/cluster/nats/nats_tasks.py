"""Tasks that use a NATS server which may not answer."""

import asyncio
import logging
import time
from collections.abc import Awaitable, Callable, Coroutine
from contextlib import suppress
from typing import Any, TypeVar

from deconflict.cluster.nats.bus import Bus
from deconflict.cluster.nats.subscriptions import BUS_ERRORS

log = logging.getLogger(__name__)

Result = TypeVar("Result")

BEAT_EVERY_S = 0.5
CANCEL_AGAIN_S = 0.2
LAST_S = 1.0
"""A member that ends waits for a server at most this long."""


async def open_bus(bus: Bus, stop: asyncio.Event) -> bool:
    """Open a bus as soon as a server answers. False if `stop` is set before."""
    stopping = asyncio.create_task(stop.wait())
    try:
        while not stop.is_set():
            opening = asyncio.create_task(bus.open())
            await asyncio.wait({opening, stopping}, return_when=asyncio.FIRST_COMPLETED)
            try:
                if opening.done():
                    await opening
                    return True
            except BUS_ERRORS as error:
                log.warning("the NATS server does not answer: %s", error or type(error).__name__)
                await asyncio.wait({stopping}, timeout=1.0)
            finally:
                opening.cancel()
                await asyncio.gather(opening, return_exceptions=True)
        return False
    finally:
        stopping.cancel()


async def beat_repeatedly(bus: Bus, beat: Callable[[], Awaitable[None]]) -> None:
    """Call `beat` without end, also while no server answers."""
    while True:
        began_s = time.monotonic()
        try:
            await beat()
        except BUS_ERRORS as error:
            bus.connection.warn(f"{bus.name} has no connection: {error or type(error).__name__}")
        await asyncio.sleep(max(BEAT_EVERY_S - (time.monotonic() - began_s), 0.05))


async def answered(call: Callable[[], Awaitable[Result]]) -> Result:
    """The result of a call, repeated until a server answers it: one that restarted may lack its streams at first."""
    while True:
        try:
            return await call()
        except BUS_ERRORS as error:
            log.warning("a NATS server does not answer a call: %s", error or type(error).__name__)
            await asyncio.sleep(BEAT_EVERY_S)


async def run_until(stop: asyncio.Event, *coroutines: Coroutine[Any, Any, None]) -> None:
    """Run coroutines until `stop` is set or one of them fails. Raises its error."""
    tasks: list[asyncio.Task[Any]] = [asyncio.create_task(coroutine) for coroutine in coroutines]
    tasks.append(asyncio.create_task(stop.wait()))
    try:
        await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
        for task in tasks:
            if task.done():
                await task
    finally:
        await end_tasks(*tasks)


async def call_last(bus: Bus, *calls: Callable[[], Awaitable[None]]) -> None:
    """Make the last calls of a member that ends. They are given up if no server answers within `LAST_S`."""
    if bus.connection.is_connected():
        with suppress(*BUS_ERRORS):
            async with asyncio.timeout(LAST_S):
                for call in calls:
                    await call()


async def end_tasks(*tasks: asyncio.Task[Any]) -> None:
    """Cancel tasks until every one has ended.

    One cancellation is not enough: the NATS client may take it for a time-out of its own.
    """
    pending = set(tasks)
    while pending:
        for task in pending:
            task.cancel()
        _, pending = await asyncio.wait(pending, timeout=CANCEL_AGAIN_S)
    await asyncio.gather(*tasks, return_exceptions=True)
