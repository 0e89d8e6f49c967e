"""What the durable stream takes and what it refuses, with a real NATS server."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

import pytest

from deconflict.advisory import AdvisoryState
from deconflict.cluster.bus import Bus, OverruledError
from deconflict.cluster.feed import connected
from deconflict.cluster.lines import key_of
from deconflict.cluster.member import Member
from deconflict.cluster.settings import Cluster
from deconflict.cluster.tiles import Place, Tile
from deconflict.site import Site
from ingest.settings import Reading
from tests.deconflict.cluster.made_cluster import Broker, needs_server, running
from tests.deconflict.made_advisories import cleared, made
from tests.saying import HALL

pytestmark = needs_server
HOME = Place(HALL, 1.0, 2.0)


@asynccontextmanager
async def buses(broker: Broker, count: int) -> AsyncIterator[list[Bus]]:
    opened = [Bus(Cluster(nats=(broker.address,)), 1.0) for _ in range(count)]
    try:
        for one in opened:
            assert await connected(one, asyncio.Event())
        yield opened
    finally:
        for one in opened:
            await one.close()
        broker.kill()


async def test_a_revision_sent_again_is_not_doubled_but_another_in_its_place_is_refused(tmp_path: Path) -> None:
    async with buses(Broker(tmp_path), 2) as (one, other):
        first = await one.tell(HOME, made(1), 0)
        second = await one.tell(HOME, made(1, revision=2), first)
        assert await one.tell(HOME, made(1, revision=2), first) == second
        with pytest.raises(OverruledError):
            await other.tell(HOME, cleared(1, revision=2), first)
        stands = (await other.last_told(key_of(made(1)))).advisory
    assert stands == made(1, revision=2)


async def test_an_engine_goes_on_with_what_another_tells_while_it_runs(tmp_path: Path) -> None:
    broker = Broker(tmp_path)
    async with buses(broker, 1) as (other,):
        member = Member(
            Site(reading=Reading(quiet_after_s=1.0, silent_after_s=2.0)), Cluster(nats=(broker.address,)), tmp_path
        )
        async with running(member), asyncio.timeout(100):
            while member.name not in other.members():
                await asyncio.sleep(0.1)
            await other.tell(HOME, made(1), 0)
            ending = asyncio.create_task(ended(other))
            while not ending.done():
                await other.beat("feed", {"roots": [str(Tile(HALL, 0, 0))]})
                await asyncio.sleep(0.5)
    assert ending.result() == (2, "Tug 1 and Lift 2 left the floor")


async def ended(bus: Bus) -> tuple[int, str | None]:
    """Which revision clears the advisory, and why."""
    while True:
        line = await bus.last_told(key_of(made(1)))
        if line.advisory and line.advisory.state is AdvisoryState.CLEARED:
            return line.advisory.revision, line.advisory.cleared_because
        await asyncio.sleep(0.2)
