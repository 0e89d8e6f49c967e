"""An operator face of a cluster shows the robots of every ingest, with a real NATS server."""

import asyncio
import json
import time
from collections.abc import Callable
from contextlib import AsyncExitStack
from pathlib import Path
from typing import Any

from websockets.asyncio.client import connect

from deconflict.cluster.ingest_calls import IngestCalls, past_frame
from deconflict.cluster.nats.nats_tasks import open_bus
from deconflict.cluster.tiles.tile_channels import EVERY
from deconflict.settings.cluster_settings import Cluster
from ingest.port.connection import Connection
from tests.deconflict.cluster.made_cluster import Broker, Faltering, cluster, ingest, needs_server, until
from tests.deconflict.cluster.made_shards import NOW_S, fleet
from tests.deconflict.roles.made_service import drive
from tests.helpers.plain_http import http_client
from tests.helpers.saying import robot, status

pytestmark = needs_server


async def test_an_operator_face_shows_the_robots_of_every_ingest(tmp_path: Path) -> None:
    async with cluster(tmp_path) as (machines, operator), AsyncExitStack() as stack:
        base = f"http://127.0.0.1:{operator.port}"
        urls = [await stack.enter_async_context(ingest(machines, tmp_path / name)) for name in ("west", "east")]
        rows = zip(urls, ({"A": lambda _: (1.0, 2.0, 0.0)}, {"B": lambda _: (9.0, 2.0, 0.0)}), strict=True)
        driving = [asyncio.create_task(drive(url, courses, 300, time.time())) for url, courses in rows]
        both = {robot("A"), robot("B")}
        listed = await until(base, "/robots", lambda each: {row["uuid"] for row in each.get("robots", ())} == both)
        assert {row["presence"] for row in listed["robots"]} == {"present"}
        await until(
            base,
            "/vendors",
            lambda row: [(vendor["name"], vendor["robots"]) for vendor in row["vendors"]] == [("Alder", 2)],
        )
        async with http_client() as client:
            assert "deconflict_messages_total" in (await client.get(f"{base}/metrics")).text
            response = await client.get(f"{base}/robots/{robot('B')}")
        assert response.json()["uuid"] == robot("B")
        seen: dict[str, set[float]] = {}
        async with connect(f"ws://127.0.0.1:{operator.port}/live") as page, asyncio.timeout(300):
            while seen.keys() != both or min(map(len, seen.values())) < 2:
                for row in json.loads(await page.recv())["floor"]["robots"]:
                    seen.setdefault(row[0], set()).add(row[6])
        for each in driving:
            each.cancel()


def test_a_robot_that_two_ingests_recorded_is_where_the_newer_status_has_it() -> None:
    answers = []
    for x_m, at_s in ((1.0, 5.0), (2.0, 9.0), (3.0, 7.0)):
        heard = fleet()
        heard.receive(status("A", NOW_S + at_s, x_m), NOW_S + at_s, Connection(1))
        answers.append(heard.snapshot(NOW_S + 10.0).to_bytes())
    (row,) = json.loads(past_frame(answers))["robots"]
    assert (row[0], row[11][1]) == (robot("A"), 2.0)


async def test_the_floor_is_subscribed_once_though_calls_repeat_before_it_has_begun(tmp_path: Path) -> None:
    broker = Broker(tmp_path)
    bus = Faltering(Cluster(nats=(broker.address,)))
    try:
        assert await open_bus(bus, asyncio.Event())
        follow = IngestCalls(bus).handlers()["follow"]
        await asyncio.gather(*(follow(b"0") for _ in range(3)))
    finally:
        await bus.close()
        broker.kill()
    assert bus.begun == {EVERY: 1}


async def test_health_shows_a_missing_ingest_and_then_a_missing_server(tmp_path: Path) -> None:
    async with cluster(tmp_path) as (machines, operator):
        base = f"http://127.0.0.1:{operator.port}"
        async with ingest(machines, tmp_path / "ingest"):
            await until(base, "/healthz", roles(nats="up", ingest="up"))
        health = await until(base, "/healthz", roles(nats="up", ingest="down"))
        assert health["status"] == "degraded"
        async with http_client() as client:
            for path in ("/robots", "/quarantine"):
                answer = await client.get(base + path)
                fields = {"detail": "the ingest does not answer; try again shortly, or see /healthz", "role": "ingest"}
                assert (answer.status_code, answer.json()) == (503, fields)
            assert 'deconflict_role_up{role="ingest"} 0.0' in (await client.get(f"{base}/metrics")).text
        machines.broker.kill()
        await until(base, "/healthz", roles(nats="down", ingest="down"))
        assert "NATS server" in (await until(base, "/robots", lambda row: row["role"] != "ingest"))["detail"]


def roles(**wanted: str) -> Callable[[dict[str, Any]], bool]:
    """Whether health says so of these."""
    return lambda health: health["roles"].items() >= wanted.items()
