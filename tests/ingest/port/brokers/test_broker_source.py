"""Robots heard over a real broker."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, suppress
from random import Random
from typing import Any

import pytest
from aiomqtt import Client

from ingest.languages.vda5050.vda_front_end import VdaFrontEnd
from ingest.port.brokers.broker_source import BrokerSource
from ingest.port.brokers.mqtt_source import MqttSource
from tests.deconflict.operator.outlets.made_outlets import broker, needs_mosquitto
from tests.deconflict.roles.made_service import free_ports
from tests.helpers import iso_saying
from tests.helpers.saying import robot
from tests.helpers.vda_saying import factsheet, state, topic
from tests.ingest.port.made_receiver import Floor, floor, until

pytestmark = needs_mosquitto

NOW_S = 1_790_000_000.0
FAILURES = "deconflict_broker_failures_total"


@asynccontextmanager
async def heard(
    of: Floor, port: int, *, configured: tuple[str, ...] = (), **settings: Any
) -> AsyncIterator[BrokerSource]:
    """A source at work, whose receiver is that of `of`."""
    source_settings = MqttSource(name="hall", host="127.0.0.1", port=port, retry_s=(0.05, 0.1), **settings)
    source = BrokerSource(source_settings, of.receiver, str.upper, configured.__contains__, of.measures, Random(1))
    running = asyncio.create_task(source.run())
    try:
        yield source
    finally:
        running.cancel()
        with suppress(asyncio.CancelledError):
            await running


async def publish(port: int, *messages: tuple[str, bytes], retain: bool = False) -> None:
    async with Client("127.0.0.1", port) as client:
        for where, raw in messages:
            await client.publish(where, raw, 1, retain)


async def test_messages_arrive_with_their_topic_and_the_vendor_of_its_manufacturer() -> None:
    async with broker() as port, floor() as of, heard(of, port) as source:
        await until(lambda: source.is_connected)
        await publish(port, (topic("state"), state(NOW_S)), ("vda5050/v3/kit/2/order", b"{}"), ("elsewhere/x", b"{}"))
        await publish(port, (topic("state"), state(NOW_S + 1)))
        await until(lambda: len(of.delivered) == 3)
        connections = [connection for _, _, connection in of.delivered]
        assert [connection.topic for connection in connections] == [
            topic("state"),
            "vda5050/v3/kit/2/order",
            topic("state"),
        ]
        assert {(connection.vendor, connection.language, connection.peer) for connection in connections} == {
            ("KIT", "vda5050", "hall")
        }
        assert connections[0] is connections[2]
        assert connections[0].id != connections[1].id
        assert of.raws()[0] == state(NOW_S)


async def test_makers_that_the_site_file_does_not_name_are_one_source() -> None:
    makers = ("KIT", "Alder", "One", "Two")
    async with broker() as port, floor() as of, heard(of, port, configured=("KIT",)) as source:
        await until(lambda: source.is_connected)
        await publish(port, *((topic("state", maker=maker), state(NOW_S)) for maker in makers))
        await until(lambda: len(of.delivered) == 4)
    assert {connection.source for _, _, connection in of.delivered} == {
        "broker hall uagv/v2 KIT",
        "broker hall uagv/v2",
    }


async def test_a_broker_whose_makers_the_site_file_lists_names_them() -> None:
    async with broker() as port, floor() as of, heard(of, port, manufacturers=["KIT", "Alder"]) as source:
        await until(lambda: source.is_connected)
        await publish(port, (topic("state", maker="Alder"), state(NOW_S)))
        await until(lambda: of.delivered)
    assert of.delivered[0][2].source == "broker hall uagv/v2 ALDER"


async def test_only_the_manufacturers_and_prefixes_of_the_settings_are_heard() -> None:
    async with broker() as port, floor() as of, heard(of, port, manufacturers=["KIT"], prefixes=["a/b", ""]) as source:
        await until(lambda: source.is_connected)
        await publish(port, (topic("state"), b"{}"), ("a/b/ACME/1/state", b"{}"), ("a/b/KIT/1/state", b"{}"))
        await publish(port, ("KIT/2/state", b"{}"))
        await until(lambda: len(of.delivered) == 2)
        assert [connection.topic for _, _, connection in of.delivered] == ["a/b/KIT/1/state", "KIT/2/state"]


async def test_retained_factsheets_are_taken_again_and_retained_states_never() -> None:
    async with broker() as port:
        await publish(port, (topic("factsheet"), factsheet(NOW_S)), (topic("state"), state(NOW_S)), retain=True)
        async with floor() as of, heard(of, port):
            await until(lambda: of.delivered and of.refused)
            assert of.raws() == [factsheet(NOW_S)]
            ((rule, reason, connection),) = of.refused
            assert (rule, connection.topic) == ("pose-retained", topic("state"))
            assert reason
            assert VdaFrontEnd.rules[rule].rejects


async def test_a_message_over_the_limit_is_refused() -> None:
    async with broker() as port, floor() as of, heard(of, port, max_message_bytes=100) as source:
        await until(lambda: source.is_connected)
        await publish(port, (topic("order"), b"x" * 101), (topic("order"), b"x" * 100))
        await until(lambda: of.delivered)
        assert [rule for rule, _, _ in of.refused] == ["message-too-large"]
        assert len(of.raws()[0]) == 100


async def test_long_topics_are_refused_and_none_is_kept() -> None:
    async with broker() as port, floor() as of, heard(of, port) as source:
        await until(lambda: source.is_connected)
        for number in range(5):
            await publish(port, (f"uagv/v2/Mallory/{number}{1000 * 'x'}/state", b"{}"))
        await publish(port, (topic("state"), b"{}"))
        await until(lambda: of.delivered)
        assert {(rule, connection.topic) for rule, _, connection in of.refused} == {("message-too-large", "")}
        assert len(of.refused) == 5
        assert list(source._connections) == ["", topic("state")]


async def test_a_flood_of_a_maker_that_no_topic_names_leaves_the_robots_of_a_vendor_their_share() -> None:
    async with broker() as port, floor(max_messages_per_s=10.0) as of, heard(of, port, language="iso21423") as source:
        of.owners[iso_saying.topic("odometry", robot("A-1"))] = "ALDER"
        await until(lambda: source.is_connected)
        flood = [(iso_saying.topic("odometry", robot(f"M-{number}")), b"{}") for number in range(300)]
        await publish(port, *flood, (iso_saying.topic("odometry", robot("A-1")), b"[]"))
        await until(lambda: b"[]" in of.raws())
        assert len(of.raws()) < 50


async def test_a_broker_that_comes_late_and_goes_is_heard_again_with_what_it_retains() -> None:
    (port,) = free_ports(1)
    async with floor() as of, heard(of, port) as source:
        await until(lambda: of.measures.values[FAILURES].get(("hall",), 0) > 1)
        for round_number in (1, 2):
            async with broker(port):
                await publish(port, (topic("factsheet"), factsheet(NOW_S)), retain=True)
                await until(lambda: len(of.delivered) == round_number)  # noqa: B023 - awaited in the same round
                assert source.is_connected
            await until(lambda: not source.is_connected)


async def test_a_vendor_that_floods_waits_alone() -> None:
    async with broker() as port, floor(max_messages_per_s=10.0) as of, heard(of, port) as source:
        await until(lambda: source.is_connected)
        flood = [(topic("state", maker="loud"), state(NOW_S + number / 1000)) for number in range(300)]
        await publish(port, *flood, (topic("state", maker="calm"), b"{}"))
        await until(lambda: any(connection.vendor == "CALM" for _, _, connection in of.delivered))
        loud = [raw for raw, _, connection in of.delivered if connection.vendor == "LOUD"]
        assert len(loud) < 50
        assert of.measures.values["deconflict_messages_shed_total"]["LOUD",] > 200


@pytest.mark.parametrize("password", ["file:/nowhere", "env:UNSET_PASSWORD"])
async def test_a_missing_secret_is_tried_again(password: str) -> None:
    async with broker() as port, floor() as of, heard(of, port, user="a", password=password) as source:
        await until(lambda: of.measures.values[FAILURES].get(("hall",), 0) > 1)
        assert not source.is_connected
