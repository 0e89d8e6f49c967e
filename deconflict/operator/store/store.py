"""The advisories on disk: every published revision, numbered once, in one SQLite file.

A revision is stored before anybody is told of it, and its number is never given to another, neither after a crash nor
after old advisories are removed. Where the disk fails or stalls, revisions are numbered, told of and read all the same,
and stored under their numbers as soon as it takes them. The write-ahead log is synchronised at each commit
(`synchronous=FULL`): what `append` has returned survives the death of the process and, on a drive that keeps its
promise to flush, the loss of power. A drive that does not may lose the last commits, but not the file.
"""

import sqlite3
from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from threading import Lock, RLock
from typing import Literal

from deconflict.advice.burden import yielded_s
from deconflict.advisory import Acknowledgement, AnyAdvisory, ConflictAdvisory
from deconflict.operator.store.migrations import UPGRADES
from deconflict.operator.store.pending_writes import MOST_AHEAD, Ahead, decided, matches, newest, open_then, revisions
from deconflict.operator.store.tables import StoreError as StoreError  # noqa: PLC0414 - told on
from deconflict.operator.store.tables import (
    advisory_of,
    answers_of,
    charge,
    insert,
    last_seq,
    open_at,
    position,
    put,
    stored_revision,
)

FILE_NAME = "advisories.db"
BUSY_TIMEOUT_S = 5.0
PRUNE_STEP = 500

StateFilter = Literal["open", "cleared", "all"]

_OPEN_VALUES: dict[StateFilter, tuple[int, int]] = {"open": (1, 1), "cleared": (0, 0), "all": (0, 1)}


@dataclass(frozen=True, slots=True)
class Listing:
    """The newest revision of each of some advisories, newest first, and the stream's position at that moment."""

    seq: int
    advisories: list[AnyAdvisory]
    more: bool
    """True where the limit left some out."""


class Store:
    """The advisories of one directory. Every method may be called from any thread and may block on the disk."""

    def __init__(self, directory: Path) -> None:
        """Open or create the file in `directory`. Raises `StoreError` where that can't be done."""
        self.path = directory / FILE_NAME
        with self._explained():
            directory.mkdir(parents=True, exist_ok=True)
            self._writer = self._connect()
            self._reader = self._connect()
            self._looker_back = self._connect()
            """Reads what takes long, an hour of revisions: who stores or resumes meanwhile does not wait for it."""
        self._write_lock, self._read_lock, self._look_back_lock = Lock(), Lock(), Lock()
        self._number_lock = RLock()
        self._ahead: list[AnyAdvisory] = []
        self._moved: dict[str, int] = {}
        """Where outlets are, as far as it is not stored."""
        try:
            self._upgrade()
            for reader in (self._reader, self._looker_back):
                reader.execute("PRAGMA query_only = ON")
        except BaseException:
            self.close()
            raise

    def close(self) -> None:
        with self._write_lock, self._read_lock, self._look_back_lock:
            for db in (self._looker_back, self._reader, self._writer):
                db.close()

    def set_aside(self, at: datetime) -> Path:
        """Give the file, once closed, a name by which no store is opened; that. Raises `StoreError`."""
        aside = self.path.with_name(f"{self.path.stem}-{at:%Y%m%dT%H%M%S}{self.path.suffix}")
        with self._explained():
            for end in ("-wal", "-shm", ""):
                if (part := self.path.with_name(self.path.name + end)).exists():
                    part.replace(aside.with_name(aside.name + end))
        return aside

    @property
    def unstored(self) -> int:
        """Revisions that wait for the disk."""
        return len(self._ahead)

    @property
    def waits(self) -> bool:
        """Whether `flush` has something to store."""
        return bool(self._ahead or self._moved)

    def take(self, advisories: Sequence[AnyAdvisory]) -> list[AnyAdvisory]:
        """Number revisions and keep them for `flush`; every other method knows them from now on.

        One that has a number keeps it: it was given elsewhere, in a stream that this store follows.
        One that is there already is returned as it was. Raises `StoreError`, also where too many wait.
        """
        with self._number_lock:
            if len(self._ahead) + len(advisories) > MOST_AHEAD:
                raise StoreError(f"{self.path}: {len(self._ahead)} revisions wait for the disk; free or mend it")
            ahead, taken, waiting = list(self._ahead), [], revisions(self._ahead)
            with self._reading() as db:
                seq = max(last_seq(db), ahead[-1].seq if ahead else 0)
                for advisory in advisories:
                    known = stored_revision(db, advisory.id, advisory.revision)
                    known = known or waiting.get((advisory.id, advisory.revision))
                    if known is None:
                        seq = advisory.seq or seq + 1
                        answer = answers_of(db, advisory.id)[1]
                        known = advisory.model_copy(update={"seq": seq, "acknowledgement": answer})
                        ahead.append(known)
                        waiting[known.id, known.revision] = known
                    taken.append(known)
            self._ahead = ahead
        return taken

    def flush(self) -> None:
        """Store what was taken and moved, at once. Raises `StoreError`; then it is still there, to be tried again."""
        with self._number_lock:
            ahead, moved = self._ahead, dict(self._moved)
        if not ahead and not moved:
            return
        with self._writing() as db:
            last = last_seq(db)
            for one in ahead:
                if one.seq > last:
                    insert(db, one, answers_of(db, one.id)[0], one.updated_at)
                    charge(db, one)
            put(db, moved)
        with self._number_lock:
            self._ahead = [one for one in self._ahead if not ahead or one.seq > ahead[-1].seq]
            self._moved = {outlet: seq for outlet, seq in self._moved.items() if moved.get(outlet) != seq}

    def append(self, advisories: Sequence[AnyAdvisory]) -> list[AnyAdvisory]:
        """Store revisions in one transaction and return them as stored, each with its sequence number.

        One that has a number keeps it: it was given elsewhere, in a stream that this store follows.
        A revision that is there already (same advisory id and revision) is returned as it was first stored, with
        the number it had, so a sender that does not know whether it was heard may send again.
        """
        with self._number_lock, self._writing_after_flush() as db:
            seq = last_seq(db)
            stored = []
            for advisory in advisories:
                known = stored_revision(db, advisory.id, advisory.revision)
                if known is None:
                    seq = advisory.seq or seq + 1
                    answers, newest = answers_of(db, advisory.id)
                    known = advisory.model_copy(update={"seq": seq, "acknowledgement": newest})
                    insert(db, known, answers, advisory.updated_at)
                    charge(db, known)
                stored.append(known)
        return stored

    def acknowledge(self, advisory_id: str, answer: Acknowledgement, seq: int | None = None) -> AnyAdvisory | None:
        """Store the newest revision once more, with the answer and a number of its own; None where there is none.

        `seq` is that number where it was given elsewhere; an answer with one that is stored already is not doubled.

        Every later revision of the advisory carries the answer. Raises `StoreError`, also while others wait for the
        disk.
        """
        with self._number_lock, self._writing_after_flush() as db:
            newest = db.execute(
                "SELECT document FROM advisories AS a JOIN revisions AS r ON r.seq = a.seq WHERE a.id = ?",
                (advisory_id,),
            ).fetchone()
            if newest is None:
                return None
            if seq is not None and seq <= last_seq(db):
                return advisory_of(newest[0])
            number = seq or last_seq(db) + 1
            answered = advisory_of(newest[0]).model_copy(update={"seq": number, "acknowledgement": answer})
            db.execute(
                "UPDATE advisories SET answers = answers + 1, acknowledgement = ? WHERE id = ?",
                (answer.model_dump_json(), advisory_id),
            )
            insert(db, answered, answers_of(db, advisory_id)[0], answer.at)
        return answered

    def after(self, seq: int, limit: int = 100) -> list[AnyAdvisory]:
        """Up to `limit` revisions with a number above `seq`, ascending; all of them where it is below 0."""
        with self._both() as (db, ahead):
            rows = db.execute(
                "SELECT document FROM revisions WHERE seq > ? ORDER BY seq LIMIT ?", (seq, limit)
            ).fetchall()
        stored = [advisory_of(document) for (document,) in rows]
        found = [*stored, *(one for one in ahead if one.seq > seq)]
        return found if limit < 0 else found[:limit]

    def latest(
        self,
        state: StateFilter = "open",
        *,
        kind: str | None = None,
        vendor: str | None = None,
        robot: str | None = None,
        limit: int | None = None,
    ) -> Listing:
        """The newest revision of each advisory that matches, newest first, at most `limit` of them."""
        chosen = {"kind": kind, "vendor": vendor, "robot": robot, "limit": -1 if limit is None else limit + 1}
        chosen["low"], chosen["high"] = _OPEN_VALUES[state]
        with self._both() as (db, ahead):
            seq, changed = _last(db, ahead), newest(ahead)
            if limit is not None:
                chosen["limit"] = limit + 1 + len(changed)
            rows = db.execute(
                """SELECT document FROM advisories AS a JOIN revisions AS r ON r.seq = a.seq
                WHERE a.open IN (:low, :high)
                AND (:kind IS NULL OR a.kind = :kind)
                AND (:vendor IS NULL OR :vendor IN (SELECT vendor FROM parties AS p WHERE p.id = a.id))
                AND (:robot IS NULL OR :robot IN (SELECT robot FROM parties AS p WHERE p.id = a.id))
                ORDER BY a.seq DESC LIMIT :limit""",
                chosen,
            ).fetchall()
        stored = [one for one in (advisory_of(document) for (document,) in rows) if one.id not in changed]
        others = [one for one in changed.values() if matches(one, _OPEN_VALUES[state], kind, vendor, robot)]
        found = sorted([*stored, *others], key=lambda one: -one.seq)
        return Listing(seq=seq, advisories=found[:limit], more=limit is not None and len(found) > limit)

    def open(self) -> list[AnyAdvisory]:
        """The newest revision of every open advisory: what an engine goes on with after a restart."""
        return self.latest("open").advisories

    def open_at(self, now_s: float) -> list[AnyAdvisory]:
        """What was open at a time: the newest revision by then of each that changed in the hour before it."""
        with self._both(long=True) as (db, ahead):
            stored = open_at(db, now_s)
        return open_then(stored, ahead, now_s)

    def waiting(self, until_s: float) -> list[AnyAdvisory]:
        """What was decided by then and waits for the disk, ascending."""
        with self._number_lock:
            ahead = self._ahead
        return [one for one in ahead if one.updated_at.timestamp() <= until_s]

    def raised(self, since_s: float, until_s: float) -> list[AnyAdvisory]:
        """The first revision of each advisory raised in that time."""
        with self._both(long=True) as (db, ahead):
            rows = db.execute(
                "SELECT document FROM revisions WHERE revision = 1 AND answers = 0 AND updated_s BETWEEN ? AND ? "
                "ORDER BY seq",
                (since_s, until_s),
            ).fetchall()
        new = (one for one in decided(ahead, since_s, until_s) if one.revision == 1)
        return [*(advisory_of(document) for (document,) in rows), *new]

    def get(self, advisory_id: str) -> list[AnyAdvisory]:
        """Every revision of one advisory, ascending; empty where there is none."""
        with self._both() as (db, ahead):
            rows = db.execute(
                "SELECT document FROM revisions WHERE id = ? ORDER BY revision, answers", (advisory_id,)
            ).fetchall()
        return [*(advisory_of(document) for (document,) in rows), *(one for one in ahead if one.id == advisory_id)]

    def last_seq(self) -> int:
        """The highest number ever given; 0 before the first."""
        with self._both() as (db, ahead):
            return _last(db, ahead)

    def position(self, outlet: str) -> int | None:
        """The number of the last revision that an outlet has delivered; None for one that is new."""
        with self._number_lock, self._reading() as db:
            return self._moved.get(outlet, position(db, outlet))

    def move(self, outlet: str, seq: int) -> None:
        """Put an outlet at the last revision it has delivered. `flush` stores it, with or after that revision."""
        with self._number_lock:
            self._moved[outlet] = seq

    def burdens_s(self) -> dict[str, float]:
        """How long the robots of each vendor were advised to yield, seconds; kept when advisories are pruned."""
        with self._both() as (db, ahead):
            burdens_s: dict[str, float] = dict(db.execute("SELECT vendor, yielded_s FROM burdens").fetchall())
        for vendor, more_s in (item for one in ahead for item in yielded_s(one).items()):
            burdens_s[vendor] = burdens_s.get(vendor, 0.0) + more_s
        return burdens_s

    def encounters(self) -> dict[tuple[str, str], int]:
        """The highest encounter ordinal of each pair of robots; kept when advisories are pruned."""
        with self._both() as (db, ahead):
            rows = db.execute("SELECT robot_a, robot_b, ordinal FROM encounters").fetchall()
        found = {(a, b): int(ordinal) for a, b, ordinal in rows}
        for one in ahead:
            if isinstance(one, ConflictAdvisory):
                found[one.robots] = max(one.encounter, found.get(one.robots, 0))
        return found

    def prune(self, before: datetime) -> int:
        """Remove cleared advisories last changed before `before`, with every revision; how many went.

        Goes in steps of `PRUNE_STEP` advisories, so that a revision to store never waits for all of it.
        """
        pruned = 0
        while gone := self._prune_step(before.timestamp()):
            pruned += gone
        return pruned

    def _prune_step(self, before_s: float) -> int:
        with self._writing() as db:
            old = db.execute(
                "SELECT id FROM advisories WHERE open = 0 AND updated_s < ? LIMIT ?", (before_s, PRUNE_STEP)
            ).fetchall()
            db.executemany("DELETE FROM revisions WHERE id = ?", old)
            db.executemany("DELETE FROM parties WHERE id = ?", old)
            db.executemany("DELETE FROM advisories WHERE id = ?", old)
        return len(old)

    def _connect(self) -> sqlite3.Connection:
        db = sqlite3.connect(self.path, timeout=BUSY_TIMEOUT_S, isolation_level=None, check_same_thread=False)
        db.execute("PRAGMA journal_mode = WAL")
        db.execute("PRAGMA synchronous = FULL")
        return db

    def _upgrade(self) -> None:
        with self._writing() as db:
            (version,) = db.execute("PRAGMA user_version").fetchone()
            if version > len(UPGRADES):
                raise StoreError(
                    f"{self.path} has format {version} and this release reads up to {len(UPGRADES)}: "
                    "run the newer release that wrote it, or choose another directory"
                )
            for statement in (one for step in UPGRADES[version:] for one in step):
                db.execute(statement)
            if version < len(UPGRADES):
                db.execute(f"PRAGMA user_version = {len(UPGRADES)}")

    def _writing(self) -> AbstractContextManager[sqlite3.Connection]:
        return self._transaction(self._writer, self._write_lock, "BEGIN IMMEDIATE")

    @contextmanager
    def _both(self, *, long: bool = False) -> Iterator[tuple[sqlite3.Connection, Ahead]]:
        """The file as it is now, and what is told of and not yet in it; `long` where the reading takes long."""
        ahead = self._ahead
        with self._looking_back() if long else self._reading() as db:
            last = last_seq(db)
            yield db, [one for one in ahead if one.seq > last]

    def _writing_after_flush(self) -> AbstractContextManager[sqlite3.Connection]:
        self.flush()
        return self._writing()

    def _reading(self) -> AbstractContextManager[sqlite3.Connection]:
        return self._transaction(self._reader, self._read_lock, "BEGIN")

    def _looking_back(self) -> AbstractContextManager[sqlite3.Connection]:
        return self._transaction(self._looker_back, self._look_back_lock, "BEGIN")

    @contextmanager
    def _transaction(self, db: sqlite3.Connection, lock: Lock, begin: str) -> Iterator[sqlite3.Connection]:
        with lock, self._explained():
            db.execute(begin)
            try:
                yield db
                db.execute("COMMIT")
            except BaseException:
                if db.in_transaction:
                    db.execute("ROLLBACK")
                raise

    @contextmanager
    def _explained(self) -> Iterator[None]:
        try:
            yield
        except sqlite3.Error as error:
            raise StoreError(f"{self.path}: {error}: {_remedy(error)}") from error
        except OSError as error:
            raise StoreError(f"{self.path}: {error}: choose a directory this user can write to") from error


def _last(db: sqlite3.Connection, ahead: Ahead) -> int:
    return ahead[-1].seq if ahead else last_seq(db)


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
