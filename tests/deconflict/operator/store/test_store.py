import sqlite3
import subprocess
import sys
from datetime import timedelta
from pathlib import Path
from threading import Thread

import pytest

from deconflict.operator.store.migrations import UPGRADES
from deconflict.operator.store.sqlite_connections import FILE_NAME
from deconflict.operator.store.store import Store, StoreError
from deconflict_client.advisory import Acknowledgement, ClearedCode, Hold, Recommendation
from tests.deconflict.operator.store.reopened_store import reopened
from tests.helpers.made_advisories import ROBOTS, START, cleared, deadlock, made, situation

ROOT = Path(__file__).parents[4]


def test_revisions_are_numbered_in_order_and_read_back_whole(store: Store) -> None:
    sent = [made(1), made(2), made(1, 2)]
    stored = store.append(sent)
    assert [advisory.seq for advisory in stored] == [1, 2, 3]
    assert [advisory.model_copy(update={"seq": 0}) for advisory in stored] == sent
    assert store.after(0) == stored
    again = reopened(store)
    assert again.after(0) == stored
    assert again.last_seq() == 3
    again.close()


def test_after_gives_what_lies_above_and_no_more_than_the_limit(store: Store) -> None:
    store.append([made(number) for number in range(1, 8)])
    assert [advisory.seq for advisory in store.after(2, limit=3)] == [3, 4, 5]
    assert [advisory.seq for advisory in store.after(5)] == [6, 7]
    assert store.after(7) == []


def test_a_revision_sent_again_keeps_its_number_and_its_first_content(store: Store) -> None:
    (first,) = store.append([made(1)])
    resent = store.append([made(1, summary="another"), made(2), made(2)])
    assert resent[0] == first
    assert [advisory.seq for advisory in resent] == [1, 2, 2]
    assert [advisory.seq for advisory in store.after(0)] == [1, 2]


def test_latest_gives_the_newest_revision_of_each_and_open_means_not_cleared(store: Store) -> None:
    store.append([made(1), made(2), made(3), made(1, 2), cleared(2)])
    assert [(advisory.id, advisory.revision) for advisory in store.latest("open").advisories] == [
        ("advisory-1", 2),
        ("advisory-3", 1),
    ]
    assert [advisory.id for advisory in store.latest("cleared").advisories] == ["advisory-2"]
    listing = store.latest("all", limit=2)
    assert [advisory.id for advisory in listing.advisories] == ["advisory-2", "advisory-1"]
    assert (listing.seq, listing.more) == (5, True)
    assert not store.latest("all", limit=3).more


def test_an_older_revision_that_comes_late_is_kept_but_not_the_latest(store: Store) -> None:
    store.append([made(1), cleared(1, 3)])
    store.append([made(1, 2)])
    assert store.latest("open").advisories == []
    assert [advisory.revision for advisory in store.get("advisory-1")] == [1, 2, 3]


def test_latest_by_vendor_and_by_robot_looks_at_both_robots(store: Store) -> None:
    store.append([made(1), made(2, vendors=("Borealis", "Cargo")), made(3, robots=("a", ROBOTS[1]))])

    def ids(**wanted: str) -> list[str]:
        return [advisory.id for advisory in store.latest(**wanted).advisories]  # type: ignore[arg-type]

    assert ids(vendor="Borealis") == ["advisory-3", "advisory-2", "advisory-1"]
    assert ids(vendor="Cargo") == ["advisory-2"]
    assert ids(robot=ROBOTS[0]) == ["advisory-2", "advisory-1"]
    assert ids(robot="a", vendor="Cargo") == []
    assert ids(kind="something else") == []


def test_a_failed_append_stores_none_of_its_revisions(store: Store) -> None:
    raw = sqlite3.connect(store.path)
    raw.execute(
        "CREATE TRIGGER refuse BEFORE INSERT ON revisions WHEN new.id = 'advisory-2' "
        "BEGIN SELECT RAISE(ABORT, 'refused'); END"
    )
    raw.close()
    with pytest.raises(StoreError, match="refused"):
        store.append([made(1), made(2)])
    assert (store.after(0), store.latest("open").advisories, store.last_seq()) == ([], [], 0)
    assert store.append([made(3)])[0].seq == 1


def test_many_threads_may_append_and_read(store: Store) -> None:
    def write(first: int) -> None:
        for number in range(first, first + 20):
            store.append([made(number)])
            assert store.latest("all", limit=1).seq <= store.last_seq()

    threads = [Thread(target=write, args=(100 * number,)) for number in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert [advisory.seq for advisory in store.after(0)] == list(range(1, 81))
    assert len({advisory.id for advisory in store.after(0)}) == 80


def test_kill_9_loses_nothing_that_append_returned_and_doubles_nothing(tmp_path: Path) -> None:
    writer = subprocess.Popen(
        [sys.executable, "-m", "tests.deconflict.roles.endless_writer", str(tmp_path)], cwd=ROOT, stdout=subprocess.PIPE
    )
    assert writer.stdout
    messages = [writer.stdout.readline() for _ in range(50)]
    writer.kill()
    messages += writer.stdout.readlines()
    writer.stdout.close()
    writer.wait()
    acknowledged = [(name, int(revision), int(seq)) for name, revision, seq in map(bytes.split, messages)]
    assert len(acknowledged) >= 50

    store = Store(tmp_path)
    kept = {(advisory.id.encode(), advisory.revision): advisory.seq for advisory in store.after(0, limit=-1)}
    assert all(kept[name, revision] == seq for name, revision, seq in acknowledged)
    assert sorted(kept.values()) == list(range(1, len(kept) + 1))
    resent = store.append([made(number, revision) for number in range(1, 27) for revision in (1, 2)])
    assert len({advisory.seq for advisory in resent}) == 52
    assert store.last_seq() == max(len(kept), 52)
    store.close()


def test_a_file_of_a_newer_release_is_refused_and_left_alone(store: Store) -> None:
    store.append([made(1)])
    newer = sqlite3.connect(store.path)
    newer.execute(f"PRAGMA user_version = {len(UPGRADES) + 1}")
    newer.close()
    with pytest.raises(StoreError, match="run the newer release"):
        reopened(store)


def test_an_older_file_is_upgraded_with_what_it_holds(store: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    stored = store.append([made(1)])
    step = ("ALTER TABLE advisories ADD COLUMN note TEXT",)
    monkeypatch.setattr("deconflict.operator.store.sqlite_connections.UPGRADES", (*UPGRADES, step))
    again = reopened(store)
    again.close()
    again = Store(store.path.parent)
    assert again.after(0) == stored
    again.close()
    raw = sqlite3.connect(store.path)
    assert raw.execute("SELECT note FROM advisories").fetchall() == [(None,)]
    raw.close()


def test_a_file_of_the_first_format_is_read_and_searched_by_robot(tmp_path: Path) -> None:
    old = sqlite3.connect(tmp_path / FILE_NAME)
    for statement in UPGRADES[0]:
        old.execute(statement)
    old.execute("INSERT INTO revisions VALUES (7, 'advisory-1', 1, ?)", (made(1, seq=7).model_dump_json(),))
    row = ("advisory-1", 1, 7, 1, START.timestamp(), "conflict", *ROBOTS, "Acme", "Borealis")
    old.execute("INSERT INTO advisories VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?)", row)
    old.execute("PRAGMA user_version = 1")
    old.commit()
    old.close()
    store = Store(tmp_path)
    assert [advisory.id for advisory in store.latest(robot=ROBOTS[1]).advisories] == ["advisory-1"]
    assert [advisory.id for advisory in store.latest(vendor="Acme").advisories] == ["advisory-1"]
    assert store.latest(vendor="Cargo").advisories == []
    assert [advisory.seq for advisory in store.append([made(2)])] == [8]
    store.close()


def test_a_deadlock_of_three_is_stored_and_found_by_each_of_its_robots(store: Store) -> None:
    (stored,) = store.append([deadlock("a", "b", "c")])
    for robot in stored.robots:
        assert store.latest(kind="deadlock", robot=robot).advisories == [stored]
    assert store.latest(kind="conflict").advisories == []
    assert dict(store.encounters_after(("", ""), 100)) == {}


def test_the_yielded_time_of_each_vendor_is_summed_once_and_kept(store: Store) -> None:
    advice = Recommendation(holds=(Hold(robot=ROBOTS[1], hold_s=4.0),), cost_s=4.0, bound_s=4.0, proven_optimal=True)
    advised = made(1, recommendation=advice)
    over = advised.cleared_revision(START.timestamp(), ClearedCode.PASSED, "over")
    store.append([advised, over])
    store.append([over])
    store.acknowledge("advisory-1", Acknowledgement(name="Ada", reason="seen", at=START))
    assert store.burdens_s() == {"Borealis": 4.0}
    store.append([cleared(2, advised_wait_s={"Borealis": 4.0})])
    again = reopened(store)
    assert again.burdens_s() == {"Borealis": 8.0}
    again.close()


def test_an_upgrade_that_fails_leaves_the_file_as_it_was(store: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    stored = store.append([made(1)])
    step = ("DELETE FROM revisions", "no such statement")
    with monkeypatch.context() as patched:
        patched.setattr("deconflict.operator.store.sqlite_connections.UPGRADES", (*UPGRADES, step))
        with pytest.raises(StoreError):
            reopened(store)
    again = Store(store.path.parent)
    assert again.after(0) == stored
    again.close()


def test_a_directory_that_cannot_be_made_is_an_explained_error(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(StoreError, match="choose a directory this user can write to"):
        Store(tmp_path / "file" / "data")
    (tmp_path / "data" / FILE_NAME).mkdir(parents=True)
    with pytest.raises(StoreError, match="is a directory where a file is expected; move it away"):
        Store(tmp_path / "data")


def test_a_store_another_process_keeps_locked_says_so(store: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("deconflict.operator.store.sqlite_connections.BUSY_TIMEOUT_S", 0.05)
    impatient = Store(store.path.parent)
    other = sqlite3.connect(store.path, isolation_level=None)
    other.execute("BEGIN IMMEDIATE")
    with pytest.raises(StoreError, match="stop the other process"):
        impatient.append([made(1)])
    other.execute("ROLLBACK")
    other.close()
    assert impatient.append([made(1)])[0].seq == 1
    impatient.close()


def test_a_closed_store_is_an_explained_error(store: Store) -> None:
    store.close()
    with pytest.raises(StoreError, match="closed"):
        store.last_seq()


def answer(name: str) -> Acknowledgement:
    return Acknowledgement(name=name, reason="called back", at=START + timedelta(minutes=30))


def test_an_acknowledgement_is_a_revision_of_its_own_and_stays_with_the_advisory(store: Store) -> None:
    store.append([made(1), made(2)])
    first, second = store.acknowledge("advisory-1", answer("Kim")), store.acknowledge("advisory-1", answer("Ada"))
    assert first
    assert second
    assert (first.seq, first.revision, second.seq, second.revision) == (3, 1, 4, 1)
    store.append([made(1, 2)])
    again = reopened(store)
    names = [
        (advisory.seq, advisory.acknowledgement and advisory.acknowledgement.name)
        for advisory in again.get("advisory-1")
    ]
    assert names == [(1, None), (3, "Kim"), (4, "Ada"), (5, "Ada")]
    assert {advisory.id: advisory.seq for advisory in again.latest("open").advisories} == {
        "advisory-1": 5,
        "advisory-2": 2,
    }
    assert [advisory.seq for advisory in again.append([made(1)])] == [1]
    again.close()


def test_an_acknowledgement_holds_for_its_situation_and_passes_to_no_other(store: Store) -> None:
    store.append([situation(1), situation(2)])
    store.acknowledge("situation-2", Acknowledgement(name="Kim", reason="called back", at=START))
    over = situation(2, 2).cleared_revision(START.timestamp() + 200, ClearedCode.PASSED)
    store.append([over, situation(1, 2), situation(3, split_from="situation-2")])
    (accepted,) = store.accept([situation(3, 2, split_from="situation-2")])
    others = [store.get("situation-1")[-1], store.get("situation-3")[-1], accepted]
    assert [each.acknowledgement for each in others] == [None] * 3
    assert store.get("situation-2")[-1].acknowledgement is not None


def test_what_is_not_stored_cannot_be_acknowledged(store: Store) -> None:
    assert store.acknowledge("advisory-9", answer("Kim")) is None
    assert store.last_seq() == 0


def test_open_and_raised_advisories_of_the_past_are_found(store: Store) -> None:
    store.append([made(1), made(2), made(1, 2), cleared(1, 3), made(3)])
    store.acknowledge("advisory-2", answer("Kim"))
    at_s = (START + timedelta(minutes=1, seconds=1)).timestamp()
    assert [(advisory.id, advisory.revision) for advisory in store.open_at(at_s)] == [("advisory-1", 2)]
    assert [advisory.id for advisory in store.open_at(at_s + 90)] == ["advisory-2"]
    assert store.raised_between(at_s - 60, at_s + 90).total() == 2


def test_a_file_of_the_second_format_keeps_its_numbers_and_never_gives_one_again(tmp_path: Path) -> None:
    old = sqlite3.connect(tmp_path / FILE_NAME)
    for statement in (name for step in UPGRADES[:2] for name in step):
        old.execute(statement)
    kept = made(2, seq=7)
    old.execute("INSERT INTO revisions VALUES (9, 'pruned', 1, '{}')")
    old.execute("DELETE FROM revisions")
    old.execute("INSERT INTO revisions VALUES (7, ?, 1, ?)", (kept.id, kept.model_dump_json()))
    old.execute("INSERT INTO advisories VALUES (?, 1, 7, 1, 0.0, 'conflict')", (kept.id,))
    old.execute("PRAGMA user_version = 2")
    old.commit()
    old.close()
    store = Store(tmp_path)
    assert store.latest("open").advisories == [kept]
    assert store.open_at(kept.updated_at.timestamp() + 1) == [kept]
    assert [advisory.seq for advisory in store.append([made(3)])] == [10]
    store.close()


@pytest.mark.parametrize("version", range(3, len(UPGRADES)))
def test_a_file_of_each_later_format_is_read_with_its_answers_positions_and_burdens(
    tmp_path: Path, version: int
) -> None:
    old = sqlite3.connect(tmp_path / FILE_NAME)
    for statement in (name for step in UPGRADES[:version] for name in step):
        old.execute(statement)
    given, kept = answer("Kim"), made(2, seq=7)
    answered = kept.model_copy(update={"seq": 8, "acknowledgement": given})
    for advisory, answers in ((kept, 0), (answered, 1)):
        row = (advisory.seq, advisory.id, 1, answers, advisory.updated_at.timestamp(), advisory.model_dump_json())
        old.execute("INSERT INTO revisions VALUES (?, ?, ?, ?, ?, ?)", row)
    old.execute(
        "INSERT INTO advisories (id, revision, seq, open, updated_s, kind, acknowledgement, answers)"
        " VALUES (?, 1, 8, 1, ?, 'conflict', ?, 1)",
        (kept.id, kept.updated_at.timestamp(), given.model_dump_json()),
    )
    parties = zip(kept.robots, kept.vendors, strict=True)
    old.executemany("INSERT INTO parties VALUES (?, ?, ?)", [(kept.id, *party) for party in parties])
    old.execute("INSERT INTO encounters VALUES (?, ?, 5)", kept.robots)
    if version > 3:
        old.execute("INSERT INTO positions VALUES ('mqtt', 7)")
    old.execute(f"PRAGMA user_version = {version}")
    old.commit()
    old.close()
    store = Store(tmp_path)
    assert store.latest(robot=ROBOTS[1]).advisories == [answered]
    assert store.get(kept.id) == [kept, answered]
    assert dict(store.encounters_after(("", ""), 100)) == {ROBOTS: 5}
    assert store.position("mqtt") == (7 if version > 3 else None)
    assert [(revision.seq, revision.acknowledgement) for revision in store.append([made(3), cleared(2)])] == [
        (9, None),
        (10, given),
    ]
    store.close()


def test_revisions_accepted_during_a_flush_are_stored_next(store: Store) -> None:
    store.accept([made(1)])
    late = [made(2)]

    def meanwhile(statement: str) -> None:
        if statement.startswith("BEGIN") and late:
            store.accept([late.pop()])

    store.connections._file.writer.set_trace_callback(meanwhile)
    store.flush()
    assert (late, store.unstored) == ([], 1)
    store.flush()
    assert store.unstored == 0
    again = reopened(store)
    assert [(advisory.id, advisory.seq) for advisory in again.after(0)] == [("advisory-1", 1), ("advisory-2", 2)]
    again.close()


def test_the_highest_encounter_of_a_pair_stays_whichever_is_stored_last(store: Store) -> None:
    store.append([made(1, encounter=5), made(2, encounter=3)])
    assert dict(store.encounters_after(("", ""), 100)) == {ROBOTS: 5}
