"""Revisions that wait to be told, with a real NATS server."""

import asyncio
from pathlib import Path

import pytest

from deconflict.cluster.judging import outbox
from deconflict.cluster.judging.outbox import Outbox, UnwrittenError
from deconflict.cluster.judging.stream_writer import StreamWriter
from deconflict.cluster.nats.nats_tasks import end_tasks
from ingest.measures.measures import Measures
from tests.deconflict.cluster.made_cluster import HOME, Broker, buses, needs_server
from tests.deconflict.operator.http.served_face import until
from tests.helpers.made_advisories import made
from tests.helpers.patience import PATIENCE_S

pytestmark = needs_server
PAIR = ("0c5b4a7e-0000-4000-8000-00000000000a", "0c5b4a7e-0000-4000-8000-00000000000b")


async def test_waiting_revisions_are_bounded_and_written_ones_do_not_count(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(outbox, "MOST_WAITING", 10)
    monkeypatch.setattr(outbox, "STUCK_S", 0.5)
    broker = Broker(tmp_path)
    async with buses(broker, 1) as (bus,):
        filled_outbox = Outbox(StreamWriter(bus.revisions, Measures()))
        writing = asyncio.create_task(filled_outbox.run())
        for revision in range(1, 25):
            written = asyncio.Event()
            filled_outbox.add_pass([(HOME, made(1, revision))], written.set)
            async with asyncio.timeout(PATIENCE_S):
                await written.wait()
            assert filled_outbox.has_room()
        broker.kill()
        filled_outbox.add_pass((HOME, made(2, revision, robots=PAIR)) for revision in range(1, 10))
        assert filled_outbox.has_room()
        filled_outbox.add_pass([])
        with pytest.raises(UnwrittenError, match="wait for a NATS server that has accepted none"):
            await until(filled_outbox.has_room)
        await end_tasks(writing)


async def test_a_pass_of_any_number_of_revisions_is_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(outbox, "MOST_WAITING", 10)
    async with buses(Broker(tmp_path), 1) as (bus,):
        filled_outbox, written = Outbox(StreamWriter(bus.revisions, Measures())), asyncio.Event()
        filled_outbox.add_pass([(HOME, made(1, revision)) for revision in range(1, 100)], written.set)
        assert not filled_outbox.has_room()
        writing = asyncio.create_task(filled_outbox.run())
        async with asyncio.timeout(PATIENCE_S):
            await written.wait()
        await until(filled_outbox.has_room)
        await end_tasks(writing)
