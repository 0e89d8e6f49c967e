"""Which stream an operator face follows, with a real NATS server."""

import asyncio
import json
import time
from pathlib import Path

import pytest

from deconflict.cluster.judging.stream_writer import StreamWriter
from deconflict.cluster.nats.bus import Bus
from deconflict.cluster.nats.nats_tasks import BEAT_EVERY_S
from deconflict.cluster.nats.stream_records import StreamPosition
from deconflict.cluster.store_follower import StoreFollower
from deconflict.operator.store.sqlite_connections import FILE_NAME
from deconflict.operator.store.store import Store
from deconflict.roles.service import runtime_directory
from deconflict.runtime.parcels import STORED
from deconflict.runtime.rpc import listening, socket_path
from deconflict_client.advisory import AnyAdvisory
from deconflict_client.client import Client, PositionLostError
from ingest.measures.measures import Measures
from tests.deconflict.cluster.made_cluster import HOME, Broker, Machines, buses, face, needs_server, until
from tests.deconflict.roles.made_service import Served, healthy
from tests.helpers.made_advisories import cleared, made
from tests.helpers.patience import PATIENCE_S
from tests.helpers.plain_http import http_client

pytestmark = needs_server
OTHERS = ("0c5b4a7e-0000-4000-8000-00000000000a", "0c5b4a7e-0000-4000-8000-00000000000b")


async def stored(machines: Machines, data: Path, wanted: list[AnyAdvisory]) -> None:
    """Wait until a face that goes on with these data has exactly these advisories."""
    async with face(machines, data) as operator:
        states = [(advisory.id, advisory.state) for advisory in reversed(wanted)]
        await until(
            f"http://127.0.0.1:{operator.port}",
            "/advisories?state=all",
            lambda listed: [(advisory["id"], advisory["state"]) for advisory in listed["advisories"]] == states,
        )


async def set_aside(data: Path) -> Store:
    """What a face has set aside, once it has."""
    async with asyncio.timeout(300):
        while not (found := [*data.glob("advisories-*.db")]) or (data / FILE_NAME).exists():
            await asyncio.sleep(0.05)
    (data / "aside").mkdir()
    found[0].rename(data / "aside" / FILE_NAME)
    return Store(data / "aside")


async def test_an_operator_face_whose_server_lost_its_store_restarts_and_keeps_the_old_file(tmp_path: Path) -> None:
    broker, data = Broker(tmp_path / "nats"), tmp_path / "face"
    machines = Machines(tmp_path, broker)
    async with buses(broker, 1) as (bus,), asyncio.timeout(300):
        writer = StreamWriter(bus.revisions, Measures())
        async with face(machines, data) as operator:
            base = f"http://127.0.0.1:{operator.port}"
            for revision in (made(1), cleared(1), made(2)):
                assert await writer.write(HOME, revision) is None
            await until(base, "/advisories", lambda listed: listed["seq"] == 3)
            async with Client(base) as client:
                following = client.follow(after=2)
                assert (await anext(following)).seq == 3
                broker.empty()
                with pytest.raises(PositionLostError, match="begin anew"):
                    await anext(following)
            aside = await set_aside(data)
        assert [advisory.id for advisory in aside.latest("all").advisories] == ["advisory-2", "advisory-1"]
        aside.close()
        assert await writer.write(HOME, cleared(2)) is None
        assert await writer.write(HOME, made(3)) is None
        await stored(machines, data, [cleared(2), made(3)])


async def test_stored_numbers_of_a_single_machine_are_not_those_of_a_stream(tmp_path: Path) -> None:
    broker, data = Broker(tmp_path / "nats"), tmp_path / "face"
    machines = Machines(tmp_path, broker)
    single = Store(data)
    single.append([made(1), cleared(1), made(2)])
    single.close()
    async with buses(broker, 1) as (bus,), asyncio.timeout(300):
        writer = StreamWriter(bus.revisions, Measures())
        for number in range(3, 8):
            assert await writer.write(HOME, made(number)) is None
            assert await writer.write(HOME, cleared(number)) is None
        async with face(machines, data):
            aside = await set_aside(data)
        assert [advisory.id for advisory in aside.latest("open").advisories] == ["advisory-2"]
        aside.close()
        await stored(machines, data, [cleared(number) for number in range(3, 8)])


async def test_open_advisories_are_shown_again_after_a_server_lost_its_store(tmp_path: Path) -> None:
    broker, site = Broker(tmp_path / "nats"), tmp_path / "site.toml"
    site.write_text(f'[cluster]\nnats = ["{broker.address}"]\n')
    service, data = Served(tmp_path / "data", site), tmp_path / "data"
    try:
        with service.running():
            await service.until("/healthz", healthy)
            async with service.with_robots(time.time() - 15.0):
                before = await service.until("/advisories", lambda answer: len(answer["advisories"]) == 1)
                await acknowledge(service, before["advisories"][0]["id"])
                await service.until("/advisories", lambda answer: answer["seq"] > before["seq"])
                broker.empty()
                async with asyncio.timeout(PATIENCE_S):
                    while not [*data.glob("advisories-*.db")]:
                        await asyncio.sleep(0.1)
                path = f"/advisories/{before['advisories'][0]['id']}"
                again = await service.until(path, lambda answer: answer.get("advisories"))
                await service.until("/advisories?state=cleared", lambda answer: len(answer["advisories"]) == 1)
    finally:
        broker.kill()
    assert again["advisories"][0]["state"] != "cleared"


async def acknowledge(service: Served, advisory_id: str) -> None:
    """So that the stream which the engine fills again does not have the same record at the last number stored."""
    async with http_client() as client:
        path = f"/advisories/{advisory_id}/acknowledgement"
        answer = await client.post(service.face_url + path, json={"name": "Ada", "reason": "seen"})
    assert answer.status_code == 201


async def test_a_position_shows_whether_a_stream_continues_from_it(tmp_path: Path) -> None:
    broker = Broker(tmp_path / "nats")
    async with buses(broker, 1) as (bus,):
        writer = StreamWriter(bus.revisions, Measures())
        for advisory in (made(1), made(1, revision=2), cleared(1, revision=3)):
            assert await writer.write(HOME, advisory) is None
        seen = [
            StreamPosition(0, "", 0),
            StreamPosition(2, "advisory-1", 2),
            StreamPosition(3, "advisory-1", 3),
            StreamPosition(2, "", 0),
            StreamPosition(3, "", 0),
        ]
        assert await going_on(bus, seen) == [True] * 5
        assert (
            await going_on(
                bus, [StreamPosition(2, "advisory-1", 1), StreamPosition(3, "advisory-2", 3), StreamPosition(4, "", 0)]
            )
            == [False] * 3
        )
        await bus.connection.js.purge_stream(f"{bus.name}-told")
        assert await going_on(bus, seen) == [True, False, True, False, True]


async def going_on(bus: Bus, seen: list[StreamPosition]) -> list[bool]:
    return [await bus.revisions.continues_from(stream_position) for stream_position in seen]


async def test_losses_are_followed_once_a_server_that_lost_its_streams_has_them_again(tmp_path: Path) -> None:
    broker, stop, added = Broker(tmp_path / "nats"), asyncio.Event(), asyncio.Event()
    machines = Machines(tmp_path, broker)
    async with buses(broker, 1) as (bus,), asyncio.timeout(PATIENCE_S):

        async def last_losses(_: bytes) -> bytes:
            await bus.connection.js.delete_stream(f"{bus.name}-lost")
            return json.dumps(["", 0]).encode()

        async def last_stored(_: bytes) -> bytes:
            return json.dumps(StreamPosition(0, "", 0)).encode()

        async def add_losses(_: bytes) -> bytes:
            added.set()
            return STORED

        with runtime_directory() as runtime:
            calls = {"last_losses": last_losses, "last_stored": last_stored, "add_losses": add_losses}
            async with listening(socket_path(Path(runtime), "operator"), calls):
                follower = StoreFollower(machines.site(), machines.settings, Path(runtime))
                following = asyncio.create_task(follower.run(stop))
                await asyncio.wait({following}, timeout=3 * BEAT_EVERY_S)
                await bus.losses.ensure()
                await bus.losses.write("1", [])
                await added.wait()
                stop.set()
                await following
