"""What memory has is whole in whichever file takes its place, whatever comes between."""

import logging
import shutil
import sqlite3
import threading
from collections.abc import Sequence
from contextlib import closing, suppress
from pathlib import Path

import pytest

from benchmarks.faulty_files.faults import held_alone, locked, remove
from deconflict.operator.store.optional import stand_in
from deconflict.operator.store.optional.optional_store import OptionalStore
from deconflict.operator.store.optional.stand_in import STEP
from deconflict.operator.store.sqlite_connections import FILE_NAME
from deconflict.operator.store.store import Store, StoreError
from deconflict_client.situations import AnyRevision
from tests.helpers.made_advisories import cleared, made, situation
from tests.helpers.patience import PATIENCE_S


@pytest.fixture(autouse=True)
def impatient(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("optional.optional_connections.OPEN_TIMEOUT_S", "optional.stand_in.READ_TIMEOUT_S"):
        monkeypatch.setattr(f"deconflict.operator.store.{name}", 0.05)
    monkeypatch.setattr("deconflict.operator.store.sqlite_connections.BUSY_TIMEOUT_S", 0.2)


@pytest.fixture
def data(tmp_path: Path) -> Path:
    """Three numbers are given; advisory 2 is open."""
    directory = tmp_path / "data"
    with closing(Store(directory)) as store:
        store.append([made(1), cleared(1), made(2)])
    return directory


def assert_whole(store: Store, given: Sequence[AnyRevision]) -> None:
    """All that was given is in the file once, and the next number is a new one."""
    assert store.outage is None
    stored = [(each.id, each.revision) for each in store.after(0, -1)]
    assert len(stored) == len(set(stored))
    assert set(stored) >= {(each.id, each.revision) for each in given}
    (next_one,) = store.append([made(90_000)])
    assert next_one.seq > max(each.seq for each in given)


def test_what_gets_its_number_after_the_last_step_is_handed_over_also_if_it_is_much(data: Path) -> None:
    with locked(data / FILE_NAME):
        store = OptionalStore(data)
    file = store.connections.opened_again()
    assert file
    given = store.accept([made(number) for number in range(10, 10 + 2 * STEP + 1)])
    store._use_again(file)
    assert_whole(store, given)
    store.close()


@pytest.mark.parametrize("is_put_back", [False, True], ids=["removed", "older copy"])
def test_a_file_that_replaces_one_that_got_a_part_gets_all(data: Path, tmp_path: Path, is_put_back: bool) -> None:
    copy = shutil.copy(data / FILE_NAME, tmp_path / "copy.db")
    with locked(data / FILE_NAME):
        store = OptionalStore(data)
        given = store.append([made(number) for number in range(10, 10 + 3 * STEP + 1)])
    write = store.connections._write_rows
    with closing(sqlite3.connect(data / FILE_NAME, isolation_level=None)) as other:

        def lock_after_two_steps(*arguments: object) -> None:
            write(*arguments)  # type: ignore[arg-type]
            if other.execute("SELECT count(*) FROM revisions").fetchone()[0] > STEP + 3:
                other.execute("BEGIN IMMEDIATE")

        store.connections._write_rows = lock_after_two_steps  # type: ignore[method-assign,assignment]
        assert not store.attach()
        store.connections._write_rows = write  # type: ignore[method-assign]
    with closing(Store(data)) as first:
        assert len(first.after(3, -1)) == 2 * STEP
    remove(data / FILE_NAME)
    if is_put_back:
        shutil.copy(copy, data / FILE_NAME)
    assert store.attach()
    assert_whole(store, given)
    assert "advisory-2" in {each.id for each in store.latest("open").advisories}
    store.close()


def test_what_a_release_cannot_read_keeps_no_file_from_taking_the_place_of_memory(
    data: Path, caplog: pytest.LogCaptureFixture
) -> None:
    with closing(Store(data)) as store:
        store.append([situation(7)])
    with closing(sqlite3.connect(data / FILE_NAME)) as db, db:
        db.execute("UPDATE revisions SET document = replace(document, '\"situation\"', '\"other\"') WHERE seq = 4")
    with held_alone(data / FILE_NAME):
        memory = OptionalStore(data)
    given = memory.append([made(3), made(4).model_copy(update={"clearance_m": float("nan")}), made(5)])
    assert memory.attach()
    assert not memory.attach()
    assert_whole(memory, [given[0], given[2]])
    assert "can't read a stored advisory" in caplog.text
    memory.close()


def test_memory_begins_although_a_revision_was_no_row_of_a_database(data: Path) -> None:
    with closing(OptionalStore(data)) as store:
        store.accept([made(3), made(4, encounter=1 << 63)])
        store.flush()
        assert [each.id for each, _ in store.unwritable] == ["advisory-4"]
        store.accept([made(5, encounter=1 << 64)])
        assert store.leave_stuck()
        store.accept([made(6)])
        store.flush()
        assert [each.id for each in store.latest("open").advisories] == [f"advisory-{number}" for number in (6, 3, 2)]


def test_a_log_that_is_removed_while_its_file_is_in_use_costs_nothing(data: Path, tmp_path: Path) -> None:
    store = OptionalStore(data)
    given = store.append([made(3)])
    (data / f"{FILE_NAME}-wal").unlink()
    assert "-wal" in (store.connections.fault() or "")
    given += store.append([made(4)])
    assert store.attach()
    assert store.outage is None
    assert not store.attach()
    given += store.append([made(5)])
    killed = shutil.copytree(data, tmp_path / "killed")
    for directory in (data, killed):
        with closing(OptionalStore(directory)) as again:
            assert_whole(again, given)
    store.close()


def test_memory_that_is_full_is_handed_over_with_what_waits_for_it(data: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(stand_in, "MOST_BYTES", 100_000)
    with locked(data / FILE_NAME):
        store = OptionalStore(data)
    given: list[AnyRevision] = []
    with suppress(StoreError):
        for number in range(10, 10_000):
            given += store.append([made(number)])
    assert len(given) < 9_000
    given += store.accept([made(10_000 + number) for number in range(STEP)])
    assert store.attach()
    store.flush()
    assert_whole(store, given)
    store.close()


def test_memory_takes_more_than_what_it_begins_with(data: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(stand_in, "MOST_BYTES", 100_000)
    with closing(OptionalStore(data)) as store:
        store.accept([made(number) for number in range(10, 500)])
        store.flush()
        assert store.leave_stuck()
        store.accept([made(501)])
        store.flush()
        assert store.unstored == 0
        assert len(store.latest("open").advisories) == 492


def test_a_store_begins_with_memory_if_its_file_opens_and_answers_no_question(
    data: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr("deconflict.operator.store.optional.optional_store.OPEN_STUCK_S", 0.2)
    read, answers = OptionalStore._read_known, threading.Event()

    def slow_read(store: OptionalStore) -> object:
        if not store.outage:
            with store.connections.long_reading():
                answers.wait(PATIENCE_S)
        return read(store)

    monkeypatch.setattr(OptionalStore, "_read_known", slow_read)
    with caplog.at_level(logging.ERROR):
        store = OptionalStore(data)
    assert store.outage
    given = store.append([made(3)])
    answers.set()
    assert store.attach()
    assert_whole(store, given)
    store.close()
