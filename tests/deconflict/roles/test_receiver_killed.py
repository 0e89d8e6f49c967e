"""`deconflict serve` whose receiver is killed: floors that its successor names in another order."""

import asyncio
import os
import signal
import time
from pathlib import Path

import pytest
from websockets.asyncio.client import connect

from tests.deconflict.roles.made_service import Served, healthy
from tests.deconflict.roles.role_processes import children
from tests.helpers.saying import HALL, LOFT, angle, identity, points, robot, status

pytestmark = pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="needs Linux's /proc")
SITE = "[recorder]\nenabled = false\n"
"""The new receiver knows no robot, so the silent one stays in the engine alone."""


async def test_after_a_kill_of_the_receiver_a_silent_robot_stays_on_its_floor(tmp_path: Path) -> None:
    (tmp_path / "site.toml").write_text(SITE)
    service = Served(tmp_path / "data", tmp_path / "site.toml")
    with service.running() as pid:
        await service.until("/healthz", healthy)
        async with connect(service.robots_url) as socket:
            await socket.send(identity("silent", time.time()))
            await socket.send(stands("silent", LOFT))
            await socket.send(identity("first", time.time()))
            await socket.send(status("first", time.time(), 500.0))
            await service.until("/robots", lambda answer: len(answer["robots"]) == 2)
            await asyncio.sleep(1.0)  # some ticks of the engine
        os.kill(children(pid)["receiver"], signal.SIGKILL)
        await service.until("/healthz", lambda health: health["restarts"].get("receiver") == 1 and healthy(health))
        driving = asyncio.create_task(drive_through(service.robots_url, ("elsewhere", HALL), ("other", LOFT)))
        raised = await service.until("/advisories?state=all", lambda answer: answer["advisories"])
        driving.cancel()
        await asyncio.gather(driving, return_exceptions=True)
    assert {frozenset(conflict["robots"]) for conflict in raised["advisories"]} == {
        frozenset({robot("silent"), robot("other")})
    }
    assert {conflict["location"]["datum"] for conflict in raised["advisories"]} == {LOFT}


def stands(name: str, floor: str) -> bytes:
    location = {"x": 0.0, "y": 0.0, "angle": angle(0.0), "planarDatum": floor}
    return status(name, time.time(), operationalState="idle", location=location)


async def drive_through(url: str, *robots: tuple[str, str]) -> None:
    """Robots drive along x through 0, each on its floor, the second three seconds after the first."""
    began_s = time.time()
    async with connect(url) as socket:
        for name, _ in robots:
            await socket.send(identity(name, began_s))
        while True:
            now_s = time.time()
            for number, (name, floor) in enumerate(robots):
                if now_s < began_s + 3.0 * number:
                    continue
                x = now_s - began_s - 4.0 - 3.0 * number
                path = points(*((now_s + i, x + i, 0.0, 0.0) for i in range(1, 11)))
                location = {"x": x, "y": 0.0, "angle": angle(0.0), "planarDatum": floor}
                await socket.send(status(name, now_s, path=path, location=location))
            await asyncio.sleep(0.25)
