"""Pairs of robots that cross each other's way by the clock, and report over real sockets in a process of their own."""

import asyncio
import multiprocessing
import ssl
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from math import ceil, pi
from multiprocessing.synchronize import Event

from websockets.asyncio.client import connect
from websockets.exceptions import WebSocketException

from tests.helpers.saying import identity, points, robot, status

GAP_S = 20.0
"""From one meeting of a pair to the next: its advisory ends, and nothing is foreseen for some seconds."""
REPORTS_A_SECOND, PATH_S, SPEED_MPS = 2, 10, 1.0
APART_M, COLUMNS = 50.0, 4
VENDORS = ("Alder", "Corvid")
RETRY_S = 0.3
Pose = tuple[float, float, float]
"""x_m, y_m and yaw_rad."""


@dataclass(frozen=True, slots=True)
class CrossingPair:
    """Two robots of which each drives to and fro, and that are in the same place every `GAP_S`."""

    number: int
    pairs: int
    """How many there are."""
    machines: tuple[int, int]
    """At which machine each of the two reports first."""

    @property
    def uuids(self) -> tuple[str, ...]:
        return tuple(sorted(robot(self.name(side)) for side in (0, 1)))

    def name(self, side: int) -> str:
        return f"crossing {self.number}.{side}"

    def meetings_s(self, since_s: float, until_s: float) -> list[float]:
        """When the two are in the same place, in seconds since the start."""
        first = ceil((since_s - self._late_s) / GAP_S - 0.5)
        times_s = [(number + 0.5) * GAP_S + self._late_s for number in range(first, first + int(until_s / GAP_S) + 2)]
        return [t_s for t_s in times_s if since_s <= t_s < until_s]

    def pose(self, side: int, t_s: float) -> Pose:
        leg, part_s = divmod(t_s - self._late_s, GAP_S)
        is_forth = leg % 2 == 0
        along_m = SPEED_MPS * (part_s - GAP_S / 2) * (1 if is_forth else -1)
        x, y = APART_M * (self.number % COLUMNS), APART_M * (self.number // COLUMNS)
        yaw = 0.0 if is_forth else pi
        return (x + along_m, y, yaw) if side == 0 else (x, y + along_m, yaw + pi / 2)

    @property
    def _late_s(self) -> float:
        """Pairs meet one after another."""
        return GAP_S * self.number / self.pairs


def made_pairs(count: int, machines: Sequence[int]) -> list[CrossingPair]:
    """Of every three pairs, two are at one machine and one is at two."""
    at = len(machines)
    return [
        CrossingPair(i, count, (machines[i % at], machines[(i + (i // at % at == at - 1)) % at])) for i in range(count)
    ]


@dataclass(frozen=True)
class Entrance:
    """Where robots report."""

    urls: Mapping[int, str]
    """By machine."""
    tokens: Mapping[str, str]
    """By vendor."""
    ca: str
    start_s: float


@contextmanager
def crossing(pairs: Sequence[CrossingPair], entrance: Entrance) -> Iterator[None]:
    """All robots report until the block ends."""
    spawn = multiprocessing.get_context("spawn")
    stop = spawn.Event()
    process = spawn.Process(target=_run, args=(pairs, entrance, stop))
    process.start()
    try:
        yield
    finally:
        stop.set()
        process.join()


def _run(pairs: Sequence[CrossingPair], entrance: Entrance, stop: Event) -> None:
    asyncio.run(_report_all(pairs, entrance, stop))


async def _report_all(pairs: Sequence[CrossingPair], entrance: Entrance, stop: Event) -> None:
    trusted = ssl.create_default_context(cafile=entrance.ca)
    await asyncio.gather(*(_report(pair, side, entrance, trusted, stop) for pair in pairs for side in (0, 1)))


async def _report(pair: CrossingPair, side: int, entrance: Entrance, trusted: ssl.SSLContext, stop: Event) -> None:
    """Report at the first machine that answers, beginning with its own."""
    own, vendor = pair.machines[side], VENDORS[side]
    machines = sorted(entrance.urls, key=lambda machine: (machine - own) % (max(entrance.urls) + 1))
    headers = {"Authorization": f"Bearer {entrance.tokens[vendor]}"}
    attempt = 0
    while not stop.is_set():
        url = f"{entrance.urls[machines[attempt % len(machines)]]}/{vendor}"
        try:
            async with connect(url, ssl=trusted, additional_headers=headers, proxy=None, open_timeout=2.0) as socket:
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
