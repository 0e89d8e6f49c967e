"""A store whose file can't be used: memory takes its place, and hands over what it has taken."""

import json
import sqlite3
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor, wait
from contextlib import AbstractContextManager, closing, contextmanager
from datetime import timedelta
from functools import partial
from pathlib import Path
from sys import maxsize

import pytest

from benchmarks.faulty_files.faults import blocked, held_alone, locked, read_only, remove
from deconflict.operator.store import tables
from deconflict.operator.store.optional import stand_in
from deconflict.operator.store.optional.optional_store import OptionalStore
from deconflict.operator.store.optional.stand_in import STEP
from deconflict.operator.store.publisher import Publisher
from deconflict.operator.store.recovery.reserved_numbers import FILE_NAME as RESERVED
from deconflict.operator.store.recovery.reserved_numbers import epoch
from deconflict.operator.store.sqlite_connections import FILE_NAME
from deconflict.operator.store.store import Store, StoreError
from deconflict_client.advisory import EVERY_KIND, Acknowledgement, ClearedCode
from ingest.measures.measures import Measures
from tests.deconflict.operator.store.made_damage import damage, page
from tests.deconflict.roles.made_disks import disk_that_can_stick, stuck
from tests.helpers.made_advisories import START, cleared, made, situation
from tests.helpers.patience import PATIENCE_S

GIVEN = Acknowledgement(name="Kim", reason="seen", at=START)
Harm = Callable[[Path], AbstractContextManager[None]]


@pytest.fixture(autouse=True)
def impatient(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("optional_connections.OPEN_TIMEOUT_S", "stand_in.READ_TIMEOUT_S"):
        monkeypatch.setattr(f"deconflict.operator.store.optional.{name}", 0.05)


@pytest.fixture
def data(tmp_path: Path) -> Path:
    """Three numbers are given; advisory 2 is open and answered."""
    with closing(Store(tmp_path)) as store:
        store.append([made(1), cleared(1), made(2)])
        store.acknowledge("advisory-2", GIVEN)
        store.set_position("hook", 2)
        store.flush()
    return tmp_path


@contextmanager
def unreadable(path: Path) -> Iterator[None]:
    with held_alone(path):
        yield


@pytest.mark.parametrize("harm", [locked, held_alone, blocked])
def test_what_is_published_without_the_file_is_in_it_later_under_its_numbers(data: Path, harm: Harm) -> None:
    with harm(data / FILE_NAME):
        store = OptionalStore(data)
        assert store.outage
        began = epoch(time.time() - 60.0)
        (first,) = store.append([made(3)])
        answered = store.acknowledge("advisory-3", GIVEN)
        (last,) = store.append([cleared(3)])
        assert answered
        assert [each.seq for each in store.get("advisory-3")] == [first.seq, answered.seq, last.seq]
        assert first.seq > began
        assert not store.attach()
    assert store.attach()
    assert store.outage is None
    (next_one,) = store.append([made(4)])
    assert next_one.seq == last.seq + 1
    store.close()
    with closing(Store(data)) as again:
        kept = again.after(0, -1)
        assert [(each.id, each.seq) for each in kept[:4]] == [
            ("advisory-1", 1), ("advisory-1", 2), ("advisory-2", 3), ("advisory-2", 4),
        ]  # fmt: skip
        assert kept[4:] == [first, answered, last, next_one]
        assert [each.id for each in again.latest("open").advisories] == ["advisory-4", "advisory-2"]


def test_what_is_open_continues_if_the_file_can_be_read(data: Path) -> None:
    with locked(data / FILE_NAME):
        store = OptionalStore(data)
        (known,) = store.latest("open").advisories
        assert (known.id, known.acknowledgement) == ("advisory-2", GIVEN)
        assert [each.seq for each in store.after(store.position("hook") or 0, 10)] == [3, 4], (
            "an outlet has them to send"
        )
        (ended,) = store.append([cleared(2)])
        assert ended.acknowledgement == GIVEN
    assert store.attach()
    assert [each.seq for each in store.get("advisory-2")] == [3, 4, ended.seq]
    store.close()


def test_a_file_that_was_read_only_is_written_after_its_repair(data: Path) -> None:
    """Also by connections that could read it meanwhile."""
    try:
        with read_only(data / FILE_NAME):
            store = OptionalStore(data)
            assert [each.id for each in store.latest("open").advisories] == ["advisory-2"]
            (given,) = store.append([made(3)])
            assert not store.attach()
    except PermissionError:
        pytest.skip("may not mount a disk")
    assert store.attach()
    store.close()
    with closing(Store(data)) as again:
        assert again.after(4) == [given]


def test_subscribers_of_a_file_that_is_not_in_use_are_to_read_again(data: Path) -> None:
    with unreadable(data / FILE_NAME):
        store = OptionalStore(data)
        store.append([made(3)])
        for known in (1, 4, 90_000):
            assert store.page_after(known, EVERY_KIND, 10).removed > known
        store.close()


def test_no_number_is_given_twice_if_the_file_and_the_reserved_number_are_lost_again_and_again(data: Path) -> None:
    numbers: list[int] = []
    (data / RESERVED).unlink()
    (data / RESERVED).mkdir()
    for number in range(3):
        remove(data / FILE_NAME)
        with closing(OptionalStore(data)) as store:
            numbers += [each.seq for each in store.append([made(number), made(number, 2)])]
        with blocked(data / FILE_NAME), closing(OptionalStore(data)) as store:
            numbers += [each.seq for each in store.append([made(number), made(number, 2)])]
    assert numbers == sorted(set(numbers))


def test_a_reserved_number_that_cannot_be_written_keeps_nothing_from_being_stored(data: Path) -> None:
    (data / RESERVED).unlink()
    (data / RESERVED).mkdir()
    with closing(Store(data)) as store:
        assert [each.seq for each in store.append([made(3)])] == [5]


def test_a_reserved_number_that_is_removed_while_the_store_is_in_use_is_written_again(data: Path) -> None:
    store = OptionalStore(data)
    reserved = (data / RESERVED).read_text()
    (data / RESERVED).unlink()
    store.append([made(3)])
    assert not store.attach()
    assert (data / RESERVED).read_text() == reserved
    store.close()


def test_a_file_that_has_given_higher_numbers_takes_what_memory_has_beyond_them(
    data: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As after a start with the clock far ahead."""
    monkeypatch.setattr("deconflict.operator.store.optional.stand_in.epoch", lambda _: 0)
    (data / RESERVED).write_text("1\n")
    with unreadable(data / FILE_NAME):
        store = OptionalStore(data)
        assert [each.seq for each in store.append([made(3), made(4)])] == [2, 3]
    assert store.attach()
    assert [(each.id, each.seq) for each in store.after(4)] == [("advisory-3", 5), ("advisory-4", 6)]
    assert all(store.page_after(known, EVERY_KIND, 10).removed > known for known in (1, 2, 3))
    store.close()


def test_what_nobody_knows_to_be_open_is_cleared_once_the_file_is_back(data: Path) -> None:
    with closing(Store(data)) as store:
        store.append([situation(7)])
    for has_engine, wanted in ((False, {"situation-7"}), (True, {"advisory-2"})):
        with unreadable(data / FILE_NAME):
            store = OptionalStore(data)
            if has_engine:
                store.note_engine()
        before = store.last_seq()
        assert store.attach()
        ended = [each for each in store.after(before) if each.cleared_code is ClearedCode.UNREAD]
        assert {each.id for each in ended} == wanted
        store.close()
    with closing(Store(data)) as store:
        assert store.latest("open").advisories == []


def test_much_is_handed_over_in_steps(data: Path) -> None:
    with locked(data / FILE_NAME):
        store = OptionalStore(data)
        given = store.append([made(number) for number in range(10, 10 + 2 * STEP + 5)])
    assert store.attach()
    assert store.after(4, -1) == given
    store.close()


@pytest.mark.parametrize("comes", ["nothing", "a directory", "an older copy"])
def test_a_file_that_is_removed_while_it_is_in_use_is_begun_anew(data: Path, comes: str) -> None:
    path = data / FILE_NAME
    copy = path.read_bytes()
    store = OptionalStore(data)
    (third,) = store.append([made(3)])
    (fourth,) = store.accept([made(4)])
    remove(path)
    if comes == "a directory":
        path.mkdir()
    elif comes == "an older copy":
        path.write_bytes(copy)
    assert store.attach()
    assert bool(store.outage) == (comes == "a directory")
    (fifth,) = store.append([made(5)])
    if comes == "a directory":
        path.rmdir()
        assert store.attach()
    assert [each.id for each in store.latest("open").advisories[:4]] == [
        "advisory-5", "advisory-4", "advisory-3", "advisory-2",
    ]  # fmt: skip
    store.close()
    with closing(Store(data)) as again:
        kept = [each.seq for each in again.after(4, -1)]
        assert kept == sorted(set(kept))
        if comes != "an older copy":
            assert again.after(4, -1) == [third, fourth, fifth]
        assert again.last_seq() >= fifth.seq


def test_a_file_that_is_damaged_beyond_repair_leaves_memory(data: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As on a disk that spoils all that it is given."""
    store = OptionalStore(data)
    store.connections._file.writer.execute("PRAGMA wal_checkpoint(TRUNCATE)")
    monkeypatch.setattr(store.connections, "_renewed_s", time.monotonic())
    damage(data / FILE_NAME, page(1))
    for path in data.glob("*-wal"):
        path.write_bytes(b"")
    assert store.attach()
    assert store.outage
    assert [each.id for each in store.append([made(5)])] == ["advisory-5"]
    store.close()


async def test_subscribers_receive_what_comes_after_a_change_of_the_file(data: Path) -> None:
    with unreadable(data / FILE_NAME):
        store = OptionalStore(data)
        publisher = Publisher(store, Measures())
        (first,) = await publisher.publish([made(3)])
    assert store.attach()
    await publisher.renew_numbers()
    (second,) = await publisher.publish([made(4)])
    assert [line.seq for line in (await publisher.after(first.seq)).lines] == [second.seq]
    await publisher.close()
    store.close()


def test_a_disk_with_no_room_for_the_memory_of_connections_is_read_all_the_same(
    data: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with closing(sqlite3.connect(data / FILE_NAME, isolation_level=None)) as db:
        db.execute("PRAGMA wal_checkpoint(TRUNCATE)")
    monkeypatch.setattr(OptionalStore.connects, "_connect", _fail)
    store = OptionalStore(data)
    assert [each.id for each in store.latest("open").advisories] == ["advisory-2"]
    store.close()


def _fail(_: object) -> sqlite3.Connection:
    raise sqlite3.OperationalError("database or disk is full")


def test_a_subscriber_that_was_away_for_an_epoch_that_was_lost_is_to_read_again(data: Path) -> None:
    with unreadable(data / FILE_NAME):
        store = OptionalStore(data)
        (lost,) = store.append([situation(7)])
        store.close()
    time.sleep(0.001)
    with unreadable(data / FILE_NAME):
        store = OptionalStore(data)
        (kept,) = store.append([made(8)])
    assert store.attach()
    for known in (4, lost.seq):
        assert store.page_after(known, EVERY_KIND, 10).removed > known
    assert store.page_after(kept.seq, EVERY_KIND, 10).removed < kept.seq
    store.close()


def test_an_outlet_that_skips_what_the_file_has_is_told_what_is_over(data: Path) -> None:
    """It has sent advisories 1 and 2, and continues in a memory that does not know that 1 was cleared."""
    with closing(Store(data)) as store:
        store.append([made(5), situation(7), cleared(5)])
        store.set_position("hook", 5)
        store.flush()
        store.append([made(6), cleared(6)])
    with unreadable(data / FILE_NAME):
        store = OptionalStore(data)
        store.set_position("hook", store.last_seq())
        store.flush()
        position = store.position("hook") or 0
    assert store.attach()
    assert {each.id for each in store.after(position, -1) if each.cleared_at} == {"advisory-5", "situation-7"}
    assert store.burdens_s() == {}
    store.close()


def test_memory_begins_with_the_end_of_all_that_an_outlet_has_sent_open(
    data: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("MOST_UNSENT", "NEWEST"):
        for table, query in stand_in.STATE.items():
            monkeypatch.setitem(stand_in.STATE, table, query.replace(f"LIMIT {getattr(stand_in, name)}", "LIMIT 3"))
    with closing(Store(data)) as store:
        store.append([made(5), made(2, 2)])
        store.set_position("hook", 5)
        store.flush()
        store.append([cleared(5), *(made(number) for number in range(10, 20)), made(2, 3)])
        store.append([cleared(number) for number in range(10, 20)])
    with locked(data / FILE_NAME):
        store = OptionalStore(data)
        assert "advisory-5" in {each.id for each in store.after(5, -1) if each.cleared_at}
        assert ("conflict", "advisory-2") in store.held_at(5, EVERY_KIND), "its first revision is known"
        store.close()


def test_what_was_removed_from_memory_counts_as_removed_in_the_file(data: Path) -> None:
    with locked(data / FILE_NAME):
        store = OptionalStore(data)
        first, last = store.append([made(8), cleared(8)])
        assert store.prune(cleared(8).updated_at + timedelta(seconds=1.0))
    assert store.attach()
    assert store.page_after(first.seq, EVERY_KIND, 10).removed == last.seq
    store.close()


def test_a_file_that_is_replaced_while_it_takes_the_place_of_memory_is_noticed(data: Path) -> None:
    store = OptionalStore(data)
    assert store.leave_stuck()
    store.append([made(3)])
    file = store.connections.opened_again()
    assert file
    store.path.rename(data / "elsewhere.db")
    Store(data).close()
    store.connections.use_again(file)
    store.append([made(4)])
    assert store.attach()
    assert store.outage is None
    store.close()
    with closing(Store(data)) as again:
        assert [each.id for each in again.latest("open").advisories] == ["advisory-4", "advisory-3", "advisory-2"]


@pytest.fixture
def little_memory(monkeypatch: pytest.MonkeyPatch) -> int:
    """The size of memory, in bytes."""
    most_bytes = 200_000
    for name in ("stand_in", "optional_connections"):
        monkeypatch.setattr(f"deconflict.operator.store.optional.{name}.MOST_BYTES", most_bytes, raising=False)
    return most_bytes


def test_memory_stays_within_its_size_while_who_removes_waits_for_the_disk(data: Path, little_memory: int) -> None:
    with closing(OptionalStore(data)) as store:
        assert store.leave_stuck()
        for number in range(1_000, 1_400, 20):
            store.append([each for n in range(number, number + 20) for each in (made(n), cleared(n))])
            store.flush()
        assert store.used_bytes() < 2 * little_memory
        assert [each.id for each in store.latest("open").advisories] == ["advisory-2"]
        left = {each.id for each in store.after(0, -1)} - {"advisory-1", "advisory-2"}
        assert store.prune_to(maxsize) == 400 - len(left)
        while store.outage:
            store.attach()


def test_a_file_that_takes_the_place_of_memory_is_not_cut_to_the_size_of_memory(data: Path, little_memory: int) -> None:
    with closing(Store(data)) as before:
        before.append([each for number in range(1_000, 1_200) for each in (made(number), cleared(number))])
        before.set_position("hook", before.last_seq())
        before.flush()
        assert before.used_bytes() > 2 * little_memory
    with closing(OptionalStore(data)) as store, ThreadPoolExecutor() as threads:
        assert store.leave_stuck()
        file = store.connections.opened_again()
        assert file
        with store.connections.changing:
            taking_over = threads.submit(store.connections.use_again, file)
            while not store.connections._locks.long_reader.locked():
                time.sleep(0.01)
            removing = threads.submit(store.prune_to, 1 << 30)
            assert not wait([removing], timeout=0.2).done, "it waits until the file has the place of memory"
        assert taking_over.result(PATIENCE_S)
        removing.result(PATIENCE_S)
        assert store.get("advisory-1000")


def test_a_file_whose_disk_does_not_answer_is_left_and_used_again(data: Path) -> None:
    """Some of what waits is being written when it is left, and is in the file before memory hands over the rest."""
    store = OptionalStore(data)
    begun = store.accept([made(3), made(4)])
    with store.connections.writing() as db:
        for revision in begun:
            tables.write_revision(db, revision)
        assert store.leave_stuck()
        assert not store.leave_stuck()
        known = {each.id: each.acknowledgement for each in store.latest("open").advisories}
        assert known == {"advisory-2": GIVEN, "advisory-3": None, "advisory-4": None}
        assert "does not answer" in (store.outage or "")
        ended, raised = store.append([cleared(2), made(5)])
        assert ended.acknowledgement == GIVEN
        assert ended.seq > begun[-1].seq
    assert store.attach()
    assert store.outage is None
    assert not store.connections._left
    store.close()
    with closing(Store(data)) as again:
        assert again.after(4) == [*begun, ended, raised]
        assert [each.id for each in again.latest("open").advisories] == ["advisory-5", "advisory-4", "advisory-3"]


@pytest.mark.parametrize("is_answer", [False, True])
def test_who_waits_for_a_disk_changes_nothing_once_its_file_was_left(is_answer: bool, data: Path) -> None:
    with closing(OptionalStore(data)) as store, ThreadPoolExecutor() as threads:
        with store.connections.numbering():  # as a read that the disk does not answer
            asked = partial(store.accept_answer, "advisory-2", GIVEN) if is_answer else partial(store.accept, [made(3)])
            waiting = threads.submit(asked)
            while store._number_lock.acquire(blocking=False):
                store._number_lock.release()
                time.sleep(0.001)
            assert store.leave_stuck()
            (given,) = store.append([made(3)])
        with pytest.raises(StoreError):
            waiting.result()
        assert [each.seq for each in store.after(epoch(time.time() - 60.0))] == [given.seq]


async def test_revisions_and_answers_are_published_from_memory_once_a_disk_does_not_answer(
    data: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("deconflict.operator.store.publisher.STUCK_S", 0.1)
    with closing(OptionalStore(data)) as store:
        publisher = Publisher(store, Measures())
        for number, answers in ((3, True), (4, False)):
            with store.connections.numbering(), store.connections.reading():
                if answers:
                    assert await publisher.acknowledge("advisory-2", GIVEN)
                await publisher.publish([made(number)])
                page = await publisher.after(publisher.last_seq - 1)
                assert [made(number).id] == [json.loads(line.text)["id"] for line in page.lines]
                assert store.outage
            assert store.attach()
            await publisher.renew_numbers()
        assert [each.id for each in store.latest("open").advisories] == ["advisory-4", "advisory-3", "advisory-2"]
        await publisher.close()


def test_a_store_begins_in_memory_on_a_disk_that_does_not_answer(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("deconflict.operator.store.optional.optional_connections.OPEN_STUCK_S", 0.3)
    with disk_that_can_stick(tmp_path) as disk:
        with closing(OptionalStore(disk / "data")) as store:
            store.append([made(1)])
        with stuck(disk):
            store = OptionalStore(disk / "data")
            assert "does not answer" in (store.outage or "")
            (given,) = store.append([made(2)])
        deadline_s = time.monotonic() + PATIENCE_S
        while not store.attach() and time.monotonic() < deadline_s:
            time.sleep(0.1)
        assert [each.id for each in store.after(0)] == ["advisory-1", "advisory-2"]
        assert store.after(given.seq - 1) == [given]
        store.close()
