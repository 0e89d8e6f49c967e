"""Work that takes long, in a process of its own that ends with this one, so that nothing live waits for it."""

import asyncio
import os
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context, parent_process
from multiprocessing.connection import Connection
from threading import Thread
from typing import Any, TypeVar

GENTLE = 10
"""Added to the process's niceness: what is live goes first."""
_SPAWN = get_context("spawn")
Told = TypeVar("Told")


class AsideError(RuntimeError):
    """The work failed; the message says why."""


def worker() -> ProcessPoolExecutor:
    """One process for work that comes again and again, started when it is first given some."""
    return ProcessPoolExecutor(1, _SPAWN, _begin)


async def once(work: Callable[..., Told], *given: object) -> Told:
    """Do one piece of work in a process that is killed where this is cancelled. Raises `AsideError`."""
    hearing, saying = _SPAWN.Pipe(duplex=False)
    process = _SPAWN.Process(target=_work, args=(saying, work, given), daemon=True)
    starting = asyncio.create_task(asyncio.to_thread(process.start))  # until it has taken in what it is given
    try:
        await asyncio.shield(starting)
        saying.close()
        done, told = await asyncio.to_thread(_heard, hearing)
    finally:
        await starting
        process.kill()
        process.join()
        hearing.close()
        process.close()
    if not done:
        raise AsideError(told)
    answer: Told = told
    return answer


def _heard(hearing: Connection) -> tuple[bool, Any]:
    try:
        told: tuple[bool, Any] = hearing.recv()
    except (EOFError, OSError):
        return False, "its process ended before it was done"
    return told


def _work(saying: Connection, work: Callable[..., Any], given: tuple[Any, ...]) -> None:
    _begin()
    try:
        saying.send((True, work(*given)))
    except Exception as error:  # noqa: BLE001 - whoever asked is told
        saying.send((False, f"{type(error).__name__}: {error}"))


def _begin() -> None:
    os.nice(GENTLE)
    Thread(target=_outlive_not, daemon=True).start()


def _outlive_not() -> None:
    parent = parent_process()
    if parent:
        parent.join()
        os._exit(1)
