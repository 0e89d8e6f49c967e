import asyncio
import threading
from collections.abc import Set
from datetime import timedelta
from pathlib import Path

import pytest

from deconflict.operator.store.listings import Page
from deconflict.operator.store.publisher import MOST_LINES, TAIL_LENGTH, PublishedLine, PublishedPage, Publisher
from deconflict.operator.store.store import Store, StoreError
from deconflict_client.advisory import Acknowledgement
from ingest.measures.measures import Measures
from tests.helpers.made_advisories import START, cleared, deadlock, made
from tests.helpers.patience import PATIENCE_S


def made_many(first: int, count: int) -> list[PublishedLine]:
    return [PublishedLine(seq, made(seq, seq=seq).model_dump_json(), "conflict") for seq in range(first, first + count)]


async def test_a_waiting_subscriber_wakes_when_a_revision_is_published(store: Store) -> None:
    publisher = Publisher(store, Measures())
    following = asyncio.create_task(publisher.after(0))
    await asyncio.sleep(0)
    assert not following.done()
    await publisher.publish([made(1), made(2)])
    assert (await following).lines == made_many(1, 2)


async def test_the_same_lines_come_from_the_tail_and_from_the_store(store: Store) -> None:
    publisher = Publisher(store, Measures())
    await publisher.publish([made(number) for number in range(1, MOST_LINES + 21)])
    from_store = Publisher(store, Measures())
    for seq in (0, 5, MOST_LINES, MOST_LINES + 19):
        assert await publisher.after(seq) == await from_store.after(seq)
    assert len((await publisher.after(0)).lines) == MOST_LINES


async def test_a_follower_behind_the_tail_is_served_from_the_store_until_it_reaches_it(store: Store) -> None:
    publisher = Publisher(store, Measures())
    total = TAIL_LENGTH + 3 * MOST_LINES
    await publisher.publish([made(number) for number in range(1, total + 1)])
    seq, seen = 0, list[PublishedLine]()
    while seq < total:
        seen += (await publisher.after(seq)).lines
        seq = seen[-1].seq
    assert seen == made_many(1, total)


async def test_a_revision_that_another_writer_stored_is_not_missed(store: Store) -> None:
    publisher = Publisher(store, Measures())
    await publisher.publish([made(1)])
    store.append([made(2)])
    await publisher.publish([made(3)])
    assert (await publisher.after(0)).lines == made_many(1, 3)
    assert (await publisher.after(1)).lines == made_many(2, 2)
    assert (await publisher.after(2)).lines == made_many(3, 1)


async def test_a_revision_whose_publish_was_cancelled_is_announced_when_sent_again(store: Store) -> None:
    publisher = Publisher(store, Measures())
    given_up = asyncio.create_task(publisher.publish([made(1)]))
    await asyncio.sleep(0)
    given_up.cancel()
    with pytest.raises(asyncio.CancelledError):
        await given_up
    await publisher.publish([made(1)])
    assert (await publisher.after(0)).lines == made_many(1, 1)


async def test_a_repeated_publish_wakes_no_subscriber_and_counts_nothing(store: Store) -> None:
    measures = Measures()
    publisher = Publisher(store, measures)
    await publisher.publish([made(1)])
    following = asyncio.create_task(publisher.after(1))
    assert [advisory.seq for advisory in await publisher.publish([made(1)])] == [1]
    await asyncio.sleep(0)
    assert not following.done()
    await publisher.publish([made(1), made(2)])
    assert (await following).lines == made_many(2, 1)
    assert measures.values["deconflict_advisories_stored_total"] == {(): 2}


UNEQUAL = deadlock("r-1", "r-2").model_copy(update={"vendors": ("Acme",)})
TOO_LARGE = made(3, encounter=1 << 70)
HIGH = made(4).model_copy(update={"revision": 1 << 70})


async def test_what_cannot_be_written_is_set_aside_and_holds_up_nothing(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    store, measures = Store(tmp_path), Measures()
    publisher = Publisher(store, measures)
    published = await publisher.publish([made(1), UNEQUAL, TOO_LARGE, made(1, 2), HIGH])
    assert [(advisory.id, advisory.revision) for advisory in published] == [("advisory-1", 1), ("advisory-1", 2)]
    assert [line.seq for line in (await publisher.after(0)).lines] == [1, 4]
    assert (store.unstored, publisher.failing) == (0, None)
    assert measures.values["deconflict_advisories_set_aside_total"] == {("invalid",): 0, ("unwritable",): 3}
    assert f"{UNEQUAL.id}, revision 1" in caplog.text
    await publisher.publish([UNEQUAL])
    store.close()
    again = Store(tmp_path)
    assert again.last_seq() == 5, "the number of what was set aside is not used again"
    assert [(advisory.id, advisory.seq) for advisory in again.after(0)] == [("advisory-1", 1), ("advisory-1", 4)]
    again.close()


class CountingStore(Store):
    """A store that counts how often it is read from."""

    reads = 0

    def page_after(self, seq: int, kinds: Set[str], limit: int) -> Page:
        self.reads += 1
        return super().page_after(seq, kinds, limit)


async def test_a_subscriber_whose_position_was_pruned_reads_once_and_waits(tmp_path: Path) -> None:
    store = CountingStore(tmp_path)
    store.append([made(1), cleared(1), made(2), cleared(2)])
    store.prune(START + timedelta(days=1))
    publisher = Publisher(store, Measures())
    pruned = await publisher.after(1)
    assert pruned == PublishedPage([], 4, removed=4)
    following = asyncio.create_task(publisher.after(pruned.last))
    (news,) = await publisher.publish([made(5)])
    assert [line.seq for line in (await following).lines] == [news.seq] == [5]
    assert store.reads == 1
    store.close()


async def test_subscribers_that_keep_up_share_the_tail_and_read_no_store(tmp_path: Path) -> None:
    store = CountingStore(tmp_path)
    publisher = Publisher(store, Measures())
    for number in range(1, 4):
        followers = [asyncio.create_task(publisher.after(number - 1)) for _ in range(3)]
        await publisher.publish([made(number)])
        assert [page.lines for page in await asyncio.gather(*followers)] == [made_many(number, 1)] * 3
    assert store.reads == 0
    store.close()


async def test_a_slow_question_of_people_delays_no_new_revision(store: Store) -> None:
    publisher, began, goes_on = Publisher(store, Measures()), threading.Event(), threading.Event()
    await publisher.publish([made(number) for number in range(1, 101)])

    def slow() -> bool:
        began.set()
        return not goes_on.wait(PATIENCE_S)

    store.connections._file.reader.set_progress_handler(slow, 100)
    asking = asyncio.create_task(asyncio.to_thread(store.latest))
    await asyncio.to_thread(began.wait, PATIENCE_S)
    await publisher.publish([made(101)])
    assert (await publisher.after(100)).lines == made_many(101, 1)
    assert not asking.done()
    goes_on.set()
    assert len((await asking).advisories) == 100


async def test_a_refused_revision_is_not_announced_and_is_counted(store: Store) -> None:
    measures = Measures()
    publisher = Publisher(store, measures)
    await publisher.publish([made(1)])
    store.close()
    with pytest.raises(StoreError):
        await publisher.publish([made(2)])
    assert publisher.last_seq == 1
    assert measures.values["deconflict_store_failures_total"] == {(): 1}


async def test_an_acknowledgement_follows_in_the_stream_with_the_next_number(store: Store) -> None:
    publisher = Publisher(store, Measures())
    await publisher.publish([made(1)])
    answer = Acknowledgement(name="Kim", reason="called back", at=START)
    assert await publisher.acknowledge("advisory-9", answer) is None
    answered = await publisher.acknowledge("advisory-1", answer)
    assert answered
    await publisher.publish([made(2)])
    lines = (await publisher.after(0)).lines
    assert [line.seq for line in lines] == [1, 2, 3]
    assert lines[1].text == answered.model_dump_json()
