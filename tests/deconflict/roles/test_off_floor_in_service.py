"""A robot is taken off the floor in the running service: by API and command, kept over a restart, and in its replay."""

import asyncio
import json
import time
from pathlib import Path
from typing import Any

import pytest
from websockets.asyncio.client import connect

from deconflict.__main__ import parser
from ingest.recording.log_reader import LogReader
from ingest.recording.operator_events import OffFloorMark
from metrics.replay.recorded_passes import PassReader
from tests.deconflict.roles.made_service import SITE, Running, running
from tests.helpers.plain_http import http_client
from tests.helpers.saying import HALL, identity, robot, status

A1 = robot("A-1")


async def report(service: Running, x_m: float, mps: float = 0.0) -> None:
    async with connect(service.robots_url) as socket:
        await socket.send(identity("A-1", time.time()))
        state = "navigating" if mps else "idle"
        await socket.send(status("A-1", time.time(), x_m, operationalState=state, velocity={"linear": mps}))


async def said(service: Running, uuid: str = A1, **statement: Any) -> tuple[int, dict[str, Any]]:
    async with http_client(f"http://{service.face}") as client:
        answer = await client.post(f"/robots/{uuid}/off-floor", json=statement)
    return answer.status_code, answer.json()


async def off_floor(service: Running, *, is_off: bool) -> dict[str, Any]:
    found = await service.until("/robots/" + A1, lambda robot: bool(robot.get("off_floor")) is is_off)
    return dict(found)


def command(service: Running, *arguments: str) -> int:
    args = parser().parse_args(["off-floor", "Alder A-1", f"http://{service.face}", *arguments])
    return int(args.run(args))


async def test_a_robot_is_off_the_floor_until_it_is_heard_elsewhere(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    async with running(tmp_path, SITE) as service:
        assert (await said(service, name="Petra"))[0] == 404
        await report(service, 1.0)
        await service.until("/robots", lambda answer: [each["location"] for each in answer["robots"]] != [])
        assert (await said(service))[0] == 422
        first = await said(service, name="Petra")
        assert first == await said(service, name="Quentin")
        assert first[1] | {"at_s": None} == {"uuid": A1, "off_floor": True, "by": "Petra", "at_s": None}
        assert await asyncio.to_thread(command, service, "--back") == 0
        assert await said(service, off_floor=False, name="Petra") == (
            200,
            {"uuid": A1, "off_floor": False, "by": None, "at_s": None},
        )
        assert await asyncio.to_thread(command, service, "--name", "Rita") == 0
        assert capsys.readouterr().out == "Alder A-1 is on the floor\nAlder A-1 is off the floor, says Rita\n"
    (tmp_path / "owners.json").unlink()  # as after a kill before it was written: the log has it, too
    async with running(tmp_path, SITE) as service:
        await report(service, 1.2)
        found = await off_floor(service, is_off=True)
        assert (found["off_floor"]["by"], found["off_floor"]["floor"]) == ("Rita", HALL)
        await service.until("/robots/" + A1, lambda robot: robot["off_floor"]["still_heard"])
        health = await service.until("/healthz", lambda health: health["off_floor"]["still_heard"])
        assert health["off_floor"]["still_heard"] == ["Alder A-1"]
        await report(service, 6.0)
        await off_floor(service, is_off=False)
    assert json.loads((tmp_path / "owners.json").read_text())["off_floor"] == []
    passes = PassReader(SITE)
    batches = [each.batch for each in passes.passes_of(LogReader().read([tmp_path / "log"]))]
    assert [batch.robots for batch in batches if batch.robots][-1] == (A1,)
    assert not passes.fleet.off_floor.marks
    marks = [event for event in LogReader().read([tmp_path / "log"]) if isinstance(event, OffFloorMark)]
    assert [mark.is_off for mark in marks] == [True, False, True, False]
