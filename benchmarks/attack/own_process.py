"""A function that runs in a process of its own until a block ends."""

import multiprocessing
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from multiprocessing.synchronize import Event
from typing import Any


@contextmanager
def in_own_process(run: Callable[..., None], *arguments: Any, core: int | None = None) -> Iterator[None]:
    """`run(*arguments, stop)` in a new process, on that core if one is given. `stop` is set when the block ends."""
    spawn = multiprocessing.get_context("spawn")
    stop = spawn.Event()
    process = spawn.Process(target=_run, args=(run, arguments, core, stop))
    process.start()
    try:
        yield
    finally:
        stop.set()
        process.join()


def _run(run: Callable[..., None], arguments: tuple[Any, ...], core: int | None, stop: Event) -> None:
    if core is not None:
        os.sched_setaffinity(0, {core})
    run(*arguments, stop)
