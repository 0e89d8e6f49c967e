"""The rows of `robots.db`, see `kept_messages`: how they are read and written."""

import json
import sqlite3
from contextlib import closing, suppress
from math import isfinite
from pathlib import Path
from typing import NamedTuple

import msgspec

from ingest.languages.front_ends import FRONT_ENDS
from ingest.plain_files import check_database

FILE_NAME = "robots.db"
FORMAT = 2
BUSY_TIMEOUT_S = 5.0
ROWS_AT_ONCE = 500
"""Rows of one statement: a thread that runs a statement for each row waits for the other threads after each."""
IDENTITY, STATUS = "identity", "status"
TABLE = (
    "CREATE TABLE IF NOT EXISTS messages (kind TEXT, uuid TEXT, arrival_s REAL, raw BLOB, peer TEXT, vendor TEXT, "
    "language TEXT, topic TEXT, heard_s REAL, PRIMARY KEY (kind, uuid))"
)
SECOND_FORMAT = ("ALTER TABLE messages ADD COLUMN heard_s REAL", "UPDATE messages SET heard_s = arrival_s")
"""Makes it of the first. The write that does so knows better of identities, and writes them all."""


class Row(NamedTuple):
    """The values of the columns."""

    kind: str
    uuid: str
    arrival_s: float
    raw: bytes
    peer: str
    vendor: str | None
    language: str
    topic: str
    heard_s: float
    """When the robot was last heard."""


class Changes(NamedTuple):
    """What is to be written."""

    identities: dict[str, Row | None]
    """By UUID. None for a robot that has none any more."""
    gone: list[str]
    """UUIDs of robots of which nothing is kept any more."""
    is_whole: bool
    """Whether these are the identities of all robots, so that the file keeps no other."""
    statuses: list[Row] | None
    """Those of all robots that have not reported since `before_s`. None if the ones in the file stay."""
    before_s: float
    heard_s: dict[str, float] | None
    """By UUID, when robots with an identity were last heard. None if what the file has stays."""
    now_s: float


def read_rows(path: Path, timeout_s: float = BUSY_TIMEOUT_S) -> tuple[list[Row], int]:
    """The rows of a file, the oldest first, without those of languages that are not read; and how many rows can't be
    read. Raises `sqlite3.Error`.

    The first format does not say when robots were heard; it counts as when the file was last written.
    """
    if not path.exists():
        return [], 0
    check_database(path)
    with closing(sqlite3.connect(path, timeout=timeout_s)) as db:
        if not (version := file_version(db)):
            return [], 0
        heard_s = "heard_s" if version == FORMAT else repr(path.stat().st_mtime)
        columns = ", ".join([*Row._fields[:-1], heard_s])
        found = db.execute(f"SELECT {columns} FROM messages ORDER BY arrival_s, kind").fetchall()  # noqa: S608 - names
    rows = [row for values in found if (row := _row(values))]
    return [row for row in rows if row.language in FRONT_ENDS], len(found) - len(rows)


def _row(values: tuple[object, ...]) -> Row | None:
    """The row with these values; None if they are of other types, which SQLite does not prevent."""
    with suppress(msgspec.ValidationError):
        row = msgspec.convert(values, Row, builtin_types=(bytes,))
        return row if isfinite(row.arrival_s) and isfinite(row.heard_s) else None
    return None


def file_version(db: sqlite3.Connection) -> int:
    """The format of a file; 0 if it has no table yet. Raises `DatabaseError` for a format that this release does not
    read."""
    (found,) = db.execute("PRAGMA user_version").fetchone()
    if found not in range(FORMAT + 1):
        raise sqlite3.DatabaseError(f"it has format {found} and this release reads up to {FORMAT}")
    return int(found)


def is_damage(error: sqlite3.DatabaseError) -> bool:
    """Whether the file is at fault, not its disk or another program: its pages, or its tables."""
    return not isinstance(error, sqlite3.OperationalError) or getattr(error, "sqlite_errorname", "") == "SQLITE_ERROR"


def replace_rows(db: sqlite3.Connection, changes: Changes) -> None:
    """Put the changes in the place of what the file has."""
    if changes.is_whole:
        db.execute("DELETE FROM messages WHERE kind = ?", (IDENTITY,))
    else:
        uuids = json.dumps(list(changes.identities))
        db.execute(
            "DELETE FROM messages WHERE kind = ? AND uuid IN (SELECT value FROM json_each(?))", (IDENTITY, uuids)
        )
    db.execute("DELETE FROM messages WHERE uuid IN (SELECT value FROM json_each(?))", (json.dumps(changes.gone),))
    rows = [row for row in changes.identities.values() if row]
    if changes.statuses is not None:
        db.execute("DELETE FROM messages WHERE kind = ?", (STATUS,))
        rows += changes.statuses
    for at in range(0, len(rows), ROWS_AT_ONCE):
        part = rows[at : at + ROWS_AT_ONCE]
        places = ",".join(["(?, ?, ?, ?, ?, ?, ?, ?, ?)"] * len(part))
        values = [value for row in part for value in row]
        db.execute(f"INSERT OR REPLACE INTO messages VALUES {places}", values)  # noqa: S608 - question marks
    if changes.heard_s:
        db.execute(
            "UPDATE messages SET heard_s = heard.value FROM json_each(?) AS heard WHERE kind = ? AND uuid = heard.key",
            (json.dumps(changes.heard_s), IDENTITY),
        )
