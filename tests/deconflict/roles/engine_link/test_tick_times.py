"""When the engine's ticks happen, on an event loop whose time only passes while it waits."""

import asyncio
from collections.abc import Coroutine
from typing import Any

import pytest

from deconflict.roles.engine_link.tick_times import IDLE_TICK_S, TickTimes

SHORTEST_S = 0.02
START_S = 1000.0


class SimulatedTime(asyncio.SelectorEventLoop):
    """A loop that waits for nothing: its time goes to the next timer at once."""

    def __init__(self) -> None:
        self.now_s = START_S
        super().__init__()

    def time(self) -> float:
        return self.now_s

    def _run_once(self) -> None:
        if not self._ready and self._scheduled:  # type: ignore[attr-defined]
            self.now_s = max(self.now_s, self._scheduled[0].when())  # type: ignore[attr-defined]
        super()._run_once()  # type: ignore[misc]


def after_s(*, pass_s: float, news_s: float, shortest_s: float = SHORTEST_S) -> float:
    """How long after a tick the next one is, if passes take `pass_s` and the first news comes `news_s` after the
    tick."""

    async def steps() -> float:
        loop = asyncio.get_running_loop()
        ticks = TickTimes(shortest_s, loop.time)
        ticks.note_message()
        tick_s = await ticks.next_s()
        loop.call_later(news_s, ticks.note_message)
        await asyncio.sleep(pass_s)
        return await ticks.next_s() - tick_s

    return run(steps())


def run(steps: Coroutine[Any, Any, float]) -> float:
    with asyncio.Runner(loop_factory=SimulatedTime) as runner:
        return runner.run(steps)


def test_a_message_on_an_idle_floor_brings_a_tick_at_once() -> None:
    assert after_s(pass_s=0.001, news_s=0.05) == pytest.approx(0.05)


def test_ticks_without_a_message_are_as_far_apart_as_they_may_be() -> None:
    assert after_s(pass_s=0.001, news_s=10.0) == pytest.approx(IDLE_TICK_S)


def test_a_message_after_a_tick_waits_for_the_shortest_time_whatever_a_pass_takes() -> None:
    assert after_s(pass_s=0.001, news_s=0.002) == pytest.approx(SHORTEST_S)
    assert after_s(pass_s=0.01, news_s=0.002) == pytest.approx(SHORTEST_S)


def test_expensive_passes_follow_each_other_without_a_pause() -> None:
    assert after_s(pass_s=0.3, news_s=0.002) == pytest.approx(0.3)


def test_the_site_file_can_ask_for_fewer_passes() -> None:
    assert after_s(pass_s=0.001, news_s=0.002, shortest_s=0.5) == pytest.approx(0.5)
    assert after_s(pass_s=0.001, news_s=10.0, shortest_s=0.5) == pytest.approx(0.5)
