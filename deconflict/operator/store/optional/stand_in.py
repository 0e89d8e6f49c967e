"""A database in memory that stands in for the file while that can't be used, and hands over to it what it has taken.

It begins with what can be read of the file: what is open, the newest, and what outlets have not sent. Its numbers are a
new epoch: they begin beyond every number given before, so none is given twice even if the file never comes back.
"""

import logging
import os
import sqlite3
import time
from collections.abc import Container, Iterable, Iterator, Sequence
from contextlib import closing, contextmanager, suppress
from pathlib import Path
from typing import NamedTuple

from deconflict.operator.store import tables
from deconflict.operator.store.migrations import UPGRADES
from deconflict.operator.store.recovery.reserved_numbers import epoch
from deconflict_client.advisory import ADVISORY_KINDS, EVERY_KIND, ClearedCode
from deconflict_client.situations import AnyRevision
from ingest.plain_files import UnfitDatabaseError, check_database

log = logging.getLogger(__name__)

IN_MEMORY = ":memory:"
MOST_BYTES = 64 << 20
"""Cleared advisories are removed beyond this size. It takes twice as much, beside what it began with."""
PAGE_BYTES = 4096
MOST_PAGES = 4_294_967_294
"""SQLite's own limit."""
MOST_UNSENT = 5_000
"""Most revisions that outlets have not sent that it begins with."""
NEWEST = 500
"""So many of the newest revisions are known in any case."""
STEP = 500
"""Revisions that are handed over in one transaction."""
READ_TIMEOUT_S = 0.5
HELD = f"""SELECT * FROM advisories AS a WHERE open = 1 OR EXISTS (
    SELECT 1 FROM positions AS p WHERE p.seq < a.seq AND p.seq >= {tables.FIRST_SEQ})"""  # noqa: S608 - a constant
"""What is open, or an outlet has not been told to be over."""
KEPT = f"""WITH held AS ({HELD}), kept AS (
    SELECT seq, id FROM held UNION SELECT {tables.FIRST_SEQ}, id FROM held AS a
    UNION SELECT * FROM (SELECT seq, id FROM revisions WHERE seq > (SELECT min(seq) FROM positions)
        ORDER BY seq DESC LIMIT {MOST_UNSENT})
    UNION SELECT * FROM (SELECT seq, id FROM revisions ORDER BY seq DESC LIMIT {NEWEST}))"""  # noqa: S608 - constants
STATE = {
    "revisions": f"{KEPT} SELECT * FROM revisions WHERE seq IN (SELECT seq FROM kept)",  # noqa: S608 - constants
    "advisories": f"{KEPT} SELECT * FROM advisories WHERE id IN (SELECT id FROM kept)",  # noqa: S608
    "parties": f"{KEPT} SELECT * FROM parties WHERE id IN (SELECT id FROM kept)",  # noqa: S608
    "encounters": "SELECT * FROM encounters",
    "burdens": "SELECT * FROM burdens",
    "positions": "SELECT * FROM positions",
}
"""By table, which rows it begins with."""
MISSED = f"""SELECT document FROM advisories AS a JOIN revisions AS r ON r.seq = a.seq
WHERE open = 0 AND a.seq > :delivered AND a.seq <= :last AND {tables.FIRST_SEQ} <= :delivered"""  # noqa: S608 - a constant
"""What an outlet was not told to be over, up to a number."""
GIVEN = """SELECT seq, document, EXISTS (
    SELECT 1 FROM revisions AS first WHERE first.id = r.id AND first.revision = r.revision AND first.seq < r.seq)
FROM revisions AS r WHERE seq > ? ORDER BY seq LIMIT ?"""
"""Number, document, and whether it only adds an answer."""


class HandedOver(NamedTuple):
    """What a file has of the database in memory after a step."""

    last: int
    """Up to this number it has everything."""
    shift: int
    """What was added to the numbers of this step."""
    newest: tuple[object, ...] | None
    """`_newest_row` of the file; None if nothing was handed over."""


class State(NamedTuple):
    """What is read of a database."""

    last_seq: int
    rows: dict[str, list[tuple[object, ...]]]
    """By table."""

    def write(self, db: sqlite3.Connection) -> None:
        for table, rows in self.rows.items():
            if rows:
                places = ", ".join("?" * len(rows[0]))
                db.executemany(f"INSERT OR REPLACE INTO {table} VALUES ({places})", rows)  # noqa: S608 - constants

    def is_lacked(self, db: sqlite3.Connection) -> bool:
        """Whether a database is another one, or an older copy."""
        if not self.rows["revisions"]:
            return tables.last_seq(db) < self.last_seq
        seq, advisory_id, *_ = max(self.rows["revisions"])
        known = db.execute("SELECT 1 FROM revisions WHERE seq = ? AND id = ?", (seq, advisory_id)).fetchone()
        return known is None


def state_of(db: sqlite3.Connection) -> State:
    """Raises `sqlite3.Error`."""
    rows = {table: db.execute(query).fetchall() for table, query in STATE.items()}
    return State(tables.last_seq(db), rows)


def empty_database() -> sqlite3.Connection:
    """One in memory, with all tables."""
    db = sqlite3.connect(IN_MEMORY, isolation_level=None, check_same_thread=False)
    for statement in (statement for step in UPGRADES for statement in step):
        db.execute(statement)
    return db


def readable_state(path: Path) -> State | None:
    """What can be read of a file that can't be written; None if nothing can.

    A file that another program keeps locked can often be read. On a full disk SQLite has no room for the memory that
    connections share, and one connection alone needs none. On a read-only disk a file without a log is whole by itself.
    """
    try:
        check_database(path)
    except UnfitDatabaseError:
        return None
    uri, log_file = path.absolute().as_uri(), path.with_name(f"{path.name}-wal")
    attempts = [("mode=ro", ""), ("mode=rw", "PRAGMA locking_mode = EXCLUSIVE")]
    with suppress(OSError):
        is_whole = not log_file.exists() or log_file.stat().st_size == 0
        if is_whole and not (os.access(path, os.W_OK) and os.access(path.parent, os.W_OK)):
            attempts.append(("mode=ro&immutable=1", ""))
    for mode, pragma in attempts:
        with (
            suppress(sqlite3.Error),
            closing(sqlite3.connect(f"{uri}?{mode}", uri=True, timeout=READ_TIMEOUT_S, isolation_level=None)) as db,
        ):
            db.execute(pragma)
            return state_of(db)
    return None


class StandIn:
    """The database in memory. For one thread at a time."""

    def __init__(
        self,
        state: State | None,
        reserved: int | None,
        pending: Sequence[AnyRevision] = (),
        answered: Container[int] = (),
    ) -> None:
        """`state` is what was read of the file; None if nothing could be. Numbers up to `reserved` may be in use; it is
        None if a stream gives the numbers.

        `pending` was published and is not in the file; the numbers in `answered` are of answers.
        """
        self.state, self._follows_stream = state, reserved is None
        self.db = empty_database()
        if state:
            state.write(self.db)
        self._begun_after = state.last_seq if state else 0
        """What has a higher number was never in the file."""
        self._handed = [HandedOver(self._begun_after, 0, None)]
        """The steps, ascending by number. The first one is what it began with."""
        unstored = [revision for revision in pending if revision.seq > self._begun_after]
        self._answered = {revision.seq for revision in unstored if revision.seq in answered}
        """Numbers of answers to what it may not know itself."""
        for revision in unstored:
            tables.write_one(self.db, revision, answered)
        (begun_pages,) = self.db.execute("PRAGMA page_count").fetchone()
        self._most_pages = begun_pages + 2 * MOST_BYTES // PAGE_BYTES
        self._limit(self._most_pages)
        self._epoch = 0
        """The last number before its epoch; 0 if a stream gives the numbers."""
        if reserved is not None:
            self._epoch = max(tables.last_seq(self.db), reserved, epoch(time.time()))
            tables.begin_after(self.db, self._epoch)
            self._begun_after = self._begun_after if unstored else self._epoch
        self._shift: int | None = None
        """What is added to its numbers for the file, which has given them to others; None until the file is known."""
        self.has_engine = False
        """Whether an engine resumed with what this database has open."""

    def _limit(self, most_pages: int) -> None:
        self.db.execute(f"PRAGMA max_page_count = {most_pages}")

    @contextmanager
    def without_limit(self) -> Iterator[None]:
        """It takes what waits, also if it is full: a file is about to get all."""
        self._limit(MOST_PAGES)
        try:
            yield
        finally:
            self._limit(self._most_pages)

    def begin_file(self, file: sqlite3.Connection) -> None:
        """A file was opened. One that lacks what was handed over is another one, or an older copy, and gets all."""
        newest = self._handed[-1].newest
        if newest is None or not _has_row(file, newest):
            self._shift, self._handed = None, self._handed[:1]

    def next_rows(self) -> list[tuple[int, str, int]]:
        """The next rows of `GIVEN` to hand over."""
        return self.db.execute(GIVEN, (self._handed[-1].last, STEP)).fetchall()

    def hand_over(self, file: sqlite3.Connection, rows: Sequence[tuple[int, str, int]]) -> HandedOver:
        """Write rows to the file, in a transaction. `handed_over` takes what this returns once that is committed."""
        shift = self._begin(file) if self._shift is None else self._shift
        last = tables.last_seq(file)
        for seq, document, is_answer in rows:
            for known in tables.readable([(document,)]) if seq + shift > last else ():
                revision = known.model_copy(update={"seq": seq + shift})
                answered = {revision.seq} if is_answer or seq in self._answered else ()
                if error := tables.write_one(file, revision, answered):
                    log.warning("%s, revision %d, is not stored: %s", revision.id, revision.revision, error)
        return HandedOver(rows[-1][0] if rows else self._handed[-1].last, shift, _newest_row(file))

    def _begin(self, file: sqlite3.Connection) -> int:
        """Let the file continue beyond the numbers of this epoch; returns what to add to them.

        Who returns with a number of before reads again: another epoch in memory may have been lost since.
        """
        last = tables.last_seq(file)
        is_same = self._follows_stream or self._has_given(file, last)
        shift = 0 if is_same else max(last - self._begun_after, 0)
        if self.state and self.state.is_lacked(file):
            self.state.write(file)
            tables.note_removed(file, ((kind, self.state.last_seq) for kind in EVERY_KIND))
        if not shift and self._begun_after > tables.last_seq(file):
            tables.use_up_number(file, self._begun_after)
        if not self._follows_stream:
            tables.note_removed(file, ((kind, self._epoch + shift) for kind in EVERY_KIND))
        return shift

    def _has_given(self, file: sqlite3.Connection, seq: int) -> bool:
        """Whether the file has the revision of this database under a number: it was about to be stored."""
        given, stored = (
            db.execute("SELECT id, revision FROM revisions WHERE seq = ?", (seq,)).fetchone() for db in (self.db, file)
        )
        return given is not None and given == stored

    def handed_over(self, step: HandedOver) -> None:
        self._shift = step.shift
        if step.last > self._handed[-1].last:
            self._handed.append(step)

    def _in_file(self, seq: int) -> int:
        """The number in the file of what has a number here."""
        return seq + next((step.shift for step in self._handed if seq <= step.last), self._shift or 0)

    def finish(self, file: sqlite3.Connection, now_s: float) -> None:
        """Hand over what is not a revision, and clear what nobody here knows to be open, or an outlet to be over."""
        known, shift = tables.positions(file), self._shift or 0
        positions = {outlet: self._in_file(seq) for outlet, seq in tables.positions(self.db).items()}
        if self.state is None and not self._follows_stream:
            skipping = [seq for outlet, seq in known.items() if seq < positions.get(outlet, 0)]
            for revision in [*self._unknown(file), *_missed(file, skipping, self._begun_after + shift)]:
                cleared = revision.cleared_revision(now_s, ClearedCode.UNREAD)
                tables.write_one(file, cleared.model_copy(update={"seq": tables.last_seq(file) + 1}), ())
        removed = self.db.execute("SELECT kind, seq FROM removed").fetchall()
        tables.note_removed(file, ((kind, self._in_file(seq)) for kind, seq in removed))
        for outlet, seq in known.items():
            if self.state is None and seq < positions.get(outlet, 0):
                log.warning("%s was not sent what the file had after number %d", outlet, seq)
        tables.put_positions(file, positions)
        self._shift = None  # a file that is not used now is looked at anew: it may have numbers of what was cleared

    def _unknown(self, file: sqlite3.Connection) -> Iterator[AnyRevision]:
        """What the file has open and this database does not know: no advisories, or what the engine did not resume."""
        for document in tables.open_after(file, 0):
            is_forgotten = document.kind not in ADVISORY_KINDS or self.has_engine
            if is_forgotten and tables.newest(self.db, document.id) is None:
                yield from tables.readable([(document.text,)])


def _newest_row(db: sqlite3.Connection) -> tuple[object, ...] | None:
    """Number, id, revision and answers of what has the highest number; None if there is nothing."""
    row: tuple[object, ...] | None = db.execute(
        "SELECT seq, id, revision, answers FROM revisions ORDER BY seq DESC LIMIT 1"
    ).fetchone()
    return row


def _has_row(db: sqlite3.Connection, row: tuple[object, ...]) -> bool:
    """Whether a database has what `_newest_row` said of it, or of another one."""
    query = "SELECT 1 FROM revisions WHERE (seq, id, revision, answers) = (?, ?, ?, ?)"
    return db.execute(query, row).fetchone() is not None


def _missed(file: sqlite3.Connection, skipping: Iterable[int], last: int) -> list[AnyRevision]:
    """The newest revisions of what ended up to the number `last`, and outlets that continue beyond it hold open.

    `skipping` are the numbers that the file has as their positions.
    """
    documents = {
        document: None
        for delivered in skipping
        for (document,) in file.execute(MISSED, {"delivered": delivered, "last": last})
    }
    return tables.readable((document,) for document in documents)
