"""The part `delivery` of the health: true while the store takes all, is late, or refuses."""

import asyncio
import json
from pathlib import Path

import pytest

from deconflict.roles.engine_link.delivery import Delivery
from deconflict.roles.health import delivery_health
from deconflict.roles.health.delivery_health import DELAY, LATE_S, DeliveryHealth
from deconflict.roles.health.refusal_health import SHOWN_S
from deconflict.roles.operator_role import OperatorRole
from deconflict.roles.service import runtime_directory
from deconflict.runtime.rpc import AsyncCaller
from deconflict.runtime.set_asides import SetAsides
from deconflict.settings.site import Operator, Site
from ingest.measures.measures import Measures
from metrics.monitoring.exposition import render
from tests.helpers.made_advisories import made
from tests.helpers.patience import PATIENCE_S


def test_a_parcel_that_is_refused_makes_the_delay_grow_until_it_is_taken() -> None:
    health = DeliveryHealth()
    assert health.document(100.0, []) == {"status": "ok", "delay_s": 0.0}
    health.arrived(100.0)
    assert health.document(100.0 + LATE_S, [])["status"] == "ok"
    health.arrived(100.0)
    late = health.document(109.0, [])
    assert late == {"status": "degraded", "reason": "advisories reach the store 9 s late", "delay_s": 9.0}
    health.taken(110.0)
    assert health.document(110.1, [])["delay_s"] == 10.0, "the next one waits as long until it is taken, too"
    health.arrived(110.0)
    health.taken(110.2)
    assert health.document(110.3, []) == {"status": "ok", "delay_s": 0.2}


def test_the_delay_of_the_last_parcel_is_forgotten_if_no_other_comes() -> None:
    health = DeliveryHealth()
    health.arrived(100.0)
    health.taken(110.0)
    assert health.document(110.0 + LATE_S, []) == {"status": "ok", "delay_s": 0.0}


def test_what_was_set_aside_shows_for_a_while_whoever_did_it() -> None:
    health, engine = DeliveryHealth(), Measures()
    aside = SetAsides(engine)
    health.note_measures([engine.as_document()], 100.0)
    assert health.document(100.0, [])["status"] == "ok"
    health.set_aside(100.0)
    assert "set aside 3 s ago" in health.document(103.0, [])["reason"]
    assert health.document(100.0 + SHOWN_S, [])["status"] == "ok"
    aside.add("invalid", "advisory-1", ValueError())
    for now_s in (200.0, 201.0):
        health.note_measures([engine.as_document()], now_s)
    assert "set aside 3 s ago" in health.document(203.0, [])["reason"]


def test_in_a_cluster_the_delay_of_the_slowest_engine_counts() -> None:
    engines = [Measures(), Measures()]
    for engine, delay_s in zip(engines, (7.0, 1.0), strict=True):
        engine.level(DELAY, {(): delay_s})
    assert DeliveryHealth().document(100.0, [engine.as_document() for engine in engines])["delay_s"] == 7.0


async def test_health_shows_that_the_store_refuses_and_that_it_takes_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(delivery_health, "LATE_S", 0.5)
    monkeypatch.setattr("deconflict.operator.store.store.MOST_PENDING", 0)
    with runtime_directory() as runtime:
        stop = asyncio.Event()
        role = OperatorRole(Site(operator=Operator(port=0)), Path(runtime), tmp_path, render)
        running = asyncio.create_task(role.run(stop))
        await role.ready.wait()
        delivery, face = Delivery(Path(runtime)), AsyncCaller(Path(runtime), "operator")
        delivery.start()
        delivery.add_pass(0.0, [made(1)], {}, Measures())
        await until_delivery(face, "degraded")
        monkeypatch.setattr("deconflict.operator.store.store.MOST_PENDING", 1)
        await until_delivery(face, "ok")
        assert [each.id for each in role._store.after(0)] == ["advisory-1"]
        await asyncio.to_thread(delivery.stop)
        stop.set()
        await running


async def until_delivery(face: AsyncCaller, status: str) -> None:
    async with asyncio.timeout(PATIENCE_S):
        while (health := json.loads(await face.call("health")))["delivery"]["status"] != status:
            await asyncio.sleep(0.05)
    assert status == "ok" or health["status"] == "degraded"
