"""A robot may say who it is to one ingest and where it is to another, with a real NATS server."""

import asyncio
import json
import time
from collections.abc import Callable
from contextlib import AsyncExitStack
from pathlib import Path
from typing import Any

import pytest
from websockets.asyncio.client import connect

from deconflict.cluster import identity_exchange
from deconflict.cluster.nats.bus import Bus
from deconflict.cluster.nats.nats_connection import entry
from deconflict.settings.fleet_factory import fleet_of
from deconflict.settings.site import Site
from ingest.fleet.recovery.log_recovery import recover
from ingest.measures.measures import Measures
from ingest.recording.log_segments import segments
from ingest.settings import Reading, Vendor
from tests.deconflict.cluster.made_cluster import Machines, cluster, ingest, needs_server, until
from tests.deconflict.roles.made_service import free_ports
from tests.helpers.patience import PATIENCE_S
from tests.helpers.plain_http import http_client
from tests.helpers.saying import identity, robot, status
from tests.ingest.fleet.made_fleet import documents

LARGE = {"x": 2.0, "y": 1.0, "z": 0.4}
pytestmark = needs_server


async def say(url: str, *messages: bytes) -> None:
    async with connect(url) as socket:
        for message in messages:
            await socket.send(message)


async def report(url: str, name: str) -> None:
    """Where a robot is, twice a second, and nothing else."""
    async with connect(url) as socket:
        while True:
            await socket.send(status(name, time.time()))
            await asyncio.sleep(0.5)


def refused(*vendors: str) -> Callable[[dict[str, Any]], bool]:
    """Whether messages of these vendors, and of no others, were refused."""
    return lambda document: {each["vendor"] for each in document.get("rejected", ())} == set(vendors)


def sized(vendor: str = "Alder", **lengths_m: float) -> Callable[[dict[str, Any]], bool]:
    """Whether these robots are somewhere and known by name, and how long they are."""

    def found(document: dict[str, Any]) -> bool:
        known = [row for row in document.get("robots", ()) if row["identified"] and row["envelope"]]
        return {row["name"]: row["envelope"]["length_m"] for row in known} == {
            f"{vendor} {name}": length_m for name, length_m in lengths_m.items()
        }

    return found


async def test_an_identity_report_to_one_ingest_applies_to_statuses_at_another(
    tmp_path: Path,
) -> None:
    async with cluster(tmp_path) as (machines, operator), AsyncExitStack() as stack:
        west, east = [await stack.enter_async_context(ingest(machines, tmp_path / name)) for name in ("west", "east")]
        robots = f"http://127.0.0.1:{operator.port}", "/robots"
        await say(west, identity("A", time.time()), identity("B", time.time()))
        reporting = [asyncio.create_task(report(east, "B"))]
        await until(*robots, sized(B=1.0))  # so the east has heard of A as well
        reporting.append(asyncio.create_task(report(east, "A")))
        await until(*robots, sized(A=1.0, B=1.0))
        await say(west, identity("A", time.time(), baseRobotEnvelope=LARGE))
        await until(*robots, sized(A=2.0, B=1.0))
        for task in reporting:
            task.cancel()
    again = fleet_of(machines.site(), Measures())
    recover(again, segments(tmp_path / "east" / "log"), time.time())
    assert sized(A=2.0, B=1.0)({"robots": documents(again, time.time())})


async def test_ingests_of_one_machine_share_a_port(tmp_path: Path) -> None:
    names = [f"A-{number}" for number in range(24)]
    async with cluster(tmp_path, share_port=True) as (machines, operator), AsyncExitStack() as stack:
        (port,) = free_ports(1)
        heard: list[set[str]] = []
        for key in ("first", "second"):
            role = await stack.enter_async_context(ingest(machines, tmp_path / key, port))
            assert role == f"ws://127.0.0.1:{port}"
        async with asyncio.TaskGroup() as saying:
            for name in names:
                now_s = time.time()
                saying.create_task(say(f"ws://127.0.0.1:{port}", identity(name, now_s), status(name, now_s)))
        base, every = f"http://127.0.0.1:{operator.port}", {robot(name) for name in names}
        await until(base, "/robots", lambda each: {row["uuid"] for row in each.get("robots", ())} == every)
    for key in ("first", "second"):
        fleet = fleet_of(machines.site(), Measures())
        recover(fleet, segments(tmp_path / key / "log"), time.time())
        heard.append(set(fleet.robots))
    assert heard[0] | heard[1] == every
    assert not heard[0] & heard[1]
    assert all(heard)


async def test_the_first_vendor_to_identify_a_robot_keeps_it(tmp_path: Path) -> None:
    async with (
        cluster(tmp_path) as (machines, operator),
        ingest(machines, tmp_path / "west") as west,
        ingest(machines, tmp_path / "east") as east,
        ingest(machines, tmp_path / "south") as south,
    ):
        robots = f"http://127.0.0.1:{operator.port}", "/robots"
        await say(west, identity("A", time.time()), identity("B", time.time()))
        beside = asyncio.create_task(report(south, "B"))
        await until(*robots, sized(B=1.0))  # so all have heard of A as well
        await say(east, identity("A", time.time(), manufacturerName="Corvid"), identity("C", time.time()))
        reporting = [asyncio.create_task(report(south, "C"))]
        await until(*robots, sized(B=1.0, C=1.0))
        reporting.append(asyncio.create_task(report(south, "A")))
        await until(*robots, sized(A=1.0, B=1.0, C=1.0))
        for task in (beside, *reporting):
            task.cancel()


async def test_a_robot_is_given_to_a_vendor_and_an_ingest_that_starts_later_knows_it(tmp_path: Path) -> None:
    site = Site(vendors=(Vendor(name="Alder"), Vendor(name="Corvid")))
    async with cluster(tmp_path, site) as (machines, operator):
        base = f"http://127.0.0.1:{operator.port}"
        async with ingest(machines, tmp_path / "west") as west, http_client(base) as client:
            corvids = identity("A", time.time(), manufacturerName="Corvid")
            await say(f"{west}/Corvid", corvids, status("A", time.time()))
            await until(base, "/robots", sized(vendor="Corvid", A=1.0))
            await introduced(machines, "Corvid")
            await say(f"{west}/Alder", status("A", time.time()))
            await until(base, "/quarantine", refused("Alder"))
            answer = await client.post(f"/robots/{robot('A')}/owner", json={"vendor": "Birch"})
            assert (answer.status_code, "'Birch' is in no site file" in answer.json()["detail"]) == (409, True)
            answer = await client.post(f"/robots/{robot('A')}/owner", json={"vendor": "Alder"})
            assert answer.json() == {"uuid": robot("A"), "vendor": "Alder", "before": "Corvid"}
            await until(base, "/robots", lambda listed: listed["robots"] == [])
            await say(f"{west}/Alder", identity("A", time.time(), baseRobotEnvelope=LARGE), status("A", time.time()))
            await introduced(machines, "Alder")
        async with ingest(machines, tmp_path / "east") as east:
            for vendor, path, wanted in (
                ("Corvid", "/quarantine", refused("Corvid")),
                ("Alder", "/robots", sized(A=2.0)),
            ):
                reporting = asyncio.create_task(report(f"{east}/{vendor}", "A"))
                await until(base, path, wanted)
                reporting.cancel()


async def introduced(machines: Machines, owner: str) -> None:
    """Wait until the servers have the identity report that a vendor sent of the robot A."""
    bus = Bus(machines.settings, 1.0)
    await bus.open()
    async with asyncio.timeout(PATIENCE_S):
        while json.loads((await entry(bus.state._introduced, robot("A")))[1] or b"{}").get("owner") != owner:
            await asyncio.sleep(0.1)
    await bus.close()


async def test_a_robot_that_was_forgotten_and_comes_back_is_known_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(identity_exchange, "AGAIN_S", 3.0)
    site = Site(reading=Reading(forget_after_s=2.0, silent_after_s=1.0, quiet_after_s=0.5))
    async with (
        cluster(tmp_path, site) as (machines, operator),
        ingest(machines, tmp_path / "west") as west,
        ingest(machines, tmp_path / "east") as east,
    ):
        robots = f"http://127.0.0.1:{operator.port}", "/robots"
        await say(west, identity("A", time.time()))
        for _ in range(2):
            reporting = asyncio.create_task(report(east, "A"))
            await until(*robots, sized(A=1.0))
            reporting.cancel()
            await until(*robots, sized())
