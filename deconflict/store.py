"""The advisories on disk: every published revision, numbered once, in one SQLite file.

A revision is stored before anybody is told of it. Its sequence number is never given to another revision, neither
after a crash nor after old advisories are removed. The write-ahead log is synchronised at each commit
(`synchronous=FULL`): what `append` has returned survives the death of the process and, on a drive that keeps its
promise to flush, the loss of power. A drive that does not may lose the last commits, but not the file.
"""

import sqlite3
from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from threading import Lock
from typing import Literal

from deconflict.advice.account import yielded_s
from deconflict.advisory import ADVISORY, Acknowledgement, AdvisoryState, AnyAdvisory, ConflictAdvisory
from deconflict.formats import UPGRADES

FILE_NAME = "advisories.db"
BUSY_TIMEOUT_S = 5.0
PRUNE_STEP = 500
LOOK_BACK_S = 3600.0
"""An advisory that has not changed for this long is not looked for in the past."""

StateFilter = Literal["open", "cleared", "all"]

_OPEN_VALUES: dict[StateFilter, tuple[int, int]] = {"open": (1, 1), "cleared": (0, 0), "all": (0, 1)}


class StoreError(Exception):
    """The advisories can't be read or written; the message says what to do about it."""


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
        self._write_lock, self._read_lock = Lock(), Lock()
        try:
            self._upgrade()
            self._reader.execute("PRAGMA query_only = ON")
        except BaseException:
            self.close()
            raise

    def close(self) -> None:
        with self._write_lock, self._read_lock:
            self._reader.close()
            self._writer.close()

    def append(self, advisories: Sequence[AnyAdvisory]) -> list[AnyAdvisory]:
        """Store revisions in one transaction and return them as stored, each with its sequence number.

        A revision that is there already (same advisory id and revision) is returned as it was first stored, with
        the number it had, so a sender that does not know whether it was heard may send again.
        """
        with self._writing() as db:
            seq = _last_seq(db)
            stored = []
            for advisory in advisories:
                known = _revision(db, advisory.id, advisory.revision)
                if known is None:
                    seq += 1
                    answers, newest = _answers(db, advisory.id)
                    known = advisory.model_copy(update={"seq": seq, "acknowledgement": newest})
                    _insert(db, known, answers, advisory.updated_at)
                    _charge(db, known)
                stored.append(known)
        return stored

    def acknowledge(self, advisory_id: str, answer: Acknowledgement) -> AnyAdvisory | None:
        """Store the newest revision once more, with the answer and a number of its own; None where there is none.

        Every later revision of the advisory carries the answer.
        """
        with self._writing() as db:
            newest = db.execute(
                "SELECT document FROM advisories AS a JOIN revisions AS r ON r.seq = a.seq WHERE a.id = ?",
                (advisory_id,),
            ).fetchone()
            if newest is None:
                return None
            answered = _advisory(newest[0]).model_copy(update={"seq": _last_seq(db) + 1, "acknowledgement": answer})
            db.execute(
                "UPDATE advisories SET answers = answers + 1, acknowledgement = ? WHERE id = ?",
                (answer.model_dump_json(), advisory_id),
            )
            _insert(db, answered, _answers(db, advisory_id)[0], answer.at)
        return answered

    def after(self, seq: int, limit: int = 100) -> list[AnyAdvisory]:
        """Up to `limit` stored revisions with a number above `seq`, ascending."""
        with self._reading() as db:
            rows = db.execute(
                "SELECT document FROM revisions WHERE seq > ? ORDER BY seq LIMIT ?", (seq, limit)
            ).fetchall()
        return [_advisory(document) for (document,) in rows]

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
        with self._reading() as db:
            seq = _last_seq(db)
            rows = db.execute(
                """SELECT document FROM advisories AS a JOIN revisions AS r ON r.seq = a.seq
                WHERE a.open IN (:low, :high)
                AND (:kind IS NULL OR a.kind = :kind)
                AND (:vendor IS NULL OR :vendor IN (SELECT vendor FROM parties AS p WHERE p.id = a.id))
                AND (:robot IS NULL OR :robot IN (SELECT robot FROM parties AS p WHERE p.id = a.id))
                ORDER BY a.seq DESC LIMIT :limit""",
                chosen,
            ).fetchall()
        found = [_advisory(document) for (document,) in rows[:limit]]
        return Listing(seq=seq, advisories=found, more=len(found) < len(rows))

    def open(self) -> list[AnyAdvisory]:
        """The newest revision of every open advisory: what an engine goes on with after a restart."""
        return self.latest("open").advisories

    def open_at(self, now_s: float) -> list[AnyAdvisory]:
        """What was open at a time: the newest revision by then of each that changed in the hour before it."""
        with self._reading() as db:
            rows = db.execute(
                "SELECT document, max(seq) FROM revisions WHERE updated_s BETWEEN ? AND ? GROUP BY id ORDER BY seq",
                (now_s - LOOK_BACK_S, now_s),
            ).fetchall()
        known = [_advisory(document) for document, _ in rows]
        return [one for one in known if one.state is not AdvisoryState.CLEARED]

    def between(self, since_s: float, until_s: float) -> list[AnyAdvisory]:
        """Every revision decided after `since_s` and by `until_s`, ascending; without those that only answer."""
        with self._reading() as db:
            rows = db.execute(
                "SELECT document FROM revisions WHERE answers = 0 AND updated_s > ? AND updated_s <= ? ORDER BY seq",
                (since_s, until_s),
            ).fetchall()
        return [_advisory(document) for (document,) in rows]

    def raised(self, since_s: float, until_s: float) -> list[AnyAdvisory]:
        """The first revision of each advisory raised in that time."""
        with self._reading() as db:
            rows = db.execute(
                "SELECT document FROM revisions WHERE revision = 1 AND answers = 0 AND updated_s BETWEEN ? AND ?",
                (since_s, until_s),
            ).fetchall()
        return [_advisory(document) for (document,) in rows]

    def get(self, advisory_id: str) -> list[AnyAdvisory]:
        """Every stored revision of one advisory, ascending; empty where there is none."""
        with self._reading() as db:
            rows = db.execute(
                "SELECT document FROM revisions WHERE id = ? ORDER BY revision, answers", (advisory_id,)
            ).fetchall()
        return [_advisory(document) for (document,) in rows]

    def last_seq(self) -> int:
        """The highest number ever given; 0 before the first."""
        with self._reading() as db:
            return _last_seq(db)

    def position(self, outlet: str, first: int) -> int:
        """The number of the last revision that an outlet has delivered; one that is new is put at `first`."""
        with self._writing() as db:
            db.execute("INSERT OR IGNORE INTO positions VALUES (?, ?)", (outlet, first))
            row = db.execute("SELECT seq FROM positions WHERE outlet = ?", (outlet,)).fetchone()
        return int(row[0])

    def move(self, outlet: str, seq: int) -> None:
        """Put an outlet at the last revision it has delivered."""
        with self._writing() as db:
            db.execute("UPDATE positions SET seq = ? WHERE outlet = ?", (seq, outlet))

    def burdens_s(self) -> dict[str, float]:
        """How long the robots of each vendor were advised to yield, seconds; kept when advisories are pruned."""
        with self._reading() as db:
            return dict(db.execute("SELECT vendor, yielded_s FROM burdens").fetchall())

    def encounters(self) -> dict[tuple[str, str], int]:
        """The highest encounter ordinal of each pair of robots; kept when advisories are pruned."""
        with self._reading() as db:
            rows = db.execute("SELECT robot_a, robot_b, ordinal FROM encounters").fetchall()
        return {(a, b): ordinal for a, b, ordinal in rows}

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
            db.execute(f"PRAGMA user_version = {len(UPGRADES)}")

    def _writing(self) -> AbstractContextManager[sqlite3.Connection]:
        return self._transaction(self._writer, self._write_lock, "BEGIN IMMEDIATE")

    def _reading(self) -> AbstractContextManager[sqlite3.Connection]:
        return self._transaction(self._reader, self._read_lock, "BEGIN")

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


def _last_seq(db: sqlite3.Connection) -> int:
    row = db.execute("SELECT seq FROM sqlite_sequence WHERE name = 'revisions'").fetchone()
    return int(row[0]) if row else 0


def _revision(db: sqlite3.Connection, advisory_id: str, revision: int) -> AnyAdvisory | None:
    row = db.execute(
        "SELECT document FROM revisions WHERE id = ? AND revision = ? ORDER BY seq LIMIT 1", (advisory_id, revision)
    ).fetchone()
    return _advisory(row[0]) if row else None


def _answers(db: sqlite3.Connection, advisory_id: str) -> tuple[int, Acknowledgement | None]:
    """How often an advisory was acknowledged, and the newest of it."""
    row = db.execute("SELECT answers, acknowledgement FROM advisories WHERE id = ?", (advisory_id,)).fetchone()
    count, newest = row or (0, None)
    return count, Acknowledgement.model_validate_json(newest) if newest else None


def _insert(db: sqlite3.Connection, advisory: AnyAdvisory, answers: int, at: datetime) -> None:
    db.execute(
        "INSERT INTO revisions (seq, id, revision, answers, updated_s, document) VALUES (?, ?, ?, ?, ?, ?)",
        (advisory.seq, advisory.id, advisory.revision, answers, at.timestamp(), advisory.model_dump_json()),
    )
    db.execute(
        """INSERT INTO advisories (id, revision, seq, open, updated_s, kind) VALUES (?, ?, ?, ?, ?, ?)
        ON CONFLICT (id) DO UPDATE SET
            revision = excluded.revision, seq = excluded.seq, open = excluded.open, updated_s = excluded.updated_s
        WHERE excluded.revision >= revision""",
        (
            advisory.id,
            advisory.revision,
            advisory.seq,
            advisory.state is not AdvisoryState.CLEARED,
            advisory.updated_at.timestamp(),
            advisory.kind,
        ),
    )
    parties = zip(advisory.robots, advisory.vendors, strict=True)
    db.executemany("INSERT OR IGNORE INTO parties VALUES (?, ?, ?)", [(advisory.id, *party) for party in parties])
    if isinstance(advisory, ConflictAdvisory):
        _count_encounter(db, advisory)


def _charge(db: sqlite3.Connection, advisory: AnyAdvisory) -> None:
    db.executemany(
        """INSERT INTO burdens VALUES (?, ?)
        ON CONFLICT (vendor) DO UPDATE SET yielded_s = yielded_s + excluded.yielded_s""",
        list(yielded_s(advisory).items()),
    )


def _count_encounter(db: sqlite3.Connection, advisory: ConflictAdvisory) -> None:
    db.execute(
        """INSERT INTO encounters VALUES (?, ?, ?)
        ON CONFLICT (robot_a, robot_b) DO UPDATE SET ordinal = max(ordinal, excluded.ordinal)""",
        (*advisory.robots, advisory.encounter),
    )


def _advisory(document: str) -> AnyAdvisory:
    try:
        return ADVISORY.validate_json(document)
    except ValueError as error:
        raise StoreError(
            f"a stored advisory is not readable by this release ({error}): run the release that wrote it, "
            "or move the file aside to start a new one"
        ) from error


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
