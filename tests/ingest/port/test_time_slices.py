import asyncio
from functools import partial

import pytest

from ingest.port.time_slices import MOST_WAITING, MOST_WEIGHT, TimeSlices


def test_calls_are_made_in_their_order_and_at_once_where_there_is_time() -> None:
    async def run() -> tuple[list[int], list[int]]:
        slices, done = TimeSlices(slice_s=10.0), list[int]()
        for n in range(5):
            slices.run(partial(done.append, n))
        return list(done), done

    at_once, done = asyncio.run(run())
    assert at_once == done == [0, 1, 2, 3, 4]


def test_the_loop_runs_between_slices_and_the_order_is_kept() -> None:
    async def run() -> list[str | int]:
        slices, done = TimeSlices(slice_s=0.0), list[str | int]()
        loop = asyncio.get_running_loop()
        for n in range(3):
            slices.run(partial(done.append, n))
        loop.call_soon(done.append, "another")
        assert done == []
        while len(done) < 4:
            await asyncio.sleep(0)
        return done

    assert asyncio.run(run()) == [0, "another", 1, 2]


def test_finish_runs_everything_that_waits() -> None:
    async def run() -> list[int]:
        slices, done = TimeSlices(slice_s=0.0), list[int]()
        for n in range(3):
            slices.run(partial(done.append, n))
        slices.finish()
        return done

    assert asyncio.run(run()) == [0, 1, 2]


def test_long_work_leaves_time_for_other_work() -> None:
    """Three hundredths of a second of work, in slices of one."""
    now_s = 0.0

    async def run() -> list[str]:
        slices, done = TimeSlices(slice_s=0.01, clock=lambda: now_s), list[str]()

        def work() -> None:
            nonlocal now_s
            now_s += 0.01
            done.append("work")

        for _ in range(3):
            slices.run(work)
        asyncio.get_running_loop().call_soon(done.append, "another")
        while len(done) < 4:
            await asyncio.sleep(0)
        return done

    assert asyncio.run(run()).index("another") < 3


@pytest.mark.parametrize(("calls", "weight"), [(2 * MOST_WAITING, 0), (100, MOST_WEIGHT // 50)], ids=["many", "heavy"])
def test_a_full_queue_calls_back_when_there_is_room_again(calls: int, weight: int) -> None:
    async def run() -> list[int]:
        slices, done, waited = TimeSlices(slice_s=0.0), list[int](), asyncio.Event()
        for n in range(calls):
            assert slices.full == (n > calls // 2)
            slices.run(partial(done.append, n), weight)
        slices.when_room(waited.set)
        await waited.wait()
        assert not slices.full
        assert 3 * calls // 4 <= len(done) < calls
        slices.finish()
        return done

    assert asyncio.run(run()) == list(range(calls))


@pytest.mark.parametrize(("round_s", "calls"), [(0.01, 10), (0.03, 30), (1.0, 120)])
def test_a_slice_lasts_as_long_as_the_last_loop_iteration_within_bounds(round_s: float, calls: int) -> None:
    """Who takes in messages all the time still reads them for as long."""
    now_s, done = 0.0, 0

    def spend(span_s: float) -> None:
        nonlocal now_s
        now_s += span_s

    def work() -> None:
        nonlocal done
        spend(0.001)
        done += 1

    async def run() -> int:
        slices = TimeSlices(slice_s=0.01, clock=lambda: now_s)
        slices.run(partial(spend, 0.01))
        for _ in range(200):
            slices.run(work)
        assert done == 0
        spend(round_s - now_s)
        await asyncio.sleep(0)
        return done

    assert asyncio.run(run()) == pytest.approx(calls, abs=1)


def test_a_call_that_fails_does_not_keep_the_others() -> None:
    async def run() -> list[int]:
        slices, done = TimeSlices(slice_s=0.0), list[int]()
        asyncio.get_running_loop().set_exception_handler(lambda *_: done.append(-1))
        slices.run(lambda: done.append(1 // 0))
        slices.run(partial(done.append, 2))
        while 2 not in done:
            await asyncio.sleep(0)
        return done

    assert asyncio.run(run()) == [-1, 2]
