"""Questions take an index: the time for an answer does not grow with what is stored."""

import sqlite3
from collections.abc import Iterator
from contextlib import closing, contextmanager

import pytest

from deconflict.operator.store.listings import ListingFilter, StateFilter
from deconflict.operator.store.pruning import OutletReach, last_old, remove_of_most, remove_old, revisions_by_vendors
from deconflict.operator.store.store import Store
from deconflict.operator.store.tables import latest
from tests.helpers.made_advisories import cleared, made, situation


@contextmanager
def traced(store: Store) -> Iterator[tuple[sqlite3.Connection, list[list[str]]]]:
    """A connection to the file; and once the block is over, the plan of each selection that it made."""
    statements: list[str] = []
    plans: list[list[str]] = []
    with closing(sqlite3.connect(store.path)) as db:
        db.set_trace_callback(statements.append)
        yield db, plans
        db.set_trace_callback(None)
        chosen = [statement for statement in statements if statement.startswith("SELECT")]
        plans += [[row[3] for row in db.execute(f"EXPLAIN QUERY PLAN {statement}")] for statement in chosen]


def test_what_is_removed_is_found_by_the_indices_of_what_is_cleared(store: Store) -> None:
    store.append([cleared(1, 1)])
    with traced(store) as (db, plans):
        last_old(db, 1.0, 2.0)
        remove_old(db, 1.0, 2.0, 0)
        remove_of_most(db, 0.0, revisions_by_vendors(db), [OutletReach(0, 0)])
    held = [
        "CORRELATED SCALAR SUBQUERY 2",
        "SCAN outlet VIRTUAL TABLE INDEX 1:",
        "CORRELATED SCALAR SUBQUERY 1",
        "SEARCH r USING COVERING INDEX sqlite_autoindex_revisions_1 (id=?)",
    ]
    assert plans == [
        ["SCAN revisions"],
        ["SEARCH revisions USING INTEGER PRIMARY KEY (rowid<?)"],
        ["SEARCH advisories USING INDEX cleared_by_age (updated_s<?)"],
        ["SEARCH advisories USING INDEX cleared_by_age (updated_s>?)"],
        ["SCAN advisories USING INDEX cleared_by_vendors"],
        ["CO-ROUTINE (subquery-1)", "SCAN revisions", "SEARCH (subquery-1)"],
        ["SEARCH a USING INDEX cleared_by_vendors (vendors=? AND updated_s>?)", *held],
        ["SEARCH a USING INDEX cleared_by_vendors (vendors=? AND updated_s<?)", *held],
    ]


@pytest.mark.parametrize("state", ["open", "cleared", "all"])
def test_a_short_listing_does_not_sort_all_that_is_stored(store: Store, state: StateFilter) -> None:
    store.append([made(1), made(2), made(3), cleared(2), cleared(3), made(4)])
    with traced(store) as (db, plans):
        found = latest(db, ListingFilter(state), 2)
    assert [each.id for each in found] == {
        "open": ["advisory-4", "advisory-1"],
        "cleared": ["advisory-3", "advisory-2"],
        "all": ["advisory-4", "advisory-3"],
    }[state]
    assert "TEMP B-TREE" not in " ".join(plans[0])


@pytest.mark.parametrize("state", ["open", "cleared", "all"])
def test_a_listing_of_situations_goes_through_no_situation_of_another_state(store: Store, state: StateFilter) -> None:
    with traced(store) as (db, plans):
        latest(db, ListingFilter(state, kind="situation"), 2)
    of_situations = [step for step in plans[0] if " a " in step or "TEMP" in step]
    assert of_situations == ["SEARCH a USING INDEX situations_by_seq (open=?)"] * (2 if state == "all" else 1)


def test_no_index_but_those_that_something_asks_for_is_kept_up_to_date(store: Store) -> None:
    with closing(sqlite3.connect(store.path)) as db:
        indices = [row[1] for row in db.execute("PRAGMA index_list(advisories)") if row[3] == "c"]
    assert sorted(indices) == ["advisories_by_seq", "cleared_by_age", "cleared_by_vendors", "situations_by_seq"]


def test_situations_are_listed_by_an_index_of_their_own(store: Store) -> None:
    store.append([made(number) if number % 50 else situation(number) for number in range(1, 500)])
    with traced(store) as (db, plans):
        found = latest(db, ListingFilter("all", kind="situation"), 2)
    assert [each.id for each in found] == ["situation-450", "situation-400"]
    assert "situations_by_seq" in " ".join(plans[0])
