"""Long work in a process of its own, so that no live work waits for it. The process ends with this one."""

import asyncio
import os
import signal
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context, parent_process
from multiprocessing.connection import Connection
from threading import Thread
from typing import Any, TypeVar

NICENESS = 10
"""Added to the niceness of the process: live work goes first."""
SPAWN = get_context("spawn")
"""Workers start afresh: a fork would share sockets and locks of the live process."""
Result = TypeVar("Result")


class WorkerError(RuntimeError):
    """The work failed; the message says why."""


def worker_pool() -> ProcessPoolExecutor:
    """One process for repeated work. It starts with the first task."""
    return ProcessPoolExecutor(1, SPAWN, prepare_worker)


async def run_in_process(function: Callable[..., Result], *arguments: object) -> Result:
    """Call a function in a new process. Cancelling this kills the process. Raises `WorkerError`."""
    receiving, sending = SPAWN.Pipe(duplex=False)
    process = SPAWN.Process(target=_call, args=(sending, function, arguments), daemon=True)
    starting = asyncio.create_task(asyncio.to_thread(process.start))  # blocks until the process has read its arguments
    try:
        await asyncio.shield(starting)
        sending.close()
        succeeded, answer = await asyncio.to_thread(_received, receiving)
    finally:
        await starting
        process.kill()
        process.join()
        receiving.close()
        process.close()
    if not succeeded:
        raise WorkerError(answer)
    return answer


def _received(receiving: Connection) -> tuple[bool, Any]:
    """Whether the function succeeded, and its result or the text of its error."""
    try:
        answer: tuple[bool, Any] = receiving.recv()
    except (EOFError, OSError):
        return False, "its process ended before it was done"
    return answer


def _call(sending: Connection, function: Callable[..., Any], arguments: tuple[Any, ...]) -> None:
    prepare_worker()
    try:
        sending.send((True, function(*arguments)))
    except Exception as error:  # noqa: BLE001 - the caller gets the error
        sending.send((False, f"{type(error).__name__}: {error}"))


def prepare_worker() -> None:
    """Begin a worker process: it goes after live work, and ends with its parent."""
    os.nice(NICENESS)
    end_with_parent()


def end_with_parent() -> None:
    """Let this worker process end as soon as its parent has ended, however that did."""
    Thread(target=_exit_with_parent, daemon=True).start()


def end_with_command() -> None:
    """Let this worker process end with the command that it works for, and as quietly if somebody interrupts that."""
    end_with_parent()
    signal.signal(signal.SIGINT, signal.SIG_DFL)


def _exit_with_parent() -> None:
    parent = parent_process()
    if parent:
        parent.join()
        os._exit(1)
