"""What is not of one place, in a cluster with a real NATS server: told by one engine for all, whichever that is."""

import asyncio
import time
from contextlib import AsyncExitStack
from pathlib import Path
from typing import Any

from websockets.asyncio.client import connect

from deconflict.cluster.member import Member
from tests.deconflict.cluster.made_cluster import cluster, ingest, needs_server, running, table
from tests.deconflict.cluster.test_cluster import lives, until
from tests.deconflict.contention.scenes import Script
from tests.deconflict.contention.test_service import SITE, scripts
from tests.saying import identity

pytestmark = needs_server


async def drive(urls: list[str], robots: dict[str, Script]) -> None:
    """Everybody reports twice a second until cancelled, each to one of the ingests; more may come."""
    start_s, known = time.time(), set[str]()
    async with AsyncExitStack() as stack:
        sockets = [await stack.enter_async_context(connect(url)) for url in urls]
        while True:
            for number, (name, one) in enumerate(robots.items()):
                socket = sockets[number % len(sockets)]
                if name not in known:
                    await socket.send(identity(name, start_s, manufacturerName=one.vendor))
                    known.add(name)
                await socket.send(one.says(name, time.time() - start_s, start_s))
            await asyncio.sleep(0.5)


def by_kind(listed: dict[str, Any]) -> dict[str, Any]:
    return {one["kind"]: one for one in listed["advisories"] if one["kind"] != "conflict"}


async def test_a_queue_is_told_once_and_goes_on_under_its_id_where_the_engine_that_watched_dies(tmp_path: Path) -> None:
    async with cluster(tmp_path, SITE) as (machines, operator), AsyncExitStack() as stack:
        base, robots = f"http://127.0.0.1:{operator.port}", scripts()
        urls = [await stack.enter_async_context(ingest(machines, tmp_path / name)) for name in ("west", "east")]
        members = [Member(machines.site(), machines.settings, tmp_path) for _ in range(2)]
        tasks = {one.name: await stack.enter_async_context(running(one)) for one in members}
        driving = asyncio.create_task(drive(urls, robots))
        found = by_kind(await until(base, "/advisories", lambda listed: by_kind(listed).keys() >= {"contention"}))
        assert (found["contention"]["resource"], found["contention"]["queue_length"]) == ("c1", 2)
        document = await table(machines.settings)
        tasks[document["watch"]].cancel()
        robots["F"] = Script([(0, 30, 60)], [(80, 0, 40)], state=lambda _: "waitingExternalEvent")
        await until(base, "/advisories", lambda listed: by_kind(listed)["contention"]["queue_length"] == 3)
        driving.cancel()
        (told,) = [life for life in await lives(base) if life[0].kind == "contention"]
        assert told[0].id == found["contention"]["id"]
        assert [one.revision for one in told] == list(range(1, len(told) + 1))
        assert (await table(machines.settings))["watch"] in tasks.keys() - {document["watch"]}
