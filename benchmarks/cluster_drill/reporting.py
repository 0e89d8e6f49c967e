"""All robots of the pairs report over real sockets, in a process of their own."""

import asyncio
import ssl
import time
from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from multiprocessing.synchronize import Event

from websockets.asyncio.client import connect
from websockets.exceptions import WebSocketException

from benchmarks.attack.own_process import in_own_process
from benchmarks.cluster_drill.crossing_pairs import MASS, PATH_S, REPORTS_A_SECOND, CrossingPair
from benchmarks.cluster_drill.robots_at_broker import report_at_broker
from tests.helpers.saying import identity, points, status

VENDORS = ("Alder", "Corvid")
"""Of the two robots of a pair."""
RETRY_S, OPEN_WITHIN_S = 0.3, 2.0


@dataclass(frozen=True)
class Entrance:
    """Where robots report."""

    urls: Mapping[int, str]
    """By machine."""
    broker_port: int
    tokens: Mapping[str, str]
    """By vendor."""
    ca: str
    start_s: float


def reporting(pairs: Sequence[CrossingPair], entrance: Entrance) -> AbstractContextManager[None]:
    """All robots report until the block ends."""
    return in_own_process(_run, pairs, entrance)


def _run(pairs: Sequence[CrossingPair], entrance: Entrance, stop: Event) -> None:
    asyncio.run(_report_all(pairs, entrance, stop))


async def _report_all(pairs: Sequence[CrossingPair], entrance: Entrance, stop: Event) -> None:
    trusted = ssl.create_default_context(cafile=entrance.ca)
    await asyncio.gather(
        report_at_broker(entrance.broker_port, pairs, entrance.start_s, entrance.ca, stop),
        *(
            _report(pair, side, entrance, trusted, stop)
            for pair in pairs
            for side in (0, 1)
            if pair.languages[side] == MASS
        ),
    )


async def _report(pair: CrossingPair, side: int, entrance: Entrance, trusted: ssl.SSLContext, stop: Event) -> None:
    """Report at the first machine that answers, beginning with its own."""
    own, vendor, attempt = pair.machines[side], VENDORS[side], 0
    machines = sorted(entrance.urls, key=lambda machine: (machine - own) % len(entrance.urls))
    headers = {"Authorization": f"Bearer {entrance.tokens[vendor]}"}
    while not stop.is_set():
        url = f"{entrance.urls[machines[attempt % len(machines)]]}/{vendor}"
        try:
            async with connect(
                url, ssl=trusted, additional_headers=headers, proxy=None, open_timeout=OPEN_WITHIN_S
            ) as socket:
                await socket.send(identity(pair.name(side), time.time(), manufacturerName=vendor))
                while not stop.is_set():
                    await socket.send(_status(pair, side, entrance.start_s))
                    await asyncio.sleep(1 / REPORTS_A_SECOND)
        except (OSError, WebSocketException, TimeoutError):
            attempt += 1
            await asyncio.sleep(RETRY_S)


def _status(pair: CrossingPair, side: int, start_s: float) -> bytes:
    now_s = time.time()
    ahead = [(now_s + i, *pair.pose(side, now_s + i - start_s)) for i in range(1, PATH_S + 1)]
    return status(pair.name(side), now_s, *pair.pose(side, now_s - start_s), path=points(*ahead))
