"""What health says of robots without a position, and of brokers whose robots are not heard."""

import asyncio
from pathlib import Path
from typing import Any

import pytest
from aiomqtt import Client

from deconflict.roles.health.positions_health import broker_notes, brokers_document, positions_document
from ingest.fleet import fleet_report
from ingest.fleet.fleet import Fleet
from ingest.fleet.owners.comparability import REMEDIES, TOO_MANY_MAPS
from ingest.measures.measures import Measures
from ingest.port.brokers import topic_scan
from ingest.port.brokers.mqtt_source import MqttSource
from ingest.port.brokers.topic_scan import OtherTopics
from ingest.settings import UNKNOWN
from tests.deconflict.operator.outlets.made_outlets import broker, needs_mosquitto
from tests.deconflict.roles.made_service import SITE, running
from tests.helpers.patience import PATIENCE_S
from tests.helpers.saying import identity, status
from tests.helpers.vda_saying import vda
from tests.ingest.fleet.made_fleet import LINE, NOW_S, fleet


def measured(of: Fleet, now_s: float) -> list[dict[str, Any]]:
    fleet_report.measure(of, now_s)
    return [of.measures.as_document()]


def test_health_is_not_ok_while_robots_of_a_vendor_have_no_position() -> None:
    of = fleet()
    for second in range(0, 41, 10):
        for name in ("A-1", "A-2"):
            of.receive(identity(name, NOW_S + second), NOW_S + second, LINE)
        of.receive(status("A-3", NOW_S + second), NOW_S + second, LINE)
    document = positions_document(measured(of, NOW_S + 41))
    assert (document["status"], document["robots"]) == ("degraded", 2)
    assert "2 of Alder (no position): let it send its position" in document["reason"]
    assert "not_compared_reason" in document["reason"]
    for name in ("A-1", "A-2"):
        of.receive(status(name, NOW_S + 42), NOW_S + 42, LINE)
    assert positions_document(measured(of, NOW_S + 43)) == {"status": "ok", "robots": 0}


def test_health_is_ok_while_robots_begin_to_report() -> None:
    of = fleet()
    for second in range(0, 26, 5):
        of.receive(identity("A-1", NOW_S + second), NOW_S + second, LINE)
    assert positions_document(measured(of, NOW_S + 26))["status"] == "ok"


def test_a_sender_that_makes_up_maps_does_not_change_health() -> None:
    measures = Measures()
    measures.level(fleet_report.NOT_COMPARED, {("Mallory", TOO_MANY_MAPS): 3.0})
    assert positions_document([measures.as_document()]) == {"status": "ok", "robots": 0}


@pytest.mark.parametrize("fault", [fault for fault in REMEDIES if fault != TOO_MANY_MAPS])
def test_health_says_what_to_do_about_each_fault(fault: str) -> None:
    measures = Measures()
    measures.level(fleet_report.NOT_COMPARED, {("Alder", fault): 3.0})
    document = positions_document([measures.as_document()])
    assert f"3 of Alder ({fault}): {REMEDIES[fault]}" in document["reason"]


def test_health_says_why_messages_of_a_robot_are_rejected() -> None:
    of = fleet()
    of.receive(identity("A-1", NOW_S), NOW_S, LINE)
    for second in range(3):
        of.receive(status("A-1", NOW_S + second, location=None), NOW_S + second, LINE)
    document = positions_document(measured(of, NOW_S + 3), fleet_report.senders(of, NOW_S + 3))
    assert "1 of Alder (not read): its messages are rejected" in document["reason"]
    assert "(Alder A-1: 3 messages rejected, the last: location: is missing)" in document["reason"]


@pytest.mark.parametrize(
    ("vendor", "accepted", "per_s", "status_expected"),
    [("Alder", 0, 2.0, "degraded"), ("Alder", 1, 2.0, "ok"), ("Alder", 0, 0.0, "ok"), (UNKNOWN, 0, 2.0, "ok")],
)
def test_health_names_a_vendor_of_which_nothing_can_be_read(
    vendor: str, accepted: int, per_s: float, status_expected: str
) -> None:
    measures = Measures()
    measures.count("deconflict_messages_total", vendor, "rejected", by=5)
    measures.count("deconflict_messages_total", vendor, "accepted", by=accepted)
    measures.level("deconflict_messages_per_second", {(vendor,): per_s})
    document = positions_document([measures.as_document()])
    assert document["status"] == status_expected
    assert ("all messages of Alder are rejected" in document.get("reason", "")) == (status_expected == "degraded")


def test_a_broker_where_no_robot_is_heard_is_degraded_if_robots_are_under_other_topics() -> None:
    other = OtherTopics("x/v2", "x/v2/KIT/1/state", 'set mqtt_sources.prefixes = ["x/v2"]')._asdict()
    unheard = {"name": "hall", "heard": False, "other_topics": [other]}
    assert brokers_document([unheard])["status"] == "degraded"
    assert 'hall: set mqtt_sources.prefixes = ["x/v2"]' in brokers_document([unheard])["reason"]
    heard = unheard | {"heard": True}
    assert brokers_document([heard]) == {"status": "ok", "notes": broker_notes([heard])}
    assert brokers_document([unheard | {"other_topics": []}]) == {"status": "ok", "notes": []}


def test_a_shared_broker_that_no_ingest_hears_is_named_and_degraded() -> None:
    answers = ("hall", ""), ("hall", "west, process 7"), ("yard", ""), ("yard", "")
    brokers = [{"name": name, "heard": False, "other_topics": [], "ingest": ingest} for name, ingest in answers]
    document = brokers_document(brokers)
    assert (document["status"], document["heard_by"]) == ("degraded", {"hall": ["west, process 7"], "yard": []})
    assert document["reason"].startswith("no robot is heard at yard: yard: no ingest is connected to this broker")
    assert brokers_document(brokers[:2])["status"] == "ok"


@needs_mosquitto
async def test_a_service_names_the_topics_of_a_broker_that_it_does_not_hear(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(topic_scan, "FIRST_AFTER_S", 0.1)
    monkeypatch.setattr(topic_scan, "SCAN_EVERY_S", 0.2)
    monkeypatch.setattr(topic_scan, "SCAN_S", 0.3)
    async with broker() as port:
        async with Client("127.0.0.1", port) as client:
            await client.publish("x/v2/KIT/1/connection", vda(NOW_S, connectionState="ONLINE"), 1, True)
        source = MqttSource(name="hall", host="127.0.0.1", port=port)
        async with running(tmp_path, SITE.model_copy(update={"mqtt_sources": (source,)})) as service:
            health: dict[str, Any] = {}
            async with asyncio.timeout(PATIENCE_S):
                while not health.get("notes"):
                    health = (await service.get("/healthz")).json().get("brokers", {})
                    await asyncio.sleep(0.05)
    assert health["status"] == "degraded"
    (note,) = health["notes"]
    assert "'x/v2/KIT/1/connection'" in note
    assert 'set mqtt_sources.prefixes = ["uagv/v2", "vda5050/v3", "x/v2"]' in note
