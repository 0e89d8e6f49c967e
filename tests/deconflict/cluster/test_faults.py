"""Faults of a cluster with a real NATS server: nothing is lost or told twice."""

import asyncio
import time
from contextlib import AsyncExitStack
from math import pi
from pathlib import Path

from deconflict.advisory import AdvisoryState, AnyAdvisory
from deconflict.cluster.member import Member
from tests.deconflict.cluster.made_cluster import cluster, ingest, needs_server, running
from tests.deconflict.cluster.test_cluster import lives, until
from tests.deconflict.test_service import Course, drive

pytestmark = needs_server

PAIRS, APART_S = 4, 6.0


def pairs(first_s: float) -> dict[str, Course]:
    """Robots that cross two by two along a hall, the first two so late and the others one pair after the other."""

    def east(number: int) -> Course:
        return lambda t: (20.0 * number + t - first_s - APART_S * number, 0.0, 0.0)

    def north(number: int) -> Course:
        return lambda t: (20.0 * number, t - first_s - APART_S * number, pi / 2)

    return {f"A-{number}": east(number) for number in range(PAIRS)} | {
        f"B-{number}": north(number) for number in range(PAIRS)
    }


def told_once(every: list[list[AnyAdvisory]]) -> None:
    """Every pair has one advisory, whole from raised to cleared."""
    assert len(every) == len({life[0].robots for life in every}) == PAIRS
    for life in every:
        assert [each.revision for each in life] == list(range(1, len(life) + 1))
        ends = [each.state for each in life if each.state is not AdvisoryState.UPDATED]
        assert ends == [AdvisoryState.RAISED, AdvisoryState.CLEARED]
    seqs = sorted(each.seq for life in every for each in life)
    assert len(seqs) == len(set(seqs))


async def test_a_server_that_is_killed_and_comes_back_with_its_store_costs_no_advisory(tmp_path: Path) -> None:
    async with cluster(tmp_path) as (machines, operator), AsyncExitStack() as stack:
        base = f"http://127.0.0.1:{operator.port}"
        url = await stack.enter_async_context(ingest(machines, tmp_path / "ingest"))
        for _ in range(2):
            await stack.enter_async_context(running(Member(machines.site(), machines.settings)))
        await until(base, "/healthz", lambda health: health["roles"]["engine"] == "up")
        driving = asyncio.create_task(drive(url, pairs(12.0), 300, time.time()))
        await until(base, "/advisories", lambda listed: listed["advisories"])
        machines.broker.kill()
        machines.broker.start()
        await until(
            base,
            "/advisories?state=all",
            lambda listed: sum(each["state"] == "cleared" for each in listed["advisories"]) >= PAIRS,
        )
        driving.cancel()
        told_once(await lives(base))
