"""Files of advisories with garbage in them."""

import sqlite3
from contextlib import closing
from pathlib import Path

PAGE_BYTES = 4_096
GARBAGE = b"\xa5"


def page(number: int) -> slice:
    return slice((number - 1) * PAGE_BYTES, number * PAGE_BYTES)


def damage(path: Path, where: slice) -> None:
    with path.open("r+b") as file:
        file.seek(where.start)
        file.write(GARBAGE * (where.stop - where.start))


def page_of(path: Path, table: str) -> int:
    with closing(sqlite3.connect(path)) as db:
        return int(db.execute("SELECT rootpage FROM sqlite_schema WHERE name = ?", (table,)).fetchone()[0])
