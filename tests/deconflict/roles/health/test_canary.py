"""A made-up conflict through the running service: it arrives at the store, and nowhere else."""

import asyncio
import json
import sqlite3
import time
from collections.abc import Awaitable, Callable
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest

from deconflict.engine.canary import canary_engine, canary_pair
from deconflict.engine.canary.canary_engine import judged
from deconflict.engine.canary.canary_pair import FLOOR, ROBOTS, CanaryPair, canary_batch
from deconflict.engine.canary.canary_parcel import Canary, packed, unpacked
from deconflict.operator.store.sqlite_connections import FILE_NAME
from deconflict.operator.store.store import Store
from deconflict.roles.health import canary_health
from deconflict.roles.health.canary_health import LATENCY, CanaryHealth
from tests.deconflict.roles.made_service import Running, running
from tests.helpers.patience import PATIENCE_S

NOW_S = 1_790_000_000.0


def advisory(canary: Canary) -> Any:
    return judged(canary)["advisory"]


def test_a_pair_that_is_about_to_meet_is_warned_of() -> None:
    for now_s in (NOW_S, NOW_S + 0.123_456):
        found = advisory(Canary(0.0, canary_batch(now_s)))
        assert (found["kind"], set(found["robots"])) == ("conflict", set(ROBOTS))


def test_an_engine_that_fails_on_the_canary_goes_on(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    assert advisory(Canary(0.0, b"torn")) is None
    assert "can't judge" in caplog.text


def test_a_batch_comes_with_a_canary_or_without() -> None:
    canary = Canary(17.25, b"pair")
    assert unpacked(packed(b"batch", canary)) == (b"batch", canary)
    assert unpacked(packed(b"batch", None)) == (b"batch", None)


async def test_a_canary_that_nobody_takes_grows_old(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(canary_pair, "CANARY_EVERY_S", 0.01)
    pair = CanaryPair(lambda: NOW_S)
    began_s, making = time.monotonic(), asyncio.create_task(pair.run())
    await asyncio.sleep(0.1)
    first = pair.take()
    assert first
    assert began_s <= first.due_s < began_s + 0.09
    making.cancel()
    assert pair.take() is None or pair.take() is None


async def canary(service: Running) -> dict[str, Any]:
    document: dict[str, Any] = (await service.get("/healthz")).json()["canary"]
    return document


async def until(condition: Callable[[], Awaitable[bool]]) -> None:
    async with asyncio.timeout(PATIENCE_S):
        while not await condition():
            await asyncio.sleep(0.05)


async def test_a_canary_comes_through_the_service_and_is_in_nothing_that_people_use(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(canary_pair, "CANARY_EVERY_S", 0.2)
    async with running(tmp_path) as service:

        async def is_stored() -> bool:
            return 0 < (await canary(service))["latency_s"] < canary_health.LATE_S

        await until(is_stored)
        answers = {path: (await service.get(path)).text for path in ("/advisories?state=all", "/robots", "/vendors")}
        metrics = (await service.get("/metrics")).text
    assert json.loads(answers["/advisories?state=all"])["advisories"] == []
    assert not any(uuid in text for uuid in (FLOOR, *ROBOTS) for text in (*answers.values(), metrics))
    assert f"\n{LATENCY} " in metrics
    assert "\ndeconflict_advisories_stored_total 0.0" in metrics
    assert not any(FLOOR[:8].encode() in file.read_bytes() for file in (tmp_path / "log").iterdir())
    with closing(sqlite3.connect(tmp_path / FILE_NAME)) as db:
        assert set(json.loads(db.execute("SELECT document FROM canary").fetchone()[0])["robots"]) == set(ROBOTS)
        assert db.execute("SELECT count(*) FROM revisions").fetchone() == (0,)


async def test_health_shows_that_no_canary_comes_through(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(canary_pair, "CANARY_EVERY_S", 0.2)
    monkeypatch.setattr(canary_health, "CANARY_EVERY_S", 0.2)
    monkeypatch.setattr(canary_health, "LATE_S", 2.0)
    async with running(tmp_path) as service:

        async def is_ok() -> bool:
            return (await canary(service))["status"] == "ok" and (await canary(service))["latency_s"] > 0

        async def is_late() -> bool:
            return not await is_ok()

        await until(is_ok)
        monkeypatch.setattr(canary_engine, "_revisions", lambda _: [])
        await until(is_late)
        health = await service.get("/healthz")
        assert (health.status_code, health.json()["status"]) == (503, "degraded")
        assert "warns of no made-up conflict" in health.json()["canary"]["reason"]


async def test_a_stuck_disk_makes_the_latency_grow(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    store = Store(tmp_path)
    health = CanaryHealth(store)
    began_s = time.monotonic()
    with closing(sqlite3.connect(store.path, isolation_level=None)) as other:
        other.execute("BEGIN IMMEDIATE")
        health.arrived({"due_s": began_s, "advisory": {}})
        health.arrived({"due_s": began_s, "advisory": {}})
        late_s = began_s + canary_pair.CANARY_EVERY_S + canary_health.LATE_S + 1
        assert health.document(late_s)["status"] == "degraded"
        other.execute("ROLLBACK")
    async with asyncio.timeout(PATIENCE_S):
        while health.latency_s(time.monotonic()) == 0:
            await asyncio.sleep(0.01)
    assert health.document(time.monotonic())["status"] == "ok"
    store.close()
