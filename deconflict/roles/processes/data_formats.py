"""The formats of the files in the data directory, before a role opens one: none is of a newer release.

A file that can't be read, or is damaged, is no reason not to start: the role that opens it goes on without it.
"""

import json
import sqlite3
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

from deconflict.operator.ledger import ledger_formats, loss_ledger
from deconflict.operator.store import learned_file, migrations, sqlite_connections
from deconflict.runtime import learned_state
from deconflict.runtime.data_lock import DataDirectoryError
from ingest.fleet.owners import owner_file, owner_register
from ingest.fleet.recovery import kept_rows
from ingest.plain_files import check_database, opened, read_file

HEADER = slice(0, 16)
MAGIC = b"SQLite format 3\0"
AT_VERSION = slice(60, 64)
"""Where the first page of a database has `PRAGMA user_version`."""
MOST_NEWER = 1000
"""A format that is further ahead is damage, which keeps no service from starting."""
LOCKED_S = 1.0
"""A database that is locked for longer is taken as it says in its first page."""


def refuse_newer(data: Path) -> None:
    """Raise `DataDirectoryError` if a newer release wrote a file. No file is changed."""
    problems = []
    for name, (format_of, known) in FILES.items():
        found = format_of(data / name)
        if found is not None and known < found <= known + MOST_NEWER:
            problems.append(f"{data / name} has format {found} and this release reads up to {known}")
    if problems:
        text = "; ".join(problems)
        raise DataDirectoryError(
            f"{text}: run the newer release that wrote it, or start with the backup from before the upgrade"
        )


def _database_format(path: Path) -> int | None:
    """`PRAGMA user_version`; None if it can't be read."""
    try:
        check_database(path)
        with opened(path, most_bytes=None) as file:
            page = file.read(AT_VERSION.stop)
        if page[HEADER] != MAGIC:
            return None
        in_first_page = int.from_bytes(page[AT_VERSION], "big")
        has_journal = path.with_name(f"{path.name}-wal").exists()
        return _format_with_journal(path, in_first_page) if has_journal else in_first_page
    except (OSError, sqlite3.Error):
        return None


def _format_with_journal(path: Path, in_first_page: int) -> int:
    """`PRAGMA user_version` of a database with a journal. Raises `sqlite3.Error`."""
    try:
        with closing(sqlite3.connect(f"{path.resolve().as_uri()}?mode=ro", uri=True, timeout=LOCKED_S)) as db:
            return int(db.execute("PRAGMA user_version").fetchone()[0])
    except sqlite3.OperationalError as error:
        if getattr(error, "sqlite_errorname", "").startswith("SQLITE_BUSY"):
            return in_first_page
        raise


def _json_format(path: Path) -> int | None:
    """The `format` of a JSON document; None if it can't be read."""
    try:
        found = json.loads(read_file(path))["format"]
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        return None
    return found if isinstance(found, int) else None


def _learned_format(path: Path) -> int | None:
    try:
        return learned_state.format_of(read_file(path))
    except OSError:
        return None


FILES: dict[str, tuple[Callable[[Path], int | None], int]] = {
    sqlite_connections.FILE_NAME: (_database_format, len(migrations.UPGRADES)),
    loss_ledger.FILE_NAME: (_database_format, len(ledger_formats.UPGRADES)),
    kept_rows.FILE_NAME: (_database_format, kept_rows.FORMAT),
    owner_file.FILE_NAME: (_json_format, owner_register.FORMAT),
    learned_file.FILE_NAME: (_learned_format, learned_state.FORMAT),
}
"""By name, what reads the format, and the newest that this release reads."""
