"""A database that is damaged, at its start or while it is used: what can be read goes on under its numbers."""

import logging
import sqlite3
import time
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from threading import Thread

import pytest

from benchmarks.faulty_files.faults import held_alone
from deconflict.operator.store.optional.optional_connections import OptionalConnections
from deconflict.operator.store.optional.optional_store import OptionalStore
from deconflict.operator.store.recovery.reserved_numbers import BLOCK, epoch
from deconflict.operator.store.recovery.reserved_numbers import FILE_NAME as RESERVED
from deconflict.operator.store.sqlite_connections import FILE_NAME, DamagedStoreError
from deconflict.operator.store.store import Store
from deconflict_client.advisory import Acknowledgement
from tests.deconflict.operator.store.made_damage import PAGE_BYTES, damage, page, page_of
from tests.deconflict.roles.made_disks import disk_that_can_stick, stuck
from tests.helpers.made_advisories import ROBOTS, START, cleared, made
from tests.helpers.patience import PATIENCE_S


def filled(directory: Path, count: int = 400) -> Path:
    """A closed database; returns its path. The first advisory is cleared, the second acknowledged, the others open."""
    store = Store(directory)
    store.append([made(number) for number in range(1, count - 1)])
    store.append([cleared(1)])
    store.acknowledge("advisory-2", Acknowledgement(name="Ada", reason="seen", at=START))
    store.set_position("mes", 17)
    store.flush()
    store.close()
    return store.path


def read_whole(store: Store) -> None:
    """Read every table, so that damage is found."""
    for read in (lambda: store.after(0, -1), lambda: store.latest("all"), store.burdens_s):
        try:
            read()
        except DamagedStoreError:
            assert store.last_seq() > 0


def garble_first_page(path: Path) -> None:
    damage(path, page(1))


def garble_header(path: Path) -> None:
    damage(path, slice(0, 100))


def garble_advisories(path: Path) -> None:
    damage(path, page(page_of(path, "advisories")))


@pytest.mark.parametrize("harm", [garble_first_page, garble_header, garble_advisories])
def test_what_follows_from_the_revisions_is_restored(tmp_path: Path, harm: Callable[[Path], None]) -> None:
    path = filled(tmp_path)
    sound = Store(tmp_path)
    expected = (sound.after(0, -1), sound.latest("open").advisories, sound.latest("cleared").advisories)
    by_robot, encounters = sound.latest("all", robot=ROBOTS[0]), sound.encounters_after(("", ""), 100)
    sound.close()
    harm(path)
    store = Store(tmp_path)
    read_whole(store)
    found = (store.after(0, -1), store.latest("open").advisories, store.latest("cleared").advisories)
    assert found == expected
    assert store.latest("all", robot=ROBOTS[0]).advisories == by_robot.advisories
    assert store.encounters_after(("", ""), 100) == encounters
    assert store.position("mes") == 17
    assert store.connections.renewal
    assert store.connections.renewal.salvage == (400, 0, True)
    assert store.append([made(9_000)])[0].seq > 400
    store.close()


@pytest.mark.parametrize("kept_share", [0.5, 0.9])
def test_what_can_be_read_of_a_damaged_file_is_kept(
    tmp_path: Path, kept_share: float, caplog: pytest.LogCaptureFixture
) -> None:
    path = filled(tmp_path)
    whole = path.read_bytes()
    path.write_bytes(whole[: int(len(whole) * kept_share)])
    store = Store(tmp_path)
    read_whole(store)
    kept = store.after(0, -1)
    assert 400 * kept_share / 2 < len(kept) < 400
    assert store.connections.renewal
    salvage = store.connections.renewal.salvage
    assert (salvage.copied, salvage.is_complete) == (len(kept), True)
    assert salvage.lost >= 400 - len(kept)
    assert store.append([made(9_000)])[0].seq > 400
    assert {advisory.id for advisory in store.latest("all").advisories} == {each.id for each in kept} | {
        "advisory-9000"
    }
    store.close()
    assert (tmp_path / store.connections.renewal.file).stat().st_size == int(len(whole) * kept_share)
    assert store.connections.renewal.file in caplog.text


def test_a_damaged_page_costs_the_revisions_on_it(tmp_path: Path) -> None:
    path = filled(tmp_path)
    at = path.read_bytes().index(b'"advisory-200"') // PAGE_BYTES + 1
    damage(path, page(at))
    store = Store(tmp_path)
    read_whole(store)
    assert store.connections.renewal
    assert 0 < store.connections.renewal.salvage.lost < 20
    assert len(store.after(0, -1)) == 400 - store.connections.renewal.salvage.lost
    store.close()


@pytest.mark.parametrize("content", [b"", b"not a database at all " * 1_000])
def test_a_damaged_file_of_which_nothing_can_be_read_is_begun_anew_beyond_its_last_number(
    tmp_path: Path, content: bytes
) -> None:
    path = filled(tmp_path)
    path.write_bytes(content)
    store = Store(tmp_path)
    assert store.after(0) == []
    (stored,) = store.append([made(1)])
    assert 400 < stored.seq <= (400 + BLOCK if content else epoch(time.time())) + 1
    store.close()
    again = Store(tmp_path)
    assert [each.seq for each in again.append([made(2)])] == [stored.seq + 1]
    again.close()


def test_a_follower_of_a_stream_continues_after_what_could_be_read(tmp_path: Path) -> None:
    path = filled(tmp_path)
    path.write_bytes(b"not a database at all " * 1_000)
    store = Store(tmp_path, follows_stream=True)
    assert store.last_seq() == 0
    store.close()


def test_a_file_that_is_damaged_while_revisions_wait_loses_none_of_them(tmp_path: Path) -> None:
    path = filled(tmp_path)
    store = Store(tmp_path)
    accepted = store.accept([made(501), made(502)])
    damage(path, page(page_of(path, "revisions")))
    damage(path, page(page_of(path, "advisories")))
    for _ in range(2):
        read_whole(store)
    assert store.connections.renewal
    assert [advisory.seq for advisory in accepted] == [401, 402]
    assert store.after(400) == accepted
    store.flush()
    assert (store.unstored, store.after(400)) == (0, accepted)
    assert [each.seq for each in store.append([made(503)])] == [403]
    store.close()


def test_a_file_that_is_damaged_again_at_once_is_not_replaced_again(tmp_path: Path) -> None:
    path = filled(tmp_path)
    damage(path, page(1))
    store = Store(tmp_path)
    store.connections._file.writer.execute("PRAGMA wal_checkpoint(TRUNCATE)")
    damage(path, page(page_of(path, "revisions")))
    for _ in range(3):
        with pytest.raises(DamagedStoreError):
            store.open_at(START.timestamp())
    assert len(list(tmp_path.glob("advisories-*.db"))) == 1
    store.close()


def test_a_reserved_number_that_cannot_be_read_is_written_anew(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    filled(tmp_path)
    (tmp_path / RESERVED).write_text("not a number")
    store = Store(tmp_path)
    assert "written anew" in caplog.text
    store.append([made(9_000)])
    store.close()
    assert int((tmp_path / RESERVED).read_text()) > 401


def test_a_stored_revision_that_cannot_be_read_holds_up_no_other(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    filled(tmp_path, 10)
    with closing(sqlite3.connect(tmp_path / FILE_NAME)) as db:
        db.execute("UPDATE revisions SET document = replace(document, 'conflict', 'c0nflict') WHERE seq = 4")
        db.commit()
    store = Store(tmp_path)
    with caplog.at_level(logging.ERROR):
        assert [each.seq for each in store.after(0, -1)] == [1, 2, 3, 5, 6, 7, 8, 9, 10]
    assert "advisory-4" in caplog.text
    page = store.page_after(0, {"conflict"}, 100)
    assert ([each.seq for each in page.revisions], page.last) == ([1, 2, 3, 5, 6, 7, 8, 9, 10], 10)
    assert "advisory-4" not in {each.id for each in store.latest("all").advisories}
    assert store.get("advisory-4") == []
    store.close()


def test_a_document_in_which_a_query_finds_damage_is_left_behind_in_the_old_file(tmp_path: Path) -> None:
    filled(tmp_path, 10)
    with closing(sqlite3.connect(tmp_path / FILE_NAME)) as db:
        db.execute("UPDATE revisions SET document = replace(document, ':', ';') WHERE seq = 4")
        db.commit()
    store = Store(tmp_path)
    with pytest.raises(DamagedStoreError, match="malformed JSON"):
        store.raised_between(START.timestamp() - 60, START.timestamp() + 3_600)
    assert sum(store.raised_between(START.timestamp() - 60, START.timestamp() + 3_600).values()) == 7
    assert store.connections.renewal
    assert store.connections.renewal.salvage == (9, 1, True)
    store.close()


@pytest.mark.parametrize("table", ["revisions", "advisories", "encounters", "burdens", "positions"])
def test_a_damaged_page_keeps_no_store_from_beginning(tmp_path: Path, table: str) -> None:
    path = filled(tmp_path)
    damage(path, page(page_of(path, table)))
    with closing(OptionalStore(tmp_path)) as store:
        assert store.connections.renewal
        assert store.outage is None
        assert store.append([made(1_000)])[0].seq > 400


def test_a_damaged_file_that_cannot_be_set_aside_leaves_memory_at_the_start(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = filled(tmp_path)
    damage(path, page(page_of(path, "burdens")))
    monkeypatch.setattr(OptionalConnections, "_may_renew", lambda _: False)
    with closing(OptionalStore(tmp_path)) as store:
        assert store.outage
        assert store.append([made(1_000)])[0].seq > epoch(time.time() - 60.0)
        monkeypatch.undo()
        while store.outage:
            store.attach()
        assert store.get("advisory-1000")
        assert store.connections.renewal


@pytest.mark.parametrize("table", ["revisions", "positions"])
def test_a_file_in_which_damage_is_found_while_memory_is_in_use_is_begun_anew(tmp_path: Path, table: str) -> None:
    path = filled(tmp_path)
    with held_alone(path):
        store = OptionalStore(tmp_path)
        (given,) = store.append([made(1_000)])
    damage(path, page(page_of(path, table)))
    with pytest.raises(DamagedStoreError):
        store.attach()
    assert store.outage
    assert "malformed" in store.outage
    assert store.attach()
    assert store.outage is None
    assert store.connections.renewal
    assert store.get("advisory-1000") == [given]
    store.close()


def test_a_damaged_file_of_a_disk_that_hangs_is_set_aside_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("deconflict.operator.store.optional.optional_connections.OPEN_STUCK_S", 0.2)
    with disk_that_can_stick(tmp_path) as disk:
        path = filled(disk / "data")
        garble_first_page(path)
        with stuck(disk):
            store = OptionalStore(path.parent)
            assert store.outage
            attaching = Thread(target=store.attach, daemon=True)
            attaching.start()
            attaching.join(1.2)
            assert attaching.is_alive(), "two threads wait for the disk, with names of two seconds"
        attaching.join(PATIENCE_S)
        while store.outage:
            store.attach()
        assert store.connections.renewal
        assert store.connections.renewal.salvage.copied == 400
        assert len([each for each in path.parent.iterdir() if each.name.endswith(".db")]) == 2
        store.close()
