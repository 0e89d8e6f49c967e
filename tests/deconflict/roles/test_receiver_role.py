import asyncio
import json
import logging
import sys
import threading
import time
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

import numba
import pytest
from websockets.asyncio.client import connect
from websockets.exceptions import InvalidStatus

from deconflict.operator.live.recent_batches import unpacked_batch
from deconflict.roles.receiver_role import DOCUMENTS_AT_ONCE, FAST_PATH_AFTER, MEASURE_EVERY_S, ReceiverRole
from deconflict.runtime.rpc import AsyncCaller
from deconflict.settings.fleet_factory import load_fast_path
from deconflict.settings.hot_reload import SITE_FILE, write
from deconflict.settings.site import Site
from ingest.batch import Batch
from ingest.fleet.recovery.kept_messages import kept_identities
from ingest.port.connection import Connection
from ingest.recording.log_reader import EngineStarted, Received, Tick
from ingest.recording.log_rotation import RotatingLog
from ingest.settings import ReceiverSettings, Vendor
from tests.helpers.patience import PATIENCE_S
from tests.helpers.saying import identity, status
from tests.ingest.recording.made_logs import read

SITE = Site(name="Test hall", receiver=ReceiverSettings(port=0))


@asynccontextmanager
async def serving(directory: Path, site: Site = SITE) -> AsyncIterator[ReceiverRole]:
    role, stop = ReceiverRole(site, directory, directory / "log"), asyncio.Event()
    running = asyncio.create_task(role.run(stop))
    try:
        async with asyncio.timeout(PATIENCE_S):
            await role.ready.wait()
            yield role
    finally:
        stop.set()
        await running


async def test_messages_are_recorded_before_the_engine_receives_them(tmp_path: Path) -> None:
    async with serving(tmp_path) as role, connect(f"ws://127.0.0.1:{role.receiver.port}") as socket:
        await socket.send(status("A-1", time.time()))
        engine, number = AsyncCaller(tmp_path, "receiver"), 0
        while not number:
            number = len(Batch.from_bytes(await engine.call("batch")))
        kinds = [type(event) for event in read(tmp_path / "log")[0]]
        assert kinds[-2:] == [Received, Tick]


async def test_what_an_engine_says_of_its_last_pass_is_recorded_with_the_tick(tmp_path: Path) -> None:
    async with serving(tmp_path):
        engine = AsyncCaller(tmp_path, "receiver")
        await engine.call("batch", b'changes 1 2 [["a","b"]] canary')
        await engine.call("batch", b"changes 0 0 [] canary")
    full, plain = (event for event in read(tmp_path / "log")[0] if isinstance(event, Tick))
    assert (full.effort, full.pending, full.followed) == (1, 2, (("a", "b"),))
    assert (plain.effort, plain.pending, plain.followed) == (0, 0, ())


async def test_the_floor_is_shown_while_no_engine_asks_for_it(tmp_path: Path) -> None:
    async with serving(tmp_path) as role, connect(f"ws://127.0.0.1:{role.receiver.port}") as socket:
        follower, seen = AsyncCaller(tmp_path, "receiver"), set[float]()
        async with asyncio.timeout(PATIENCE_S):
            while len(seen) < 2:
                await socket.send(status("A-1", time.time()))
                _, whole, batch = unpacked_batch(await follower.call("follow", b"0"))
                if batch and len(batch):
                    assert whole
                    seen.add(float(batch.event_s[0]))


async def test_a_vendor_whose_token_can_not_be_read_as_the_site_file_changes_still_gets_in(tmp_path: Path) -> None:
    token, file = "alder-0123456789abcdef", tmp_path / "token"
    file.write_text(token)
    alder, headers = Vendor(name="Alder", token=f"file:{file}"), {"Authorization": f"Bearer {token}"}
    async with serving(tmp_path, SITE.model_copy(update={"vendors": (alder,)})) as role:
        file.write_text("")
        vendors = alder, Vendor(name="Basalt")
        write(tmp_path / SITE_FILE, SITE.model_copy(update={"vendors": vendors}).model_dump_json())
        while role.site.vendors != vendors:
            await asyncio.sleep(0.01)
        url = f"ws://127.0.0.1:{role.receiver.port}"
        await (await connect(url, additional_headers=headers)).close()
        with pytest.raises(InvalidStatus):
            await connect(url)


async def test_no_two_connections_of_a_log_have_the_same_number(tmp_path: Path) -> None:
    for _ in range(3):
        async with serving(tmp_path) as role:
            for name in ("A-1", "B-1"):
                async with connect(f"ws://127.0.0.1:{role.receiver.port}") as socket:
                    await socket.send(status(name, time.time()))
    numbers = [event.connection.id for event in read(tmp_path / "log")[0] if isinstance(event, Received)]
    assert numbers == [1, 2, 3, 4, 5, 6]


async def test_messages_are_read_while_all_robot_documents_are_written(tmp_path: Path) -> None:
    async with serving(tmp_path) as role:
        for number in range(10 * DOCUMENTS_AT_ONCE):
            role.fleet.receive(status(f"R-{number:03}", time.time()), time.time(), Connection(1))
        late = status("Z-1", time.time())
        asking = asyncio.create_task(AsyncCaller(tmp_path, "receiver").call("robots"))
        turns = 0
        while not asking.done():
            await asyncio.sleep(0)
            role.fleet.receive(late, time.time(), Connection(1))
            turns += 1
        document = json.loads(await asking)
        assert len(document) in {10 * DOCUMENTS_AT_ONCE, 10 * DOCUMENTS_AT_ONCE + 1}
        assert [row["uuid"] for row in document] == sorted(row["uuid"] for row in document)
        assert turns > 10


async def test_only_the_document_of_one_robot_is_written_if_one_is_asked_for(tmp_path: Path) -> None:
    async with serving(tmp_path) as role:
        for name in ("R-1", "R-2", "R-3"):
            role.fleet.receive(status(name, time.time()), time.time(), Connection(1))
        known, caller = sorted(role.fleet.robots), AsyncCaller(tmp_path, "receiver")
        documents = json.loads(await caller.call("robots", known[1].encode()))
        assert [document["uuid"] for document in documents] == [known[1]]
        assert json.loads(await caller.call("robots", b"nobody")) == []


async def test_levels_of_the_fleet_are_measured_once_a_second_however_many_ask(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    role, now = ReceiverRole(SITE, tmp_path, tmp_path / "log"), [time.time()]
    monkeypatch.setattr(role, "_now_s", lambda: now[0])

    async def asked() -> tuple[float, float]:
        """How many robots there are, and how many messages came."""
        await role._measures(b"")
        values = role.measures.values
        return sum(values["deconflict_robots"].values()), sum(values["deconflict_messages_total"].values())

    assert await asked() == (0, 0)
    role.fleet.receive(status("A-1", now[0]), now[0], Connection(1))
    now[0] += MEASURE_EVERY_S - 0.1
    assert await asked() == (0, 1), "counters are always true"
    now[0] += 0.2
    assert await asked() == (1, 1)


async def test_a_stalled_disk_delays_no_batch_and_loses_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    go_on, write = threading.Event(), RotatingLog.write

    def stalled(files: RotatingLog, data: bytes) -> int:
        assert go_on.wait(PATIENCE_S)
        return write(files, data)

    monkeypatch.setattr(RotatingLog, "write", stalled)
    try:
        async with serving(tmp_path) as role, connect(f"ws://127.0.0.1:{role.receiver.port}") as socket:
            engine = AsyncCaller(tmp_path, "receiver")
            batch, ticks = Batch.from_bytes(await engine.call("batch", b"everything")), 1
            await socket.send(status("A-1", time.time()))
            while not len(batch):
                batch, ticks = Batch.from_bytes(await engine.call("batch")), ticks + 1
            assert role.recorder.writer.waiting
            go_on.set()
        events, unreadable = read(tmp_path / "log")
    finally:
        go_on.set()
    assert unreadable == 0
    assert isinstance(events[0], EngineStarted)
    assert sum(isinstance(event, Tick) for event in events) == ticks
    assert sum(isinstance(event, Received) for event in events) == 1


async def test_a_restarted_receiver_knows_identities_that_the_log_has_no_longer(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    async with serving(tmp_path) as role:
        now_s = time.time()
        role._deliver(identity("A-1", now_s, baseRobotEnvelope={"x": 2.0, "y": 1.0, "z": 0.4}), now_s, Connection(1))
        async with asyncio.timeout(PATIENCE_S):
            while not kept_identities(tmp_path / "log"):
                await asyncio.sleep(0.05)
        role._deliver(identity("A-2", now_s), now_s, Connection(1))
    for segment in (tmp_path / "log").iterdir():
        segment.unlink()
    caplog.set_level(logging.INFO)
    async with serving(tmp_path) as role:
        names = {robot.name: robot.identity and robot.identity.envelope_m for robot in role.fleet.robots.values()}
        assert names == {"Alder A-1": (2.0, 1.0, 0.4), "Alder A-2": (1.0, 0.5, 0.4)}
    assert "the floor is restored: 2 robots, 0 of them with a position; 0 have sent no identity" in caplog.text


def deliver_recording(role: ReceiverRole) -> None:
    """So many messages of the last seconds that they are worth the fast path."""
    began_s = time.time() - 20
    for number in range(FAST_PATH_AFTER):
        arrival_s = began_s + number * 0.01
        assert role._deliver(status("A-1", arrival_s), arrival_s, Connection(1)) is None


async def test_a_restarted_receiver_reads_a_long_recording_with_the_fast_path(tmp_path: Path) -> None:
    assert load_fast_path(), "as in a copy of a process that has the engine's code"
    for is_long in (False, True):
        async with serving(tmp_path) as role:
            assert bool(role.fleet._repeat_readers) == is_long
            deliver_recording(role)
            before = {uuid: robot.seen for uuid, robot in role.fleet.robots.items()}
    async with serving(tmp_path) as role:
        assert {uuid: robot.seen for uuid, robot in role.fleet.robots.items()} == before


async def test_a_restarted_receiver_does_without_a_fast_path_that_is_not_compiled(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    async with serving(tmp_path) as role:
        deliver_recording(role)
    loaded = "ingest.fast_path", "ingest.fleet.repeat_status"
    for name in [name for name in sys.modules if name.startswith(loaded)]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path / "kernels"))
    async with serving(tmp_path) as role:
        assert not role.fleet._repeat_readers
        assert len(role.fleet.robots) == 1


async def test_a_receiver_that_has_read_a_thousand_messages_loads_the_fast_path(tmp_path: Path) -> None:
    async with serving(tmp_path) as role, asyncio.timeout(PATIENCE_S):
        engine, now_s = AsyncCaller(tmp_path, "receiver"), time.time()
        for number in range(FAST_PATH_AFTER - 1):
            role.fleet.receive(status("A-1", now_s + number * 1e-3), now_s + number * 1e-3, Connection(1))
        await engine.call("batch")
        assert not role._fast_path_asked
        role.fleet.receive(status("A-1", now_s + 60), now_s + 60, Connection(1))
        while not role.fleet._repeat_readers:
            await engine.call("batch")
