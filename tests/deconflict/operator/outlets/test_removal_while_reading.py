"""An outlet that catches up while advisories are removed: it sends the end of whatever it sends open."""

import asyncio
import json
from pathlib import Path

import pytest

from deconflict.operator.outlets.store_cursor import StoreCursor
from deconflict.operator.store.publisher import TAIL_LENGTH, PublishedLine, Publisher
from deconflict.operator.store.store import Store
from ingest.measures.measures import Measures
from tests.deconflict.operator.outlets.made_outlets import kept
from tests.helpers.made_advisories import cleared, made

ADVISORIES, NEWEST = range(1, 251), 300


class Receiver:
    """What a receiver holds open."""

    def __init__(self, cursor: StoreCursor) -> None:
        self._cursor, self._lines = cursor, cursor.lines()
        self.held_open: set[str] = set()
        self.heard: set[str] = set()

    async def hear_to(self, seq: int) -> None:
        while self._cursor.seq < seq:
            line = await anext(self._lines)
            self._hear(line)
            self._cursor.delivered(line)

    def _hear(self, line: PublishedLine) -> None:
        document = json.loads(line.text)
        self.heard.add(document["id"])
        (self.held_open.discard if document["state"] == "cleared" else self.held_open.add)(document["id"])


async def beginning(store: Store, publisher: Publisher) -> Receiver:
    """A receiver whose outlet begins with the first revision."""
    store.set_position("mes", 0)
    store.flush()
    cursor = StoreCursor("mes", ["advisory"], store, publisher)
    await cursor.begin()
    return Receiver(cursor)


@pytest.mark.parametrize("is_position_stored", [True, False])
async def test_an_outlet_that_catches_up_sends_the_end_of_what_it_has_read_open(
    tmp_path: Path, is_position_stored: bool
) -> None:
    with kept(tmp_path) as (store, _):
        store.append([made(number) for number in ADVISORIES])
        store.append([cleared(number) for number in ADVISORIES])
        end = store.append([made(NEWEST)])[-1].seq
        receiver = await beginning(store, Publisher(store, Measures()))
        await receiver.hear_to(150)
        if is_position_stored:
            store.flush()
        assert store.prune_to(1) == 50, "all but the first two pages"
        await receiver.hear_to(end)
    assert (len(receiver.heard), receiver.held_open) == (201, {f"advisory-{NEWEST}"})


async def test_a_page_that_begins_during_a_removal_has_nothing_that_is_removed(tmp_path: Path) -> None:
    with kept(tmp_path) as (store, _):
        store.append([made(number) for number in ADVISORIES])
        store.append([cleared(number) for number in ADVISORIES])
        end = store.append([made(NEWEST)])[-1].seq
        receiver = await beginning(store, Publisher(store, Measures()))
        await receiver.hear_to(100)
        with store.outlets.removing(store.connections) as db:
            hearing = asyncio.create_task(receiver.hear_to(end))
            await asyncio.sleep(0.05)
            assert len(receiver.heard) == 100
            db.execute("DELETE FROM revisions WHERE id IN ('advisory-101', 'advisory-150')")
            db.execute("DELETE FROM advisories WHERE id IN ('advisory-101', 'advisory-150')")
        await hearing
    assert (len(receiver.heard), receiver.held_open) == (249, {f"advisory-{NEWEST}"})


async def test_an_outlet_sends_nothing_open_from_memory_whose_end_is_removed(tmp_path: Path) -> None:
    with kept(tmp_path) as (store, publisher):
        receiver = await beginning(store, publisher)
        await publisher.publish([made(number) for number in ADVISORIES])
        await publisher.publish([cleared(number) for number in ADVISORIES])
        await receiver.hear_to(50)
        store.prune_to(1)
        await receiver.hear_to(200)
        later = range(1_000, 1_000 + TAIL_LENGTH)
        end = (await publisher.publish([cleared(number, 1) for number in later]))[-1].seq
        await receiver.hear_to(end)
    assert receiver.held_open == set()


async def test_an_outlet_that_is_cancelled_while_it_waits_keeps_nothing_more_from_removal(tmp_path: Path) -> None:
    with kept(tmp_path) as (store, publisher):
        receiver = await beginning(store, publisher)
        waiting = asyncio.create_task(receiver.hear_to(1))
        await asyncio.sleep(0.05)
        waiting.cancel()
        await asyncio.gather(waiting, return_exceptions=True)
        store.append([made(1), cleared(1)])
        assert store.prune_to(1) == 1
