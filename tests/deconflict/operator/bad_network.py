"""What is between the page and the service while a test delays, reorders, repeats and loses answers and messages."""

import asyncio
import re
from collections.abc import Callable, Coroutine
from contextlib import suppress
from functools import partial
from random import Random
from typing import TYPE_CHECKING, Any
from urllib.parse import urlsplit

if TYPE_CHECKING:
    from playwright.async_api import Page, Route, WebSocketRoute

Fate = list[float]
"""After how many seconds each copy of an answer or a message arrives; empty if it is lost."""
AT_ONCE: Fate = [0.0]
ANSWERS = ("past", "heat", "recorded", "presence", "situations", "advisories", "advice", "site")
MESSAGES = ("live", "stream")


def drawn_fate(random: Random, delay_s: float, spread_s: float, lost: float, again: float) -> Fate:
    """`lost` and `again` are the probabilities that it is lost, and that it comes once more."""
    copies = (random.random() >= lost) + (random.random() < again)
    return [delay_s + spread_s * random.random() for _ in range(copies)]


class BadNetwork:
    """Decides for each answer and message, by its kind, what becomes of it. Without a decision it arrives at once."""

    def __init__(self) -> None:
        self.fates: dict[str, Callable[[], Fate]] = {}
        self._held: dict[str, list[Callable[[], None]]] = {}
        self._tasks: set[asyncio.Task[None]] = set()

    async def between(self, page: "Page") -> None:
        await page.route(re.compile(rf"^[^?]*/({'|'.join(ANSWERS)})(\?.*)?$"), self._answer)
        await page.route_web_socket(re.compile(r"/(live|advisories/stream)(\?.*)?$"), self._connect)

    def lose(self, *kinds: str) -> None:
        for kind in kinds:
            self.fates[kind] = list

    def hold(self, kind: str) -> None:
        """Let what comes of a kind wait for `release`."""
        self._held[kind] = []

    def held(self, kind: str) -> int:
        return len(self._held[kind])

    def release(self, kind: str, order: Callable[[list[Callable[[], None]]], None] = lambda _: None) -> None:
        waiting = self._held.pop(kind)
        order(waiting)
        for deliver in waiting:
            deliver()

    def clear_up(self) -> None:
        self.fates.clear()

    def storm(self, random: Random) -> None:
        """New weather for each kind: nothing wrong, a delay, various delays, or losses; repeated now and then."""
        for kind in (*ANSWERS, *MESSAGES):
            delay_s, spread_s = random.choice([(0.0, 0.0), (0.0, 0.0), (3.5, 0.0), (0.2, 1.5), (1.0, 5.0)])
            lost, again = random.choice([0.0, 0.0, 0.02, 0.3, 1.0]), random.choice([0.0, 0.1])
            self.fates[kind] = partial(drawn_fate, random, delay_s, spread_s, lost, again)

    async def _answer(self, route: "Route") -> None:
        kind = urlsplit(route.request.url).path.rpartition("/")[2]
        with suppress(Exception):  # the page has gone, or waits no more
            response = await route.fetch()
            self._pass_on(kind, lambda: self._run(route.fulfill(response=response)), copies=1)

    def _connect(self, page: "WebSocketRoute") -> None:
        kind, server = urlsplit(page.url).path.rpartition("/")[2], page.connect_to_server()
        page.on_message(server.send)
        server.on_message(lambda message: self._pass_on(kind, lambda: page.send(message)))

    def _pass_on(self, kind: str, deliver: Callable[[], None], copies: int = 9) -> None:
        if kind in self._held:
            self._held[kind].append(deliver)
            return
        for after_s in self.fates.get(kind, lambda: AT_ONCE)()[:copies]:
            if after_s:
                asyncio.get_running_loop().call_later(after_s, deliver)
            else:
                deliver()

    def _run(self, sending: Coroutine[Any, Any, None]) -> None:
        async def send() -> None:
            with suppress(Exception):  # the page has gone, or waits no more
                await sending

        task = asyncio.get_running_loop().create_task(send())
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)
