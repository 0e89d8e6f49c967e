"""The connections to the database file: one that writes, one that reads, and one for long reads."""

import sqlite3
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager
from datetime import datetime
from pathlib import Path
from threading import Lock

from deconflict.operator.store.migrations import UPGRADES
from deconflict.operator.store.tables import StoreError

FILE_NAME = "advisories.db"
BUSY_TIMEOUT_S = 5.0


class SqliteConnections:
    """Transactions on the file of one directory. Errors become `StoreError`."""

    def __init__(self, directory: Path) -> None:
        """Open or create the file in `directory`. Raises `StoreError`."""
        self.path = directory / FILE_NAME
        with self._explained_errors():
            directory.mkdir(parents=True, exist_ok=True)
            self._writer = self._connect()
            self._reader = self._connect()
            self._long_reader = self._connect()
        self._write_lock, self._read_lock, self._long_read_lock = Lock(), Lock(), Lock()
        try:
            self._upgrade()
            for reader in (self._reader, self._long_reader):
                reader.execute("PRAGMA query_only = ON")
        except BaseException:
            self.close()
            raise

    def writing(self) -> AbstractContextManager[sqlite3.Connection]:
        return self._transaction(self._writer, self._write_lock, "BEGIN IMMEDIATE")

    def reading(self) -> AbstractContextManager[sqlite3.Connection]:
        return self._transaction(self._reader, self._read_lock, "BEGIN")

    def long_reading(self) -> AbstractContextManager[sqlite3.Connection]:
        """For a read that takes long, such as an hour of revisions: other readers and writers do not wait for it."""
        return self._transaction(self._long_reader, self._long_read_lock, "BEGIN")

    def close(self) -> None:
        with self._write_lock, self._read_lock, self._long_read_lock:
            for db in (self._long_reader, self._reader, self._writer):
                db.close()

    def set_aside(self, at: datetime) -> Path:
        """Rename the closed file so that no store opens it; returns its new path. Raises `StoreError`."""
        aside = self.path.with_name(f"{self.path.stem}-{at:%Y%m%dT%H%M%S}{self.path.suffix}")
        with self._explained_errors():
            for suffix in ("-wal", "-shm", ""):
                if (part := self.path.with_name(self.path.name + suffix)).exists():
                    part.replace(aside.with_name(aside.name + suffix))
        return aside

    def _connect(self) -> sqlite3.Connection:
        db = sqlite3.connect(self.path, timeout=BUSY_TIMEOUT_S, isolation_level=None, check_same_thread=False)
        db.execute("PRAGMA journal_mode = WAL")
        db.execute("PRAGMA synchronous = FULL")
        return db

    def _upgrade(self) -> None:
        with self.writing() as db:
            (version,) = db.execute("PRAGMA user_version").fetchone()
            if version > len(UPGRADES):
                raise StoreError(
                    f"{self.path} has format {version} and this release reads up to {len(UPGRADES)}: "
                    "run the newer release that wrote it, or choose another directory"
                )
            for statement in (statement for step in UPGRADES[version:] for statement in step):
                db.execute(statement)
            if version < len(UPGRADES):
                db.execute(f"PRAGMA user_version = {len(UPGRADES)}")

    @contextmanager
    def _transaction(self, db: sqlite3.Connection, lock: Lock, begin: str) -> Iterator[sqlite3.Connection]:
        with lock, self._explained_errors():
            db.execute(begin)
            try:
                yield db
                db.execute("COMMIT")
            except BaseException:
                if db.in_transaction:
                    db.execute("ROLLBACK")
                raise

    @contextmanager
    def _explained_errors(self) -> Iterator[None]:
        try:
            yield
        except sqlite3.Error as error:
            raise StoreError(f"{self.path}: {error}: {_remedy(error)}") from error
        except OSError as error:
            raise StoreError(f"{self.path}: {error}: choose a directory this user can write to") from error


def _remedy(error: sqlite3.Error) -> str:
    name = getattr(error, "sqlite_errorname", "")
    if name.startswith(("SQLITE_NOTADB", "SQLITE_CORRUPT")):
        return f"move it aside together with {FILE_NAME}-wal and {FILE_NAME}-shm, or restore a copy"
    if name.startswith("SQLITE_FULL"):
        return "free some space on its disk"
    if name.startswith(("SQLITE_BUSY", "SQLITE_LOCKED")):
        return "stop the other process that is writing to it"
    if name.startswith(("SQLITE_READONLY", "SQLITE_CANTOPEN", "SQLITE_IOERR", "SQLITE_PERM")):
        return "make the directory and the file readable and writable by this user"
    return "this is a fault of the program, or the file was changed by another one"
