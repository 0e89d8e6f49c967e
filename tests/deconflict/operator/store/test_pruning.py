"""Removal of cleared advisories, by age and by size."""

import sqlite3
from contextlib import closing
from datetime import timedelta

import pytest

from deconflict.advisories.encounter_numbers import FORGOTTEN
from deconflict.operator.store import pruning
from deconflict.operator.store.store import Store
from deconflict.roles.engine_link.restoration import FIRST_PAIR
from deconflict_client.advisory import ConflictAdvisory
from tests.deconflict.operator.store.reopened_store import reopened
from tests.helpers.made_advisories import ROBOTS, START, cleared, made

ROWS = {
    "revisions": "SELECT DISTINCT id FROM revisions",
    "advisories": "SELECT id FROM advisories",
    "parties": "SELECT DISTINCT id FROM parties",
}
"""Of which advisories each table has any."""


def test_pruning_removes_old_cleared_advisories_and_reuses_no_number(store: Store) -> None:
    store.append([made(1), made(2), cleared(2), made(3), cleared(3)])
    assert store.prune(START + timedelta(minutes=3)) == 1
    assert store.get("advisory-2") == []
    assert [advisory.seq for advisory in store.after(0)] == [1, 4, 5]
    assert store.prune(START + timedelta(days=1)) == 1
    with closing(sqlite3.connect(store.path)) as raw:
        left = {table: raw.execute(rows).fetchall() for table, rows in ROWS.items()}
    assert left == {table: [("advisory-1",)] for table in ROWS}
    again = reopened(store)
    assert again.last_seq() == 5
    assert [advisory.seq for advisory in again.append([made(4)])] == [6]
    again.close()


def test_numbers_of_many_pairs_are_kept_as_one(store: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    """An older data directory may have any number of pairs, and a start reads them as before."""
    monkeypatch.setattr(pruning, "MOST_PAIRS", 10)
    monkeypatch.setattr(pruning, "PAIRS_AT_ONCE", 3)
    pairs = [("a", f"b{number:02}") for number in range(30)]
    store.append([made(number, robots=pair, encounter=number + 1) for number, pair in enumerate(pairs)])
    assert dict(store.encounters_after(FIRST_PAIR, 100)) == {pair: number for number, pair in enumerate(pairs, 1)}
    store.prune(START)
    again = reopened(store)
    known = dict(again.encounters_after(FIRST_PAIR, 100))
    assert known == {pair: number for number, pair in enumerate(pairs, 1) if number > 20} | {FORGOTTEN: 20}
    again.append([made(40, robots=("c", "d"), encounter=21)])
    again.prune(START)
    found = dict(again.encounters_after(FIRST_PAIR, 100))
    assert len(found) == 11
    assert found[FORGOTTEN] == 21
    again.close()


@pytest.mark.parametrize(
    ("days", "before", "left"),
    [
        ((-9, -8, -2, -1), -5, (-2, -1)),
        ((-9, 900, -8, -1), -5, (-1,)),
        ((-9, 900, -2, -1), -5, (900, -2, -1)),
        ((-2, -900, -1, -800), -5, (-2, -900, -1, -800)),
        ((-9, -2, -900, -1), -5, (-2, -900, -1)),
    ],
)
def test_advisories_are_old_in_the_order_of_writing_whatever_the_clock_said(
    store: Store, days: tuple[int, ...], before: int, left: tuple[int, ...]
) -> None:
    store.append([at(number, day) for number, day in enumerate(days)])
    store.prune(START + timedelta(days=before), START.timestamp())
    assert tuple((found.updated_at - START).days for found in store.after(0)) == left


@pytest.mark.parametrize(
    ("days", "left"),
    [((0, 400, 1, 2), (1, 2)), ((0, 1, 400, 401), (400, 401)), ((0, 1, -400, -399), (-400, -399))],
    ids=["was ahead", "is ahead", "is behind"],
)
def test_the_newest_are_kept_within_a_size_whatever_the_clock_said(
    store: Store, monkeypatch: pytest.MonkeyPatch, days: tuple[int, ...], left: tuple[int, ...]
) -> None:
    monkeypatch.setattr("deconflict.operator.store.pruning.STEP", 10)
    monkeypatch.setattr("deconflict.operator.store.pruning.LAST_WRITTEN", 10)
    store.append([at(number, days[number // 20]) for number in range(80)])
    store.prune_to(store.used_bytes() // 2)
    kept = {(found.updated_at - START).days for found in store.after(0)}
    assert kept <= set(left)


def at(number: int, day: int) -> ConflictAdvisory:
    """A cleared advisory that says this day."""
    return cleared(number, 1, updated_at=START + timedelta(days=day), summary="x" * 4_000)


def test_pruning_in_steps_removes_all_of_it(store: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("deconflict.operator.store.pruning.STEP", 2)
    store.append([cleared(number, 1) for number in range(5)])
    assert store.prune(START + timedelta(days=1)) == 5
    assert store.latest("all").advisories == []


def test_a_database_that_is_too_large_loses_its_oldest_cleared_advisories(
    store: Store, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("deconflict.operator.store.pruning.STEP", 10)
    store.append([made(0), *(cleared(number, 1, summary="x" * 4_000) for number in range(1, 101))])
    whole_bytes = store.used_bytes()
    removed = store.prune_to(whole_bytes // 2)
    assert 40 <= removed <= 70
    assert store.used_bytes() <= whole_bytes // 2 < store.used_bytes() + 10 * 4_096 * 2
    newest_first = [advisory.id for advisory in store.latest("all").advisories]
    assert newest_first == [*(f"advisory-{number}" for number in range(100, removed, -1)), "advisory-0"]
    assert store.prune_to(whole_bytes // 2) == 0
    store.append([cleared(number, 1, summary="x" * 4_000) for number in range(101, 101 + removed // 2)])
    assert store.path.stat().st_size <= whole_bytes + 16 * 4_096, "free pages are used again"


def test_advisories_of_one_vendor_displace_those_of_no_others_whomever_it_meets(
    store: Store, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("deconflict.operator.store.pruning.STEP", 10)
    long = {"summary": "x" * 4_000}
    honest = [cleared(number, 1, vendors=("Alder", "Basalt"), **long) for number in range(20)]
    met = [("Mallory", vendor) for vendor in ("Mallory", "Alder", "Basalt")]
    store.append([*honest, *(cleared(20 + number, 2, vendors=met[number % 3], **long) for number in range(180))])
    removed = store.prune_to(store.used_bytes() // 2)
    kept = [advisory.vendors for advisory in store.latest("all").advisories]
    assert 80 <= removed <= 120
    assert kept.count(("Alder", "Basalt")) == 20
    assert all(20 <= kept.count(vendors) <= 40 for vendors in met)


def test_revisions_are_counted_by_vendors_once_for_all_steps_and_without_the_lock_of_the_writer(
    store: Store, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("deconflict.operator.store.pruning.STEP", 5)
    store.append([cleared(number, 1, summary="x" * 4_000) for number in range(1, 101)])
    statements: list[str] = []
    store.connections._file.writer.set_trace_callback(statements.append)
    store.connections._file.long_reader.set_trace_callback(statements.append)
    most_bytes = store.used_bytes() // 2
    removed = store.prune_to(most_bytes)
    assert (removed // 5, removed % 5) == (statements.count("BEGIN IMMEDIATE") - 1, 0)
    (counting,) = (number for number, statement in enumerate(statements) if "GROUP BY" in statement)
    assert "BEGIN IMMEDIATE" not in statements[: counting + 1]
    assert store.used_bytes() <= most_bytes * 0.99


def test_what_an_outlet_has_sent_open_is_kept_for_it_unless_it_is_too_old(store: Store) -> None:
    store.append([made(1), made(2), cleared(1), cleared(2), made(3), cleared(3)])
    for position, kept in [(2, ["advisory-2", "advisory-1"]), (3, ["advisory-2"]), (4, [])]:
        store.set_position("mes", position)
        store.flush()
        store.prune_to(1)
        assert [advisory.id for advisory in store.latest("all").advisories] == kept
    store.append([made(4)])
    store.set_position("mes", store.last_seq())
    store.append([cleared(4)])
    assert store.prune(START + timedelta(days=1)) == 1


def test_open_advisories_are_kept_however_large_the_database_is(store: Store) -> None:
    store.append([made(1), made(2), cleared(2)])
    assert store.prune_to(1) == 1
    assert [advisory.id for advisory in store.latest("all").advisories] == ["advisory-1"]


def test_encounters_are_counted_by_pair_even_when_their_advisories_are_pruned(store: Store) -> None:
    store.append([made(1), cleared(1), made(2, encounter=2), cleared(2, encounter=2), made(3, robots=("a", "b"))])
    store.prune(START + timedelta(days=1))
    assert dict(store.encounters_after(("", ""), 100)) == {ROBOTS: 2, ("a", "b"): 1}
