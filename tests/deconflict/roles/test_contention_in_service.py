"""Contention through the whole service: real sockets in, the stored advisories and the metrics out."""

import asyncio
import json
import re
import time
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

from websockets.asyncio.client import connect

from deconflict.roles.service import run_in_one_process
from deconflict_client.situations import AnyRevision
from metrics.monitoring.exposition import render
from tests.deconflict.roles.made_queues import SITE, scripts
from tests.helpers.patience import PATIENCE_S
from tests.helpers.plain_http import http_client
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
        for name, script in scripts().items():
            await socket.send(identity(name, start_s, manufacturerName=script.vendor))
        while True:
            for name, script in scripts().items():
                await socket.send(script.says(name, time.time() - start_s, start_s))
            await asyncio.sleep(0.5)


async def until(url: str, *kinds: str) -> dict[str, Any]:
    """The first open advisory of each kind, once there are some of all."""
    async with http_client() as client, asyncio.timeout(PATIENCE_S):
        while True:
            answer = await client.get(f"{url}/advisories")
            found = (
                {advisory["kind"]: advisory for advisory in reversed(answer.json()["advisories"])}
                if answer.is_success
                else {}
            )
            if found.keys() >= set(kinds):
                return found
            await asyncio.sleep(0.1)


async def situations(url: str, advisory_id: str) -> list[dict[str, Any]]:
    """The open situations that an advisory is in, once there is one."""
    async with http_client() as client, asyncio.timeout(PATIENCE_S):
        while True:
            listed = (await client.get(f"{url}/situations")).json()["situations"]
            if found := [situation for situation in listed if advisory_id in situation["advisories"]]:
                return found
            await asyncio.sleep(0.1)


async def revisions(url: str, *ids: str) -> list[dict[str, Any]]:
    """Every revision of some advisories."""
    async with http_client() as client:
        answers = [(await client.get(f"{url}/advisories/{name}")).json()["advisories"] for name in ids]
    return [revision for answer in answers for revision in answer]


async def told_in_metrics(url: str) -> None:
    """Demand, occupancy and wait at each place, deadlocks ahead, and what solves took."""
    async with http_client() as client, asyncio.timeout(PATIENCE_S):
        while True:
            text = (await client.get(f"{url}/metrics")).text
            row = dict(re.findall(r"^(deconflict_[^ ]+) ([\d.e+-]+)$", text, re.M))
            if float(row.get("deconflict_advice_solve_seconds_count", 0)) >= 2:
                break
            await asyncio.sleep(0.1)
    expected = {
        'deconflict_resource_occupancy{resource="c1"}': 1.0,
        'deconflict_resource_demand{resource="c1"}': 3.0,
        'deconflict_resource_demand{resource="lane"}': 2.0,
        "deconflict_deadlocks_ahead": 1.0,
    }
    assert {name: float(row[name]) for name in expected} == expected
    wait_s = float(row['deconflict_resource_wait_seconds{resource="c1"}'])
    assert 100 < wait_s < 160, "one robot stays for 100 s before the other one's turn"


def by_revision(advisories: list[AnyRevision]) -> dict[tuple[str, int], dict[str, Any]]:
    return {(advisory.id, advisory.revision): json.loads(advisory.model_dump_json()) for advisory in advisories}


async def test_a_deadlock_and_a_queue_are_predicted_and_keep_their_ids_over_a_restart(tmp_path: Path) -> None:
    start_s = time.time()
    async with running(tmp_path) as (robots, operator):
        driving = asyncio.create_task(drive(robots, start_s))
        found = await until(operator, "deadlock", "contention")
        assert set(found["deadlock"]["robots"]) == {robot("A"), robot("B")}
        assert {row["where"] for row in found["deadlock"]["cycle"]} == {"lane"}
        assert found["deadlock"]["time_to_conflict_s"] > 3
        assert (found["contention"]["resource"], found["contention"]["queue_length"]) == ("c1", 2)
        assert found["contention"]["recommendation"]["slots"]
        await told_in_metrics(operator)
        (situation,) = await situations(operator, found["deadlock"]["id"])
        assert situation["situation_kind"] == "deadlock"
        driving.cancel()
        live = await revisions(operator, found["deadlock"]["id"], found["contention"]["id"])
    documents = by_revision(replayed(tmp_path / "log", SITE))
    assert [document | {"seq": 0} for document in live] == [
        documents[document["id"], document["revision"]] for document in live
    ]
    async with running(tmp_path) as (robots, operator):
        driving = asyncio.create_task(drive(robots, start_s))
        again = await until(operator, "deadlock", "contention")
        assert {kind: again[kind]["id"] for kind in found} == {kind: found[kind]["id"] for kind in found} | {
            kind: again[kind]["id"] for kind in found if kind == "conflict"
        }
        (restored,) = await situations(operator, found["deadlock"]["id"])
        assert restored["id"] == situation["id"]
        driving.cancel()
