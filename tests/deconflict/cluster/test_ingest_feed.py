"""Chores of a role end with it."""

import asyncio

import pytest

from deconflict.cluster.nats.nats_tasks import run_until
from tests.helpers.patience import PATIENCE_S


async def test_a_task_that_swallows_one_cancellation_still_ends() -> None:
    cancelled = 0

    async def stubborn() -> None:
        nonlocal cancelled
        while cancelled < 2:
            try:
                await asyncio.sleep(3600)
            except asyncio.CancelledError:
                cancelled += 1

    stop = asyncio.Event()
    stop.set()
    async with asyncio.timeout(PATIENCE_S):
        await run_until(stop, stubborn())
    assert cancelled == 2


async def test_a_task_that_fails_ends_the_others_and_raises() -> None:
    async def fails() -> None:
        raise ValueError("no more")

    async def waits() -> None:
        await asyncio.sleep(3600)

    async with asyncio.timeout(PATIENCE_S):
        with pytest.raises(ValueError, match="no more"):
            await run_until(asyncio.Event(), fails(), waits())
