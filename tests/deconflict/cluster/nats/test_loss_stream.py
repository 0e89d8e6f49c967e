"""The durable stream of losses, with a real server."""

import asyncio
from pathlib import Path

from deconflict.operator.ledger.loss_ledger import LossParcel
from tests.deconflict.cluster.made_cluster import Broker, buses, needs_server
from tests.deconflict.operator.ledger.made_entries import CROSSED, LATER, QUEUED
from tests.helpers.patience import PATIENCE_S

pytestmark = needs_server


async def received(records: "asyncio.Queue[LossParcel]", count: int) -> list[LossParcel]:
    async with asyncio.timeout(PATIENCE_S):
        return [await records.get() for _ in range(count)]


async def test_losses_arrive_in_order_and_once_and_a_reader_resumes_where_it_was(tmp_path: Path) -> None:
    async with buses(Broker(tmp_path), 3) as (writer, reader, later):
        records, others = asyncio.Queue[LossParcel](), asyncio.Queue[LossParcel]()
        await reader.losses.follow(records.put_nowait, "", 0)
        first = writer.losses.next_id()
        for message_id in (first, first, writer.losses.next_id()):
            await writer.losses.write(message_id, [QUEUED, CROSSED] if message_id == first else [LATER])
        early, late = await received(records, 2)
        assert (early.entries, late.entries) == ([QUEUED, CROSSED], [LATER])
        await later.losses.follow(others.put_nowait, early.sender, early.number)
        assert await received(others, 1) == [late]
        assert records.empty()


async def test_another_stream_is_read_from_its_beginning(tmp_path: Path) -> None:
    async with buses(Broker(tmp_path), 2) as (writer, reader):
        records = asyncio.Queue[LossParcel]()
        await writer.losses.write(writer.losses.next_id(), [QUEUED])
        await reader.losses.follow(records.put_nowait, "another stream", 7)
        (record,) = await received(records, 1)
        assert (record.entries, record.number) == ([QUEUED], 1)
