"""Robots over WebSockets and over a real broker in one service."""

import asyncio
import json
import time
from contextlib import suppress
from pathlib import Path
from typing import Any

from aiomqtt import Client
from websockets.asyncio.client import connect

from deconflict_client.advisory import AdvisoryState
from deconflict_client.situations import REVISION, AnyRevision
from ingest.port.brokers.mqtt_source import MqttSource
from tests.deconflict.operator.outlets.made_outlets import broker, needs_mosquitto
from tests.deconflict.roles.made_service import SITE, drive, running
from tests.helpers.patience import PATIENCE_S
from tests.helpers.replayed import replayed
from tests.helpers.saying import HALL
from tests.helpers.vda_saying import factsheet, node, order, position, topic, under_way

pytestmark = needs_mosquitto

PLACE = {"mapId": HALL}
WAY = [{**node(number, 0.0), "nodePosition": {"x": 0.0, "y": y, **PLACE}} for number, y in enumerate((-6.0, 6.0))]


async def report(port: int) -> None:
    """A robot of VDA 5050 drives north through the origin, which it passes after six seconds."""
    began_s = time.time()
    async with Client("127.0.0.1", port) as client:
        await client.publish(topic("factsheet"), factsheet(began_s), 1, retain=True)
        await client.publish(topic("order"), order(began_s, WAY), 1)
        while (t := time.time() - began_s) < 12:
            pose = position(0.0, -6.0 + t, 1.5708, **PLACE)
            raw = under_way(began_s + t, 0.0, 0.0, WAY[1:], agvPosition=pose, velocity={"vx": 1.0})
            await client.publish(topic("state"), raw)
            await asyncio.sleep(0.5)


async def test_robots_of_two_standards_are_warned_of_each_other_live_and_in_the_replay(
    tmp_path: Path,
) -> None:
    async with broker() as port:
        site = SITE.model_copy(update={"mqtt_sources": (MqttSource(name="hall", host="127.0.0.1", port=port),)})
        async with running(tmp_path, site) as service:
            await service.metrics_with('deconflict_broker_connected{source="hall"} 1')
            address = f"ws://{service.face}/advisories/stream?after=0"
            async with connect(address) as stream, asyncio.timeout(PATIENCE_S):
                eastwards = {"A-1": lambda t: (-6.0 + t, 0.0, 0.0)}
                driving = [
                    asyncio.create_task(drive(service.robots_url, eastwards, 12)),
                    asyncio.create_task(report(port)),
                ]
                revisions: list[AnyRevision] = []
                async for message in stream:
                    revisions.append(REVISION.validate_json(message))
                    if revisions[-1].state is AdvisoryState.CLEARED:
                        break
                for task in driving:
                    task.cancel()
                    with suppress(asyncio.CancelledError):
                        await task
            vendors = {vendor["name"]: vendor for vendor in (await service.get("/vendors")).json()["vendors"]}
    first = json.loads(revisions[0].model_dump_json())
    assert (sorted(first["vendors"]), sorted(first["basis"])) == (["Alder", "KIT"], ["order", "path"])
    assert (vendors["KIT"]["languages"], vendors["Alder"]["languages"]) == (["vda5050"], ["massrobotics"])
    again = [json.loads(revision.model_dump_json()) for revision in replayed(tmp_path / "log", site)]
    assert without_seq(again[0]) == without_seq(first)


async def test_what_a_robot_of_a_broker_said_is_known_after_a_restart(tmp_path: Path) -> None:
    async with broker() as port:
        heard = SITE.model_copy(update={"mqtt_sources": (MqttSource(name="hall", host="127.0.0.1", port=port),)})
        async with running(tmp_path, heard) as service:
            await service.metrics_with('deconflict_broker_connected{source="hall"} 1')
            reporting = asyncio.create_task(report(port))
            await service.until("/robots", lambda answer: answer["robots"] and answer["robots"][0]["forecast"])
            reporting.cancel()
    async with running(tmp_path) as service:
        (only,) = (await service.until("/robots", lambda answer: answer["robots"]))["robots"]
        assert only["identified"]
        assert (only["name"], only["language"], only["forecast"]["basis"]) == ("KIT 0001", "vda5050", "order")


def without_seq(document: dict[str, Any]) -> dict[str, Any]:
    return {key: value for key, value in document.items() if key not in {"seq", "situation_id"}}
