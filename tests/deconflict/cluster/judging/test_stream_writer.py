"""What is told where the durable stream has lost what it had, with a real NATS server."""

import asyncio
from pathlib import Path

from deconflict.cluster.judging.stream_writer import StreamWriter
from deconflict.cluster.nats.nats_tasks import end_tasks
from deconflict.cluster.nats.stream_records import key_of
from ingest.measures.measures import Measures
from tests.deconflict.cluster.made_cluster import HOME, Broker, buses, needs_server
from tests.helpers.made_advisories import cleared, cleared_situation, made, situation

pytestmark = needs_server
KEPT_S = 2.0
OTHERS = ("0c5b4a7e-0000-4000-8000-00000000000a", "0c5b4a7e-0000-4000-8000-00000000000b")


async def test_a_pair_whose_last_advisory_has_expired_gets_a_new_one(tmp_path: Path) -> None:
    async with buses(Broker(tmp_path), 1, KEPT_S / 86400) as (bus,), asyncio.timeout(300):
        writer = StreamWriter(bus.revisions, Measures())
        assert await writer.write(HOME, made(1)) is None
        assert await writer.write(HOME, cleared(1, revision=2)) is None
        while await bus.revisions.last(key_of(made(1))):
            await asyncio.sleep(0.1)
        assert await writer.write(HOME, made(2)) is None
        stands = await bus.revisions.last(key_of(made(2)))
    assert stands
    assert stands.advisory == made(2)


async def test_a_server_that_lost_its_store_gets_the_missing_revisions_again(tmp_path: Path) -> None:
    broker = Broker(tmp_path / "nats")
    async with buses(broker, 1) as (bus,), asyncio.timeout(300):
        writer = StreamWriter(bus.revisions, Measures())
        assert await writer.write(HOME, made(1)) is None
        broker.empty()
        assert await writer.write(HOME, made(1, revision=2)) is None
        stands = await bus.revisions.last(key_of(made(1)))
    assert stands
    assert (stands.seq, stands.advisory) == (1, made(1, revision=2))


async def test_a_revision_that_no_server_accepts_is_set_aside_and_the_next_is_written(tmp_path: Path) -> None:
    measures = Measures()
    too_large = made(1, summary="x" * (1 << 20))
    not_finite = made(1).model_copy(update={"min_separation_m": float("nan")})
    async with buses(Broker(tmp_path / "nats"), 1) as (bus,), asyncio.timeout(300):
        writer = StreamWriter(bus.revisions, measures)
        for revision in (too_large, not_finite, made(2, robots=OTHERS)):
            assert await writer.write(HOME, revision) is None
        assert await bus.revisions.last(key_of(made(1))) is None
        assert await bus.revisions.last(key_of(made(2, robots=OTHERS)))
    assert measures.values["deconflict_advisories_set_aside_total"]["unwritable",] == 2


async def test_any_writer_restores_open_advisories_to_a_server_that_lost_its_store(tmp_path: Path) -> None:
    broker = Broker(tmp_path / "nats")
    async with buses(broker, 2) as both, asyncio.timeout(300):
        writers = [StreamWriter(bus.revisions, Measures()) for bus in both]
        for bus, writer in zip(both, writers, strict=True):
            await bus.revisions.follow(writer.note)
        async with asyncio.TaskGroup() as keeping:
            kept = [keeping.create_task(writer.keep_complete()) for writer in writers]
            assert await writers[0].write(HOME, made(1)) is None
            assert await writers[0].write(HOME, made(1, revision=2)) is None
            assert await writers[0].write(HOME, made(2, robots=OTHERS)) is None
            assert await writers[0].write(HOME, cleared(2, robots=OTHERS)) is None
            while writers[1].open() != [made(1, revision=2)]:
                await asyncio.sleep(0.05)
            broker.empty()
            streams = [bus.revisions for bus in both]
            while not all(stream.replacements for stream in streams) or not await streams[1].last(key_of(made(1))):
                await asyncio.sleep(0.05)
            assert await writers[0].write(HOME, cleared(1, revision=3)) is None
            await end_tasks(*kept)
        stream_records = [
            await both[0].revisions.last(key_of(advisory)) for advisory in (made(1), made(2, robots=OTHERS))
        ]
    assert [stream_record and (stream_record.seq, stream_record.advisory) for stream_record in stream_records] == [
        (2, cleared(1, revision=3)),
        None,
    ]


async def test_an_open_advisory_is_written_once_more_before_it_expires(tmp_path: Path) -> None:
    async with buses(Broker(tmp_path), 1, KEPT_S / 86400) as (bus,), asyncio.timeout(300):
        writer = StreamWriter(bus.revisions, Measures())
        keeping = asyncio.create_task(writer.keep_complete())
        assert await writer.write(HOME, made(1)) is None
        assert await writer.write(HOME, made(2, robots=OTHERS)) is None
        assert await writer.write(HOME, cleared(2, robots=OTHERS)) is None
        while await bus.revisions.last(key_of(made(2, robots=OTHERS))):
            await asyncio.sleep(0.05)
        stands = await bus.revisions.last(key_of(made(1)))
        assert await writer.write(HOME, made(1, revision=2)) is None
        await end_tasks(keeping)
    assert stands
    assert (stands.seq > 3, stands.advisory) == (True, made(1))


async def test_advisories_carry_the_id_of_the_situation_that_the_stream_has(tmp_path: Path) -> None:
    async with buses(Broker(tmp_path / "nats"), 2) as (first, second), asyncio.timeout(300):
        writer, other = StreamWriter(first.revisions, Measures()), StreamWriter(second.revisions, Measures())
        await second.revisions.follow(other.note)
        assert await writer.write(HOME, made(1)) is None
        assert await writer.write(None, situation(1)) is None
        while len(other.open()) < 2:
            await asyncio.sleep(0.01)
        assert await other.write(HOME, made(1, 2)) is None
        assert await other.write(HOME, cleared(1, 3)) is None
        last = await first.revisions.last(key_of(made(1)))
        assert last
        assert last.advisory
        assert (last.advisory.revision, last.advisory.situation_id) == (3, "situation-1")
        assert await writer.write(None, cleared_situation(1)) is None
        while other.open():
            await asyncio.sleep(0.01)
        assert await other.write(HOME, made(2).model_copy(update={"situation_id": "situation-1"})) is None
        last = await first.revisions.last(key_of(made(2)))
    assert last
    assert last.advisory
    assert (last.advisory.id, last.advisory.situation_id) == ("advisory-2", None)
