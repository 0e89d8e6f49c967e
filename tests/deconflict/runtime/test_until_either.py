import asyncio

import pytest

from deconflict.runtime.until_either import until_either


class BrokenError(Exception):
    """The error of one of the two coroutines."""


async def test_the_end_of_one_cancels_the_other() -> None:
    ended = asyncio.Event()

    async def for_ever() -> None:
        try:
            await asyncio.Event().wait()
        finally:
            ended.set()

    await until_either(for_ever(), asyncio.sleep(0))
    assert ended.is_set()


async def test_the_error_of_the_one_that_ends_is_raised() -> None:
    async def breaks() -> None:
        raise BrokenError

    with pytest.raises(BrokenError):
        await until_either(asyncio.Event().wait(), breaks())


async def test_cancelling_cancels_both() -> None:
    ended: list[int] = []

    async def for_ever(which: int) -> None:
        try:
            await asyncio.Event().wait()
        finally:
            ended.append(which)

    doing = asyncio.create_task(until_either(for_ever(0), for_ever(1)))
    await asyncio.sleep(0)
    await asyncio.sleep(0)
    doing.cancel()
    with pytest.raises(asyncio.CancelledError):
        await doing
    assert sorted(ended) == [0, 1]
