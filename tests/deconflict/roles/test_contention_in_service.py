"""Contention through the whole service: real sockets in, the stored advisories and the metrics out."""

import asyncio
import json
import re
import time
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import httpx
from websockets.asyncio.client import connect

from deconflict.advisory import AnyAdvisory
from deconflict.roles.service import run_in_one_process
from metrics.monitoring.exposition import render
from tests.deconflict.roles.made_queues import SITE, scripts
from tests.helpers.patience import PATIENCE_S
from tests.helpers.replayed import replayed
from tests.helpers.saying import identity, robot


@asynccontextmanager
async def running(data: Path) -> AsyncIterator[tuple[str, str]]:
    """The robots' address and the operators'."""
    async with run_in_one_process(SITE, data, render) as (receiver, operator):
        yield f"ws://127.0.0.1:{receiver.receiver.port}", f"http://127.0.0.1:{operator.port}"


async def drive(url: str, start_s: float) -> None:
    """Everybody reports twice a second until cancelled."""
    async with connect(url) as socket:
        for name, one in scripts().items():
            await socket.send(identity(name, start_s, manufacturerName=one.vendor))
        while True:
            for name, one in scripts().items():
                await socket.send(one.says(name, time.time() - start_s, start_s))
            await asyncio.sleep(0.5)


async def until(url: str, *kinds: str) -> dict[str, Any]:
    """The first open advisory of each kind, once there are some of all."""
    async with httpx.AsyncClient(timeout=PATIENCE_S) as client, asyncio.timeout(PATIENCE_S):
        while True:
            answer = await client.get(f"{url}/advisories")
            found = {one["kind"]: one for one in reversed(answer.json()["advisories"])} if answer.is_success else {}
            if found.keys() >= set(kinds):
                return found
            await asyncio.sleep(0.1)


async def revisions(url: str, *ids: str) -> list[dict[str, Any]]:
    """Every revision of some advisories."""
    async with httpx.AsyncClient(timeout=PATIENCE_S) as client:
        answers = [(await client.get(f"{url}/advisories/{one}")).json()["advisories"] for one in ids]
    return [revision for answer in answers for revision in answer]


async def told_in_metrics(url: str) -> None:
    """Demand, occupancy and wait at each place, deadlocks ahead, and what solves took."""
    async with httpx.AsyncClient(timeout=PATIENCE_S) as client, asyncio.timeout(PATIENCE_S):
        while True:
            text = (await client.get(f"{url}/metrics")).text
            told = dict(re.findall(r"^(deconflict_[^ ]+) ([\d.e+-]+)$", text, re.M))
            if float(told.get("deconflict_advice_solve_seconds_count", 0)) >= 2:
                break
            await asyncio.sleep(0.1)
    expected = {
        'deconflict_resource_occupancy{resource="c1"}': 1.0,
        'deconflict_resource_demand{resource="c1"}': 3.0,
        'deconflict_resource_demand{resource="lane"}': 2.0,
        "deconflict_deadlocks_ahead": 1.0,
    }
    assert {name: float(told[name]) for name in expected} == expected
    wait_s = float(told['deconflict_resource_wait_seconds{resource="c1"}'])
    assert 100 < wait_s < 160, "one robot stays for 100 s before the other one's turn"


def by_revision(told: list[AnyAdvisory]) -> dict[tuple[str, int], dict[str, Any]]:
    return {(one.id, one.revision): json.loads(one.model_dump_json()) for one in told}


async def test_a_deadlock_and_a_queue_are_predicted_and_keep_their_ids_over_a_restart(tmp_path: Path) -> None:
    start_s = time.time()
    async with running(tmp_path) as (robots, operator):
        driving = asyncio.create_task(drive(robots, start_s))
        found = await until(operator, "deadlock", "contention")
        assert set(found["deadlock"]["robots"]) == {robot("A"), robot("B")}
        assert {one["where"] for one in found["deadlock"]["cycle"]} == {"lane"}
        assert found["deadlock"]["time_to_conflict_s"] > 3
        assert (found["contention"]["resource"], found["contention"]["queue_length"]) == ("c1", 2)
        assert found["contention"]["recommendation"]["slots"]
        await told_in_metrics(operator)
        driving.cancel()
        live = await revisions(operator, found["deadlock"]["id"], found["contention"]["id"])
    told = by_revision(replayed(tmp_path / "log", SITE))
    assert [one | {"seq": 0} for one in live] == [told[one["id"], one["revision"]] for one in live]
    async with running(tmp_path) as (robots, operator):
        driving = asyncio.create_task(drive(robots, start_s))
        again = await until(operator, "deadlock", "contention")
        assert {kind: again[kind]["id"] for kind in found} == {kind: found[kind]["id"] for kind in found} | {
            kind: again[kind]["id"] for kind in found if kind == "conflict"
        }
        driving.cancel()
