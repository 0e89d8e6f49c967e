"""A disk that answers nothing for a second time, or while memory takes the place of its file."""

import asyncio
import sqlite3
import subprocess
import threading
from contextlib import closing
from pathlib import Path

import pytest

from benchmarks.faulty_files.faults import held_alone
from deconflict.advisories.encounter_numbers import FORGOTTEN
from deconflict.operator.store.optional.optional_store import OptionalStore
from deconflict.operator.store.optional.stand_in import State
from deconflict.operator.store.publisher import Publisher
from deconflict.operator.store.sqlite_connections import StoreConnections
from deconflict.operator.store.store import Store
from deconflict_client.advisory import ADVISORY_KINDS, Acknowledgement
from ingest.measures.measures import Measures
from tests.deconflict.roles.made_disks import disk_that_can_stick, stuck
from tests.helpers.made_advisories import START, cleared, made
from tests.helpers.patience import PATIENCE_S


@pytest.fixture(autouse=True)
def impatient(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("deconflict.operator.store.publisher.STUCK_S", 0.2)


async def attached(store: OptionalStore) -> None:
    async with asyncio.timeout(PATIENCE_S):
        while store.outage:
            await asyncio.to_thread(store.attach)


async def test_memory_goes_on_if_the_disk_sticks_again_while_the_file_takes_over(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with disk_that_can_stick(tmp_path) as disk:
        store = OptionalStore(disk / "data")
        publisher = Publisher(store, Measures())
        await publisher.publish([made(1)])
        with store.connections.numbering():
            await publisher.publish([made(2)])
        open_file = store.connections.opened_again

        def open_file_of_a_disk_that_sticks() -> StoreConnections | None:
            file = open_file()
            subprocess.run(["fsfreeze", "-f", str(disk)], check=True)
            return file

        monkeypatch.setattr(store.connections, "opened_again", open_file_of_a_disk_that_sticks)
        attaching = asyncio.create_task(asyncio.to_thread(store.attach))
        try:
            while not store.connections._locks.writer.locked():
                await asyncio.sleep(0.01)
            async with asyncio.timeout(PATIENCE_S):
                published = await publisher.publish([cleared(1), made(3)])
                open_now = await asyncio.to_thread(store.latest, "open")
            assert [each.id for each in open_now.advisories] == ["advisory-3", "advisory-2"]
            assert store.outage
        finally:
            subprocess.run(["fsfreeze", "-u", str(disk)], check=True)
        await attaching
        assert store.outage, "its place was taken while it waited"
        monkeypatch.undo()
        await publisher.publish([made(4)])
        await attached(store)
        stored = store.after(0)
        assert [each.seq for each in stored] == sorted({each.seq for each in stored})
        assert {(each.id, each.revision) for each in stored} == {
            (f"advisory-{number}", revision) for number, revision in ((1, 1), (2, 1), (1, 2), (3, 1), (4, 1))
        }
        assert [each for each in stored if each.seq >= published[0].seq][:2] == published
        store.close()


async def test_a_thread_that_left_a_file_late_does_not_replace_the_memory_that_took_its_place(tmp_path: Path) -> None:
    with closing(OptionalStore(tmp_path)) as store:
        publisher = Publisher(store, Measures())
        await publisher.publish([made(1)])
        read, begun, answers = store.connections._last_state, threading.Event(), threading.Event()

        def slow_state(file: StoreConnections) -> State | None:
            begun.set()
            answers.wait(PATIENCE_S)
            return read(file)

        store.connections._last_state = slow_state  # type: ignore[method-assign]
        store.path.rename(tmp_path / "elsewhere.db")
        attaching = asyncio.create_task(asyncio.to_thread(store.attach))
        await asyncio.to_thread(begun.wait, PATIENCE_S)
        async with asyncio.timeout(PATIENCE_S):
            published = await publisher.publish([made(2)])
        answers.set()
        await attaching
        assert published[0] in store.after(0)
        assert [each.id for each in store.latest("open").advisories] == ["advisory-2", "advisory-1"]


@pytest.mark.parametrize("is_left", [False, True])
def test_a_store_is_closed_although_its_disk_does_not_answer(
    is_left: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr("deconflict.operator.store.optional.optional_store.OPEN_STUCK_S", 0.2, raising=False)
    with disk_that_can_stick(tmp_path) as disk:
        store = OptionalStore(disk / "data")
        closing_store = threading.Thread(target=store.close, daemon=True)
        with stuck(disk):
            if is_left:
                assert store.leave_stuck()
            store.accept([made(1)])
            closing_store.start()
            closing_store.join(PATIENCE_S)
            assert not closing_store.is_alive()
        assert "may be lost" in caplog.text


@pytest.mark.parametrize("is_answer", [False, True])
def test_what_gets_its_number_as_a_file_is_left_is_in_memory(is_answer: bool, tmp_path: Path) -> None:
    with closing(OptionalStore(tmp_path)) as store:
        store.accept([made(1)])
        store.flush()
        refuse, leaving = store._refuse_if_left, threading.Thread(target=store.leave_stuck)

        def refuse_before_it_is_left(lock: object) -> None:
            refuse(lock)
            leaving.start()
            leaving.join(0.2)

        store._refuse_if_left = refuse_before_it_is_left  # type: ignore[method-assign]
        if is_answer:
            given = store.accept_answer("advisory-1", Acknowledgement(name="Kim", reason="seen", at=START))
        else:
            (given,) = store.accept([made(1, 2)])
        store._refuse_if_left = refuse  # type: ignore[method-assign]
        leaving.join()
        store.flush()
        assert store.get("advisory-1")[-1] == given
        while store.outage:
            store.attach()
        assert [each.revision for each in store.get("advisory-1")] == [1, 2 - is_answer]


async def test_revisions_go_out_if_the_disk_sticks_again_as_soon_as_it_was_left(tmp_path: Path) -> None:
    with closing(OptionalStore(tmp_path)) as store:
        publisher, leave, answers = Publisher(store, Measures()), store.leave_stuck, threading.Event()

        def hand_over() -> None:
            with store._number_lock:
                answers.wait(PATIENCE_S)

        def leave_as_it_sticks_again() -> bool:
            is_left = leave()
            if not answers.is_set() and not threads:
                threads.append(threading.Thread(target=hand_over))
                threads[0].start()
            return is_left

        threads: list[threading.Thread] = []
        store.leave_stuck = leave_as_it_sticks_again  # type: ignore[method-assign]
        with store.connections.numbering():
            async with asyncio.timeout(PATIENCE_S):
                published = await publisher.publish([made(1)])
        answers.set()
        threads[0].join()
        assert store.after(0) == published


def test_an_outlet_misses_nothing_if_a_disk_sticks_after_it_took_what_is_over(tmp_path: Path) -> None:
    with closing(Store(tmp_path)) as before:
        before.append([made(1), made(2)])
        before.set_position("hook", 2)
        before.flush()
    with held_alone(before.path):
        store = OptionalStore(tmp_path)
        store.note_engine()
        sent, *_ = store.append([made(number) for number in range(3, 8)])
        store.set_position("hook", sent.seq)
    stand_in = store.connections._stand_in
    assert stand_in
    finish = stand_in.finish

    def finish_as_the_disk_sticks(file: sqlite3.Connection, now_s: float) -> None:
        finish(file, now_s)
        leaving = threading.Thread(target=store.leave_stuck)
        leaving.start()
        leaving.join()

    stand_in.finish = finish_as_the_disk_sticks  # type: ignore[method-assign]
    store.attach()
    assert store.outage
    stand_in.finish = finish  # type: ignore[method-assign]
    store.append([made(8)])
    while store.outage:
        store.attach()
    unsent = store.page_after(store.position("hook") or 0, ADVISORY_KINDS, 100).revisions
    assert [each.id for each in unsent] == [f"advisory-{number}" for number in (4, 5, 6, 7, 1, 2, 8)]
    store.close()


def test_memory_knows_what_outlets_have_not_sent_who_yielded_and_the_numbers_of_encounters(tmp_path: Path) -> None:
    with closing(Store(tmp_path)) as before:
        before.append([made(1, encounter=7), made(2)])
        before.set_position("hook", 1)
        before.flush()
    with closing(OptionalStore(tmp_path)) as store:
        store.accept([cleared(2, advised_wait_s={"Acme": 4.0})])
        store.flush()
        store.accept([made(3, advised_wait_s={"Acme": 1.0})])
        assert store.leave_stuck()
        assert store.position("hook") == 1
        unsent = store.page_after(1, ADVISORY_KINDS, 10).revisions
        assert [(each.id, each.revision) for each in unsent] == [
            ("advisory-2", 1),
            ("advisory-2", 2),
            ("advisory-3", 1),
        ]
        assert store.burdens_s() == {"Acme": 5.0}
        assert dict(store.encounters_after(("", ""), 10))[FORGOTTEN] == 7
        store.set_position("hook", unsent[-1].seq)
        store.flush()
        while store.outage:
            store.attach()
        assert store.burdens_s() == {"Acme": 5.0}
        assert store.position("hook") == unsent[-1].seq
    with closing(Store(tmp_path)) as again:
        assert again.burdens_s() == {"Acme": 5.0}
        assert [each.id for each in again.latest("open").advisories] == ["advisory-3", "advisory-1"]


def test_an_answer_that_waits_for_a_disk_that_hangs_holds_in_memory_and_in_the_file(tmp_path: Path) -> None:
    given = Acknowledgement(name="Kim", reason="seen", at=START)
    with closing(Store(tmp_path)) as before:
        before.append([made(1)])
    with closing(OptionalStore(tmp_path)) as store:
        store.accept_answer("advisory-1", given)
        assert store.leave_stuck()
        store.append([made(2)])
        (later,) = store.append([made(1, 2)])
        assert later.acknowledgement == given
        while store.outage:
            store.attach()
        assert [(each.revision, each.acknowledgement) for each in store.get("advisory-1")] == [
            (1, None),
            (1, given),
            (2, given),
        ]
        assert store.append([made(1, 3)])[0].acknowledgement == given


def test_an_outlet_moves_on_while_the_disk_does_not_answer(tmp_path: Path) -> None:
    with closing(OptionalStore(tmp_path)) as store:
        with store._number_lock:
            moving = threading.Thread(target=store.set_position, args=("hook", 3), daemon=True)
            moving.start()
            moving.join(PATIENCE_S)
            assert not moving.is_alive()
        assert store.position("hook") == 3


def test_memory_takes_what_is_published_while_a_note_waits_for_the_disk(tmp_path: Path) -> None:
    with closing(OptionalStore(tmp_path)) as store:
        with store.connections._note_lock:
            assert store.leave_stuck()
            store.accept([made(1)])
            storing = threading.Thread(target=store.flush, daemon=True)
            storing.start()
            storing.join(PATIENCE_S)
            assert not storing.is_alive()
        assert store.unstored == 0
