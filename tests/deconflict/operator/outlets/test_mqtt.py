"""The outlet to a broker, with a real one."""

import asyncio
from contextlib import AbstractAsyncContextManager
from getpass import getuser
from pathlib import Path

import pytest
import trustme
from aiomqtt import Client

from deconflict.operator.outlets.mqtt import MqttOutlet, messages_of
from deconflict.operator.outlets.store_cursor import StoreCursor
from deconflict.operator.store.publisher import PublishedLine, Publisher
from deconflict.operator.store.store import Store
from deconflict.settings.outlet_settings import Mqtt
from deconflict_client.advisory import KindChoice
from deconflict_client.situations import REVISION
from tests.deconflict.operator.http.served_face import until
from tests.deconflict.operator.outlets.made_outlets import broker, kept, needs_mosquitto, retained, working
from tests.deconflict.roles.made_service import free_ports
from tests.helpers.made_advisories import cleared, cleared_situation, made, situation
from tests.helpers.patience import PATIENCE_S
from tests.ingest.security.made_tls import write

pytestmark = needs_mosquitto


def feeding(
    port: int, store: Store, publisher: Publisher, kinds: tuple[KindChoice, ...] = ("advisory",)
) -> AbstractAsyncContextManager[None]:
    settings = Mqtt(host="127.0.0.1", port=port, retry_s=(0.05, 0.2), kinds=kinds)
    return working(MqttOutlet(settings, StoreCursor("mqtt", kinds, store, publisher), store).run(), publisher)


async def test_the_broker_retains_open_advisories_and_forgets_cleared_ones(tmp_path: Path) -> None:
    async with broker() as port, asyncio.timeout(PATIENCE_S):
        with kept(tmp_path) as (store, publisher):
            async with feeding(port, store, publisher):
                await publisher.publish([made(1), made(2)])
                (first,) = await publisher.publish([made(1, 2)])
                held = await retained(port, {"service", "advisories/advisory-1", "advisories/advisory-2"})
                while held["deconflict/advisories/advisory-1"] != first.model_dump_json():
                    held = await retained(port, {"service", "advisories/advisory-1", "advisories/advisory-2"})
                assert held["deconflict/service"] == "online"
                await publisher.publish([cleared(1, 3)])
                await retained(port, {"service", "advisories/advisory-2"})
            assert (await retained(port, {"service", "advisories/advisory-2"}))["deconflict/service"] == "offline"


# The client leaves the socket of a failed handshake to the garbage collector.
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
async def test_the_authority_of_the_broker_is_named_and_read_again_at_each_connect(tmp_path: Path) -> None:
    (port,) = free_ports(1)
    config, authority = tmp_path / "mosquitto.conf", tmp_path / "ca.pem"
    config.write_text(
        f"listener {port} 127.0.0.1\nallow_anonymous true\nuser {getuser()}\n"
        f"certfile {tmp_path}/site.pem\nkeyfile {tmp_path}/site.pem\n"
    )
    settings = Mqtt(host="127.0.0.1", port=port, tls=True, ca=str(authority), retry_s=(0.05, 0.2), kinds=("advisory",))
    with kept(tmp_path) as (store, publisher):
        outlet = MqttOutlet(settings, StoreCursor("mqtt", ("advisory",), store, publisher), store)
        failures = publisher.measures.values["deconflict_outlet_failures_total"]
        async with working(outlet.run(), publisher), asyncio.timeout(PATIENCE_S):
            await publisher.publish([made(1)])
            await until(lambda: failures["mqtt",] > 0)
            for seq in (1, 2):
                signs = trustme.CA()
                write(signs, tmp_path)
                signs.cert_pem.write_to_path(str(authority))
                async with broker(port, settings=config):
                    await until(lambda seq=seq: store.position("mqtt") == seq)
                await publisher.publish([made(seq + 1)])
            failed = failures["mqtt",]
            trustme.CA().cert_pem.write_to_path(str(authority))
            async with broker(port, settings=config):
                await until(lambda: failures["mqtt",] > failed + 2)
            assert store.position("mqtt") == 2


async def test_revisions_missed_while_broker_or_service_was_down_are_sent_later(tmp_path: Path) -> None:
    (port,) = free_ports(1)
    async with asyncio.timeout(PATIENCE_S):
        with kept(tmp_path) as (store, publisher):
            async with feeding(port, store, publisher):
                async with broker(port):
                    await publisher.publish([made(1), made(2)])
                    await until(lambda: store.position("mqtt") == 2)
                failures = publisher.measures.values["deconflict_outlet_failures_total"]
                await publisher.publish([cleared(2), made(3)])
                await until(lambda: failures["mqtt",] > 0)
                async with broker(port):  # it has forgotten everything
                    await retained(port, {"service", "advisories/advisory-1", "advisories/advisory-3"})
            await publisher.publish([cleared(1)])
        async with broker(port):
            with kept(tmp_path) as (store, publisher):
                async with feeding(port, store, publisher):
                    await retained(port, {"service", "advisories/advisory-3"})


async def test_the_broker_retains_open_situations_and_forgets_the_kinds_of_earlier_settings(tmp_path: Path) -> None:
    async with broker() as port, asyncio.timeout(PATIENCE_S):
        with kept(tmp_path) as (store, publisher):
            async with feeding(port, store, publisher):
                await publisher.publish([made(1), situation(1), made(2)])
                await retained(port, {"service", "advisories/advisory-1", "advisories/advisory-2"})
            async with feeding(port, store, publisher, Mqtt(host="").kinds):
                await publisher.publish([made(3), situation(2), cleared(1)])
                held = await retained(port, {"service", "situations/situation-1", "situations/situation-2"})
                assert REVISION.validate_json(held["deconflict/situations/situation-2"]).seq == 5
                await publisher.publish([cleared_situation(2)])
                await retained(port, {"service", "situations/situation-1"})


async def test_topics_that_the_outlet_cannot_have_sent_are_not_emptied(tmp_path: Path) -> None:
    async with broker() as port, asyncio.timeout(PATIENCE_S):
        with kept(tmp_path) as (store, publisher):
            async with feeding(port, store, publisher):
                await publisher.publish([made(1), made(2)])
                await until(lambda: store.position("mqtt") == 2)
            await publisher.publish([cleared(1), made(3), cleared(3), made(4), situation(1)])
            async with Client("127.0.0.1", port) as watching, feeding(port, store, publisher, Mqtt(host="").kinds):
                await watching.subscribe("deconflict/+/+", qos=1)
                emptied = set()
                async for message in watching.messages:
                    if message.topic.matches("deconflict/situations/+"):
                        break
                    if not message.payload:
                        emptied.add(message.topic.value)
    assert emptied == {"deconflict/advisories/advisory-1", "deconflict/advisories/advisory-2"}


def test_a_clearing_revision_is_sent_and_then_the_topic_is_emptied() -> None:
    line = PublishedLine(7, cleared(1).model_dump_json(), "conflict")
    assert [(message.payload, message.retain) for message in messages_of("hall", line)] == [
        (line.text, False),
        (None, True),
    ]
    assert {message.topic for message in messages_of("hall", line)} == {"hall/advisories/advisory-1"}
