"""The live picture: one WebSocket a page. Each is sent what changed since its own last frame, at its own pace.

The floor is followed only while somebody looks, and a page that reads slowly skips states rather than delay another.
"""

import asyncio
import json
import time
from collections.abc import Awaitable, Callable
from typing import Any

from fastapi import WebSocket, WebSocketDisconnect

from deconflict.operator.live.advisory_stream import left
from deconflict.operator.live.floor_frames import Picture
from deconflict.runtime.first_of import until_either
from ingest.batch import Batch
from ingest.measures.measures import Measures

FRAME_S = 0.1
"""Shortest time between two frames to one page."""
HEALTH_S = 2.0
RETRY_S = 0.5

Follow = Callable[[int], Awaitable[tuple[int, bool, Batch | None]]]
"""What came after a number: its own number, whether it is the whole floor, and the batch, None without a tick."""
Health = Callable[[], Awaitable[dict[str, Any]]]


class Viewers:
    """Serves pages. `follow` raises `ConnectionError` where the floor can't be had just now."""

    def __init__(self, follow: Follow, health: Health, measures: Measures, send_timeout_s: Callable[[], float]) -> None:
        self._follow, self._health, self._measures = follow, health, measures
        self._send_timeout_s = send_timeout_s
        self._picture = Picture()
        self._told = json.dumps({})
        self._beat = 0
        """Rises with every change of the picture or the health, and when neither comes."""
        self._news = asyncio.Event()
        self._watching = 0
        self._work: list[asyncio.Task[None]] = []
        self._count(0)

    async def serve(self, websocket: WebSocket) -> None:
        """Accept, and send frames until the page leaves or takes none for the time allowed."""
        await websocket.accept()
        self._count(+1)
        try:
            await until_either(self._feed(websocket), left(websocket))
        except TimeoutError:
            self._measures.count("deconflict_stream_dropped_total")
        except WebSocketDisconnect:
            pass
        finally:
            self._count(-1)

    async def _feed(self, websocket: WebSocket) -> None:
        version, beat = 0, -1
        while True:
            if beat == self._beat:
                await self._news.wait()
            beat = self._beat
            health, picture = self._told, self._picture
            frame = picture.since(version)
            version = picture.version
            async with asyncio.timeout(self._send_timeout_s()):
                await websocket.send_text(f'{{"sent_s": {time.time():.3f}, "health": {health}, "floor": {frame}}}')
            await asyncio.sleep(FRAME_S)

    async def _watch_floor(self) -> None:
        number = 0
        while True:
            try:
                number, whole, batch = await self._follow(number)
            except ConnectionError:
                number = 0
                await asyncio.sleep(RETRY_S)
            else:
                if batch is not None:
                    self._picture.put(batch, whole=whole)
            self._announce()

    async def _watch_health(self) -> None:
        while True:
            self._told = json.dumps(await self._health() | {"at_s": time.time()})
            self._announce()
            await asyncio.sleep(HEALTH_S)

    def _announce(self) -> None:
        self._beat += 1
        self._news.set()
        self._news = asyncio.Event()

    def _count(self, change: int) -> None:
        self._watching += change
        self._measures.level("deconflict_page_viewers", {(): self._watching})
        if self._watching and not self._work:
            self._work = [asyncio.create_task(self._watch_floor()), asyncio.create_task(self._watch_health())]
        elif not self._watching:
            for task in self._work:
                task.cancel()
            self._work, self._picture = [], Picture()
