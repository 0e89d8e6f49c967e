"""The ledger of a service: losses wait in memory for its file, so that nothing else ever waits for it."""

import logging
import sqlite3
from collections import deque
from pathlib import Path
from threading import Lock

from deconflict.operator.ledger.loss_ledger import FILE_NAME, LossLedger, LossParcel
from deconflict.operator.ledger.loss_questions import LossQuestion
from deconflict.operator.store.optional.optional_connections import OPEN_STUCK_S, within
from deconflict.operator.store.tables import UNWRITABLE, StoreError
from deconflict.settings.site import LossSettings
from deconflict_client.answers.loss_models import LossList
from ingest.measures.measures import Measures
from ingest.plain_files import with_advice

log = logging.getLogger(__name__)

MOST_WAITING = 50_000
"""Losses that wait for the file, some 20 MB. The oldest beyond are dropped and counted."""
DROPPED = "deconflict_losses_dropped_total"


class OptionalLedger:
    """`store` is to be called again and again: it opens the file and writes what waits. Methods are for any thread."""

    def __init__(self, directory: Path, settings: LossSettings, measures: Measures) -> None:
        self._directory, self._settings, self._measures = directory, settings, measures
        self._ledger: LossLedger | None = None
        self._identity: tuple[int, int] | None = None
        """Device and inode of the open file."""
        self._waiting: deque[LossParcel] = deque()
        self._waiting_count = 0
        self._lock, self._file_lock = Lock(), Lock()
        self.outage: str | None = None
        """Why the file is not in use; None if it is."""
        measures.count(DROPPED, by=0)

    def renew(self, settings: LossSettings) -> None:
        """Use changed settings."""
        self._settings = settings
        if ledger := self._ledger:
            ledger.settings = settings

    def add(self, parcel: LossParcel) -> None:
        """Keep a parcel for `store`. Does not wait."""
        with self._lock:
            self._waiting.append(parcel)
            self._waiting_count += len(parcel.entries)
            while self._waiting_count > MOST_WAITING and len(self._waiting) > 1:
                dropped = len(self._waiting.popleft().entries)
                self._waiting_count -= dropped
                self._measures.count(DROPPED, by=dropped)

    def store(self) -> None:
        """Write what waits. May wait for the disk, and for another program that keeps the file locked."""
        with self._file_lock:
            try:
                ledger = self._opened()
                while parcel := next(iter(self._waiting), None):
                    self._write(ledger, parcel)
                    self._note_stored(parcel)
            except (sqlite3.Error, OSError) as error:
                self._fail(error)
            else:
                if self.outage:
                    log.warning("%s is in use again", FILE_NAME)
                self.outage = None

    def _write(self, ledger: LossLedger, parcel: LossParcel) -> None:
        try:
            ledger.add(*parcel)
        except UNWRITABLE as error:
            self._measures.count(DROPPED, by=len(parcel.entries))
            log.error("%d losses can't be written, which should be reported: %s", len(parcel.entries), error)

    def last_parcel(self) -> tuple[str, int]:
        """As of `LossLedger`. Raises `sqlite3.Error` also while the file is not in use."""
        return self._usable().last_parcel()

    def ask(self, question: LossQuestion) -> LossList:
        """The answer with all that was added before. Raises `sqlite3.Error` also while the file is not in use."""
        if self.outage is None:
            self.store()
        return self._usable().ask(question)

    def prune(self, now_s: float) -> int:
        """As of `LossLedger`. Raises `sqlite3.Error` and `OSError` also if the file can't be used."""
        with self._file_lock:
            return self._opened().prune(now_s)

    def close(self) -> None:
        """Write what waits, if the disk takes it. It is waited for no longer than at a start."""
        try:
            within(OPEN_STUCK_S, self._end)
        except StoreError as error:
            log.error("losses that wait for %s may be lost: %s", FILE_NAME, error)

    def _end(self) -> None:
        if self.outage is None:
            self.store()
        if self._waiting_count:
            log.error("%d losses were never stored", self._waiting_count)
        with self._file_lock:
            self._close()

    def _usable(self) -> LossLedger:
        if self.outage or self._ledger is None:
            raise sqlite3.OperationalError(self.outage or "it is being opened")
        return self._ledger

    def _opened(self) -> LossLedger:
        """Raises `sqlite3.Error` and `OSError`."""
        path = self._directory / FILE_NAME
        if self._ledger and self._identity != _identity(path):
            log.error("%s was removed or replaced; the ledger continues with what is there now", path)
            self._close()
        if self._ledger is None:
            self._ledger = LossLedger(self._directory, self._settings)
            self._identity = _identity(path)
        return self._ledger

    def _note_stored(self, parcel: LossParcel) -> None:
        with self._lock:
            if self._waiting and self._waiting[0] is parcel:
                self._waiting.popleft()
                self._waiting_count -= len(parcel.entries)

    def _fail(self, error: Exception) -> None:
        if self.outage is None:
            log.error("lost time is kept in memory, and %s is tried again each second: %s", FILE_NAME, error)
        self.outage = with_advice(error, f"check {self._directory / FILE_NAME} and what keeps it")
        if not getattr(error, "sqlite_errorname", "").startswith("SQLITE_BUSY"):
            self._close()  # a damaged file is set aside when it is opened, and one that was read-only is opened anew

    def _close(self) -> None:
        if self._ledger:
            self._ledger.close()
        self._ledger = None


def _identity(path: Path) -> tuple[int, int] | None:
    try:
        status = path.stat()
    except (FileNotFoundError, NotADirectoryError):
        return None
    return status.st_dev, status.st_ino
