"""Robots that report over real sockets, in a process of their own."""

import asyncio
import time
from collections.abc import Sequence
from contextlib import AbstractContextManager
from multiprocessing.synchronize import Event

import numpy as np
from websockets.asyncio.client import connect
from websockets.exceptions import WebSocketException

from benchmarks.attack.courses import Robot, at_origin, crowd, honest
from benchmarks.attack.own_process import in_own_process
from tests.helpers.saying import identity

RETRY_S = 0.5
KINDS = {"honest": lambda robots: honest(robots // 2), "crowd": crowd, "origin": at_origin}


def sending(url: str, kind: str, robots: int, start_s: float, core: int | None = None) -> AbstractContextManager[None]:
    """Robots of a kind report once a second until the block ends."""
    return in_own_process(_run, url, kind, robots, start_s, core=core)


def _run(url: str, kind: str, robots: int, start_s: float, stop: Event) -> None:
    asyncio.run(_send_all(url, KINDS[kind](robots), start_s, stop))


async def _send_all(url: str, robots: Sequence[Robot], start_s: float, stop: Event) -> None:
    phases_s = np.random.default_rng(1).uniform(0, 1, len(robots)).tolist()
    await asyncio.gather(
        *(_send(url, robot, start_s, phase_s, stop) for robot, phase_s in zip(robots, phases_s, strict=True))
    )


async def _send(url: str, robot: Robot, start_s: float, phase_s: float, stop: Event) -> None:
    """Report once a second. A lost connection is opened again."""
    while not stop.is_set():
        try:
            async with connect(f"{url}/{robot.vendor}", proxy=None) as socket:
                await socket.send(identity(robot.name, time.time(), manufacturerName=robot.vendor))
                while not stop.is_set():
                    t_s = time.time() - start_s
                    await asyncio.sleep(1.0 - (t_s - phase_s) % 1.0)
                    await socket.send(robot.status(start_s, time.time() - start_s))
        except (OSError, WebSocketException):
            await asyncio.sleep(RETRY_S)
