"""The ledger of lost time in one SQLite file: sums by hour, vendors, kind and place.

A loss counts in the hour in which it began. A parcel of losses that comes twice counts once. If the file is damaged, it
is set aside, and a new one is begun.
"""

import logging
import sqlite3
from collections.abc import Iterable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from datetime import UTC, datetime
from math import inf
from pathlib import Path
from threading import Lock
from typing import NamedTuple

from deconflict.foresight.losses.loss_places import PlacedLoss
from deconflict.foresight.losses.refusal import AdviceRefusal
from deconflict.operator.ledger.ledger_formats import upgrade
from deconflict.operator.ledger.loss_questions import (
    CELL_M,
    DAY_S,
    HOUR_S,
    OF_REFUSALS,
    SUMS,
    LossQuestion,
    LossSum,
    answer,
)
from deconflict.operator.store.pruning import used_bytes
from deconflict.settings.site import LossSettings
from deconflict_client.answers.loss_models import LossList
from ingest.plain_files import check_database
from ingest.recording.replaced_file import set_database_aside

log = logging.getLogger(__name__)

FILE_NAME = "losses.db"
IN_MEMORY = ":memory:"
KEYS = "hour_s, vendor, model, by_vendor, root_vendor, kind, floor, place, cell_x, cell_y"
ADD = f"""
INSERT INTO losses ({KEYS}, {", ".join(SUMS)})
VALUES ({", ".join("?" * (len(KEYS.split(",")) + len(SUMS)))})
ON CONFLICT DO UPDATE SET {", ".join(f"{name} = {name} + excluded.{name}" for name in SUMS)}
"""  # noqa: S608 - constants
NOTE_BEGIN = "INSERT INTO begun SELECT ? WHERE NOT EXISTS (SELECT 1 FROM begun)"
COLUMNS = {
    "vendor": "vendor",
    "model": "model",
    "by": "by_vendor",
    "root": "root_vendor",
    "kind": "kind",
    "floor": "floor",
    "place": "place",
    "cell": "cell_x || ',' || cell_y",
    "hour": "hour_s",
    "day": f"hour_s - hour_s % {DAY_S}",
}
"""By key of a question."""
FILTERS = {"vendor": "vendor", "by": "by_vendor", "kind": "kind", "place": "place"}


class LedgerEntry(NamedTuple):
    """What the ledger keeps of a loss."""

    from_s: float
    vendor: str
    model: str
    by_vendor: str
    root_vendor: str
    kind: str
    floor: str
    place: str
    x_m: float
    y_m: float
    lost_s: float
    over_usual_s: float
    is_sure: bool
    is_warned: bool = False
    is_advised: bool = False
    is_heeded: bool = False
    losses: int = 1
    """0 if it is the time that a robot stood because another refused advice."""
    refusals: int = 0
    refused_s: float = 0.0
    unable: int = 0
    """Refusals because a robot cannot, which are not among the others."""
    unable_s: float = 0.0


class LossParcel(NamedTuple):
    """Losses that reach the ledger together, once."""

    sender: str
    """Who numbers them: a new engine or stream has another name."""
    number: int
    entries: Sequence[LedgerEntry]


def ledger_entries(losses: Iterable[PlacedLoss]) -> list[LedgerEntry]:
    return [
        LedgerEntry(
            loss.from_s, loss.vendor, loss.model, loss.by_vendor, loss.root_vendor, loss.kind.value, datum, place,
            loss.x_m, loss.y_m, loss.lost_s, loss.over_usual_s, loss.is_sure, *notice,
        )
        for loss, datum, place, notice in losses
    ]  # fmt: skip


def refusal_entries(refusals: Iterable[AdviceRefusal]) -> list[LedgerEntry]:
    """One for each robot that stood because of a refusal. The refusal counts once: at the robot for which it was."""
    return [_refusal_entry(refusal, at) for refusal in refusals for at in range(len(refusal.others))]


def _refusal_entry(refusal: AdviceRefusal, at: int) -> LedgerEntry:
    other, count = refusal.others[at], int(at == 0)
    entry = LedgerEntry(
        refusal.since_s, other.vendor, other.model, refusal.vendor, refusal.vendor, other.kind.value, other.datum,
        other.place, other.x_m, other.y_m, lost_s=0.0, over_usual_s=0.0, is_sure=False, losses=0,
    )  # fmt: skip
    if refusal.is_unable:
        return entry._replace(unable=count, unable_s=other.stood_s)
    return entry._replace(refusals=count, refused_s=other.stood_s)


class LossLedger:
    """The ledger of one directory, or in memory without one. Every method may be called from any thread."""

    def __init__(self, directory: Path | None, settings: LossSettings) -> None:
        """Raises `sqlite3.Error` if the file can't be used."""
        self.settings = settings
        self._added_s = inf
        """When what was added last began."""
        self._path, self._lock = directory and directory / FILE_NAME, Lock()
        self._read_lock = Lock() if directory else self._lock
        try:
            self._db = self._opened()
        except sqlite3.DatabaseError as error:
            if self._path is None or isinstance(error, sqlite3.OperationalError):
                raise
            aside = self._path.with_name(f"losses-{datetime.now(UTC):%Y%m%dT%H%M%S}.db")
            set_database_aside(self._path, aside)
            log.error("%s: %s: it is kept as %s, and a new one is begun", self._path, error, aside.name)
            self._db = self._opened()
        self._reader = self._connected() if directory else self._db
        """Questions take long, and new losses do not wait for them."""

    def close(self) -> None:
        with self._lock:
            self._db.close()
        with self._read_lock:
            self._reader.close()

    def add(self, sender: str, number: int, entries: Sequence[LedgerEntry]) -> None:
        """Add a parcel of losses, unless its number or a later one is known of its sender. Raises `sqlite3.Error`."""
        with self._writing() as db:
            last = db.execute("SELECT number FROM parcels WHERE sender = ?", (sender,)).fetchone()
            if last and number <= last[0]:
                return
            db.execute("DELETE FROM parcels")
            db.execute("INSERT INTO parcels VALUES (?, ?)", (sender, number))
            db.executemany(ADD, (_row_of(entry) for entry in entries))
            if entries:
                self._added_s = max(entry.from_s for entry in entries)
                db.execute(NOTE_BEGIN, (min(entry.from_s for entry in entries),))

    def last_parcel(self) -> tuple[str, int]:
        """The sender and the number of the last parcel; "" and 0 before the first. Raises `sqlite3.Error`."""
        with self._writing() as db:
            return db.execute("SELECT sender, number FROM parcels").fetchone() or ("", 0)

    def ask(self, question: LossQuestion) -> LossList:
        """Raises `sqlite3.Error`."""
        columns = ", ".join(COLUMNS[key] for key in (*question.keys, "vendor", "model"))
        sums = ", ".join(f"SUM({name})" for name in SUMS)
        wanted = {name: value for name in FILTERS if (value := getattr(question, name)) is not None}
        conditions = "".join(f" AND {FILTERS[name]} = :{name}" for name in wanted)
        span = {"from_s": question.from_s - question.from_s % HOUR_S, "until_s": question.until_s}
        with self._reading() as db:
            rows = db.execute(
                f"SELECT {columns}, {sums} FROM losses"  # noqa: S608 - constants
                f" WHERE hour_s >= :from_s AND hour_s < :until_s{conditions} GROUP BY {columns}",
                span | wanted,
            ).fetchall()
            (begun_s,) = db.execute("SELECT MIN(at_s) FROM begun").fetchone()
        width = len(question.keys)
        parts = [LossSum(_values(question, row[:width]), row[width], row[width + 1], row[width + 2 :]) for row in rows]
        question = question._replace(from_s=span["from_s"])
        return answer(question, parts, self.settings.cost_per_robot_hour, self.settings.currency, begun_s)

    def prune(self, now_s: float) -> int:
        """Remove hours that are older than the settings say, or too many; returns how many. Raises `sqlite3.Error`.

        If they are too many, first those of a wrong clock: they are later than what was added last.
        """
        before_s, removed = now_s - self.settings.keep_days * DAY_S, 0
        with self._writing() as db:
            while True:
                oldest_s, newest_s = db.execute("SELECT MIN(hour_s), MAX(hour_s) FROM losses").fetchone()
                is_too_large = used_bytes(db) > self.settings.most_bytes
                if oldest_s is None or (oldest_s >= before_s and not is_too_large):
                    return removed
                is_of_wrong_clock = is_too_large and newest_s > self._added_s + DAY_S
                db.execute("DELETE FROM losses WHERE hour_s = ?", (newest_s if is_of_wrong_clock else oldest_s,))
                removed += 1

    def _opened(self) -> sqlite3.Connection:
        """A connection to a file of the newest format."""
        if self._path:
            self._path.parent.mkdir(parents=True, exist_ok=True)
        db = self._connected()
        try:
            db.execute("PRAGMA journal_mode = WAL")
            upgrade(db)
        except BaseException:
            db.close()
            raise
        return db

    def _connected(self) -> sqlite3.Connection:
        if self._path:
            check_database(self._path)
        return sqlite3.connect(self._path or IN_MEMORY, isolation_level=None, check_same_thread=False)

    def _writing(self) -> AbstractContextManager[sqlite3.Connection]:
        return _transaction(self._db, self._lock)

    def _reading(self) -> AbstractContextManager[sqlite3.Connection]:
        return _transaction(self._reader, self._read_lock)


@contextmanager
def _transaction(db: sqlite3.Connection, lock: Lock) -> Iterator[sqlite3.Connection]:
    with lock, db:
        db.execute("BEGIN")
        yield db


def _row_of(entry: LedgerEntry) -> tuple[object, ...]:
    hour_s, cell = int(entry.from_s // HOUR_S * HOUR_S), (int(entry.x_m // CELL_M), int(entry.y_m // CELL_M))
    names = entry[1 : LedgerEntry._fields.index("x_m")]
    flags = entry.is_sure, entry.is_warned, entry.is_advised, entry.is_heeded
    parts = (entry.lost_s if counts else 0.0 for counts in flags)
    refused = entry[-len(OF_REFUSALS) :]
    return hour_s, *names, *cell, entry.losses, entry.lost_s, entry.over_usual_s, *parts, *refused


def _values(question: LossQuestion, values: Sequence[object]) -> tuple[object, ...]:
    """The values of the keys; of a cell its middle."""
    return tuple(
        tuple((int(part) + 0.5) * CELL_M for part in str(value).split(",")) if key == "cell" else value
        for key, value in zip(question.keys, values, strict=True)
    )
