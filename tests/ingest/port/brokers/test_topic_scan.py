"""Robots at a broker under other topics than those that are heard are noticed, with a real broker."""

import json
from typing import Any

import pytest
from aiomqtt import Client, Message

from ingest.port.brokers import topic_scan
from ingest.port.brokers.mqtt_source import MqttSource
from ingest.port.brokers.topic_scan import MOST_FOUND, MOST_MESSAGES, OtherTopics, TopicScan, filters
from tests.deconflict.operator.outlets.made_outlets import broker, needs_mosquitto
from tests.helpers import iso_saying
from tests.helpers.vda_saying import state, vda

NOW_S = 1_790_000_000.0
CONNECTION = vda(NOW_S, connectionState="ONLINE")


def source(port: int = 1883, **settings: Any) -> MqttSource:
    return MqttSource(name="hall", host="127.0.0.1", port=port, **settings)


def scan_of(settings: MqttSource, *others: MqttSource) -> TopicScan:
    return TopicScan(settings, (settings, *others))


def came(topic: str, raw: bytes) -> Message:
    return Message(topic, raw, 0, True, 0, None)


def prefixes(scan: TopicScan) -> list[str]:
    return [other.prefix for other in scan.found]


@pytest.mark.parametrize("prefix", ["x/v2", "uagv/v3", "vda5050/v2", "v2", "site/hall/uagv/v2", ""])
def test_robots_under_another_prefix_or_version_are_named_with_what_to_set(prefix: str) -> None:
    scan, topic = scan_of(source()), "/".join(filter(None, (prefix, "KIT/0001/state")))
    scan.look_at(came(topic, state(NOW_S)))
    (other,) = scan.found
    assert (other.prefix, other.example) == (prefix, topic)
    assert f'set mqtt_sources.prefixes = ["uagv/v2", "vda5050/v3", "{prefix}"]' in other.advice


@pytest.mark.parametrize(
    ("topic", "raw"),
    [
        ("uagv/v2/KIT/1/state", state(NOW_S)),
        ("vda5050/v3/KIT/1/connection", CONNECTION),
        ("home/cellar/pump/state", b'{"state": "ON"}'),
        ("home/cellar/pump/state", b"ON"),
        ("x" * 300 + "/v2/KIT/1/state", state(NOW_S)),
    ],
)
def test_what_is_heard_and_what_is_no_robot_is_not_named(topic: str, raw: bytes) -> None:
    scan = scan_of(source())
    scan.look_at(came(topic, raw))
    assert scan.found == ()


def test_what_another_source_hears_at_the_same_broker_and_what_manufacturers_leave_out_is_not_named() -> None:
    scan = scan_of(source(manufacturers=["ACME"]), source(prefixes=["x/v2"]), source(1884, prefixes=["y/v2"]))
    for prefix in ("x/v2", "y/v2", "uagv/v2"):
        scan.look_at(came(f"{prefix}/KIT/1/state", state(NOW_S)))
    assert prefixes(scan) == ["y/v2"]


def test_topics_of_iso_21423_are_known_by_their_entity_type() -> None:
    scan = scan_of(source(language="iso21423"))
    for prefix in ("/ISO_21423/v1", "/ISO_21423/v2"):
        topic = f"{prefix}/IMR/{iso_saying.ROBOT}/odometry"
        scan.look_at(came(topic, iso_saying.odometry(NOW_S)))
    assert prefixes(scan) == ["/ISO_21423/v2"]


def test_no_scan_subscribes_to_everything() -> None:
    assert all("#" not in each and each.rsplit("/", 1)[1] != "+" for each in filters(("vda5050", "iso21423")))


def test_robots_of_another_standard_at_the_broker_are_named_once_with_the_section_to_add() -> None:
    settings, second = source(), source(prefixes=["x/v2"])
    topic = f"/ISO_21423/v1/IMR/{iso_saying.ROBOT}/odometry"
    for scan, named in ((scan_of(settings, second), True), (TopicScan(second, (settings, second)), False)):
        scan.look_at(came(topic, iso_saying.odometry(NOW_S)))
        assert [other.example for other in scan.found] == [topic] * named
    (other,) = scan_of_iso(settings, topic)
    assert 'add a section [[mqtt_sources]] of this broker with language = "iso21423"' in other.advice
    both = scan_of(settings, source(language="iso21423"))
    both.look_at(came(topic, iso_saying.odometry(NOW_S)))
    assert both.found == ()


def scan_of_iso(settings: MqttSource, topic: str) -> tuple[OtherTopics, ...]:
    scan = scan_of(settings)
    scan.look_at(came(topic, iso_saying.odometry(NOW_S)))
    return scan.found


@needs_mosquitto
async def test_a_scan_finds_what_a_broker_retains_and_what_comes_meanwhile() -> None:
    async with broker() as port:
        async with Client("127.0.0.1", port) as client:
            await client.publish("x/v2/KIT/1/connection", CONNECTION, 1, True)
            await client.publish("uagv/v2/KIT/1/connection", CONNECTION, 1, True)
            scan = scan_of(source(port))
            await scan.scan(0.5)
            assert prefixes(scan) == ["x/v2"]
            await client.publish("x/v2/KIT/1/connection", b"", 1, True)
        await scan.scan(0.2)
        assert scan.found == (), "what is gone is named no more"


@needs_mosquitto
async def test_a_busy_broker_is_left_after_enough_messages(monkeypatch: pytest.MonkeyPatch) -> None:
    looked: list[str] = []
    monkeypatch.setattr(topic_scan, "MOST_MESSAGES", 20)
    monkeypatch.setattr(TopicScan, "look_at", lambda _, message: looked.append(message.topic.value))
    async with broker() as port:
        async with Client("127.0.0.1", port) as client:
            for number in range(60):
                await client.publish(f"uagv/v2/KIT/{number}/connection", CONNECTION, 1, True)
        await scan_of(source(port)).scan(30.0)
    assert len(looked) == 20


def test_what_is_found_is_bounded_and_kept_over_a_reload() -> None:
    scan = scan_of(source())
    for number in range(3):
        scan.look_at(came(f"x{number}/v2/KIT/1/state", json.dumps({"headerId": 1, "serialNumber": "1"}).encode()))
    again = TopicScan(source(prefixes=["x1/v2"]), [source(prefixes=["x1/v2"])], scan.found)
    assert prefixes(again) == ["x0/v2", "x2/v2"]
    assert MOST_FOUND < MOST_MESSAGES
