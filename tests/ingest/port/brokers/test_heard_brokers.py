"""Brokers that several ingests share."""

import asyncio
import json
import time
from collections.abc import AsyncIterator, Sequence
from contextlib import asynccontextmanager

from aiomqtt import Client

from ingest.port.brokers.heard_brokers import HeardBrokers
from ingest.port.brokers.mqtt_source import MqttSource
from tests.deconflict.operator.outlets.made_outlets import broker, needs_mosquitto
from tests.helpers.vda_saying import factsheet, topic
from tests.ingest.port.made_receiver import Floor, floor, until

pytestmark = needs_mosquitto
CONNECTED = "deconflict_broker_connected"


@asynccontextmanager
async def shared(of: Floor, port: int) -> AsyncIterator[HeardBrokers]:
    brokers = HeardBrokers(of.receiver, of.measures, shared=True)
    sources = [MqttSource(name=name, host="127.0.0.1", port=port) for name in ("hall", "yard")]
    brokers.use(sources, (str.upper, lambda _: True))
    try:
        yield brokers
    finally:
        tasks = brokers.tasks
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)


async def grant(brokers: HeardBrokers, names: Sequence[str], for_s: float) -> None:
    await brokers.grant(json.dumps([names, time.monotonic() + for_s]).encode())


def connected(brokers: HeardBrokers) -> list[str]:
    return [each["name"] for each in brokers.documents() if each["ingest"]]


async def test_a_shared_broker_is_heard_while_it_is_granted_and_no_longer() -> None:
    async with broker() as port, floor() as of, shared(of, port) as brokers:
        async with Client("127.0.0.1", port) as client:
            await client.publish(topic("factsheet"), factsheet(1_790_000_000.0), 1, retain=True)
        assert not brokers.tasks
        await grant(brokers, ["hall"], 60.0)
        await until(lambda: of.delivered)
        assert connected(brokers) == ["hall"]
        of.measures.as_document()
        assert of.measures.values[CONNECTED] == {("hall",): 1.0, ("yard",): 0.0}
        await grant(brokers, ["hall"], 0.3)
        await until(lambda: not connected(brokers))
        assert not brokers.tasks
        assert of.closed


async def test_a_grant_that_comes_after_its_end_grants_nothing() -> None:
    async with broker() as port, floor() as of, shared(of, port) as brokers:
        await grant(brokers, ["hall", "yard"], -0.1)
        assert not brokers.tasks


async def test_a_grant_that_is_renewed_in_time_interrupts_nothing() -> None:
    async with broker() as port, floor() as of, shared(of, port) as brokers:
        await grant(brokers, ["hall"], 0.5)
        await until(lambda: connected(brokers))
        before, began_s = brokers.tasks, time.monotonic()
        while time.monotonic() < began_s + 1.0:
            await grant(brokers, ["hall"], 0.5)
            assert connected(brokers) == ["hall"]
            await asyncio.sleep(0.1)
        assert brokers.tasks == before
