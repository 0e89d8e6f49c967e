"""What the durable stream takes and what it refuses, with a real NATS server."""

import asyncio
import json
import time
from collections.abc import Awaitable, Callable
from contextlib import AsyncExitStack, suppress
from pathlib import Path
from unittest.mock import patch

import pytest
from nats.aio.client import Client
from nats.errors import MaxPayloadError
from nats.js import JetStreamContext
from nats.js.api import ConsumerConfig, ConsumerInfo

from deconflict.cluster.engine_member import EngineMember
from deconflict.cluster.judging.stream_writer import StreamWriter
from deconflict.cluster.nats import shared_state
from deconflict.cluster.nats.bus import Bus
from deconflict.cluster.nats.nats_tasks import end_tasks, open_bus
from deconflict.cluster.nats.revision_stream import OverruledError
from deconflict.cluster.nats.shared_state import FEED
from deconflict.cluster.nats.stream_records import key_of
from deconflict.cluster.nats.subscriptions import BUS_ERRORS, since_lately
from deconflict.cluster.tiles.tiles import Tile
from deconflict.settings.cluster_settings import Cluster
from deconflict.settings.site import Site
from deconflict_client.advisory import AdvisoryState
from ingest.measures.measures import Measures
from ingest.settings import Reading
from tests.deconflict.cluster.made_cluster import HOME, Broker, buses, needs_server, running
from tests.deconflict.roles.made_service import free_ports
from tests.helpers.made_advisories import cleared, made
from tests.helpers.patience import PATIENCE_S
from tests.helpers.plain_http import http_client
from tests.helpers.saying import HALL

pytestmark = needs_server


async def test_a_repeated_revision_is_stored_once_and_another_in_its_place_is_refused(tmp_path: Path) -> None:
    async with buses(Broker(tmp_path), 2) as (bus, other):
        first = await bus.revisions.write(HOME, made(1), 0)
        second = await bus.revisions.write(HOME, made(1, revision=2), first)
        assert await bus.revisions.write(HOME, made(1, revision=2), first) == second
        with pytest.raises(OverruledError):
            await other.revisions.write(HOME, cleared(1, revision=2), first)
        stands = await other.revisions.last(key_of(made(1)))
    assert stands
    assert stands.advisory == made(1, revision=2)


async def test_a_heartbeat_that_a_server_sends_again_makes_no_dead_member_live(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(shared_state, "LEASE_S", 1.0)
    again = json.dumps({"at_s": time.time() - 106.0}).encode()
    async with buses(Broker(tmp_path), 1) as (bus,), asyncio.timeout(PATIENCE_S):
        subject = f"$KV.{bus.name}-members.engine-a"
        await bus.connection.js.publish(subject, again)
        while "engine-a" not in bus.state.members():
            await asyncio.sleep(0.02)
        while "engine-a" in bus.state.members():
            await asyncio.sleep(0.02)
        await bus.connection.js.publish(subject, again)
        await bus.state.beat("engine-b", {})
        while "engine-b" not in bus.state.members():
            assert "engine-a" not in bus.state.members()
            await asyncio.sleep(0.02)
        assert "engine-a" not in bus.state.members()


async def test_a_consumer_that_ended_while_it_began_is_an_error_like_those_of_a_late_server(tmp_path: Path) -> None:
    def described_without_name(_: object) -> ConsumerInfo:
        return ConsumerInfo.from_response({"type": "io.nats.jetstream.api.v1.consumer_info_response"})

    received = list[bytes]()
    async with buses(Broker(tmp_path), 1) as (bus,), asyncio.timeout(PATIENCE_S):
        ending = patch.object(JetStreamContext.PushSubscription, "consumer_info", described_without_name)
        with ending, pytest.raises(BUS_ERRORS, match="ended while it began"):
            await bus.follow_channel("hall.1.2", received.append)
        await bus.follow_channel("hall.1.2", received.append)
        await bus.send_parcel("hall.1.2", b"parcel")
        while not received:
            await asyncio.sleep(0.01)
    assert received == [b"parcel"]


async def test_an_engine_continues_an_advisory_that_another_wrote(tmp_path: Path) -> None:
    broker = Broker(tmp_path)
    async with buses(broker, 1) as (other,):
        member = EngineMember(
            Site(reading=Reading(quiet_after_s=1.0, silent_after_s=2.0)), Cluster(nats=(broker.address,)), tmp_path
        )
        async with running(member), asyncio.timeout(300):
            while member.name not in other.state.members():
                await asyncio.sleep(0.1)
            await other.revisions.write(HOME, made(1), 0)
            ending = asyncio.create_task(ended(other))
            while not ending.done():
                await other.state.beat("feed", {"roots": [str(Tile(HALL, 0, 0))]})
                await asyncio.sleep(0.5)
    assert ending.result() == (2, "Tug 1 and Lift 2 left the floor")


async def ended(bus: Bus) -> tuple[int, str | None]:
    """Which revision clears the advisory, and why."""
    while True:
        line = await bus.revisions.last(key_of(made(1)))
        if line and line.advisory and line.advisory.state is AdvisoryState.CLEARED:
            return line.advisory.revision, line.advisory.cleared_because
        await asyncio.sleep(0.2)


async def test_a_role_ends_though_no_server_was_ever_there() -> None:
    stop = asyncio.Event()
    (port,) = free_ports(1)
    opening = asyncio.create_task(open_bus(Bus(Cluster(nats=(f"nats://127.0.0.1:{port}",)), 1.0), stop))
    await asyncio.sleep(0.1)
    stop.set()
    async with asyncio.timeout(PATIENCE_S):
        assert not await opening


def three(folder: Path) -> dict[str, Broker]:
    """Servers that keep everything thrice, by name."""
    routes = [f"nats://127.0.0.1:{port}" for port in free_ports(3)]
    found = ("--cluster_name", "three", "--routes", ",".join(routes))
    return {
        name: Broker(folder / name, "-n", name, "--cluster", route, *found)
        for name, route in zip("abc", routes, strict=True)
    }


async def test_the_loss_of_one_server_of_three_costs_neither_rows_nor_advisories(tmp_path: Path) -> None:
    servers = three(tmp_path)
    settings = Cluster(nats=tuple(server.address for server in servers.values()), copies=3)
    first, other = (Bus(settings, 1.0) for _ in range(2))
    heard: list[int] = []
    try:
        async with asyncio.timeout(300):
            for each in (first, other):
                assert await open_bus(each, asyncio.Event())
            await other.follow_channel("x", lambda parcel: heard.append(int(parcel)))
            writer = StreamWriter(first.revisions, Measures())
            assert await writer.write(HOME, made(1)) is None
            await sent(first, heard, 0)
            leader = (await first.connection.js.stream_info(f"{first.name}-rows")).cluster
            assert leader
            servers[str(leader.leader)].kill()
            assert await writer.write(HOME, made(1, revision=2)) is None
            await sent(first, heard, 1000)
            stands = await other.revisions.last(key_of(made(1)))
            assert stands
            assert stands.advisory == made(1, revision=2)
    finally:
        for each in (first, other):
            await each.close()
        for server in servers.values():
            server.kill()


async def sent(bus: Bus, heard: list[int], first: int) -> None:
    """Send parcels until one of them is heard."""
    number = first
    while max(heard, default=-1) < first:
        with suppress(*BUS_ERRORS):
            await bus.send_parcel("x", str(number).encode())
        number += 1
        await asyncio.sleep(0.1)


async def test_a_channel_left_during_a_reconnect_is_not_subscribed_again(tmp_path: Path) -> None:
    broker = Broker(tmp_path)
    async with buses(broker, 1) as (bus,), asyncio.timeout(300):
        leaves: dict[str, Callable[[], Awaitable[None]]] = {}
        leaving: list[asyncio.Task[None]] = []

        def begins() -> ConsumerConfig:
            """Once it begins anew, both are left: itself on its way, the other before its turn."""
            if leaves:
                leaving.extend(asyncio.create_task(_done(leaves.pop(name))) for name in ("a", "b"))
            return since_lately()

        with patch("deconflict.cluster.nats.bus.since_lately", begins):
            first = await bus.follow_channel("a", lambda _: None)
        leaves |= {"a": first, "b": await bus.follow_channel("b", lambda _: None)}
        await bus.follow_channel("c", lambda _: None)
        broker.kill()
        broker.start()
        while not bus.renewals:
            await asyncio.sleep(0.05)
        await asyncio.gather(*leaving)
        assert len(leaving) == 2
        while (heard := await channels_heard(bus)) != {"c"}:
            assert heard >= {"c"}
            await asyncio.sleep(0.2)


async def _done(ending: Callable[[], Awaitable[None]]) -> None:
    await ending()


async def channels_heard(bus: Bus) -> set[str]:
    """Of whatever consumers of parcels the server still has."""
    while True:
        with suppress(AttributeError):  # the client can't read one that is deleted while it is listed
            consumers = await bus.connection.js.consumers_info(f"{bus.name}-rows")
            return {str(consumer.config.filter_subject).rsplit(".", 1)[1] for consumer in consumers}


async def test_a_failed_or_cancelled_question_leaves_no_subscription(tmp_path: Path) -> None:
    (port,) = free_ports(1)
    async with buses(Broker(tmp_path, "-m", str(port)), 1) as (bus,), asyncio.timeout(300):
        await bus.state.beat(f"{FEED}silent", {})
        while not bus.state.members():
            await asyncio.sleep(0.05)
        before = await subscriptions(port)
        with pytest.raises(MaxPayloadError):
            await bus.requests.ask("a" * (bus.connection.client.max_payload + 1), 1.0)
        given_up = asyncio.create_task(bus.requests.ask("robots", 300.0))
        while await subscriptions(port) == before:
            await asyncio.sleep(0.05)
        await end_tasks(given_up)
        while await subscriptions(port) > before:
            await asyncio.sleep(0.05)


async def subscriptions(port: int) -> int:
    """Of the one connection, as the server says."""
    async with http_client() as client:
        answer = await client.get(f"http://127.0.0.1:{port}/connz")
    return int(answer.json()["connections"][0]["subscriptions"])


async def test_nothing_tries_to_connect_after_the_end_though_a_cancellation_was_lost(tmp_path: Path) -> None:
    trying = asyncio.Event()

    async def refused(*_: object) -> None:
        """As the standard library does if a cancellation comes together with the refusal."""
        trying.set()
        with suppress(asyncio.CancelledError):
            await asyncio.sleep(0.05)
        raise ConnectionRefusedError

    others = asyncio.all_tasks()
    others = asyncio.all_tasks()
    async with AsyncExitStack() as stack, asyncio.timeout(PATIENCE_S):
        (bus,) = await stack.enter_async_context(buses(broker := Broker(tmp_path), 1))
        stack.enter_context(patch.object(Client, "_connect_to_server", refused))
        broker.kill()
        await trying.wait()
        await bus.close()
        while asyncio.all_tasks() != others:
            await asyncio.sleep(0.02)
