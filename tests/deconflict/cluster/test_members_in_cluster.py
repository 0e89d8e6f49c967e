"""A member that is dead is seen by every operator face, with a real NATS server."""

import asyncio
import json
import signal
from contextlib import AsyncExitStack
from pathlib import Path
from typing import Any

import pytest
from websockets.asyncio.client import connect

from deconflict.cluster.nats import member_roster, shared_state
from tests.deconflict.cluster.made_cluster import Broker, buses, cluster, face, needs_server, until
from tests.helpers.patience import PATIENCE_S
from tests.helpers.plain_http import http_client

pytestmark = needs_server


def members(status: str, **there: int) -> Any:
    """Whether health says so of the members."""
    return lambda health: (health.get("members", {}).get("status"), health["members"].get("there")) == (status, there)


async def test_a_dead_engine_is_missed_until_another_takes_its_place_or_it_says_goodbye(tmp_path: Path) -> None:
    async with cluster(tmp_path) as (machines, operator), AsyncExitStack() as stack:
        base = f"http://127.0.0.1:{operator.port}"
        machines.start("west", "receiver", "feed")
        for name in ("first", "second"):
            machines.start(name, "engine")
        health = await until(base, "/healthz", members("ok", ingest=1, engine=2, face=1))
        assert health["members"]["expected"] == {"ingest": 1, "engine": 2, "face": 1}
        process = machines.process_of("second", "engine")
        machines.kill("second", "engine")
        health = await until(base, "/healthz", members("degraded", ingest=1, engine=1, face=1))
        assert health["status"] == "degraded"
        assert "engines there: 1 of 2 (" in health["members"]["reason"]
        assert f"process {process}, was last heard of at " in health["members"]["reason"]
        assert [(each["part"], each["process"]) for each in health["members"]["gone"]] == [("engine", process)]
        async with http_client() as client:
            scrape = (await client.get(f"{base}/metrics")).text
        assert 'deconflict_members{part="engine"} 1.0' in scrape
        assert 'deconflict_members_expected{part="engine"} 2.0' in scrape
        late = await stack.enter_async_context(face(machines, tmp_path / "late face"))
        other = f"http://127.0.0.1:{late.port}"
        health = await until(other, "/healthz", members("degraded", ingest=1, engine=1, face=2))
        assert f"process {process}, " in health["members"]["reason"]
        machines.start("third", "engine")
        await until(base, "/healthz", members("ok", ingest=1, engine=2, face=2))
        machines.stop("third", "engine")
        health = await until(base, "/healthz", members("ok", ingest=1, engine=1, face=2))
        assert health["members"]["expected"]["engine"] == 1


async def test_a_member_takes_no_place_of_one_that_died_after_it_began(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for module in (shared_state, member_roster):
        monkeypatch.setattr(module, "LEASE_S", 1.0)
    monkeypatch.setattr(member_roster, "NOTE_EVERY_S", 0.1)
    async with buses(Broker(tmp_path), 2) as (bus, other), asyncio.timeout(PATIENCE_S):
        await bus.beat("engine-a", {})
        await other.beat("engine-b", {})
        while "engine-b" not in bus.state.working():
            await asyncio.sleep(0.02)
        while not bus.roster._has_joined or "engine-b" in bus.state.working():
            await bus.beat("engine-a", {})
            await asyncio.sleep(0.1)
        assert [each.part for each in bus.roster.gone()] == ["engine"]


async def test_a_face_without_servers_says_that_members_are_unknown(tmp_path: Path) -> None:
    async with cluster(tmp_path) as (machines, operator):
        base = f"http://127.0.0.1:{operator.port}"
        await until(base, "/healthz", members("ok", ingest=0, engine=0, face=1))
        machines.broker.signal(signal.SIGSTOP)
        health = await until(base, "/healthz", lambda health: health["members"]["status"] != "ok")
        assert (health["status"], health["members"]["status"]) == ("degraded", "unknown")
        machines.broker.signal(signal.SIGCONT)
        await until(base, "/healthz", members("ok", ingest=0, engine=0, face=1))
        machines.broker.kill()
        health = await until(base, "/healthz", lambda health: health["members"]["status"] != "ok")
        assert health["members"]["status"] == "unknown"
        assert "it is unknown which members of the cluster are there" in health["members"]["reason"]
        async with http_client() as client:
            assert "\ndeconflict_members{" not in (await client.get(f"{base}/metrics")).text


async def test_what_the_site_file_expects_is_missed_though_nobody_ever_saw_it(tmp_path: Path) -> None:
    async with cluster(tmp_path, engines=2, faces=1) as (machines, operator):
        base = f"http://127.0.0.1:{operator.port}"
        machines.start("first", "engine")
        health = await until(base, "/healthz", members("degraded", ingest=0, engine=1, face=1))
        assert health["members"]["reason"].startswith("engines there: 1 of 2 (no other was heard of in the last day")
        machines.start("second", "engine")
        await until(base, "/healthz", members("ok", ingest=0, engine=2, face=1))
        machines.stop("second", "engine")
        await until(base, "/healthz", members("degraded", ingest=0, engine=1, face=1))


async def test_an_ingest_whose_receiver_is_dead_is_missed_also_on_the_page(tmp_path: Path) -> None:
    async with cluster(tmp_path) as (machines, operator):
        base = f"http://127.0.0.1:{operator.port}"
        machines.start("west", "receiver", "feed")
        await until(base, "/healthz", members("ok", ingest=1, engine=0, face=1))
        machines.kill("west", "receiver")
        health = await until(base, "/healthz", members("degraded", ingest=0, engine=0, face=1))
        assert "ingests there: 0 of 1 (" in health["members"]["reason"]
        async with connect(f"ws://127.0.0.1:{operator.port}/live") as page, asyncio.timeout(PATIENCE_S):
            while "ingests there: 0 of 1 (" not in json.loads(await page.recv()).get("health", {}).get("notice", ""):
                pass
