"""The connections to the database file: one that writes, and three that read and wait for no other.

One reads for the numbers of new revisions, so that these wait for no question of people. One is for long reads.
"""

import logging
import sqlite3
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, ExitStack, closing, contextmanager, nullcontext, suppress
from datetime import UTC, datetime, timedelta
from pathlib import Path
from threading import Lock
from typing import NamedTuple

from deconflict.operator.store.migrations import TABLES, UPGRADES
from deconflict.operator.store.recovery.reserved_numbers import ReservedNumbers, epoch
from deconflict.operator.store.recovery.salvage import Salvage, salvage
from deconflict.operator.store.tables import StoreError, begin_after, last_seq
from deconflict_client.counted_nouns import count_of
from ingest.plain_files import UnfitDatabaseError, check_database
from ingest.recording.replaced_file import set_database_aside

log = logging.getLogger(__name__)

FILE_NAME = "advisories.db"
GONE = (
    "was gone at the start, although numbers had been given; a new one begins without its advisories, and with the "
    "numbers of a new epoch; to have them back, stop the service, and put it back or restore a backup"
)
BUSY_TIMEOUT_S = 5.0
RENEW_EVERY_S = 60.0
"""A file that is damaged again within this time is not replaced again: the disk is at fault."""
DAMAGE = ("SQLITE_NOTADB", "SQLITE_CORRUPT")
DAMAGED_DOCUMENT = "malformed JSON"
"""SQLite's words for a document in which a query finds damage."""


class DamagedStoreError(StoreError):
    """The file is damaged. The next transaction sets it aside and begins a new one."""


class Renewal(NamedTuple):
    """A damaged file was set aside, or it was gone, and a new one was begun."""

    at: datetime
    file: str
    """Name of the damaged file; "" if it was gone."""
    salvage: Salvage

    def __str__(self) -> str:
        if not self.file:
            return f"{FILE_NAME} {GONE}"
        parts = [f"{count_of(self.salvage.copied, 'revision was', 'revisions were')} copied"]
        if self.salvage.lost:
            parts.append(f"up to {self.salvage.lost} could not be read")
        if not self.salvage.is_complete:
            parts.append("others were left in it")
        return f"{FILE_NAME} was damaged and is kept as {self.file}; {', '.join(parts)}"


class StoreConnections(NamedTuple):
    """The connections to the file, or to the memory that stands in for it."""

    writer: sqlite3.Connection
    numberer: sqlite3.Connection
    reader: sqlite3.Connection
    long_reader: sqlite3.Connection

    def close(self) -> None:
        for db in reversed(self):
            db.close()


class StoreLocks(NamedTuple):
    """One for each of `StoreConnections`."""

    writer: Lock
    numberer: Lock
    reader: Lock
    long_reader: Lock


def new_locks() -> StoreLocks:
    return StoreLocks(Lock(), Lock(), Lock(), Lock())


class SqliteConnections:
    """Transactions on the file of one directory. Errors become `StoreError`.

    A damaged file is set aside. A new one begins with what can be read of it, and with a number beyond the last.
    """

    def __init__(self, directory: Path, *, follows_stream: bool = False) -> None:
        """Open or create the file in `directory`. Raises `StoreError`.

        `follows_stream` is whether a stream gives the numbers: then a new file continues after what it holds.
        """
        self.path, self._follows_stream = directory / FILE_NAME, follows_stream
        self._locks = new_locks()
        self.changing = Lock()
        """Held while a file takes the place of another one, or of memory. Nobody waits for the disk with it."""
        self._opening, self._is_damaged, self._renewed_s = Lock(), False, float("-inf")
        self.renewal: Renewal | None = None
        """The last one since the start."""
        self._reserved = ReservedNumbers(directory)
        self._lost_some = self._reserved.lost_some and not follows_stream
        """Whether the file, once it is opened, begins a new epoch: numbers beyond its last may have been given."""
        self._note_lock = Lock()
        self._known_seq = 0 if follows_stream else self._reserved.last
        """Every number up to this may be in use; those of revisions that wait for the disk are above it."""
        if self._reserved.last and not follows_stream and _is_gone(self.path):
            self._known_seq = max(self._reserved.last, epoch(time.time()))
            self.renewal = Renewal(datetime.now(UTC), "", Salvage(copied=0, lost=0, is_complete=True))
            log.error("%s", self.renewal)
        self._begin()

    def _begin(self) -> None:
        self._use(self._opened_or_renewed(), self._locks)

    @contextmanager
    def writing(self) -> Iterator[sqlite3.Connection]:
        with self._transaction(lambda: self._file.writer, self._locks.writer, "BEGIN IMMEDIATE") as db:
            yield db
            self._note_last(last_seq(db))

    def _note_last(self, seq: int) -> None:
        """Revisions up to this number are about to be stored."""
        if not self._follows_stream:
            self._reserved.reserve(seq)
        self._known_seq = seq

    def note_unstored(self, has_unstored: Callable[[], bool]) -> None:
        """Have a later start know whether numbers were given that the file does not hold. It may wait for the disk.

        It does what it can: a disk may take neither revisions nor this.
        """
        if not self._follows_stream:
            with self._note_lock, suppress(OSError):
                self._reserved.note_unstored(has_unstored=has_unstored())

    def reading(self) -> AbstractContextManager[sqlite3.Connection]:
        return self._transaction(lambda: self._file.reader, self._locks.reader, "BEGIN")

    def numbering(self) -> AbstractContextManager[sqlite3.Connection]:
        """For the short reads that new revisions need: they do not wait for other readers."""
        return self._transaction(lambda: self._file.numberer, self._locks.numberer, "BEGIN")

    def long_reading(self) -> AbstractContextManager[sqlite3.Connection]:
        """For a read that takes long, such as an hour of revisions: other readers and writers do not wait for it."""
        return self._transaction(lambda: self._file.long_reader, self._locks.long_reader, "BEGIN")

    def most_bytes(self, db: sqlite3.Connection, most_bytes: float) -> float:  # noqa: ARG002 - of memory, another one
        """The size to keep a database within if its file is to be kept within `most_bytes`."""
        return most_bytes

    def close(self) -> None:
        with self._all_locked():
            self._file.close()

    def set_aside(self, at: datetime) -> Path:
        """Rename the closed file so that no store opens it; returns its new path. Raises `StoreError`."""
        while (aside := self.path.with_name(f"{self.path.stem}-{at:%Y%m%dT%H%M%S}{self.path.suffix}")).exists():
            at += timedelta(seconds=1)
        with self._explained_errors():
            set_database_aside(self.path, aside)
        return aside

    def _use(self, file: StoreConnections, locks: StoreLocks) -> bool:
        """Use a file from now on. `locks` are held; if others have taken their place meanwhile, so has memory, and the
        file is closed. Returns whether it is in use."""
        with self.changing:
            if is_used := locks is self._locks:
                self._begin_use(file)
        if not is_used:
            file.close()
        return is_used

    def _begin_use(self, file: StoreConnections) -> None:
        self._file = file

    def _opened_or_renewed(self) -> StoreConnections:
        """By one thread at a time: one that waited long for the disk may be in this still. Raises `StoreError`."""
        with self._opening:
            if not (self._is_damaged and self._may_renew()):
                try:
                    return self._opened()
                except DamagedStoreError:
                    if not self._may_renew():
                        raise
            return self._renewed()

    def _opened(self) -> StoreConnections:
        """Connections to the file, with its tables created or upgraded. Closes them again if that fails."""
        with ExitStack() as opened, self._explained_errors():
            self.path.parent.mkdir(parents=True, exist_ok=True)
            file = StoreConnections(*(opened.enter_context(closing(self._connect())) for _ in range(4)))
            status = self.path.stat()  # now: when it is used, another one may have its place
            self._check_tables(file.writer)
            self._upgrade(file.writer)
            if self._lost_some:
                self._lost_some = False
                self.note_unstored(lambda: False)
            for db in file:
                db.execute(f"PRAGMA busy_timeout = {BUSY_TIMEOUT_S * 1000:.0f}")
            for reader in file[1:]:
                reader.execute("PRAGMA query_only = ON")
            self._identity = status.st_dev, status.st_ino
            opened.pop_all()
        return file

    def _connect(self) -> sqlite3.Connection:
        check_database(self.path)
        db = sqlite3.connect(self.path, timeout=self._open_timeout_s(), isolation_level=None, check_same_thread=False)
        try:
            db.execute("PRAGMA journal_mode = WAL")
            db.execute("PRAGMA synchronous = FULL")
        except BaseException:
            db.close()
            raise
        return db

    def _check_tables(self, db: sqlite3.Connection) -> None:
        """Raises `DamagedStoreError` if the tables are not those of the format that the file states."""
        (version,) = db.execute("PRAGMA user_version").fetchone()
        tables = {name for (name,) in db.execute("SELECT name FROM sqlite_master WHERE type = 'table'")}
        lacks_some = version == len(UPGRADES) and not tables >= TABLES
        if lacks_some or (version == 0 and tables):
            raise DamagedStoreError(f"{self.path} has other tables: it is set aside, and a new one is begun")

    def _open_timeout_s(self) -> float:
        return BUSY_TIMEOUT_S

    def _upgrade(self, db: sqlite3.Connection) -> None:
        with begun(db, "BEGIN IMMEDIATE"):
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
            if self._known_seq and (version == 0 or self._lost_some):
                if self._reserved.last:
                    why = "is new" if version == 0 else "may lack numbers that were given before the service was killed"
                    log.warning("%s %s; its numbers continue after %d", self.path, why, self._known_seq)
                begin_after(db, self._known_seq)
            self._known_seq = last_seq(db)

    def _renewed(self) -> StoreConnections:
        """Replace the closed, damaged file by one with what can be read of it. Raises `StoreError`."""
        at = datetime.now(UTC)
        aside = self.set_aside(at)
        file = self._opened()
        try:
            salvaged = salvage(aside, self.path, self._known_seq)
        except sqlite3.Error as error:
            log.warning("nothing is copied from %s: %s", aside, error)
            salvaged = Salvage(copied=0, lost=0, is_complete=False)
        with self._explained_errors():
            self._known_seq = last_seq(file.writer)
        self.renewal = Renewal(at, aside.name, salvaged)
        self._is_damaged, self._renewed_s = False, time.monotonic()
        log.error("%s", self.renewal)
        return file

    def _may_renew(self) -> bool:
        return time.monotonic() - self._renewed_s > RENEW_EVERY_S

    def _renew_if_damaged(self) -> None:
        if self._is_damaged and self._may_renew():
            with self._all_locked() as locks:
                if self._is_damaged and locks is self._locks:
                    self._file.close()
                    self._use(self._opened_or_renewed(), locks)

    @contextmanager
    def _all_locked(self) -> Iterator[StoreLocks]:
        with ExitStack() as held:
            locks = self._locks
            for lock in locks:
                held.enter_context(lock)
            yield locks

    @contextmanager
    def _transaction(
        self, connection: Callable[[], sqlite3.Connection], lock: Lock, begin: str
    ) -> Iterator[sqlite3.Connection]:
        self._renew_if_damaged()
        with lock, self._connection_lock(), self._explained_errors(), begun(connection(), begin) as db:
            yield db

    def _connection_lock(self) -> AbstractContextManager[object]:
        """Held by the thread that uses a connection which several names stand for."""
        return nullcontext()

    @contextmanager
    def _explained_errors(self) -> Iterator[None]:
        try:
            yield
        except UnfitDatabaseError as error:
            raise StoreError(str(error)) from error
        except sqlite3.Error as error:
            if getattr(error, "sqlite_errorname", "").startswith(DAMAGE) or str(error) == DAMAGED_DOCUMENT:
                self._is_damaged = True
                raise DamagedStoreError(f"{self.path}: {error}: it is set aside, and a new one is begun") from error
            raise StoreError(f"{self.path}: {error}: {_remedy(error)}") from error
        except OSError as error:
            raise StoreError(f"{self.path}: {error}: choose a directory this user can write to") from error


@contextmanager
def begun(db: sqlite3.Connection, begin: str) -> Iterator[sqlite3.Connection]:
    db.execute(begin)
    try:
        yield db
        db.execute("COMMIT")
    except BaseException:
        if db.in_transaction:
            db.execute("ROLLBACK")
        raise


def _is_gone(path: Path) -> bool:
    """Whether nothing has the place of a file, or it is empty. False if it can't be known."""
    try:
        return path.stat().st_size == 0 and path.is_file()
    except FileNotFoundError:
        return True
    except OSError:
        return False


def _remedy(error: sqlite3.Error) -> str:
    name = getattr(error, "sqlite_errorname", "")
    if name.startswith("SQLITE_FULL"):
        return "free some space on its disk"
    if name.startswith(("SQLITE_BUSY", "SQLITE_LOCKED")):
        return "stop the other process that is writing to it"
    if name.startswith(("SQLITE_READONLY", "SQLITE_CANTOPEN", "SQLITE_IOERR", "SQLITE_PERM")):
        return "make the directory and the file readable and writable by this user"
    return "this is a fault of the program, or the file was changed by another one"
