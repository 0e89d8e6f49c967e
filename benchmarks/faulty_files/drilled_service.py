"""A service in processes of its own whose robots meet again and again, and what its subscribers and its health say."""

import asyncio
import json
import signal
import subprocess
import sys
import time
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from itertools import count
from math import pi
from pathlib import Path
from typing import Any
from uuid import uuid4

import httpx
from websockets.asyncio.client import connect
from websockets.exceptions import ConnectionClosed, WebSocketException

from benchmarks.endtoend import free_ports
from deconflict_client.situations import POSITION_LOST
from tests.helpers.saying import HALL, angle, identity, points, robot, status

START_WITHIN_S, WARNED_WITHIN_S = 60.0, 20.0
MEETING_M, MEETINGS_APART_M = 12.0, 60.0


class DrilledService:
    """`deconflict serve`, and one subscriber that follows its stream all the time."""

    def __init__(self, data: Path) -> None:
        self._data, self._meetings, self._own = data, count(1), uuid4().hex[:6]
        self._robots_port, self._face_port = free_ports(2)
        self._http = httpx.AsyncClient(base_url=f"http://127.0.0.1:{self._face_port}", timeout=20.0, trust_env=False)
        self.revisions: list[dict[str, Any]] = []
        """As the subscriber received them."""
        self.lost_positions = 0
        """How often it was told to read again what is open."""

    @asynccontextmanager
    async def running(self) -> AsyncIterator["DrilledService"]:
        """Until the end of the block. Raises `TimeoutError` if health does not answer in time."""
        command = [sys.executable, "-m", "deconflict", "serve", "--data", str(self._data)]
        ports = ["--robots-port", str(self._robots_port), "--operator-port", str(self._face_port)]
        with subprocess.Popen([*command, *ports], stderr=subprocess.DEVNULL) as process:
            following = asyncio.create_task(self._follow())
            try:
                await self.health_once(lambda health: health.get("roles", {}).get("engine") == "up", START_WITHIN_S)
                yield self
            finally:
                following.cancel()
                process.send_signal(signal.SIGTERM)
                await asyncio.to_thread(process.wait, 60)

    async def health(self) -> dict[str, Any]:
        """Empty if it does not answer."""
        try:
            document: dict[str, Any] = (await self._http.get("/healthz")).json()
        except (httpx.HTTPError, json.JSONDecodeError):
            return {}
        return document

    async def health_once(self, wanted: Any, within_s: float) -> dict[str, Any]:
        """Raises `TimeoutError`."""
        async with asyncio.timeout(within_s):
            while not wanted(health := await self.health()):
                await asyncio.sleep(0.2)
        return health

    async def meet(self) -> float | None:
        """Two new robots drive towards each other; returns after how many seconds the subscriber had a revision."""
        number, began_s = next(self._meetings), time.time()
        uuids = {robot(self._name(side, number)) for side in "AB"}
        driving = asyncio.create_task(self._drive(number))
        try:
            async with asyncio.timeout(WARNED_WITHIN_S):
                while not any(uuids <= set(revision["robots"]) for revision in self.revisions):
                    await asyncio.sleep(0.02)
        except TimeoutError:
            return None
        finally:
            driving.cancel()
            await asyncio.gather(driving, return_exceptions=True)
        return time.time() - began_s

    def _name(self, side: str, number: int) -> str:
        return f"{side}-{self._own}-{number}"

    async def _drive(self, number: int) -> None:
        y_m, began_s = MEETINGS_APART_M * number, time.time()
        async with connect(f"ws://127.0.0.1:{self._robots_port}") as robots:
            for name in "AB":
                await robots.send(identity(self._name(name, number), began_s))
            while True:
                now_s = time.time()
                for name, side, yaw_rad in (("A", -1, 0.0), ("B", 1, pi)):
                    way_m = [side * (MEETING_M - (now_s + ahead_s - began_s)) for ahead_s in range(11)]
                    path = points(*((now_s + i, way_m[i], y_m, yaw_rad) for i in range(1, 11)))
                    place = {"x": way_m[0], "y": y_m, "angle": angle(yaw_rad), "planarDatum": HALL}
                    await robots.send(status(self._name(name, number), now_s, location=place, path=path))
                await asyncio.sleep(0.25)

    async def _follow(self) -> None:
        after: int | None = None
        while True:
            position = "" if after is None else f"&after={after}"
            try:
                async with connect(
                    f"ws://127.0.0.1:{self._face_port}/advisories/stream?kinds=situation,advisory{position}"
                ) as stream:
                    async for message in stream:
                        self.revisions.append(json.loads(message))
                        after = self.revisions[-1]["seq"]
            except ConnectionClosed as closed:
                if closed.rcvd and closed.rcvd.code == POSITION_LOST:
                    self.lost_positions += 1
                    after = None
            except (OSError, WebSocketException):
                await asyncio.sleep(0.1)
            await asyncio.sleep(0.02)


def repeated_numbers(revisions: list[dict[str, Any]]) -> list[int]:
    """Numbers that a subscriber received for two different things."""
    seen: dict[int, tuple[str, int]] = {}
    return [
        revision["seq"]
        for revision in revisions
        if seen.setdefault(revision["seq"], (revision["id"], revision["revision"]))
        != (revision["id"], revision["revision"])
    ]
