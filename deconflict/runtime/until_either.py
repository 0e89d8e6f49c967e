"""Two coroutines at once, until the first of them ends."""

import asyncio
from collections.abc import Coroutine
from typing import Any


async def until_either(first: Coroutine[Any, Any, object], second: Coroutine[Any, Any, object]) -> None:
    """Run both until one of them ends, then cancel the other. Raises the error of the one that ended."""
    tasks = {asyncio.create_task(first), asyncio.create_task(second)}
    try:
        done, _ = await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
    finally:
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)
    for task in done:
        task.result()
