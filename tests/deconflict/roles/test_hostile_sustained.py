"""Everything hostile at once, again and again, beside a hundred honest robots: nothing of theirs is lost or untold."""

import asyncio
import json
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Awaitable, Callable, Iterator
from contextlib import contextmanager, suppress
from math import pi
from pathlib import Path
from typing import Any

import pytest
from websockets.asyncio.client import connect
from websockets.exceptions import ConnectionClosed, InvalidHandshake

from tests.deconflict.roles.made_abuses import ABUSES
from tests.deconflict.roles.made_service import Served, healthy
from tests.deconflict.roles.role_processes import children
from tests.helpers.made_site import toml
from tests.helpers.patience import PATIENCE_S
from tests.helpers.plain_http import http_client
from tests.helpers.saying import HALL, identity, points, robot, status

PAIRS, PAIRS_OF_A_FLEET = 50, 5
MEET_AFTER_S = 14.0
LASTS_S = 12.0
"""How long everything goes on at least."""
MOST_MB = {"receiver": 400, "engine": 700, "operator": 400}
"""At any moment; without anybody hostile they have some 130, 300 and 150."""
SITE: dict[str, Any] = {
    "datums": [{"id": HALL, "name": "Hall"}],
    "vendors": [{"name": "Alder"}, {"name": "Mallory"}],
    "receiver": {"max_messages_per_s": 500.0, "open_timeout_s": 1.0, "idle_timeout_s": 4.0, "max_connections": 300},
    "reading": {"max_robots_per_vendor": 120},
}
BECAME = {
    "accepted": 'deconflict_messages_total{result="accepted"',
    "overtaken": 'deconflict_messages_total{result="overtaken"',
    "rejected": 'deconflict_messages_total{result="rejected"',
    "shed": "deconflict_messages_shed_total",
}
pytestmark = pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="needs Linux's /proc")


def pair(number: int) -> frozenset[str]:
    return frozenset((robot(f"A-{number}"), robot(f"B-{number}")))


async def fleet(url: str, first: int, start_s: float, stop: asyncio.Event) -> int:
    """Pairs that meet head-on, each in its own aisle; how many messages were sent, over one connection."""
    sent = 0
    async with connect(f"{url}/Alder") as socket:
        numbers = range(first, first + PAIRS_OF_A_FLEET)
        for name in (f"{letter}-{number}" for number in numbers for letter in "AB"):
            await socket.send(identity(name, start_s))
            sent += 1
        while not stop.is_set():
            now_s = time.time()
            for number in numbers:
                for letter, side, yaw in (("A", -1.0, 0.0), ("B", 1.0, pi)):
                    at = [side * (MEET_AFTER_S - (now_s + i - start_s)) for i in range(11)]
                    path = points(*((now_s + i, at[i], 5.0 * number, yaw) for i in range(1, 11)))
                    await socket.send(status(f"{letter}-{number}", now_s, at[0], 5.0 * number, yaw, path=path))
                    sent += 1
            with suppress(TimeoutError):
                await asyncio.wait_for(stop.wait(), 1.0)
    return sent


async def abused(url: str) -> None:
    """Everything hostile, over and over."""
    await asyncio.gather(*(again_and_again(abuse, url) for abuse in ABUSES))


async def again_and_again(abuse: Callable[[str], Awaitable[None]], url: str) -> None:
    while True:
        with suppress(OSError, ConnectionClosed, InvalidHandshake, TimeoutError):
            await abuse(url)
        await asyncio.sleep(0.1)


@contextmanager
def abusers(url: str) -> Iterator[None]:
    """In a process of their own, so that honest robots do not wait for them to make up what they send."""
    root = Path(__file__).parents[3]
    text = f"import asyncio; from {__name__} import abused; asyncio.run(abused({url!r}))"
    with subprocess.Popen([sys.executable, "-c", text], cwd=root, stderr=subprocess.DEVNULL) as process:
        try:
            yield
        finally:
            process.kill()


async def all_told(service: Served) -> None:
    """Until every pair was warned of, from the stream's beginning on."""
    missing = {pair(number) for number in range(PAIRS)}
    async with (
        asyncio.timeout(PATIENCE_S),
        connect(f"ws://127.0.0.1:{service.operator_port}/advisories/stream?after=0") as stream,
    ):
        async for message in stream:
            missing.discard(frozenset(json.loads(message)["robots"]))
            if not missing:
                return


async def counted(service: Served, vendor: str) -> Counter[str]:
    """Messages of a vendor by what became of them."""
    async with http_client() as client:
        text = (await client.get(f"{service.face_url}/metrics")).text
    found = Counter[str]()
    for line in text.splitlines():
        for what, begins in BECAME.items():
            if line.startswith(begins) and f'vendor="{vendor}"' in line:
                found[what] += int(float(line.split()[-1]))
    return found


async def abused_for_long(service: Served) -> None:
    """`LASTS_S` from when much of what is hostile was refused and shed, however late its process has begun."""
    async with asyncio.timeout(PATIENCE_S):
        while (hostile := await counted(service, "Mallory"))["rejected"] < 100 or hostile["shed"] < 1000:
            await asyncio.sleep(0.2)
    await asyncio.sleep(LASTS_S)


def peak_mb(pid: int) -> float:
    """The most memory that a process ever had, of which it did not share."""
    (line,) = (line for line in Path(f"/proc/{pid}/status").read_text().splitlines() if line.startswith("VmHWM"))
    return int(line.split()[1]) / 1024


def files(pid: int) -> int:
    return sum(1 for _ in Path(f"/proc/{pid}/fd").iterdir())


async def test_a_hundred_honest_robots_lose_nothing_while_everything_hostile_goes_on(tmp_path: Path) -> None:
    site = tmp_path / "site.toml"
    site.write_text(toml(SITE))
    service, stop = Served(tmp_path / "data", site), asyncio.Event()
    with service.running() as pid:
        await service.until("/healthz", healthy)
        roles = children(pid)
        quiet = {role: files(number) for role, number in roles.items()}
        with abusers(service.robots_url):
            fleets = [
                asyncio.create_task(fleet(service.robots_url, first, time.time(), stop))
                for first in range(0, PAIRS, PAIRS_OF_A_FLEET)
            ]
            try:
                await asyncio.gather(all_told(service), abused_for_long(service))
            finally:
                stop.set()
        sent = sum(await asyncio.gather(*fleets))
        async with asyncio.timeout(PATIENCE_S):
            while sum((became := await counted(service, "Alder")).values()) < sent:
                await asyncio.sleep(0.2)
        assert sum(became.values()) == sent
        assert (+became).keys() <= {"accepted", "overtaken"}, (
            "a machine that stands still for a second has two of a robot"
        )
        assert children(pid) == roles, "somebody died"
        peaks = {role: peak_mb(number) for role, number in roles.items()}
        assert {role: mb for role, mb in peaks.items() if mb > MOST_MB[role]} == {}
        async with asyncio.timeout(PATIENCE_S):
            while any(files(number) > quiet[role] + 10 for role, number in roles.items()):
                await asyncio.sleep(0.2)
        await service.until("/healthz", healthy)
