"""Faults of a cluster with a real NATS server: nothing is lost or told twice."""

import asyncio
import signal
import time
from collections.abc import Callable
from contextlib import AsyncExitStack
from math import pi
from pathlib import Path
from typing import Any

from deconflict.cluster.engine_member import EngineMember
from deconflict.cluster.tiles.tile_owners import OwnerTable
from deconflict.cluster.tiles.tiles import Tile
from deconflict_client.advisory import AdvisoryState
from deconflict_client.situations import AnyRevision
from tests.deconflict.cluster.made_cluster import Machines, cluster, ingest, lives, needs_server, running, table, until
from tests.deconflict.roles.made_service import Course, drive

pytestmark = needs_server

PAIRS, APART_S = 3, 4.0


def pairs(first_s: float) -> dict[str, Course]:
    """Robots that cross two by two along a hall, the first two so late and the others one pair after the other."""

    def east(number: int) -> Course:
        return lambda t: (20.0 * number + t - first_s - APART_S * number, 0.0, 0.0)

    def north(number: int) -> Course:
        return lambda t: (20.0 * number, t - first_s - APART_S * number, pi / 2)

    return {f"A-{number}": east(number) for number in range(PAIRS)} | {
        f"B-{number}": north(number) for number in range(PAIRS)
    }


def told_once(every: list[list[AnyRevision]]) -> None:
    """Every pair has one advisory, whole from raised to cleared."""
    assert len(every) == len({life[0].robots for life in every}) == PAIRS
    for life in every:
        assert [each.revision for each in life] == list(range(1, len(life) + 1))
        ends = [each.state for each in life if each.state is not AdvisoryState.UPDATED]
        assert ends == [AdvisoryState.RAISED, AdvisoryState.CLEARED]
    seqs = sorted(each.seq for life in every for each in life)
    assert len(seqs) == len(set(seqs))


def all_cleared(listed: dict[str, Any]) -> bool:
    return [each["state"] for each in listed["advisories"]].count("cleared") >= PAIRS


async def owning(machines: Machines, wanted: Callable[[dict[Tile, str]], bool]) -> None:
    """Wait until tiles are owned as wanted."""
    async with asyncio.timeout(300):
        while not wanted(dict(OwnerTable.of_document(await table(machines.settings)).owners)):
            await asyncio.sleep(0.2)


async def test_a_server_that_is_killed_and_comes_back_with_its_store_costs_no_advisory(tmp_path: Path) -> None:
    async with cluster(tmp_path) as (machines, operator), AsyncExitStack() as stack:
        base = f"http://127.0.0.1:{operator.port}"
        url = await stack.enter_async_context(ingest(machines, tmp_path / "ingest"))
        for _ in range(2):
            await stack.enter_async_context(running(EngineMember(machines.site(), machines.settings, tmp_path)))
        await until(base, "/healthz", lambda health: health["roles"]["engine"] == "up")
        driving = asyncio.create_task(drive(url, pairs(10.0), 300, time.time()))
        await until(base, "/advisories", lambda listed: listed["advisories"])
        machines.broker.kill()
        machines.broker.start()
        await until(base, "/advisories?state=all", all_cleared)
        driving.cancel()
        told_once(await lives(base))


async def test_an_engine_that_was_stopped_publishes_nothing_twice_when_it_continues(tmp_path: Path) -> None:
    async with cluster(tmp_path) as (machines, operator), AsyncExitStack() as stack:
        base, courses = f"http://127.0.0.1:{operator.port}", pairs(10.0)
        first = {name: courses.pop(name) for name in ("A-0", "B-0")}
        url = await stack.enter_async_context(ingest(machines, tmp_path / "ingest"))
        machines.start("stopped", "engine")
        await until(base, "/healthz", lambda health: health["roles"]["engine"] == "up")
        driving = [asyncio.create_task(drive(url, first, 300, time.time()))]
        await until(base, "/advisories", lambda listed: listed["advisories"])
        stopped = (await table(machines.settings))["watch"]
        machines.signal("stopped", "engine", signal.SIGSTOP)
        await stack.enter_async_context(running(EngineMember(machines.site(), machines.settings, tmp_path)))
        await owning(machines, lambda owners: stopped not in owners.values())
        driving.append(asyncio.create_task(drive(url, courses, 300, time.time())))
        await until(base, "/advisories?state=all", lambda listed: len(listed["advisories"]) >= 2)
        machines.signal("stopped", "engine", signal.SIGCONT)
        await owning(machines, lambda owners: stopped in owners.values())
        await until(base, "/advisories?state=all", all_cleared)
        for each in driving:
            each.cancel()
        told_once(await lives(base))


def crowd() -> dict[str, Course]:
    """Robots that meet two by two in one tile, each two in a lane of their own, and stay in it."""

    def towards(number: int, side: float) -> Course:
        def course(t: float) -> tuple[float, float, float]:
            away_m = min(max(0.5 * (12.0 + APART_S * number - t), -14.0), 14.0)
            return 16.0 - side * away_m, 4.0 + 8.0 * number, 0.0 if side > 0 else pi

        return course

    return {
        f"{name}-{number}": towards(number, side) for number in range(PAIRS) for name, side in (("A", 1), ("B", -1))
    }


async def test_a_hot_tile_is_split_among_engines_and_no_advisory_is_lost(tmp_path: Path) -> None:
    async with cluster(tmp_path, hot_per_s=6.0) as (machines, operator), AsyncExitStack() as stack:
        base = f"http://127.0.0.1:{operator.port}"
        url = await stack.enter_async_context(ingest(machines, tmp_path / "ingest"))
        for _ in range(2):
            await stack.enter_async_context(running(EngineMember(machines.site(), machines.settings, tmp_path)))
        await until(base, "/healthz", lambda health: health["roles"]["engine"] == "up")
        driving = asyncio.create_task(drive(url, crowd(), 300, time.time()))
        await owning(machines, lambda owners: len({who for tile, who in owners.items() if tile.path}) == 2)
        await until(base, "/advisories?state=all", all_cleared)
        driving.cancel()
        told_once(await lives(base))
