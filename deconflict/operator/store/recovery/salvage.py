"""Copies what can be read of a damaged database into a new one, the newest revisions first, within a limited time."""

import sqlite3
import time
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import closing, suppress
from itertools import chain
from pathlib import Path
from typing import NamedTuple

from deconflict.operator.store.tables import begin_after, last_seq, read_only

SALVAGE_S = 3.0
"""Revisions that are not copied by then stay in the old file only. The other tables take up to twice as long."""
STEP = 2_048
"""Numbers that are copied by one statement."""
PAGE_BYTES = 4_096
AT_PAGE_COUNT = slice(28, 32)
"""Where the first page of a database has the number of its pages."""
READ_REVISIONS = """SELECT seq, id, revision, answers, updated_s, document, json_valid(document) FROM revisions
WHERE seq BETWEEN ? AND ?"""
WRITE_REVISIONS = """INSERT OR IGNORE INTO revisions (seq, id, revision, answers, updated_s, document)
VALUES (?, ?, ?, ?, ?, ?)"""
COPIED = (
    ("positions", "outlet", "outlet, seq"),
    ("burdens", "vendor", "vendor, yielded_s"),
    ("encounters", "robot_a, robot_b", "robot_a, robot_b, ordinal"),
)
"""Tables that keep more than the revisions say: name, key, columns."""
DERIVED = (
    """INSERT INTO advisories (id, revision, seq, open, updated_s, kind, acknowledgement, answers)
    SELECT id, revision, seq, document ->> '$.state' <> 'cleared',
        (julianday(document ->> '$.updated_at') - 2440587.5) * 86400.0, document ->> '$.kind',
        document ->> '$.acknowledgement', answers
    FROM (SELECT seq AS newest, max((revision << 20) + answers) FROM revisions GROUP BY id)
    CROSS JOIN revisions ON seq = newest""",
    """INSERT OR IGNORE INTO parties SELECT a.id, robot.value, vendor.value
    FROM advisories AS a JOIN revisions AS r ON r.seq = a.seq
    JOIN json_each(r.document, '$.robots') AS robot JOIN json_each(r.document, '$.vendors') AS vendor
    WHERE robot.key = vendor.key""",
    """INSERT INTO encounters SELECT document ->> '$.robots[0]', document ->> '$.robots[1]',
        max(document ->> '$.encounter')
    FROM advisories AS a JOIN revisions AS r ON r.seq = a.seq WHERE a.kind = 'conflict' GROUP BY 1, 2
    ON CONFLICT (robot_a, robot_b) DO UPDATE SET ordinal = max(ordinal, excluded.ordinal)""",
)
"""Fills the tables that follow from the revisions."""


class Salvage(NamedTuple):
    """What became of the revisions of a damaged database."""

    copied: int
    lost: int
    """Numbers that could not be read, at most: some of them had been removed before."""
    is_complete: bool
    """False if the time or the disk did not suffice for all of it."""


def salvage(damaged: Path, new: Path, known_seq: int, clock: Callable[[], float] = time.monotonic) -> Salvage:
    """Copy from a damaged file into a new one, which has its tables.

    The new file gives no number up to `known_seq`, nor one that the old file gave. Raises `sqlite3.Error` if the new
    file can't be written.
    """
    until_s = clock() + SALVAGE_S
    if not _has_tables(damaged):
        _replace_first_page(damaged, new)
    with read_only(damaged) as old, closing(sqlite3.connect(new, isolation_level=None)) as db:
        db.execute("BEGIN IMMEDIATE")
        given = _number(old, "SELECT seq FROM sqlite_sequence WHERE name = 'revisions'", known_seq)
        result = _copy_revisions(old, db, given, lambda: clock() < until_s)
        for table, key, columns in COPIED:
            _copy_rows(old, db, table, key, columns)
        for statement in DERIVED:
            db.execute(statement)
        begin_after(db, max(given, known_seq, last_seq(db)))
        db.execute("COMMIT")
    return result


def _has_tables(path: Path) -> bool:
    with read_only(path) as old:
        return _number(old, "SELECT count(*) FROM (SELECT 1 FROM revisions LIMIT 1)", -1) >= 0


def _replace_first_page(damaged: Path, new: Path) -> None:
    """Replace the page that says where the tables are by that of a new file. The old page is kept in a file beside it.

    Both files have their tables on the same pages if releases of one format began them.
    """
    with closing(sqlite3.connect(new)) as db:
        page = bytearray(db.serialize()[:PAGE_BYTES])
    page[AT_PAGE_COUNT] = bytes(4)  # so that the size of the file counts
    with damaged.open("r+b") as file:
        damaged.with_name(f"{damaged.name}-page1").write_bytes(file.read(PAGE_BYTES))
        file.seek(0)
        file.write(page)


def _copy_revisions(
    old: sqlite3.Connection, db: sqlite3.Connection, last: int, has_time: Callable[[], bool]
) -> Salvage:
    """Copy the revisions up to number `last`, the newest first, and what lies beside damage after all others."""
    last = _number(old, "SELECT max(seq) FROM revisions", last)
    first = _number(old, "SELECT min(seq) FROM revisions", 1)
    copied = lost = 0
    ranges, damaged = _ranges(old, first, last), deque[tuple[int, int]]()
    for low, high in chain(ranges, _emptied(damaged)):
        if not has_time():
            return Salvage(copied, lost, is_complete=False)
        try:
            rows = old.execute(READ_REVISIONS, (low, high)).fetchall()
        except sqlite3.DatabaseError:
            if low == high:
                lost += 1
            else:
                middle = (low + high) // 2
                damaged += [(middle + 1, high), (low, middle)]
        else:
            sound = [row[:-1] for row in rows if row[-1]]
            db.executemany(WRITE_REVISIONS, sound)
            copied += len(sound)
            lost += len(rows) - len(sound)
    return Salvage(copied, lost, is_complete=True)


def _ranges(old: sqlite3.Connection, first: int, last: int) -> Iterator[tuple[int, int]]:
    """Numbers to be copied by one statement each, the newest first, without the wide gap before a new epoch."""
    while last >= first:
        low = max(last - STEP + 1, first)
        yield low, last
        last = min(_number(old, f"SELECT max(seq) FROM revisions WHERE seq < {low}", low - 1), low - 1)  # noqa: S608


def _emptied(ranges: deque[tuple[int, int]]) -> Iterator[tuple[int, int]]:
    while ranges:
        yield ranges.popleft()


def _number(old: sqlite3.Connection, query: str, otherwise: int) -> int:
    """The number that a query finds; `otherwise` if it finds none, or can't read."""
    with suppress(sqlite3.DatabaseError):
        row = old.execute(query).fetchone()
        return otherwise if row is None or row[0] is None else int(row[0])
    return otherwise


def _copy_rows(old: sqlite3.Connection, db: sqlite3.Connection, table: str, key: str, columns: str) -> None:
    """Copy the rows that can be read from the first one on, and from the last one back."""
    places = ", ".join("?" for _ in columns.split(","))
    for order in ("ASC", "DESC"):
        keys = ", ".join(f"{column} {order}" for column in key.split(", "))
        rows = _readable(old, f"SELECT {columns} FROM {table} ORDER BY {keys}")  # noqa: S608 - constants
        db.executemany(f"INSERT OR IGNORE INTO {table} ({columns}) VALUES ({places})", rows)  # noqa: S608 - constants


def _readable(old: sqlite3.Connection, query: str) -> Iterator[tuple[object, ...]]:
    """The rows up to the first that can't be read."""
    with suppress(sqlite3.DatabaseError):
        yield from old.execute(query)
