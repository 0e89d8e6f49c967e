"""Removal of cleared advisories, by age and by the size of the file. Open ones stay.

Subscribers may hold open what is removed. What an outlet may hold stays, unless it is too old. The store knows the
position of no other subscriber: it keeps the highest removed numbers, so that one that was away can be told.
"""

import json
import sqlite3
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from sys import maxsize
from threading import Lock
from typing import NamedTuple

from deconflict.advisories.encounter_numbers import FORGOTTEN, MOST_PAIRS
from deconflict.operator.store import tables
from deconflict.operator.store.sqlite_connections import SqliteConnections
from deconflict_client.advisory import EVERY_KIND
from ingest.recording.clock_notes import DAY_S, LATEST_S

STEP = 200
"""So many advisories are removed in one transaction: no revision can be stored meanwhile."""
PAIRS_AT_ONCE = 2_000
"""The same of pairs that are forgotten."""
ROOM = 0.01
"""A file that is too large gets this share of its size free, so that revisions are rarely counted by vendors."""
HELD = f"""EXISTS (SELECT 1 FROM json_each(?) AS outlet
    WHERE outlet.value ->> 0 < a.seq AND outlet.value ->> 1 >= {tables.FIRST_SEQ})"""  # noqa: S608 - a constant
"""Whether an outlet has sent, or may send, the first revision of the advisory `a`, and has not sent the newest. The
parameter is a JSON array of `OutletReach`."""
OF_AGE = """SELECT id, revision, kind, seq FROM advisories INDEXED BY cleared_by_age
    WHERE open = 0 AND updated_s {} ? AND seq <= ? ORDER BY updated_s LIMIT ?"""
OF_VENDORS = f"""SELECT id, revision, kind, seq FROM advisories AS a INDEXED BY cleared_by_vendors
    WHERE open = 0 AND vendors = ? AND updated_s {{}} ? AND NOT {HELD} ORDER BY updated_s LIMIT ?"""  # noqa: S608 - a constant
LAST_WRITTEN = 100
"""Revisions that say what the time was when something was last written."""


class OutletReach(NamedTuple):
    """How far one outlet is, in numbers of revisions."""

    delivered: int
    """It has sent every revision up to this number."""
    read_to: int
    """It may have sent, or may yet send, any stored revision up to this number. It has read none above it."""


class RemovedAdvisory(NamedTuple):
    """Its newest revision, and that one's number."""

    id: str
    revision: int
    kind: str
    seq: int


def last_old(db: sqlite3.Connection, before_s: float, latest_s: float) -> int:
    """The number of the last of the revisions that are old, as of `old_ones`; 0 if none is. Reads little more than
    these."""
    scan = "SELECT seq FROM revisions NOT INDEXED WHERE"
    young = db.execute(f"{scan} updated_s BETWEEN ? AND ? ORDER BY seq LIMIT 1", (before_s, latest_s)).fetchone()
    bounds = before_s, young[0] if young else maxsize
    old = db.execute(f"{scan} updated_s < ? AND seq < ? ORDER BY seq DESC LIMIT 1", bounds).fetchone()
    return int(old[0]) if old else 0


def remove_old(db: sqlite3.Connection, before_s: float, latest_s: float, last: int) -> int:
    """Remove up to `STEP` of the cleared advisories up to the number `last_old`; returns how many."""
    removed = _removed(db, OF_AGE.format("<"), before_s, last) or _removed(db, OF_AGE.format(">"), latest_s, last)
    return len(removed)


def revisions_by_vendors(db: sqlite3.Connection) -> Counter[str]:
    """How many revisions the cleared advisories on each set of vendors have. Goes through all of them."""
    sums = db.execute(
        "SELECT vendors, sum(revision) FROM advisories INDEXED BY cleared_by_vendors WHERE open = 0 GROUP BY vendors"
    )
    return Counter(dict(sums))


def remove_of_most(
    db: sqlite3.Connection, least_bytes: float, revisions: Counter[str], outlets: Sequence[OutletReach]
) -> int:
    """Remove up to `STEP` cleared advisories of the vendors with most revisions, the oldest first, unless the file
    uses `least_bytes` or less. Returns how many, and takes their revisions off `revisions`.

    Advisories on the same vendors count together. So those of one vendor, whomever it meets, displace no others. What
    one of the `outlets` may hold open stays: no more than was open when it stopped, or is raised in the page that it
    has read. What has a later time than what was written last has that of a wrong clock, and goes first.
    """
    written_s, held = _written_s(db), json.dumps(outlets)
    while revisions and used_bytes(db) > least_bytes:
        ((vendors, _),) = revisions.most_common(1)
        removed = _removed(db, OF_VENDORS.format(">"), vendors, written_s, held) or _removed(
            db, OF_VENDORS.format("<="), vendors, written_s, held
        )
        if removed:
            revisions[vendors] -= sum(each.revision for each in removed)
            return len(removed)
        del revisions[vendors]
    return 0


def forget_surplus_pairs(connections: SqliteConnections) -> None:
    """Forget pairs beyond `MOST_PAIRS`, those with the lowest numbers: so the numbers of others grow least by it."""
    with connections.long_reading() as db:
        (pairs,) = db.execute("SELECT count(*) FROM encounters WHERE robot_a <> ?", FORGOTTEN[:1]).fetchone()
        if (surplus := pairs - MOST_PAIRS) <= 0:
            return
        numbers = db.execute(
            "SELECT ordinal FROM encounters WHERE robot_a <> ? ORDER BY ordinal LIMIT 1 OFFSET ?",
            (FORGOTTEN[0], surplus - 1),
        )
        (highest,) = numbers.fetchone()
    while surplus > 0:
        with connections.writing() as db:
            surplus -= _forget_pairs(db, min(surplus, PAIRS_AT_ONCE), highest) or surplus


def _forget_pairs(db: sqlite3.Connection, most: int, highest: int) -> int:
    """Forget up to `most` pairs whose number is `highest` at most; returns how many."""
    rows = db.execute(
        "SELECT robot_a, robot_b, ordinal FROM encounters WHERE ordinal <= ? AND robot_a <> ? LIMIT ?",
        (highest, FORGOTTEN[0], most),
    ).fetchall()
    if rows:
        db.executemany("DELETE FROM encounters WHERE robot_a = ? AND robot_b = ?", (row[:2] for row in rows))
        tables.note_encounter(db, FORGOTTEN, max(number for *_, number in rows))
    return len(rows)


def used_bytes(db: sqlite3.Connection) -> int:
    """Size of the database without its free pages."""
    pages, free, page_bytes = (
        int(db.execute(f"PRAGMA {name}").fetchone()[0]) for name in ("page_count", "freelist_count", "page_size")
    )
    return (pages - free) * page_bytes


def _written_s(db: sqlite3.Connection) -> float:
    """No revision that was written lately is of a later time."""
    (newest_s,) = db.execute(
        "SELECT max(updated_s) FROM (SELECT updated_s FROM revisions ORDER BY seq DESC LIMIT ?)", (LAST_WRITTEN,)
    ).fetchone()
    return LATEST_S if newest_s is None else float(newest_s) + DAY_S


def _removed(db: sqlite3.Connection, chosen: str, *bounds: float | str) -> list[RemovedAdvisory]:
    """Remove the advisories that a selection gives, with every revision. The parameters of the selection are `bounds`,
    and how many it gives at most."""
    removed = [RemovedAdvisory(*row) for row in db.execute(chosen, (*bounds, STEP))]
    tables.note_removed(db, ((each.kind, each.seq) for each in removed))
    ids = [(each.id,) for each in removed]
    for table in ("revisions", "parties", "advisories"):
        db.executemany(f"DELETE FROM {table} WHERE id = ?", ids)  # noqa: S608 - the tables are constants
    return removed


class OutletPositions:
    """Positions that are not in the file yet, and the pages that outlets read.

    `begin_page`, `end_page` and `move` never wait for the disk.
    """

    def __init__(self) -> None:
        self.unstored: dict[str, int] = {}
        """Positions of outlets that are not in the file yet."""
        self._lock = Lock()
        self._is_removing = False
        """From the choice of what is removed until that is committed."""
        self._reading: set[str] = set()
        """Outlets between `begin_page` and `end_page`."""
        self._late: set[str] = set()
        """Outlets that began a page during the present removal, which does not spare what they read."""
        self._read_to: dict[str, int] = {}
        """By outlet, the last number of its newest page."""
        self._removed_to = 0
        """The highest number that was removed since the start."""

    def move(self, outlet: str, seq: int) -> None:
        """The outlet has sent every revision up to a number."""
        with self._lock:
            self.unstored[outlet] = seq

    def stored(self, positions: Mapping[str, int]) -> None:
        """These positions are in the file."""
        with self._lock:
            self.unstored = {outlet: seq for outlet, seq in self.unstored.items() if positions.get(outlet) != seq}

    def begin_page(self, outlet: str) -> int | None:
        """The outlet reads its next page: until `end_page`, no removal that begins takes what it may still send.

        Returns the highest number that was removed since the start. Returns None while an earlier removal is being
        committed: then the outlet may not read yet, and asks again.
        """
        with self._lock:
            if self._is_removing and outlet not in self._reading:
                self._late.add(outlet)
            self._reading.add(outlet)
            return None if outlet in self._late else self._removed_to

    def end_page(self, outlet: str, last: int) -> None:
        """The outlet has read its page, which ends with the number `last`, or reads none."""
        with self._lock:
            self._read_to[outlet] = max(last, self._read_to.get(outlet, 0))
            self._reading.discard(outlet)
            self._late.discard(outlet)

    def reaches(self, db: sqlite3.Connection) -> list[OutletReach]:
        """How far each outlet is that has a position."""
        positions = tables.positions(db) | self.unstored
        return [OutletReach(position, self._most_read(outlet, position)) for outlet, position in positions.items()]

    def _most_read(self, outlet: str, position: int) -> int:
        with self._lock:
            return maxsize if outlet in self._reading else max(position, self._read_to.get(outlet, 0))

    @contextmanager
    def removing(self, connections: SqliteConnections) -> Iterator[sqlite3.Connection]:
        """A transaction that removes advisories."""
        try:
            with connections.writing() as db:
                with self._lock:
                    self._is_removing = True
                yield db
                self._removed_to = tables.last_removed(db, EVERY_KIND)
        finally:
            with self._lock:
                self._is_removing = False
                self._late.clear()


def remove_in_steps(
    outlets: OutletPositions, connections: SqliteConnections, remove: Callable[[sqlite3.Connection], int]
) -> int:
    """Remove advisories in a transaction for each step, so that no revision waits long to be stored."""
    pruned, removed = 0, 1
    while removed:
        with outlets.removing(connections) as db:
            removed = remove(db)
        pruned += removed
    return pruned
