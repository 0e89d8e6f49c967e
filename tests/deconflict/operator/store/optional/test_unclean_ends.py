"""A service that was killed while the file took nothing: none of the numbers that it gave is given again."""

import shutil
import time
from contextlib import closing
from pathlib import Path
from threading import Event

import pytest

from benchmarks.faulty_files.faults import locked
from deconflict.operator.store import publisher as publishing
from deconflict.operator.store.optional.optional_store import OptionalStore
from deconflict.operator.store.optional.stand_in import STEP
from deconflict.operator.store.publisher import Publisher
from deconflict.operator.store.recovery import reserved_numbers
from deconflict.operator.store.recovery.reserved_numbers import FILE_NAME as RESERVED
from deconflict.operator.store.recovery.reserved_numbers import epoch
from deconflict.operator.store.sqlite_connections import FILE_NAME
from deconflict.operator.store.store import Store
from deconflict_client.advisory import EVERY_KIND
from ingest.measures.measures import Measures
from tests.helpers.made_advisories import cleared, made


@pytest.fixture(autouse=True)
def impatient(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("sqlite_connections.BUSY_TIMEOUT_S", "optional.optional_connections.OPEN_TIMEOUT_S"):
        monkeypatch.setattr(f"deconflict.operator.store.{name}", 0.05)


@pytest.fixture
def data(tmp_path: Path) -> Path:
    """Three numbers are given."""
    directory = tmp_path / "data"
    with closing(Store(directory)) as store:
        store.append([made(1), made(2), made(3)])
    return directory


def as_killed(data: Path, number: int = 0) -> Path:
    """What a kill would leave now."""
    return shutil.copytree(data, data.with_name(f"killed-{number}"))


async def published_while_locked(data: Path) -> tuple[list[int], Path]:
    """Numbers that subscribers received while the file was locked, and what a kill would leave then."""
    with closing(OptionalStore(data)) as store, locked(data / FILE_NAME):
        publisher = Publisher(store, Measures())
        given = [each.seq for number in (4, 5) for each in await publisher.publish([made(number), made(number, 2)])]
        assert [line.seq for line in (await publisher.after(3)).lines] == given
        return given, as_killed(data)


async def test_numbers_given_while_the_file_was_locked_are_not_given_again_after_a_kill(data: Path) -> None:
    before = epoch(time.time())
    given, left = await published_while_locked(data)
    assert given == [4, 5, 6, 7]
    with closing(OptionalStore(left)) as store:
        assert store.last_seq() >= before
        (new,) = store.append([made(6)])
        assert new.seq not in given
        for known in (3, *given):
            assert store.page_after(known, EVERY_KIND, 10).removed > known, "its subscriber is to read again"
        again = as_killed(left, 1)
    with closing(OptionalStore(again)) as store:
        assert [each.seq for each in store.append([made(7)])] == [new.seq + 1], "only one epoch for one kill"


async def test_numbers_given_while_the_file_was_locked_are_not_given_again_if_it_is_locked_at_the_start(
    data: Path,
) -> None:
    given, left = await published_while_locked(data)
    with locked(left / FILE_NAME):
        store = OptionalStore(left)
        (new,) = store.append([made(6)])
    assert store.attach()
    assert new.seq not in given
    assert [each.seq for each in store.append([made(7)])] == [new.seq + 1]
    assert all(store.page_after(known, EVERY_KIND, 10).removed > known for known in (3, *given))
    store.close()


async def test_a_kill_after_everything_was_stored_begins_no_epoch(data: Path) -> None:
    store = OptionalStore(data)
    publisher = Publisher(store, Measures())
    with locked(data / FILE_NAME):
        await publisher.publish([made(4)])
    await publisher.publish([cleared(4)])
    with closing(OptionalStore(as_killed(data))) as after_kill:
        assert [each.seq for each in after_kill.append([made(5)])] == [6]
        assert after_kill.page_after(4, EVERY_KIND, 10).removed == 0
    store.close()


async def test_a_full_disk_takes_the_note_that_numbers_were_given(data: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object) -> None:
        raise OSError("no space left on device")

    monkeypatch.setattr(reserved_numbers, "replace_file", fail)
    given, left = await published_while_locked(data)
    monkeypatch.undo()
    with closing(OptionalStore(left)) as store:
        assert store.append([made(6)])[0].seq not in given


@pytest.mark.parametrize("is_empty", [False, True])
def test_numbers_after_a_lost_file_begin_a_new_epoch_and_it_is_said(data: Path, is_empty: bool) -> None:
    reserved, before = int((data / RESERVED).read_text()), epoch(time.time())
    for part in data.glob(f"{FILE_NAME}*"):
        part.unlink()
    if is_empty:
        (data / FILE_NAME).touch()
    for _ in range(2):
        with closing(OptionalStore(data)) as store:
            assert store.connections.renewal is not None or store.last_seq() > before
            (new,) = store.append([made(9)])
            assert new.seq > before > reserved
            assert store.page_after(3, EVERY_KIND, 10).removed > 3, "its subscriber is to read again"
    assert store.connections.renewal is None, "the next start has a file"
    assert new.seq < epoch(time.time()), "and begins no epoch of its own"


def test_a_lost_file_is_called_lost_and_a_new_directory_is_not(data: Path, tmp_path: Path) -> None:
    (data / FILE_NAME).unlink()
    with closing(OptionalStore(data)) as store:
        assert "was gone at the start" in str(store.connections.renewal)
        assert "a new epoch" in str(store.connections.renewal)
    with closing(OptionalStore(tmp_path / "new")) as store:
        assert store.connections.renewal is None


async def test_a_note_of_an_older_release_is_written_whole(data: Path) -> None:
    last = abs(int((data / RESERVED).read_text()))
    (data / RESERVED).write_text(f"{last}\n")
    given, left = await published_while_locked(data)
    assert (left / RESERVED).read_text() == f"-{last}\n"
    with closing(OptionalStore(left)) as store:
        assert store.append([made(6)])[0].seq not in given


async def test_a_stuck_disk_that_takes_no_note_delays_no_revision(data: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    free = Event()
    monkeypatch.setattr(publishing, "DISK_TIMEOUT_S", 0.05)
    monkeypatch.setattr("os.fsync", lambda _: free.wait(20.0))
    with closing(OptionalStore(data)) as store, locked(data / FILE_NAME):
        publisher = Publisher(store, Measures())
        began_s = time.monotonic()
        for number in range(10, 30):
            await publisher.publish([made(number)])
        assert time.monotonic() - began_s < 10.0
        free.set()


def test_a_kill_while_much_is_handed_over_gives_no_number_twice(data: Path) -> None:
    with locked(data / FILE_NAME):
        store = OptionalStore(data)
        given = store.append([made(number) for number in range(10, 10 + STEP + 5)])
    file = store.connections.opened_again()
    assert file
    left = as_killed(data)
    file.close()
    with closing(OptionalStore(left)) as after_kill:
        assert after_kill.append([made(6)])[0].seq > given[-1].seq
    assert store.attach()
    store.close()
    with closing(OptionalStore(data)) as again:
        assert [each.seq for each in again.append([made(6)])] == [given[-1].seq + 1]


def test_a_thread_that_tries_the_file_after_the_store_was_closed_begins_no_epoch(data: Path) -> None:
    store = OptionalStore(data)
    store.close()
    assert not store.attach()
    with closing(OptionalStore(data)) as again:
        assert [each.seq for each in again.append([made(4)])] == [4]
        assert again.page_after(3, EVERY_KIND, 10).removed == 0
