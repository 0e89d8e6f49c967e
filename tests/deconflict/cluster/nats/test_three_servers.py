"""Three NATS servers that keep three copies, with the documents' own file."""

import asyncio
from collections.abc import AsyncIterator, Iterator
from contextlib import asynccontextmanager
from pathlib import Path

import pytest

from benchmarks.cluster_drill.drilled_machines import MACHINES, TOKENS, DrilledMachines
from deconflict.cluster.nats.bus import Bus
from deconflict.cluster.nats.nats_tasks import open_bus
from deconflict.cluster.nats.shared_state import LEASE_S
from deconflict.settings.cluster_settings import Cluster
from tests.deconflict.cluster.made_cluster import needs_server
from tests.helpers.patience import PATIENCE_S

pytestmark = needs_server


@pytest.fixture
def servers(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[DrilledMachines]:
    monkeypatch.setenv("NATS_PASSWORD", TOKENS["NATS_PASSWORD"])
    machines = DrilledMachines(tmp_path)
    for server in MACHINES:
        machines.start_nats(server)
    yield machines
    machines.end()


@asynccontextmanager
async def member(servers: DrilledMachines, copies: int) -> AsyncIterator[Bus]:
    addresses = tuple(servers.nats_address(server) for server in MACHINES)
    known = {"ca": servers.nats_ca, "user": "deconflict", "password": "env:NATS_PASSWORD"}
    bus = Bus(Cluster(nats=addresses, copies=copies, **known), keep_days=1.0)
    async with asyncio.timeout(PATIENCE_S):
        assert await open_bus(bus, asyncio.Event())
    yield bus
    await bus.close()


async def copies_of(bus: Bus) -> set[int]:
    """Of all streams and buckets."""
    return {info.config.num_replicas or 1 for info in await bus.connection.js.streams_info()}


async def test_another_number_of_copies_holds_for_what_exists(servers: DrilledMachines) -> None:
    for copies in (1, 3):
        async with member(servers, copies) as bus, asyncio.timeout(PATIENCE_S):
            while await copies_of(bus) != {copies}:
                await asyncio.sleep(0.2)


async def test_a_server_that_serves_a_subscription_is_missed_before_members_are_given_up(
    servers: DrilledMachines,
) -> None:
    """The client begins anew after at most four times without a sign of life."""
    async with member(servers, 1) as bus:
        await bus.follow_channel("x", lambda _: None)
        names = [info.config.name for info in await bus.connection.js.streams_info()]
        heartbeats_s = {
            consumer.config.idle_heartbeat
            for name in names
            if name
            for consumer in await bus.connection.js.consumers_info(name)
        }
    assert len(heartbeats_s) == 1
    assert 4 * (heartbeats_s.pop() or 0.0) <= LEASE_S
