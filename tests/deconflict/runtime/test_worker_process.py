"""Work in a process aside."""

import asyncio
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from deconflict.runtime.worker_process import AsideError, once
from tests.helpers.patience import PATIENCE_S

LARGE = bytes(10_000_000)
"""More than a pipe holds."""


class Awaited:
    """Is taken in by another process only once a file is there."""

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


def said(what: str, _: bytes) -> str:
    return what


def failing(_: str) -> None:
    raise ValueError("no such robot")


async def test_nothing_waits_while_a_process_begins_and_takes_in_what_it_is_given(tmp_path: Path) -> None:
    path = tmp_path / "said"
    work = asyncio.create_task(once(said, Awaited(path), LARGE))
    await asyncio.sleep(0)
    path.write_text("by who started it")
    assert await work == "by who started it"


async def test_who_asked_is_told_why_it_failed() -> None:
    with pytest.raises(AsideError, match="ValueError: no such robot"):
        await once(failing, "A-1")


async def test_work_that_nobody_waits_for_any_more_ends(tmp_path: Path) -> None:
    work = asyncio.create_task(once(found, tmp_path / "never"))
    await asyncio.sleep(0)
    work.cancel()
    with pytest.raises(asyncio.CancelledError):
        await work
