"""Two things at once, until whichever ends first."""

import asyncio
from collections.abc import Coroutine
from typing import Any


async def until_either(one: Coroutine[Any, Any, object], other: Coroutine[Any, Any, object]) -> None:
    """Do both until one of them ends, and then no more of the other. Raises what the one that ended raised."""
    tasks = {asyncio.create_task(one), asyncio.create_task(other)}
    try:
        done, _ = await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
    finally:
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)
    for task in done:
        task.result()
