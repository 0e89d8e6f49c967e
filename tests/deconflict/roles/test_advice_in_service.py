"""Advice end to end: robots that stand for each other, what is asked of them, and what their vendors answer."""

import asyncio
import json
import time
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from math import pi
from pathlib import Path

from websockets.asyncio.client import connect

from deconflict_client.advisory import AdvisoryState
from deconflict_client.advisory.robot_advice import RobotAdvice
from deconflict_client.client import Client
from tests.deconflict.roles.made_service import Running, running
from tests.helpers.patience import PATIENCE_S
from tests.helpers.saying import identity, points, robot, status

MAKERS = {robot("A-1"): "Alder", robot("B-1"): "Birch"}


class Standoff:
    """Two robots that drive towards each other and stop; one of them drives around the other once it is asked to."""

    def __init__(self, url: str) -> None:
        self._url, self.passes = url, ""
        """UUID of the robot that drives around the other."""

    async def drive(self) -> None:
        began_s, gone_m = time.time(), 0.0
        async with connect(self._url) as socket:
            for name, maker in (("A-1", "Alder"), ("B-1", "Birch")):
                await socket.send(identity(name, began_s, manufacturerName=maker))
            while True:
                now_s = time.time()
                short_m = max(3.0 - (now_s - began_s), 0.0)
                gone_m += 0.5 if self.passes else 0.0
                for name, x_m, way in (("A-1", -1.0, 1.0), ("B-1", 1.0, -1.0)):
                    aside_m = 1.5 if self.passes == robot(name) else 0.0
                    here_m = x_m - way * short_m + (way * gone_m if aside_m else 0.0)
                    yaw_rad = 0.0 if way > 0 else pi
                    path = points(*((now_s + k, here_m + way * k, aside_m, yaw_rad) for k in range(1, 11)))
                    velocity = {"linear": 1.0 if short_m else 0.0}
                    await socket.send(status(name, now_s, here_m, aside_m, yaw_rad, path=path, velocity=velocity))
                await asyncio.sleep(0.5)


@asynccontextmanager
async def standoff(service: Running) -> AsyncIterator[Standoff]:
    robots = Standoff(service.robots_url)
    driving = asyncio.create_task(robots.drive())
    try:
        async with asyncio.timeout(PATIENCE_S):
            yield robots
    finally:
        driving.cancel()
        await asyncio.gather(driving, return_exceptions=True)


async def test_a_vendor_declines_the_other_is_asked_and_drives_around(tmp_path: Path) -> None:
    revisions: list[RobotAdvice] = []
    async with running(tmp_path) as service, Client(f"http://{service.face}") as client, standoff(service) as robots:
        async for advice in client.follow(0, ["advice"]):
            assert isinstance(advice, RobotAdvice)
            revisions.append(advice)
            if advice.state is AdvisoryState.RAISED and not advice.acknowledgement:
                is_first = len({each.id for each in revisions}) == 1
                answered = await client.answer(advice.id, "declined" if is_first else "accepted", name="fleet")
                assert answered.acknowledgement
                robots.passes = "" if is_first else advice.robot
            elif robots.passes and advice.state is AdvisoryState.CLEARED:
                break
        listed = await client.advice()
    last = {advice.id: advice for advice in revisions}
    declined, done = last.values()
    assert [each.cleared_code for each in (declined, done)] == ["declined", "done"]
    assert {declined.robot, done.robot} == set(MAKERS)
    assert (done.verb, done.other, done.until) == ("go_around", declined.robot, (declined.robot,))
    assert done.vendor == MAKERS[done.robot]
    assert done.begun_at
    assert done.saving_interval_s
    assert done.saving_interval_s[0] < (done.saving_s or 0.0) < done.saving_interval_s[1]
    assert "drive around" in done.summary
    assert not listed.advice
    assert [each.seq for each in revisions] == sorted(each.seq for each in revisions)


async def test_what_is_asked_ends_with_the_engine_that_asked(tmp_path: Path) -> None:
    async with running(tmp_path) as service, standoff(service):
        await service.until("/advice", lambda answer: answer["advice"])
    async with running(tmp_path) as service:
        ended = await service.until("/advice?state=cleared", lambda answer: answer["advice"])
        assert not (await service.get("/advice")).json()["advice"]
    assert {advice["cleared_code"] for advice in ended["advice"]} <= {"restarted", "withdrawn"}
    assert "restarted" in json.dumps(ended)
