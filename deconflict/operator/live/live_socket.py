"""The live map: one WebSocket for each page. Each page receives the changes since its own last frame, at its own pace.

The floor is followed only while a page is open. A page that reads slowly skips states and delays no other page.

A page can prove how fresh a message is, however late all of them are: it sends numbers, and each message has the newest
number that had come. A message is younger than the number in it.
"""

import asyncio
import json
import time
from collections.abc import Awaitable, Callable
from contextlib import suppress
from itertools import count
from typing import Any

from fastapi import WebSocket

from deconflict.operator.live.advisory_stream import send_while_read
from deconflict.operator.live.floor_frames import FloorFrames
from ingest.batch import Batch
from ingest.measures.lasting_loops import lasting
from ingest.measures.measures import Measures

FRAME_S = 0.1
"""Shortest time between two frames to one page."""
BEAT_S = 0.5
"""Longest time between two frames to one page, also with nothing to say."""
HEALTH_S = 2.0
RETRY_S = 0.5
MOST_DIGITS = 15
"""Most digits of a number from a page. Whatever else it sends is ignored."""

Follow = Callable[[int], Awaitable[tuple[int, bool, Batch | None]]]
"""From a batch number to the next: its number, whether it is the whole floor, and the batch; None if no tick came."""
Health = Callable[[], Awaitable[dict[str, Any]]]


class PageNumbers:
    """The newest number that one page sent."""

    def __init__(self) -> None:
        self.newest: int | None = None

    def hear(self, text: str) -> None:
        if text.isascii() and text.isdigit() and len(text) <= MOST_DIGITS:
            self.newest = int(text)


class LiveSocket:
    """Serves all pages. `follow` raises `ConnectionError` while the floor is not available."""

    def __init__(
        self,
        follow: Follow,
        health: Health,
        last_seq: Callable[[], int],
        measures: Measures,
        send_timeout_s: Callable[[], float],
    ) -> None:
        self._follow, self._health, self._measures = follow, health, measures
        self._last_seq, self._send_timeout_s = last_seq, send_timeout_s
        self._frames = FloorFrames()
        self._health_text = json.dumps({})
        self._change = 0
        """Rises with every change of the floor or the health, and when a tick is overdue."""
        self._news = asyncio.Event()
        self._pages = 0
        self._tasks: list[asyncio.Task[None]] = []
        self._count(0)

    async def serve(self, websocket: WebSocket) -> None:
        """Accept, and send frames until the page leaves or stops reading."""
        await websocket.accept()
        heard = PageNumbers()
        await send_while_read(websocket, self._send_frames(websocket, heard), self._count, self._measures, heard.hear)

    async def _send_frames(self, websocket: WebSocket, heard: PageNumbers) -> None:
        version, change, sent_health = 0, -1, ""
        for number in count(1):
            if change == self._change:
                await self._news_or_beat()
            change = self._change
            health, frames = self._health_text, self._frames
            frame = frames.since(version)
            version = frames.version
            head: dict[str, Any] = {"number": number, "sent_s": round(time.time(), 3), "seq": self._last_seq()}
            if heard.newest is not None:
                head["heard"] = heard.newest
            news = "" if health == sent_health else f'"health": {health}, '
            sent_health = health
            async with asyncio.timeout(self._send_timeout_s()):
                await websocket.send_text(f'{json.dumps(head)[:-1]}, {news}"floor": {frame}}}')
            await asyncio.sleep(FRAME_S)

    async def _news_or_beat(self) -> None:
        with suppress(TimeoutError):
            async with asyncio.timeout(BEAT_S):
                await self._news.wait()

    async def _follow_floor(self) -> None:
        number = 0
        while True:
            try:
                number, whole, batch = await self._follow(number)
            except ConnectionError:
                number = 0
                await asyncio.sleep(RETRY_S)
            else:
                if batch is not None:
                    self._frames.add_batch(batch, whole=whole)
            self._announce()

    async def _follow_health(self) -> None:
        while True:
            self._health_text = json.dumps(await self._health() | {"at_s": time.time()})
            self._announce()
            await asyncio.sleep(HEALTH_S)

    def _announce(self) -> None:
        self._change += 1
        self._news.set()
        self._news = asyncio.Event()

    def _count(self, change: int) -> None:
        self._pages += change
        self._measures.level("deconflict_page_viewers", {(): self._pages})
        if self._pages and not self._tasks:
            loops = {"following the floor": self._follow_floor, "asking for the health": self._follow_health}
            self._tasks = [asyncio.create_task(lasting(*item, self._measures)) for item in loops.items()]
        elif not self._pages:
            for task in self._tasks:
                task.cancel()
            self._tasks, self._frames = [], FloorFrames()
