"""What is not of one place, in a cluster with a real NATS server: told by one engine for all, whichever that is."""

import asyncio
import time
from contextlib import AsyncExitStack
from pathlib import Path
from typing import Any

from websockets.asyncio.client import connect

from deconflict.advice.deferred_answers import answer_at_once
from deconflict.cluster.engine_member import EngineMember
from deconflict.cluster.judging.global_engine import GlobalEngine
from deconflict.cluster.judging.stream_writer import StreamWriter
from deconflict.cluster.nats.bus import Bus
from deconflict.cluster.nats.nats_tasks import end_tasks
from deconflict.cluster.nats.stream_records import StreamPosition, StreamRecord
from deconflict.cluster.tiles.tile_channels import EVERY
from deconflict_client.advisory import AdvisoryState
from ingest.measures.measures import Measures, joined_values
from ingest.port.connection import Connection
from tests.deconflict.cluster.judging.made_fleet import fleet
from tests.deconflict.cluster.made_cluster import (
    Broker,
    buses,
    cluster,
    ingest,
    lives,
    needs_server,
    running,
    table,
    until,
)
from tests.deconflict.contention.scenes import Script
from tests.deconflict.roles.made_queues import SITE, scripts
from tests.helpers.saying import identity

pytestmark = needs_server


async def drive(urls: list[str], robots: dict[str, Script]) -> None:
    """Everybody reports twice a second until cancelled, each to one of the ingests; more may come."""
    start_s, known = time.time(), set[str]()
    async with AsyncExitStack() as stack:
        sockets = [await stack.enter_async_context(connect(url)) for url in urls]
        while True:
            for number, (name, script) in enumerate(robots.items()):
                socket = sockets[number % len(sockets)]
                if name not in known:
                    await socket.send(identity(name, start_s, manufacturerName=script.vendor))
                    known.add(name)
                await socket.send(script.says(name, time.time() - start_s, start_s))
            await asyncio.sleep(0.5)


def by_kind(listed: dict[str, Any]) -> dict[str, Any]:
    return {advisory["kind"]: advisory for advisory in listed["advisories"] if advisory["kind"] != "conflict"}


async def test_a_queue_and_a_situation_keep_their_ids_when_the_global_engine_dies(tmp_path: Path) -> None:
    async with cluster(tmp_path, SITE) as (machines, operator), AsyncExitStack() as stack:
        base, robots = f"http://127.0.0.1:{operator.port}", scripts()
        urls = [await stack.enter_async_context(ingest(machines, tmp_path / name)) for name in ("west", "east")]
        members = [EngineMember(machines.site(), machines.settings, tmp_path) for _ in range(2)]
        tasks = {member.name: await stack.enter_async_context(running(member)) for member in members}
        driving = asyncio.create_task(drive(urls, robots))
        found = by_kind(await until(base, "/advisories", lambda listed: by_kind(listed).keys() >= {"contention"}))
        assert (found["contention"]["resource"], found["contention"]["queue_length"]) == ("c1", 2)
        (situation,) = (await until(base, "/situations?kind=deadlock", lambda listed: listed["situations"]))[
            "situations"
        ]
        document = await table(machines.settings)
        tasks[document["watch"]].cancel()
        robots["F"] = Script([(0, 30, 60)], [(80, 0, 40)], state=lambda _: "waitingExternalEvent")
        await until(base, "/advisories", lambda listed: by_kind(listed)["contention"]["queue_length"] == 3)
        path = f"/situations/{situation['id']}"
        life = (await until(base, path, lambda life: life["situations"][-1]["state"] == "cleared"))["situations"]
        assert [each["revision"] for each in life] == list(range(1, len(life) + 1))
        assert len(life) > situation["revision"]
        driving.cancel()
        (advisories,) = [life for life in await lives(base) if life[0].kind == "contention"]
        assert advisories[0].id == found["contention"]["id"]
        assert [advisory.revision for advisory in advisories] == list(range(1, len(advisories) + 1))
        deadlock = (await until(base, "/advisories?state=all&kind=deadlock", bool))["advisories"][0]
        assert deadlock["situation_id"] == situation["id"]
        assert (await table(machines.settings))["watch"] in tasks.keys() - {document["watch"]}


async def feed(bus: Bus, robots: dict[str, Script]) -> None:
    """As an ingest whose robots report twice a second, until cancelled; more may come."""
    start_s, receiving_fleet, line = time.time(), fleet(), Connection(1)
    while True:
        now_s = time.time()
        for name, script in robots.items():
            receiving_fleet.receive(identity(name, start_s, manufacturerName=script.vendor), now_s, line)
            receiving_fleet.receive(script.says(name, now_s - start_s, start_s), now_s, line)
        await bus.send_parcel(EVERY, receiving_fleet.next_batch(now_s).to_bytes())
        await asyncio.sleep(0.5)


def counted(engine: GlobalEngine, state: AdvisoryState) -> float:
    """Revisions of queues so far."""
    return joined_values(engine.measures).get("deconflict_advisories_total", {}).get(("contention", state.value), 0)


async def bounded(bus: Bus, bytes_a_message: int) -> None:
    """Let the stream of what is told take messages of no more than that; -1 of any size."""
    kept = (await bus.connection.js.stream_info(f"{bus.name}-told")).config
    await bus.connection.js.update_stream(kept, max_msg_size=bytes_a_message)


async def test_the_global_engine_keeps_judging_while_nothing_can_be_written_and_writes_it_later(tmp_path: Path) -> None:
    async with buses(Broker(tmp_path), 1) as (bus,), asyncio.timeout(300):
        stream_records: list[StreamRecord] = []
        await bus.revisions.follow(stream_records.append, after=StreamPosition(0, "", 0))
        await bounded(bus, 1)
        engine, robots = GlobalEngine(SITE, bus, StreamWriter(bus.revisions, Measures()), answer_at_once), scripts()
        chores = (engine.run(lambda: True), engine.outbox.run(), feed(bus, robots))
        tasks = [asyncio.create_task(chore) for chore in chores]
        while not counted(engine, AdvisoryState.RAISED):
            await asyncio.sleep(0.05)
        robots["F"] = Script([(0, 30, 60)], [(80, 0, 40)], state=lambda _: "waitingExternalEvent")
        while not counted(engine, AdvisoryState.UPDATED):
            await asyncio.sleep(0.05)
        assert not stream_records
        await bounded(bus, -1)
        while (
            len(
                life := [
                    stream_record
                    for stream_record in stream_records
                    if stream_record.advisory and stream_record.advisory.kind == "contention"
                ]
            )
            < 2
        ):
            await asyncio.sleep(0.05)
        await end_tasks(*tasks)
    assert [stream_record.advisory and stream_record.advisory.revision for stream_record in life] == list(
        range(1, len(life) + 1)
    )
