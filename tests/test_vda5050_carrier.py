"""The example that carries advice to robots of VDA 5050, with virtual robots that this project did not write."""

import asyncio
import json
import sys
from collections.abc import AsyncIterator
from contextlib import nullcontext
from datetime import timedelta
from pathlib import Path
from types import SimpleNamespace

import pytest
from aiomqtt import Client

from deconflict_client.advisory import ClearedCode
from deconflict_client.advisory.robot_advice import RobotAdvice
from deconflict_client.client import AdviceListing
from examples import vda5050_carrier
from ingest.languages.vda5050.vda_front_end import robot_uuid
from tests.deconflict.operator.http.served_face import Served, served, until
from tests.deconflict.operator.outlets.made_outlets import broker, needs_mosquitto
from tests.helpers.made_advisories import ROBOTS, START, made_advice
from tests.helpers.node_libraries import ENVIRONMENT, needs_library
from tests.helpers.patience import PATIENCE_S

ROOT = Path(__file__).parent.parent
VIRTUAL = ROOT / "tests" / "metrics" / "replay" / "virtual_agvs.js"
EAST = robot_uuid("Siemens", "east")
pytestmark = [needs_mosquitto, pytest.mark.slow, needs_library("vda-5050-lib")]


class Paused(dict[str, bool]):
    """By serial number, whether a robot says that it is paused."""

    async def hear(self, port: int) -> None:
        async with Client("127.0.0.1", port) as client:
            await client.subscribe("uagv/v2/Siemens/+/state")
            async for message in client.messages:
                self[message.topic.value.split("/")[-2]] = json.loads(bytes(message.payload))["paused"]


def asked(number: int, verb: str) -> dict[str, object]:
    pair = tuple(sorted((EAST, ROBOTS[1])))
    vendors = tuple("Siemens" if robot == EAST else "Borealis" for robot in pair)
    parties = {"robots": pair, "vendors": vendors, "robot": EAST, "vendor": "Siemens"}
    return {"id": f"advice-{number}", **parties, "verb": verb}


async def carried(face: Served, paused: Paused) -> None:
    """A robot waits until the advice ends, or is over and nobody says so, and is asked for what it cannot do."""
    await until(lambda: paused.get("east") is False)
    waits = made_advice(1, **asked(1, "wait_before"))
    await face.publish(waits)
    await until(lambda: paused["east"])
    await face.publish(waits.cleared_revision(START.timestamp() + 5, ClearedCode.WITHDRAWN))
    await until(lambda: not paused["east"])
    await face.publish(made_advice(4, **asked(4, "wait_before"), latest_at=START + timedelta(seconds=2)))
    await until(lambda: paused["east"])
    await until(lambda: not paused["east"])
    await face.publish(made_advice(2, **asked(2, "back_out")), made_advice(3, **asked(3, "wait_before")))
    await until(lambda: paused["east"])


async def test_a_robot_that_should_wait_is_paused_and_goes_on_once_that_has_ended(tmp_path: Path) -> None:
    paused = Paused()
    async with served(tmp_path) as face, broker() as port, asyncio.timeout(PATIENCE_S):
        hearing = asyncio.create_task(paused.hear(port))
        robots = await asyncio.create_subprocess_exec("node", VIRTUAL, str(port), "600", env=ENVIRONMENT)
        command = [f"http://{face.address}", "--broker", f"127.0.0.1:{port}", "--vendor", "Siemens"]
        script = ROOT / "examples" / "vda5050_carrier.py"
        carrier = await asyncio.create_subprocess_exec(sys.executable, script, *command, cwd=ROOT)
        try:
            await carried(face, paused)
            carrier.terminate()
            assert await carrier.wait() == 0
            await until(lambda: not paused["east"])
        finally:
            for process in (robots, carrier):
                if process.returncode is None:
                    process.kill()
                    await process.wait()
            hearing.cancel()
            await asyncio.gather(hearing, return_exceptions=True)
        declined = face.store.get("advice-2")[-1].acknowledgement
    assert paused.get("west") is False, "nobody asked it to wait"
    assert declined
    assert (declined.answer, declined.reason.partition(":")[0]) == ("declined", "cannot")


class Unreachable:
    """A service that asks a robot to wait, and is not reached any more after that."""

    async def advice(self, _: str) -> AdviceListing:
        return AdviceListing(seq=1, advice=[made_advice(1, **asked(1, "wait_before"))], more=False)

    async def answer(self, *_: str, **__: str) -> None:
        pass

    async def follow(self, *_: object) -> AsyncIterator[RobotAdvice]:
        raise ConnectionError
        yield


class Sent(list[str]):
    """A broker with one robot, which keeps what is sent to it."""

    async def subscribe(self, _: str) -> None:
        pass

    @property
    async def messages(self) -> AsyncIterator[SimpleNamespace]:
        yield SimpleNamespace(topic=SimpleNamespace(value="uagv/v2/Siemens/east/connection"))

    async def publish(self, _: str, payload: str, __: int) -> None:
        self.append(json.loads(payload)["actions"][0]["actionType"])


async def test_robots_go_on_also_if_the_example_fails(monkeypatch: pytest.MonkeyPatch) -> None:
    sent = Sent()
    monkeypatch.setattr(vda5050_carrier, "Client", lambda *_, **__: nullcontext(Unreachable()))
    monkeypatch.setattr(vda5050_carrier, "Broker", lambda *_: nullcontext(sent))
    with pytest.raises(ConnectionError):
        await vda5050_carrier.run("http://floor.example", "broker.example", 1883, "Siemens")
    assert sent == ["startPause", "stopPause"]
