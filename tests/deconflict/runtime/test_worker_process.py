import asyncio
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from deconflict.runtime.worker_process import WorkerError, run_in_process
from tests.helpers.patience import PATIENCE_S

LARGE = bytes(10_000_000)
"""More than a pipe holds."""


class WaitsForFile:
    """Can be unpickled only run_in_process a file exists."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def __reduce__(self) -> tuple[Callable[[Path], str], tuple[Any, ...]]:
        return found, (self.path,)


def found(path: Path) -> str:
    until_s = time.monotonic() + PATIENCE_S
    while not path.exists():
        if time.monotonic() > until_s:
            raise TimeoutError(path)
        time.sleep(0.01)
    return path.read_text()


def first_argument(text: str, _: bytes) -> str:
    return text


def failing(_: str) -> None:
    raise ValueError("no such robot")


async def test_the_event_loop_does_not_wait_while_a_process_reads_its_arguments(tmp_path: Path) -> None:
    path = tmp_path / "file"
    work = asyncio.create_task(run_in_process(first_argument, WaitsForFile(path), LARGE))
    await asyncio.sleep(0)
    path.write_text("written by the parent")
    assert await work == "written by the parent"


async def test_the_error_of_the_work_reaches_the_caller() -> None:
    with pytest.raises(WorkerError, match="ValueError: no such robot"):
        await run_in_process(failing, "A-1")


async def test_cancelling_ends_the_work(tmp_path: Path) -> None:
    work = asyncio.create_task(run_in_process(found, tmp_path / "never"))
    await asyncio.sleep(0)
    work.cancel()
    with pytest.raises(asyncio.CancelledError):
        await work
